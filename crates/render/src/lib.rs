//! From a scene description to a film: cameras, lights, materials, and exact volumetric transport.
//!
//! Data flows one way: [`description::SceneDescription`] -> [`scene::Scene`] -> [`film::Film`]. Nothing here reads files,
//! prints, or looks at the clock; a sample of a pixel is a pure function of scene, settings, pixel and sample number
//! ([`session::sample`]).

mod apart;
pub mod audit;
mod balls;
pub mod bsdf;
mod bssrdf;
pub mod camera;
mod cloud;
mod connect;
pub mod description;
pub mod doctor;
pub mod effort;
pub mod film;
pub mod filter;
pub mod integrator;
mod interior;
pub mod lights;
mod manifold;
pub mod material;
mod media;
mod mirrors;
pub mod nest;
pub mod scene;
pub mod seen;
pub mod session;
mod snag;
pub mod texture;
mod through;
mod tint;
mod touch;
mod vertices;
pub mod walks;
mod window;
