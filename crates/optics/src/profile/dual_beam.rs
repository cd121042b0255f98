//! The dual-beam searchlight BSSRDF: an exponential source along the refracted light, an exponential detector along the refracted view.
//!
//! Index-matched, isotropic scattering (reduced coefficients), in units of the reduced mean free path:
//!
//! $$ L_o = \int_0^\infty\!\!\int_0^\infty e^{-(u+v)}\, \frac{\alpha'^2}{4\pi}\, \phi_M(x_o - u\,\omega_o',\; x_i + v\,\omega_i')\, du\, dv $$
//!
//! The two points are connected by Grosjean's monopole, uncollided and diffuse part each with its own negative image, fitted so that the plane-parallel BRDF comes out right:
//!
//! $$ \phi_M = G_u(d) + G_D(d) - a_u G_u(d_u) - a_D G_D(d_D), \qquad G_u = \frac{e^{-d}}{4\pi d^2}, \qquad G_D = \frac{3\alpha'}{2-\alpha'}\, \frac{e^{-\kappa_G d}}{4\pi d} . $$
//!
//! Exact single scattering is added. Reciprocal.
//!
//! **The offset of the images.** In the only public code the source is mirrored at z = 0 and raised by z_u or z_D; its albedo is then 21 % too low at alpha = .99. With the mirror *plane* at that height (an
//! offset of twice it) albedos are within 2 % for alpha .3 to .99, and this is the most accurate model of all to three mean free paths. `dual-beam` has the factor 2, inferred from numbers; `dual-beam-as-published` follows
//! the code. In bright media the image's amplitude exceeds 1:
//! the fluence turns negative far out (values below 0 are kept, [`super::Prepared`] counts them), and above alpha' = .99 the fits fail altogether; such media are refused.
//!
//! | alpha | albedo error | as published |
//! |---|---|---|
//! | .3 | -.7 % | -1.0 % |
//! | .6 | +1.3 | -2.1 |
//! | .8 | +2.0 | -6.0 |
//! | .95 | +2.0 | -13.7 |
//! | .99 | +.1 | -20.7 |
//!
//! (measured, light along the normal; test.) *Domain*: eta = 1, alpha' <= .99; the fits are stated for alpha' >= .5. *Accuracy* of the radial profile's quadrature: 3e-3 (test). *Source*: \[DEon2014\].

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_core::{DVec3, Real};

use crate::error::{Error, within};
use crate::exponential::e_1;
use crate::properties::OpticalProperties;

pub(crate) mod directed;

use super::model::RadialModel;
use super::single::Single;
use super::table::growing_breaks;
use super::{Info, Kind};

/// Description of the corrected model.
pub const INFO: Info = Info {
    name: "dual-beam",
    summary: "beams of light and of view joined by Grosjean's monopole with fitted images; reciprocal",
    source: "DEon2014",
    kind: Kind::Whole,
    valid: "eta 1 alone: albedo within 2 %, R(r) within 7 % to 3 mean free paths, -11 to -18 % at 10",
    use_when: "for index-matched media: the most accurate analytic model there",
    avoid_when: "with a refractive boundary (refused)",
};

/// Description of the published code's model.
pub const AS_PUBLISHED: Info = Info {
    name: "dual-beam-as-published",
    summary: "the same with image offsets as the public code has them",
    source: "DEon2014",
    kind: Kind::Whole,
    valid: "eta 1 alone: albedo -1 % at alpha .3, -6 at .8, -21 at .99",
    use_when: "to compare with other programs",
    avoid_when: "otherwise: dual-beam corrects it",
};

/// The connection between two points, in units of the reduced mean free path.
#[derive(Clone, Copy, Debug)]
struct Connection<T> {
    alpha: T,
    kappa: T,
    /// Amplitude of the diffuse part, 3 alpha / (2 - alpha).
    diffuse: T,
    /// Amplitudes of the images, and the sums that are added to the depths.
    a_u: T,
    a_d: T,
    offset_u: T,
    offset_d: T,
}

