//! Totals of slabs and half-spaces, and mean path lengths.

use moonmilk_core::Estimate;
use moonmilk_optics::halfspace::{Anisotropic, HalfSpace, Illumination};
use moonmilk_optics::slab;

use super::{Check, Settings};
use crate::error::Error;
use crate::experiment::{Experiment, LayerSpec, Source};
use crate::law::Law;
use crate::run::run;

pub(super) fn layer(thickness: f64, n: f64, sigma_a: f64, sigma_s: f64, g: f32) -> LayerSpec {
    LayerSpec { name: "slab".into(), thickness, n, sigma_a, sigma_s, law: Law::HenyeyGreenstein(g) }
}

pub(super) fn of(results: &crate::Results, name: &str) -> Estimate {
    results.scalar(name).expect("every run records its totals")
}

/// Adds two shares of the same run; their errors are added too, which is never too small.
fn sum(a: Estimate, b: Estimate) -> Estimate {
    Estimate { mean: a.mean + b.mean, std_err: a.std_err + b.std_err, n: a.n }
}

/// Measures the values.
pub(super) fn checks(settings: &Settings) -> Result<Vec<Check>, Error> {
    let Settings { walks: photons, seed } = *settings;
    let mut checks = Vec::new();
    let measure = |layers: Vec<LayerSpec>, source: Source, salt: u64| {
        let mut e = Experiment::new(layers, source);
        e.photons = photons;
        e.seed = seed.wrapping_mul(1000).wrapping_add(salt);
        run(&e)
    };
    let mut add = |name: &str, source: &'static str, expected: f64, uncertainty: f64, measured: Estimate| {
        checks.push(Check { name: name.into(), unit: "", source, expected, uncertainty, measured });
    };
    let normal = Source::Pencil { angle: 0.0 };

    // Slab of MCML's first case: 10 and 90 per cm, .02 cm, matched.
    let r = measure(vec![layer(0.02, 1.0, 10.0, 90.0, 0.75)], normal, 1)?;
    add("slab, tau 2, g .75: reflected", "van de Hulst 1980", slab::VAN_DE_HULST.0, 5e-6, of(&r, "reflected"));
    add(
        "slab, tau 2, g .75: transmitted",
        "van de Hulst 1980",
        slab::VAN_DE_HULST.1,
        5e-6,
        sum(of(&r, "transmitted"), of(&r, "ballistic")),
    );
    add("slab, tau 2, g .75: reflected", "MCML", 0.09734, 0.00035, of(&r, "reflected"));
    add("slab, tau 2, g .75: transmitted", "MCML", 0.66096, 0.0002, sum(of(&r, "transmitted"), of(&r, "ballistic")));

    // Half-space of MCML's second case, specular reflection included.
    let r = measure(vec![layer(f64::INFINITY, 1.5, 10.0, 90.0, 0.0)], normal, 2)?;
    let total = sum(of(&r, "reflected"), of(&r, "specular"));
    add("half-space, n 1.5, alpha .9: all reflected", "Giovanelli 1955", 0.2600, 5e-5, total);
    add("half-space, n 1.5, alpha .9: all reflected", "MCML", 0.25907, 0.0017, total);

    // Half-spaces against the exact solution.
    for (k, (alpha, eta)) in [(0.5, 1.0), (0.9, 1.0), (0.99, 1.0), (0.6, 1.33), (0.95, 1.33), (0.8, 1.5), (0.99, 1.5)]
        .into_iter()
        .enumerate()
    {
        let half = HalfSpace::new(alpha, eta).expect("within the domain of the exact solution");
        let media = || vec![layer(f64::INFINITY, eta, 1.0 - alpha, alpha, 0.0)];
        let entered = 1.0 - ((eta - 1.0) / (eta + 1.0)) * ((eta - 1.0) / (eta + 1.0));
        let r = measure(media(), normal, 10 + k as u64)?;
        let name = format!("half-space, alpha {alpha}, n {eta}: reflected, normal");
        add(&name, "Chandrasekhar 1960", entered * half.albedo(Illumination::Normal), 1e-6, of(&r, "reflected"));
    }

    // Half-spaces of other scattering.
    for (k, (alpha, g, eta)) in [(0.9, 0.8, 1.33), (0.99, 0.9, 1.0), (0.8, -0.5, 1.5)].into_iter().enumerate() {
        let half = Anisotropic::new(g, eta, Illumination::Normal).and_then(|h| h.albedo(alpha));
        let entered = 1.0 - ((eta - 1.0) / (eta + 1.0)) * ((eta - 1.0) / (eta + 1.0));
        let r = measure(vec![layer(f64::INFINITY, eta, 1.0 - alpha, alpha, g as f32)], normal, 20 + k as u64)?;
        let name = format!("half-space, alpha {alpha}, g {g}, n {eta}: reflected, normal");
        let exact = entered * half.expect("within the domain of the exact solution");
        add(&name, "discrete ordinates", exact, 1e-5, of(&r, "reflected"));
    }

    // A thick conservative slab: Milne's problem.
    let r = measure(vec![layer(50.0, 1.0, 0.0, 1.0, 0.0)], normal, 30)?;
    add(
        "conservative slab, tau 50: transmitted",
        "Chandrasekhar 1960",
        slab::conservative_transmittance(50.0),
        1e-8,
        of(&r, "transmitted"),
    );

    // The mean path length of light in a body that does not absorb; a slab is its own mirror image.
    for (k, (n, g, sigma_s)) in [(1.0, 0.0, 5.0), (1.5, 0.9, 20.0)].into_iter().enumerate() {
        let mut e = Experiment::new(vec![layer(1.0, n, 0.0, sigma_s, g)], Source::Lambertian);
        e.photons = photons;
        e.seed = seed.wrapping_mul(1000).wrapping_add(40 + k as u64);
        // The absorption of a trace is the path length times its coefficient: read the track-length tally of fluence over depth.
        e.tallies.depth = Some(crate::Bins { first: 0.0, max: 1.0, bins: 1 });
        let r = run(&e)?;
        let fluence = r.grid("fluence_z").expect("asked for").cells[0];
        let name = format!("slab, n {n}, g {g}, tau {sigma_s}: mean path over thickness");
        add(&name, "4 n^2 V / S, Blanco & Fournier 2003", 2.0 * n * n, 1e-9, fluence);
    }
    Ok(checks)
}
