//! Optics of translucent materials: boundaries, phase functions, media, exact half-spaces, and the diffusion family of BSSRDFs.
//!
//! Usable alone: no files, no threads, no meshes. Conventions: directions are unit vectors away from the point; the
//! cosine of a phase function is that of the deflection, forward = +1; `eta` is the index inside over that outside; coefficients
//! are in \[1/length\] of any one unit. Kernels of rendering are f32, analysis is f64. Equations are typeset with
//! `RUSTDOCFLAGS="--html-in-header $PWD/crates/optics/docs/katex.html" cargo doc -p moonmilk-optics`.
//!
//! | question | where |
//! |---|---|
//! | how much is reflected at a boundary, and in the mean over directions? | [`fresnel`], [`boundary`] |
//! | where does a collision send light? | [`phase`] |
//! | what is a medium, and what are marble's coefficients? | [`properties`], [`medium`], [`materials`], [`skin`] |
//! | what does another program call that? | [`conventions`] |
//! | how does a point source light an infinite medium? | [`point_source`], [`p1`] |
//! | which medium looks the same at less cost? | [`similarity`] |
//! | how much does a half-space reflect, exactly, at any asymmetry and index? | [`halfspace`] |
//! | which medium has this albedo? | [`inversion`] |
//! | how far does light spread before it comes out? | [`profile`], all models by name; exactly: [`profile::tabulated`] |
//! | what gets out of a ball, exactly, for light from its centre? | [`escape`] |
//! | what do slabs and closed bodies do? | [`profile::multipole`]; exact ones to test a simulation with in [`slab`] |
//!
//! Three albedos have three names: `alpha` of one collision, `alpha_prime` reduced by similarity, `albedo` of a surface with all its scattering.
//!
//! # From transport to a profile
//!
//! Light in a medium is absorbed and scattered,
//!
//! $$ \omega \cdot \nabla L = -\sigma_t L + \sigma_s \int p(\omega, \omega')\, L(\omega')\, d\omega' + L_e . $$
//!
//! **1. Two moments.** Keep fluence and flux of the radiance alone: the transport equation becomes a screened Poisson equation with
//! $D = 1/(3\sigma_t')$ and the attenuation $\kappa = \sqrt{\sigma_a / D}$ ([`p1`]).
//!
//! ```
//! use moonmilk_core::DVec3;
//! use moonmilk_optics::OpticalProperties;
//! use moonmilk_optics::p1::Field;
//!
//! let medium = OpticalProperties::new(0.1, 2.0, 0.0, 1.3)?; // sigma_a, sigma_s, g, eta
//! let field = Field::monopole(&medium, DVec3::new(0.0, 0.0, 2.0));
//! // Light streams away from the source: more radiance outwards than back.
//! assert!(field.radiance(DVec3::Z) > field.radiance(-DVec3::Z));
//! # Ok::<(), moonmilk_optics::Error>(())
//! ```
//!
//! **2. A point source.** Diffusion knows nothing of light that has not collided yet. Grosjean's form adds it, and is within 5 % of the exact solution ([`point_source`]).
//!
//! ```
//! use moonmilk_optics::{OpticalProperties, point_source};
//!
//! let medium = OpticalProperties::from_albedo(1.0, 0.9, 0.0, 1.0)?;
//! let exact = point_source::Exact::new(0.9)?.fluence(0.1);
//! assert!(point_source::classical(0.1, &medium) < 0.3 * exact);
//! assert!((point_source::grosjean(0.1, &medium) / exact - 1.0).abs() < 0.05);
//! # Ok::<(), moonmilk_optics::Error>(())
//! ```
//!
//! **3. A boundary.** Fresnel's reflection keeps diffuse light in: $\phi = 2 A D\, \partial_z \phi$, as if the fluence vanished at the distance 2 A D outside ([`boundary`]).
//!
//! **4. A profile.** A source and its negative image obey that ([`profile::dipole`]); sources all along the beam are better ([`profile::photon_beam`]); the best measure of
//! them all is how much they return, since the exact albedo is known ([`halfspace`]).
//!
//! ```
//! use moonmilk_optics::halfspace::{Illumination, exact_albedo};
//! use moonmilk_optics::{MODELS, OpticalProperties};
//!
//! let medium = OpticalProperties::from_albedo(1.0, 0.95, 0.0, 1.33)?;
//! let exact = exact_albedo(&medium, Illumination::Normal)?;
//! for model in MODELS {
//!     if let Ok(profile) = model.build(&medium) {
//!         let error = 100.0 * (profile.total() / exact - 1.0);
//!         println!("{:<24} R(1) = {:.5}   albedo {error:+.1} %", model.info.name, profile.eval(1.0));
//!     }
//! }
//! # Ok::<(), moonmilk_optics::Error>(())
//! ```
//!
//! # Five faults of a lecture
//!
//! The slides that this crate follows have five faults, each named again and tested where it belongs:
//!
//! | slide | as printed | right | where |
//! |---|---|---|---|
//! | Grosjean's correction | $\frac{e^{-\sigma_t r}}{4\pi r^2} - \phi_m$ | plus: uncollided and collided light add up | [`point_source`] |
//! | | the classical $\phi_m$ | $\alpha'$ times the monopole of $D_G = (2\sigma_a + \sigma_s')/(3\sigma_t'^2)$ | [`point_source`] |
//! | Burley's profile | $e^{-sr/\ell} - e^{-sr/3\ell}$ | plus: as printed it is negative | [`profile::normalized`] |
//! | | $A / (8\pi\ell r)$ | $A s / (8\pi\ell r)$, so that the integral is A | [`profile::normalized`] |
//! | | A is the albedo sigma_s / sigma_t | A is the surface albedo | [`profile::normalized`], [`inversion`] |

pub mod boundary;
pub mod conventions;
pub mod error;
pub mod escape;
mod exponential;
pub mod fresnel;
pub mod halfspace;
pub mod inversion;
pub mod materials;
pub mod medium;
pub mod p1;
pub mod phase;
pub mod point_source;
pub mod profile;
pub mod properties;
pub mod similarity;
pub mod skin;
pub mod slab;

pub use boundary::Boundary;
pub use error::{Error, ErrorKind};
pub use inversion::AlbedoTable;
pub use medium::Homogeneous;
pub use phase::HenyeyGreenstein;
pub use profile::{MODELS, Profile};
pub use properties::OpticalProperties;
