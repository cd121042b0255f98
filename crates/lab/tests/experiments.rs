//! Experiments against exact and published values. Each comparison accepts 5 standard errors between 64 batches (Student's t with 63 degrees of
//! freedom: 5e-6 two-sided; 60 comparisons: 3e-4 in all would be too much for 1e-4, so those of one run share a bound of 5.3).

use moonmilk_core::Estimate;
use moonmilk_core::stats::{sidak, t_test};
use moonmilk_lab::{Bins, Experiment, Law, LayerSpec, Results, Source, run, validate};

/// Student's t with 63 degrees of freedom: two-sided 1.7e-6, so that 60 comparisons stay below 1e-4.
const Z: f64 = 5.3;

fn layer(name: &str, thickness: f64, n: f64, sigma_a: f64, sigma_s: f64, g: f32) -> LayerSpec {
    LayerSpec { name: name.into(), thickness, n, sigma_a, sigma_s, law: Law::HenyeyGreenstein(g) }
}

fn skin() -> Experiment {
    let layers = vec![
        layer("epidermis", 0.1, 1.45, 0.5, 10.0, 0.8),
        layer("gel", 0.05, 1.34, 0.0, 0.0, 0.0),
        layer("dermis", 1.0, 1.4, 0.05, 8.0, 0.7),
    ];
    let mut e = Experiment::new(layers, Source::Pencil { angle: 0.5 });
    e.photons = 100_000;
    e.tallies.radius = Some(Bins { first: 0.0, max: 2.0, bins: 10 });
    e.tallies.depth = Some(Bins { first: 0.0, max: 1.2, bins: 12 });
    e.tallies.angle = Some(6);
    e.tallies.plane = Some(Bins { first: 0.0, max: 1.0, bins: 4 });
    e.tallies.path = Some(Bins { first: 0.0, max: 10.0, bins: 8 });
    e.tallies.time = Some(Bins { first: 0.0, max: 50.0, bins: 8 });
    e.tallies.collisions = Some(8);
    e
}

/// Sums a grid times the measures of its cells: the share of light that it caught, with what fell outside.
fn whole(r: &Results, name: &str) -> f64 {
    let g = r.grid(name).expect(name);
    let measure = |axis: &moonmilk_lab::plan::Axis, i: usize| {
        let (a, b) = (axis.edges[i], axis.edges[i + 1]);
        match axis.name {
            "r" => std::f64::consts::PI * (b * b - a * a),
            "angle" => std::f64::consts::TAU * (a.cos() - b.cos()),
            "collisions" => 1.0,
            _ => b - a,
        }
    };
    let sum: f64 = g
        .cells
        .iter()
        .enumerate()
        .map(|(c, e)| {
            let (mut c, mut m) = (c, 1.0);
            for axis in g.axes.iter().rev() {
                m *= measure(axis, c % (axis.edges.len() - 1));
                c /= axis.edges.len() - 1;
            }
            e.mean * m
        })
        .sum();
    sum + g.outside.mean
}

#[test]
fn published_values_are_found_again() {
    let found = validate::validate(&validate::Settings { walks: 100_000, seed: 3 }).unwrap();
    assert!(found.values.len() > 55);
    let limit = sidak(1e-4, found.checks().count());
    for c in found.checks() {
        assert!(t_test(c.z(), 63.0) > limit, "{}: {} against {} ({})", c.name, c.measured, c.expected, c.source);
    }
    for c in found.values.iter().filter(|c| c.unit.is_empty()) {
        assert!(c.measured.relative_error() < 0.03, "{}: {}", c.name, c.measured);
    }
}

#[test]
fn a_wrong_coefficient_would_be_found() {
    // Five per cent more scattering than van de Hulst's slab has: the comparison must fail.
    let mut e = Experiment::new(vec![layer("slab", 0.02, 1.0, 10.0, 94.5, 0.75)], Source::Pencil { angle: 0.0 });
    e.photons = 400_000;
    let r = run(&e).unwrap().scalar("reflected").unwrap();
    assert!(r.z(0.09739).abs() > Z, "{r}");
}