impl<T: Real> Connection<T> {
    fn new(medium: &OpticalProperties<T>, factor: f64) -> Self {
        let a = medium.alpha_prime();
        let a2 = a * a;
        let root = a.sqrt();
        let z_d = (a2.scale(0.335867) - a.scale(0.62166)) + root.recip().scale(0.944945);
        let z_u = a.scale(0.154352).offset(-0.142497).larger(T::from_f64(-0.03));
        let a_d = (a2.scale(0.359563) - a.scale(0.692592)).offset(1.34954);
        let a_u = a.scale(20.0) - a2.scale(22.8) + (a2 * a).scale(9.8) + a.recip().scale(1.1);
        Self {
            alpha: a,
            kappa: medium.sigma_tr_grosjean() / medium.sigma_t_prime(),
            diffuse: a.scale(3.0) / (-a).offset(2.0),
            a_u: a_u.offset(-7.7),
            a_d,
            offset_u: z_u.scale(factor),
            offset_d: z_d.scale(factor),
        }
    }

    /// Returns the decay of the diffuse part, as a plain number.
    fn decay(&self) -> f64 {
        self.kappa.value()
    }

    /// Returns phi_M for two depths and a squared distance across.
    fn eval(&self, across2: T, z: T, z_s: T) -> T {
        let d2 = |h: T| across2 + h * h;
        let (real, image_u, image_d) = (d2(z - z_s), d2(z + z_s + self.offset_u), d2(z + z_s + self.offset_d));
        let uncollided = |d2: T| (-(d2.sqrt())).exp() / d2;
        let diffuse = |d2: T| {
            let d = d2.sqrt();
            (-(self.kappa * d)).exp() / d
        };
        let u = uncollided(real) - self.a_u * uncollided(image_u);
        let d = diffuse(real) - self.a_d * diffuse(image_d);
        (u + self.diffuse * d).scale(0.25 / PI)
    }
}

/// The radial profile for light along the normal; F is the factor of the image offset.
#[derive(Clone, Debug)]
struct Beams<T> {
    sigma: T,
    connection: Connection<T>,
    single: Single<T>,
    /// rho e^(kappa rho) times the fluence of the beam, over ln rho and ln z.
    fluence: Vec<T>,
    total: T,
}

/// Nodes per unit of the logarithm, and the range of the table.
const PER_E: f64 = 5.0;
const FIRST: f64 = 1e-4;
const LAST_RHO: f64 = 2e3;
const LAST_Z: f64 = 50.0;

fn nodes(last: f64) -> usize {
    ((last / FIRST).ln() * PER_E).ceil() as usize + 1
}

impl<T: Real> Beams<T> {
    fn new(medium: &OpticalProperties<T>, factor: f64) -> Result<Self, Error> {
        let eta = medium.eta().value();
        within("eta", eta as f32, eta == 1.0, "[1, 1]: the model is index-matched")?;
        let alpha = medium.alpha_prime().value();
        within("alpha'", alpha as f32, alpha <= 0.9901, "[0, 0.99], where its fits hold")?;
        let connection = Connection::new(medium, factor);
        let mut fluence = Vec::with_capacity(nodes(LAST_RHO) * nodes(LAST_Z));
        for j in 0..nodes(LAST_Z) {
            let z = FIRST * (j as f64 / PER_E).exp();
            for i in 0..nodes(LAST_RHO) {
                let rho = FIRST * (i as f64 / PER_E).exp();
                // Without its exponential the field is a slow function of the logarithms.
                let decay = connection.decay() * rho;
                fluence.push(if decay > 300.0 {
                    T::from_f64(0.0)
                } else {
                    beam_fluence(&connection, rho, z).scale(rho * decay.exp())
                });
            }
        }
        let total = multiple_total(&connection);
        Ok(Self { sigma: medium.sigma_t_prime(), connection, single: Single::new(medium)?, fluence, total })
    }

    /// Adds one depth, with a weight, to a line over the nodes in ln rho: cubic interpolation in ln z.
    fn add_depth(&self, line: &mut [T], z: f64, weight: f64) {
        let columns = nodes(LAST_Z);
        let y = ((z / FIRST).ln() * PER_E).max(0.0);
        let j = (y as usize).min(columns - 2);
        for (b, v) in cubic_weights(y - j as f64).into_iter().enumerate() {
            let column = (j as isize + b as isize - 1).clamp(0, columns as isize - 1) as usize;
            for (i, l) in line.iter_mut().enumerate() {
                *l = *l + self.fluence[column * nodes(LAST_RHO) + i].scale(v * weight);
            }
        }
    }

