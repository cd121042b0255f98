//! Mean path lengths: under uniform light a closed body that does not absorb is crossed over 4 eta^2 V / S on average per ray that
//! meets it, whatever its shape, density and phase function \[BlancoFournier2003\].
//!
//! *How it is measured.* A medium that emits radiance 1 per unit length and absorbs nothing shows the length of each path inside, over
//! eta^2 as all radiance from inside. Emission needs absorption (sigma_a L_e = 1), so sigma_a is 2^-30 sigma_s: in single precision
//! sigma_t = sigma_s exactly, and nothing is lost.
//!
//! *What is expected.* Of rays of uniform light through a sphere of radius B around the body (uniform entry points, cosine-distributed
//! directions) S / (4 pi B^2) enter a convex body of surface S, and the mean radiance is 4 V / S times that: V / (pi B^2). Written
//! so, without S, it holds for concave bodies too: rays that miss or enter twice need no care.

use std::f64::consts::PI;

use crate::bodies::{Body, SHELLS, shells};
use crate::common::{Tracer, World, assert_exact, ball, glow, measure, samples, uniform_ray};

/// Share of absorption that emission needs and that f32 does not notice.
pub const UNNOTICED: f32 = 1.0 / 1_073_741_824.0;

/// Compares the mean length of paths per ray, over squared index, with `volume`.
pub fn assert_length(what: &str, tracer: &Tracer, reach: f32, volume: f64, n: u64) {
    let [length] = measure(n, |i| {
        let (o, d) = uniform_ray(31, i, reach);
        [tracer.radiance(i, o, d)]
    });
    tracer.assert_sound();
    assert_exact(what, length, volume / (PI * f64::from(reach).powi(2)), 0.0);
}

#[test]
fn mean_path_length_is_four_eta_squared_v_over_s_whatever_the_body_and_medium() {
    // Slow: .03 to .05 % of lengths near the size of the body; .2 to 1 % at the densest, whose lengths vary most, and at the thinnest,
    // where n collisions tell a length to 1 / sqrt n.
    for (body, tau, g, eta, n, slow) in [
        (Body::ball(), 0.01, -0.5, 1.5, 200_000, 64),
        (Body::ball(), 1.0, 0.0, 1.0, 200_000, 100),
        (Body::ball(), 10.0, 0.5, 1.5, 100_000, 100),
        (Body::ball(), 300.0, 0.95, 2.0, 4_000, 16),
        (Body::bumpy(), 1.0, 0.95, 1.33, 150_000, 100),
        (Body::bumpy(), 10.0, 0.0, 1.0, 100_000, 32),
        (Body::bumpy(), 30.0, -0.5, 1.5, 20_000, 16),
        (Body::smooth(), 1.0, -0.5, 2.0, 100_000, 100),
        (Body::smooth(), 5.0, 0.5, 1.33, 100_000, 64),
        (Body::smooth(), 0.3, 0.0, 1.5, 150_000, 100),
        (Body::sheet(), 0.3, 0.0, 1.5, 200_000, 64),
        (Body::sheet(), 10.0, 0.9, 1.33, 60_000, 32),
        (Body::sheet(), 100.0, 0.0, 1.5, 10_000, 16),
    ] {
        let sigma_s = body.sigma_s(tau);
        let sigma_a = sigma_s * UNNOTICED;
        assert_eq!(sigma_a + sigma_s, sigma_s);
        let mut world = World::new();
        let glow = world.glow(sigma_a, sigma_s, g, 1.0 / sigma_a);
        let boundary = world.dielectric(eta, 0.0);
        world.body(&body.geometry, boundary, Some(glow), None);
        let what = format!("path length in a {}, {tau} mean free paths, g {g}, eta {eta}", body.name);
        assert_length(&what, &world.tracer(), body.reach, body.volume, samples(n, slow));
    }
}

#[test]
fn nested_shells_share_path_length_by_volume_and_squared_index() {
    // Each medium shows its own length over its own squared index. Slow: .06 to .1 %.
    for shown in 0..2 {
        let (mut world, reach, volumes) = shells();
        let s = SHELLS[shown].1;
        world.0.media[shown].kind = glow(s * UNNOTICED, s, 0.3, 1.0 / (s * UNNOTICED));
        assert_length(
            &format!("path length in shell {shown}"),
            &world.tracer(),
            reach,
            volumes[shown],
            samples(200_000, 20),
        );
    }
}

#[test]
fn a_glowing_ball_without_scattering_shines_as_its_chords_say() {
    // Chords of a unit ball are 2 mu long with density 2 mu dmu: the mean of 1 - exp(-2 a mu) is 1 - (1 - (1 + 2 a) exp(-2 a)) / (2 a^2).
    // Slow: .01 %.
    for a in [0.3f32, 2.0, 30.0] {
        let mut world = World::new();
        let glow = world.glow(a, 0.0, 0.0, 1.0);
        let boundary = world.dielectric(1.0, 0.0);
        world.body(&ball(1.0), boundary, Some(glow), None);
        let tracer = world.tracer();
        let [l] = measure(samples(100_000, 64), |i| {
            let (o, d) = uniform_ray(33, i, 1.0001);
            [tracer.radiance(i, o, d)]
        });
        tracer.assert_sound();
        let a = f64::from(a);
        let exact = (1.0 - (1.0 - (1.0 + 2.0 * a) * (-2.0 * a).exp()) / (2.0 * a * a)) / 1.0001f64.powi(2);
        assert_exact(&format!("glow of an absorbing ball, {a} mean free paths"), l, exact, 0.0);
    }
}