#[test]
fn all_light_is_accounted_for_and_all_tallies_agree() {
    let r = run(&skin()).unwrap();
    let s = |name: &str| r.scalar(name).unwrap();
    // Weights are absorbed at collisions and ended by roulette: the sum is 1 in the mean; the errors of its parts add at most.
    let parts = ["specular", "reflected", "transmitted", "ballistic", "absorbed", "unfinished"].map(s);
    let (sum, error) = parts.iter().fold((0.0, 0.0), |(m, e), p| (m + p.mean, e + p.std_err));
    assert!((sum - 1.0).abs() < Z * error, "{sum} +- {error}");
    assert_eq!(r.lost, 0);
    // Both estimators of the absorption of each layer.
    for name in ["epidermis", "dermis"] {
        let (a, b): (Estimate, Estimate) = (s(&format!("absorbed.{name}")), s(&format!("absorbed_track.{name}")));
        assert!((a.mean - b.mean).abs() < Z * (a.std_err + b.std_err), "{name}: {a} {b}");
    }
    assert_eq!(s("absorbed.gel").mean, 0.0);
    // Each grid catches all of the light of its event: rounding of sums in f64.
    for suffix in ["r", "angle", "r_angle", "xy", "path", "time", "r_time", "collisions"] {
        let reflected = whole(&r, &format!("reflectance_{suffix}"));
        assert!((reflected - s("reflected").mean).abs() < 1e-12, "{suffix}");
        if suffix != "collisions" {
            let transmitted = whole(&r, &format!("transmittance_{suffix}"));
            assert!((transmitted - s("transmitted").mean - s("ballistic").mean).abs() < 1e-12, "{suffix}");
        }
    }
    for name in ["absorption_z", "absorption_rz"] {
        assert!((whole(&r, name) - s("absorbed").mean).abs() < 1e-12, "{name}");
    }
    // Fluence by track length on both grids, and times sigma_a the absorption.
    assert!((whole(&r, "fluence_z") / whole(&r, "fluence_rz") - 1.0).abs() < 1e-9);
    let track: f64 = ["epidermis", "dermis"].map(|l| s(&format!("absorbed_track.{l}")).mean).iter().sum();
    let g = r.grid("fluence_z").unwrap();
    // Cells of .1: the first is the epidermis, the second holds the gel's .05 as well, so compare the sum over the rest alone.
    let rest: f64 = g.cells[2..].iter().map(|e| 0.05 * 0.1 * e.mean).sum();
    assert!(rest < track && rest > 0.0);
    // The mean path is the sum of those in the layers.
    let partial: f64 = ["epidermis", "gel", "dermis"].map(|l| s(&format!("path.{l}")).mean).iter().sum();
    assert!(partial > 0.1);
}

#[test]
fn an_oblique_beam_moves_the_light_sideways() {
    let r = run(&skin()).unwrap();
    let g = r.grid("reflectance_xy").unwrap();
    let row = |x: usize| g.cells[4 * x..4 * x + 4].iter().map(|e| e.mean).sum::<f64>();
    let error = g.cells.iter().map(|e| e.std_err).sum::<f64>();
    assert!(row(2) + row(3) - row(0) - row(1) > Z * error, "{:?}", g.cells);
}

#[test]
fn threads_change_no_bit() {
    let mut e = skin();
    e.photons = 5_000;
    let on = |e: &Experiment, n: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| run(e).unwrap())
    };
    let one = on(&e, 1);
    assert_eq!(one, on(&e, 2));
    assert_eq!(one, on(&e, 5));
    e.seed += 1;
    assert!(one != on(&e, 1), "the seed matters");
}

#[test]
fn a_point_source_deep_inside_makes_the_exact_fluence() {
    // Infinite medium, alpha = .9: the mean fluence over z of planes through the source follows from the plane source, so compare the total:
    // all light is absorbed, half of it on either side, and the track-length fluence integrates to 1 / sigma_a.
    let mut e = Experiment::new(vec![layer("sea", 80.0, 1.0, 0.1, 0.9, 0.0)], Source::Point { depth: 40.0 });
    e.photons = 50_000;
    e.tallies.depth = Some(Bins { first: 0.0, max: 80.0, bins: 2 });
    let r = run(&e).unwrap();
    let cells = &r.grid("fluence_z").unwrap().cells;
    // Decay exp(-.5254 r): 40 mean free paths lose 1e-9.
    for c in cells {
        let share = Estimate { mean: c.mean * 40.0, std_err: c.std_err * 40.0, n: c.n };
        assert!(share.z(5.0).abs() < Z, "{share}");
    }
}