    /// Interpolates such a line, cubic in ln rho, and puts the factor 1 / (rho e^(kappa rho)) back.
    fn along(&self, line: &[T], rho: T) -> T {
        if rho.value() > LAST_RHO {
            return T::from_f64(0.0);
        }
        let x = (rho.larger(T::from_f64(FIRST)).ln().offset(-FIRST.ln())).scale(PER_E);
        let i = (x.value().max(0.0) as usize).min(line.len() - 2);
        let mut sum = T::from_f64(0.0);
        for (a, w) in cubic_weights(x.offset(-(i as f64))).into_iter().enumerate() {
            let row = (i as isize + a as isize - 1).clamp(0, line.len() as isize - 1) as usize;
            sum = sum + w * line[row];
        }
        sum / rho * (-rho.scale(self.connection.decay())).exp()
    }

    fn eval(&self, r: T) -> T {
        // The last flight of all light that scatters at lateral distance s, azimuth psi and depth z = s cot: z e^(-d) / (4 pi d^3).
        let x = r * self.sigma;
        let xv = x.value();
        let mut breaks: Vec<f64> = growing_breaks(xv.min(1.0), 30.0);
        // The beam is a singular line at s = r, psi = 0.
        breaks.extend((0..7).flat_map(|k| [xv * (1.0 + 0.4 * 0.4f64.powi(k)), xv * (1.0 - 0.4 * 0.4f64.powi(k))]));
        breaks.extend([xv, 40.0]);
        breaks.retain(|b| (0.0..=40.0).contains(b));
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let azimuths = Rule::composite(4, &[0.0, PI / 256.0, PI / 64.0, PI / 16.0, PI / 4.0, PI]);
        let slopes = Rule::composite(4, &[0.0, 0.05, 0.2, 0.6, 0.5 * PI]);
        let mut sum = T::from_f64(0.0);
        let mut line = vec![T::from_f64(0.0); nodes(LAST_RHO)];
        for (s, ws) in Rule::composite(4, &breaks).iter() {
            line.fill(T::from_f64(0.0));
            for (theta, wt) in slopes.iter() {
                // theta is the angle of the last flight: z = s cot, d = s / sin, and s ds dpsi z dz / d^3 = ds dpsi cos dtheta.
                let (sin, cos) = theta.sin_cos();
                let (z, d) = (s * cos / sin, s / sin);
                if d < LAST_Z {
                    self.add_depth(&mut line, z, ws * wt * 2.0 * cos * (-d).exp() / (4.0 * PI));
                }
            }
            for (psi, wp) in azimuths.iter() {
                let rho2 = (x.offset(-s)).squared() + x.scale(2.0 * s * (1.0 - psi.cos()));
                let rho = rho2.sqrt().larger(T::from_f64(1e-7));
                sum = sum + self.along(&line, rho).scale(wp);
            }
        }
        self.connection.alpha * sum * self.sigma * self.sigma + self.single.eval(r)
    }
}

/// Weights of Catmull-Rom interpolation at a fraction t between the second and the third of four nodes.
fn cubic_weights<T: Real>(t: T) -> [T; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (t2.scale(2.0) - t - t3).scale(0.5),
        (t3.scale(3.0) - t2.scale(5.0)).offset(2.0).scale(0.5),
        (t + t2.scale(4.0) - t3.scale(3.0)).scale(0.5),
        (t3 - t2).scale(0.5),
    ]
}

/// Returns the fluence at (rho, z) of the light that collides along the beam.
fn beam_fluence<T: Real>(connection: &Connection<T>, rho: f64, z: f64) -> T {
    let across2 = T::from_f64(rho * rho);
    let mut breaks: Vec<f64> = growing_breaks(rho.min(1.0), 45.0).iter().flat_map(|b| [z + b, z - b]).collect();
    let image = -connection.offset_u.value() - z;
    if image > 0.0 {
        breaks.extend(growing_breaks(rho.min(0.1), 1.0).iter().flat_map(|b| [image + b, image - b]));
    }
    breaks.extend([0.0, 0.3, 1.0, 3.0, 10.0, 45.0]);
    breaks.retain(|b| (0.0..=45.0).contains(b));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    let mut sum = T::from_f64(0.0);
    for (v, w) in Rule::composite(5, &breaks).iter() {
        sum = sum + connection.eval(across2, T::from_f64(z), T::from_f64(v)).scale(w * (-v).exp());
    }
    connection.alpha * sum
}

