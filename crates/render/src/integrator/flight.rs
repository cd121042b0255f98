//! Flights where nothing scatters: to the next surface, or to the environment.

use moonmilk_core::{Sampler, Wavelengths};
use moonmilk_walk::Medium;

use super::{Counters, Integrator, Light, Path, balance};
use crate::scene::Scene;
use crate::touch;

impl Integrator {
    /// Goes to the next surface through vacuum.
    pub(super) fn step_outside<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        let ray = path.standing.ray(scene, path.walker.p, path.walker.d);
        match touch::nearest(scene, &path.inside, ray) {
            Some((hit, surface, _)) => {
                path.walker.p = surface.p;
                self.meet(scene, path, hit, &surface, wavelengths, rng, light, counters)
            }
            None => {
                self.environment(scene, path, wavelengths, light, counters);
                false
            }
        }
    }

    /// Goes to the next surface through a medium that absorbs (and emits) but does not scatter: attenuation in closed form.
    pub(super) fn step_absorbing<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        medium: &Medium<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        let ray = path.standing.ray_inside(scene, path.inside.innermost(), path.walker.p, path.walker.d);
        let next = touch::nearest(scene, &path.inside, ray);
        let t = next.as_ref().map_or(f32::INFINITY, |n| n.2);
        let transmittance = medium.transmittance(t);
        if let Some(emission) = medium.emission {
            // Integrate sigma_a L_e exp(-sigma_a s) along the segment.
            light.add(path.walker.collisions, path.walker.beta * emission * medium.sigma_t.map(|s| -(-s * t).exp_m1()));
        }
        path.walker.beta *= transmittance;
        match next {
            Some((hit, surface, _)) if !path.walker.beta.is_black() => {
                path.walker.p = surface.p;
                self.meet(scene, path, hit, &surface, wavelengths, rng, light, counters)
            }
            Some(_) => false,
            None => {
                self.environment(scene, path, wavelengths, light, counters);
                false
            }
        }
    }

    /// Adds the radiance of infinite lights.
    pub(super) fn environment<const N: usize>(
        &self,
        scene: &Scene,
        path: &Path<N>,
        wavelengths: &Wavelengths<N>,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        // A portal asks for the line: it starts where the direction was drawn, or at the last smooth boundary.
        let from = if path.walker.direction_pdf.is_some() { path.walker.scatter_point } else { path.walker.p };
        let even = scene.lights.even_environment(path.walker.d, wavelengths);
        let aimed = scene.lights.aimed_environment(from, path.walker.d, wavelengths);
        let radiance = match (path.walker.direction_pdf, path.escape) {
            (Some(pdf), _) => {
                let sampled = scene.lights.pdf_environment(path.walker.scatter_point, path.normal, path.walker.d);
                // From media and boundaries that light can cross the even part is left to chance.
                match path.normal {
                    None => even + aimed * balance(pdf, sampled),
                    Some(_) => (even + aimed) * balance(pdf, sampled),
                }
            }
            // Connections and looks leave the even part to chance.
            (None, Some(escape)) if !aimed.is_black() => even + aimed * escape.share(scene, wavelengths, counters),
            (None, _) => even + aimed,
        };
        light.add(path.walker.collisions, path.walker.beta * radiance);
    }
}