#[test]
fn conservative_half_spaces_end_and_say_so() {
    let mut e = Experiment::new(vec![layer("milk", f64::INFINITY, 1.0, 0.0, 1.0, 0.0)], Source::Pencil { angle: 0.0 });
    e.photons = 2_000;
    e.max_collisions = 1_000;
    let r = run(&e).unwrap();
    let unfinished = r.scalar("unfinished").unwrap();
    // Every weight is one: what is not reflected is unfinished. About 2.9 / sqrt(3 pi N) of the light outlasts N collisions.
    assert!((r.scalar("reflected").unwrap().mean + unfinished.mean - 1.0).abs() < 1e-12);
    assert!(unfinished.mean > 0.0 && unfinished.mean < 0.1, "{unfinished}");
}

#[test]
fn what_is_out_of_range_is_named() {
    let bad = |change: &dyn Fn(&mut Experiment)| {
        let mut e = skin();
        change(&mut e);
        run(&e).unwrap_err().to_string()
    };
    assert_eq!(bad(&|e| e.layers[0].sigma_a = -1.0), "layer 1 (epidermis): sigma_a = -1 is outside [0, inf)");
    assert_eq!(bad(&|e| e.layers[2].law = Law::HenyeyGreenstein(1.0)), "layer 3 (dermis): g = 1 is outside (-1, 1)");
    assert!(bad(&|e| e.layers[0].thickness = f64::INFINITY).contains("or inf for the last layer"));
    assert!(bad(&|e| e.n_above = 0.0).starts_with("n_above = 0 is outside"));
    assert!(bad(&|e| e.layers.clear()).contains("at least one layer"));
    assert!(
        bad(&|e| e.tallies.radius = Some(Bins { first: 0.0, max: 1.0, bins: usize::MAX })).contains("[1, 1000000]")
    );
    assert!(
        bad(&|e| e.tallies.radius = Some(Bins { first: 0.0, max: 1.0, bins: 999_999 }))
            .contains("cells are to be recorded")
    );
    assert!(bad(&|e| e.source = Source::Point { depth: 9.0 }).starts_with("depth = 9"));
}

#[test]
fn radial_profiles_are_those_measured_by_another_program() {
    // Monte Carlo of 2e7 histories by an independent program (physics notes, 9): mean of R over r / 1.05 .. 1.05 r, alpha .95, eta 1.33.
    for (r, exact, error) in [(0.1, 0.3827f64, 0.004), (1.0, 0.01656, 0.002), (3.0, 0.002319, 0.001)] {
        let mut e =
            Experiment::new(vec![layer("half", f64::INFINITY, 1.33, 0.05, 0.95, 0.0)], Source::Pencil { angle: 0.0 });
        e.photons = 400_000;
        e.tallies.radius = Some(Bins { first: r / 1.05, max: r * 1.05, bins: 1 });
        let results = run(&e).unwrap();
        let entered = 1.0 - results.scalar("specular").unwrap().mean;
        let c = results.grid("reflectance_r").unwrap().cells[0];
        let (mean, std_err) = (c.mean / entered, c.std_err / entered);
        // One more unit of the last printed digit for rounding.
        let rounding = 0.5 * 10f64.powf(exact.log10().floor() - 3.0);
        assert!(
            (mean - exact).abs() < Z * std_err.hypot(exact * error) + rounding,
            "r {r}: {mean} +- {std_err} against {exact}"
        );
    }
}

#[test]
fn a_profile_is_worth_nothing_less_than_the_noise_against_itself() {
    use moonmilk_lab::profile::{HalfSpace, compare, measure};
    let medium = HalfSpace { sigma_a: 0.2, sigma_s: 0.8, g: 0.0, eta: 1.0 };
    let (a, b) = (measure(&medium, 20.0, 100_000, 1).unwrap(), measure(&medium, 20.0, 100_000, 2).unwrap());
    // The other run's rings as a step function.
    let steps = |r: f64| b.edges.windows(2).position(|e| r >= e[0] && r < e[1]).map_or(0.0, |i| b.rings[i].mean);
    let w = compare(&a, steps);
    // Two equal noises: root 2 of one in the mean over 40 rings, its own scatter a tenth of that.
    assert!(w.l1 < 2.0 * w.noise && w.l1 > 0.8 * w.noise, "{w:?}");
    let w = compare(&a, |r| 1.1 * steps(r));
    assert!((w.l1 - 0.1).abs() < 3.0 * w.noise, "{w:?}");
    // Exact albedo of the isotropic half-space.
    assert!(a.albedo.z(0.285255).abs() < Z, "{}", a.albedo);
}