/// Returns the integral of the multiple-scattering profile: alpha^2 / 2 times that of E_2(z) e^(-s) over planes that emit and collect.
fn multiple_total<T: Real>(c: &Connection<T>) -> T {
    // Integrals over planes at distance h: G_u gives E_1(h) / 2, G_D gives diffuse e^(-kappa h) / (2 kappa).
    let uncollided = |h: T| {
        let v = h.value().abs().max(1e-300);
        h.lift(0.5 * e_1(v), -0.5 * (-v).exp() / v * h.value().signum())
    };
    let diffuse = |h: T| c.diffuse * (-(c.kappa * h)).exp() / c.kappa.scale(2.0);
    // Both depths on graded grids; the logarithm at equal depths is resolved by splitting there.
    let outer = Rule::composite(8, &growing_breaks(0.02, 45.0));
    let mut sum = T::from_f64(0.0);
    for (z, wz) in outer.iter() {
        let mut breaks: Vec<f64> =
            (0..24).flat_map(|k| [z * (1.0 - 0.5f64.powi(k)), z + 0.5f64.powi(k) * 4.0]).collect();
        breaks.extend([z, z + 8.0, z + 16.0, 45.0_f64.max(z + 20.0)]);
        // Below alpha = .92 the fitted height is negative: the image of the uncollided light lies in the medium, with its own logarithm.
        let image = -c.offset_u.value() - z;
        if image > 0.0 {
            breaks.extend((0..20).flat_map(|k| [image * (1.0 - 0.5f64.powi(k)), image * (1.0 + 0.5f64.powi(k))]));
            breaks.push(image);
        }
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let mut inner = T::from_f64(0.0);
        for (s, ws) in Rule::composite(6, &breaks).iter() {
            let (h, mirror) = (T::from_f64((z - s).abs()), z + s);
            let value = uncollided(h) + diffuse(h)
                - c.a_u * uncollided(c.offset_u.offset(mirror))
                - c.a_d * diffuse(c.offset_d.offset(mirror));
            inner = inner + value.scale(ws * (-s).exp());
        }
        sum = sum + inner.scale(wz * ((-z).exp() - z * e_1(z)));
    }
    (c.alpha * c.alpha * sum).scale(0.5)
}

macro_rules! variant {
    ($name:ident, $factor:literal, $doc:literal) => {
        #[doc = $doc]
        #[derive(Clone, Debug)]
        pub struct $name<T = f64>(Box<Inner<T>>);

        impl<T: Real> RadialModel<T> for $name<T> {
            fn new(medium: &OpticalProperties<T>) -> Result<Self, Error> {
                Ok(Self(Box::new(Inner(Beams::new(medium, $factor)?))))
            }

            fn eval(&self, r: T) -> T {
                self.0.0.eval(r)
            }

            fn total(&self) -> T {
                self.0.0.total + self.0.0.single.total()
            }
        }
    };
}

#[derive(Clone, Debug)]
struct Inner<T>(Beams<T>);

variant!(DualBeam, 2.0, "The corrected model, images mirrored in a plane at the fitted height.");
variant!(AsPublished, 1.0, "The public code's model, images raised by the fitted height.");

/// Returns the radiance of the corrected model in multiple scattering, per unit of power that enters along a ray \[1/(L^2 sr)\].
///
/// `offset` is exit minus entry point on the plane z = 0, medium below; `w_i` and `w_o` point to the light and to the viewer (straight on inside: no refraction). Single
/// scattering joins only rays that meet, and is not a density in direction. Symmetric in the two rays.
///
/// *Domain*: a non-zero offset, directions above the surface. *Errors*: eta other than 1.
pub fn multiple_radiance(medium: &OpticalProperties, offset: DVec3, w_i: DVec3, w_o: DVec3) -> Result<f64, Error> {
    within("eta", medium.eta() as f32, medium.eta() == 1.0, "[1, 1]: the model is index-matched")?;
    let c = Connection::new(medium, 2.0);
    let sigma = medium.sigma_t_prime();
    // In units of the reduced mean free path from the entry point; both rays go down, against the directions to light and viewer.
    let x = offset * sigma;
    let rule = Rule::composite(8, &growing_breaks(x.length().min(1.0), 40.0));
    let mut sum = 0.0;
    for (u, wu) in rule.iter() {
        let y = x - w_o * u;
        for (v, wv) in rule.iter() {
            let s = -w_i * v;
            let across2 = (y.x - s.x).powi(2) + (y.y - s.y).powi(2);
            sum += wu * wv * (-u - v).exp() * c.eval(across2, -y.z, -s.z);
        }
    }
    Ok(c.alpha * c.alpha / (4.0 * PI) * sum * sigma * sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halfspace::HFunction;

    fn medium(alpha: f64) -> OpticalProperties {
        OpticalProperties::from_albedo(1.0, alpha, 0.0, 1.0).unwrap()
    }

    #[test]
    fn albedos_have_the_measured_errors_with_both_offsets() {
        // Physics notes, 5.11, printed digits: error with the code's offset, with twice it.
        for (alpha, published, corrected) in [
            // The notes print -.9 % for .3 with twice the offset; two quadratures here give -.68 %.
            (0.3, -0.011, -0.0068),
            (0.6, -0.021, 0.012),
            (0.8, -0.060, 0.020),
            (0.95, -0.137, 0.020),
            (0.99, -0.207, 0.001),
        ] {
            let m = medium(alpha);
            let exact = HFunction::new(alpha).unwrap().plane_albedo(1.0);
            let single = Single::new(&m).unwrap().total();
            let error = |factor| (multiple_total(&Connection::new(&m, factor)) + single) / exact - 1.0;
            // Printed to .1 %, against a Monte Carlo albedo that is good to .05 %.
            assert!((error(1.0) - published).abs() < 1e-3, "{alpha} {}", error(1.0));
            assert!((error(2.0) - corrected).abs() < 1e-3, "{alpha} {}", error(2.0));
        }
    }

    #[test]
    fn profiles_have_the_measured_errors() {
        // Monte Carlo of physics notes, 9 (eta 1): R at r = .1, .3, 1, 3 with relative errors; errors of the model from 5.11.
        for (alpha, r_mc, error) in [
            (0.8, [0.48, 0.1127, 0.01466, 0.0008044], [0.001, 0.021, 0.052, 0.022]),
            (0.95, [0.6064, 0.1552, 0.02588, 0.002541], [0.004, 0.031, 0.064, 0.007]),
        ] {
            let d = DualBeam::new(&medium(alpha)).unwrap();
            for ((r, mc), e) in [0.1, 0.3, 1.0, 3.0].into_iter().zip(r_mc).zip(error) {
                // Monte Carlo .3 %, its bins of 5 % (R like 1/r^2 there: .2 %), this quadrature .3 %: together within 1.2 %.
                let measured = d.eval(r) / mc - 1.0;
                assert!((measured - e).abs() < 0.012, "{alpha} {r} {measured} {e}");
            }
        }
    }

    #[test]
    fn the_radiance_is_reciprocal_and_the_fluence_turns_negative_far_out() {
        let (m, x) = (medium(0.9), DVec3::new(0.7, 0.2, 0.0));
        let (a, b) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.2, 0.5, 0.1).normalize());
        let (forth, back) = (multiple_radiance(&m, x, a, b).unwrap(), multiple_radiance(&m, -x, b, a).unwrap());
        assert!((forth / back - 1.0).abs() < 1e-10 && forth > 0.0);
        // Physics notes, 5.11: negative at 60 mean free paths for alpha = .99.
        let c = Connection::new(&medium(0.99), 2.0);
        assert!(c.eval(3600.0, 0.0, 0.0) < 0.0);
        assert!(multiple_radiance(&OpticalProperties::new(0.1, 1.0, 0.0, 1.3).unwrap(), x, a, b).is_err());
    }
}
