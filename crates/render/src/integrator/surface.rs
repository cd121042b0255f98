//! What a path does at a surface.

use moonmilk_core::{Frame, Random, Sampler, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Hit, Surface};
use moonmilk_walk::{Medium, Walker};

use super::{Counters, Integrator, Light, Path, Policy, SURE_BOUNCES, balance};
use crate::bsdf::boundary::branches;
use crate::bsdf::{Bsdf, Crossing, Kind, Shaded, lambert};
use crate::bssrdf::{Arriving, Bank, Exit, Slant};
use crate::connect;
use crate::interior::Standing;
use crate::mirrors::{self, Sight};
use crate::nest::{Meeting, Nest};
use crate::scene::{Boundary, Object, Scene};
use crate::texture::TexturePoint;
use crate::through;
use crate::tint::Lanes;
use crate::touch::{self, Arrival};

/// Returns a surface with its other side outward.
fn turned(s: &Surface) -> Surface {
    Surface { ng: -s.ng, ns: -s.ns, ..*s }
}

impl Integrator {
    /// Handles the arrival at a surface, or at that of several at one place which comes first; returns whether the path goes on.
    pub(super) fn surface<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        match touch::arrival(scene, &path.inside, &hit, surface, path.walker.d) {
            Arrival::This => self.meet(scene, path, hit, surface, wavelengths, rng, light, counters),
            Arrival::Other(other, surface) => {
                path.walker.p = surface.p;
                self.meet(scene, path, other, &surface, wavelengths, rng, light, counters)
            }
            Arrival::Ghost => {
                path.standing = Standing::Through(hit);
                true
            }
        }
    }

    /// Handles a surface that is met; returns whether the path goes on.
    pub(super) fn meet<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        let object = &scene.objects[hit.shape as usize];
        let wo = -path.walker.d;
        let escape = path.escape.take();
        let sight = std::mem::take(&mut path.sight);

        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        // Let rays through what is cut out: in and out of a body, too, which they are not in then.
        let cut_out = object.alpha.is_some_and(|a| {
            let alpha = scene.textures.eval_float(a, &point);
            alpha < 1.0 && rng.uniform() >= alpha
        });
        let light_here = scene.lights.light_of(hit.shape, hit.index);
        if cut_out {
            path.standing = Standing::Through(hit);
            // Lamps of opacity 0 light what chance comes from, if light sampling did not; they are never seen themselves.
            if let Some(l) = light_here.filter(|&l| scene.lights.is_hidden(l)) {
                let scattered = path.scattered || path.walker.collisions > 0;
                if scattered && path.walker.direction_pdf.is_none() {
                    let radiance = scene.lights.emitted(l, surface.uv, surface.ng, wo, wavelengths);
                    let share = match escape {
                        Some(escape) if !radiance.is_black() => escape.share(scene, wavelengths, counters),
                        _ => 1.0,
                    };
                    light.add(path.walker.collisions, path.walker.beta * radiance * share);
                }
                path.escape = escape.and_then(|e| e.beyond(1.0));
            }
            return true;
        }

        if object.body.is_some() && hit.exiting != path.inside.contains(hit.shape) {
            counters.contrary += 1;
            path.correct(scene, object, &hit, &point, wavelengths);
        }

        // Add what the surface emits, shared with light sampling.
        let elsewhere = sight == Sight::Mirrored && object.alpha.is_none();
        if let Some(l) = light_here.filter(|_| !elsewhere) {
            let radiance = scene.lights.emitted(l, surface.uv, surface.ng, wo, wavelengths);
            if !radiance.is_black() {
                let share = match (path.walker.direction_pdf, escape) {
                    (Some(pdf), _) => {
                        balance(pdf, scene.lights.pdf_hit(path.walker.scatter_point, path.normal, l, surface.p))
                    }
                    (None, Some(escape)) if object.alpha.is_none() => escape.share(scene, wavelengths, counters),
                    (None, _) => 1.0,
                };
                light.add(path.walker.collisions, path.walker.beta * radiance * share);
            }
        }

        // Pass what is not there: walls of fibres from inside, mere interfaces, boundaries within a body of higher rank, and between equal indices.
        let meeting = match object.body {
            Some(_) => path.inside.meet(object, hit.shape, hit.exiting),
            None => Meeting::True(1.0),
        };
        if object.is_open_to_light(meeting, hit.exiting) || (object.fibre && wo.dot(surface.ng) < 0.0) {
            path.change_medium(scene, object, hit, &point, path.walker.d.dot(surface.ng) > 0.0, wavelengths, counters);
            return true;
        }
        let outer = if let Meeting::True(outer) = meeting { outer } else { 1.0 };
        // A body that a model renders is a surface to light from outside, an open one on both sides.
        let back = object.open.is_some() && wo.dot(surface.ng) < 0.0;
        let bank = if hit.exiting && object.open.is_none() { None } else { scene.bank_at(object, &point, wavelengths) };
        let surface = &if back && bank.is_some() { turned(surface) } else { *surface };
        let leave = |path: &mut Path<N>, rng: &mut Sampler, light: &mut Light<N>, counters: &mut Counters| {
            self.leave_by_profile(scene, path, object, (surface, back), bank, wavelengths, rng, light, counters)
        };
        if !path.seen {
            path.seen = true;
            light.normal = surface.ns;
            light.depth = hit.t;
            light.albedo = scene.albedo(object, surface, &point, wavelengths);
        }
        if self.max_depth.is_some_and(|m| path.depth >= m) {
            return false;
        }
        path.depth += 1;

        // Cross smooth refractive boundaries by the reciprocal rule.
        if let Boundary::Smooth { eta } = object.boundary {
            let eta = eta / outer;
            let surface = &Surface { ns: scene.boundary_normal(object, surface), ..*surface };
            let first = std::mem::take(&mut path.whole);
            let apart = sight == Sight::First
                && light_here.is_none()
                && mirrors::reflects(object, &hit, &path.inside).is_some();
            let mirrored = if apart { Sight::Mirrored } else { Sight::All };
            let outcome = if first {
                self.split(scene, path, hit, surface, eta, mirrored, wavelengths, rng, light, counters)
            } else {
                crate::bsdf::cross(wo, surface.ng, surface.ns, eta, rng)
            };
            match outcome {
                Crossing::Reflected(d) => {
                    path.turn(d, None);
                    path.sight = mirrored;
                    path.stand(object, hit, wo.dot(surface.ng) > 0.0);
                }
                Crossing::Transmitted(_) if bank.is_some() => {
                    return leave(path, rng, light, counters);
                }
                Crossing::Transmitted(d) => {
                    path.turn(d, None);
                    path.transmit(scene, object, hit, &point, wo.dot(surface.ng) <= 0.0, eta, wavelengths, counters);
                    // Connections and looks lead through clear bodies as well.
                    path.escape = escape
                        .filter(|_| object.clear && through::is_clear(&path.medium))
                        .and_then(|e| e.beyond(through::transmitted(wo, surface.ng, surface.ns, eta)));
                    if first && self.policy == Policy::Auto && self.max_depth.is_none() {
                        path.double(rng, counters);
                    }
                }
            }
            return self.survives(path, rng);
        }

        // An index-matched body has no boundary besides its profile.
        if bank.is_some() && matches!(object.boundary, Boundary::Interface) {
            return leave(path, rng, light, counters);
        }

        // Every other surface has a BSDF.
        let mut bsdf =
            scene.materials.resolve(object.material, &scene.textures, surface, &point, wavelengths, rng.uniform());
        if let (Bsdf::Dielectric(d), true) = (&mut bsdf.bsdf, outer != 1.0) {
            d.eta /= outer;
        }
        if bsdf.bsdf.wavelength_dependent() {
            let mut lanes = Lanes::of(&path.walker);
            path.walker.hero_only();
            lanes.settle(&path.walker, light);
        }
        let both_sides = bsdf.bsdf.transmits();
        if !bsdf.bsdf.is_specular() {
            let n = (!both_sides).then_some(if wo.dot(surface.ng) > 0.0 { surface.ng } else { -surface.ng });
            connect::at_surface(scene, path, object, hit, surface, &bsdf, None, n, wavelengths, rng, light, counters);
        }
        let (uc, u) = (rng.uniform(), rng.uniform2());
        let Some(s) = bsdf.sample(wo, uc, u) else {
            return false;
        };
        path.walker.beta *= s.weight(bsdf.cos(s.wi));
        if path.walker.beta.is_black() {
            return false;
        }
        if bank.is_some() && s.kind == Kind::Transmission {
            // What got in: without the factor of radiance, which the way out takes back.
            path.walker.beta *= s.eta * s.eta;
            return leave(path, rng, light, counters);
        }
        // Coats sample by a random walk: what competes with light sampling is their density as light sampling knows it.
        let pdf = if matches!(bsdf.bsdf, Bsdf::Layered(_)) { bsdf.pdf(wo, s.wi) } else { s.pdf };
        path.turn(s.wi, (!s.specular).then_some(pdf));
        path.scattered |= !s.specular;
        path.normal = (!both_sides).then_some(if wo.dot(surface.ng) > 0.0 { surface.ng } else { -surface.ng });
        let outward = s.wi.dot(surface.ng) > 0.0;
        if s.kind == Kind::Transmission {
            // The BSDF has applied the radiance factor; only the bookkeeping of roulette and media remains.
            path.walker.eta_scale *= s.eta * s.eta;
            path.change_medium(scene, object, hit, &point, outward, wavelengths, counters);
        } else {
            path.stand(object, hit, outward);
        }
        self.survives(path, rng)
    }

    /// Follows the reflected branch of the camera's first smooth boundary with its probability as weight, and leaves the other to
    /// the caller: a bright mirror image seen by one sample in twenty would be most of a pixel's noise.
    fn split<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        hit: Hit,
        surface: &Surface,
        eta: f32,
        sight: Sight,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> Crossing {
        let wo = -path.walker.d;
        let branches = branches(wo, surface.ng, surface.ns, eta);
        let is_reflected = |c: &Crossing| matches!(c, Crossing::Reflected(_));
        let share = |reflected| branches.iter().filter(|b| is_reflected(&b.1) == reflected).map(|b| b.0).sum::<f32>();
        let (reflected, transmitted) = (share(true), share(false));
        // Choose among the outcomes of one kind in proportion to their probabilities.
        let pick = |kind: bool, total: f32, u: f32| {
            let mut left = u * total;
            let mut last = None;
            for (p, c) in branches.iter().filter(|b| is_reflected(&b.1) == kind && b.0 > 0.0) {
                last = Some(*c);
                left -= p;
                if left < 0.0 {
                    break;
                }
            }
            last
        };
        let (u, v) = (rng.uniform(), rng.uniform());
        match (pick(true, reflected, u), pick(false, transmitted, v)) {
            (Some(Crossing::Reflected(d)), Some(other)) => {
                let mut mirror = path.clone();
                mirror.copies = Vec::new();
                mirror.sight = sight;
                mirror.walker.beta *= reflected;
                mirror.turn(d, None);
                mirror.stand(&scene.objects[hit.shape as usize], hit, wo.dot(surface.ng) > 0.0);
                mirror.bounces += 1;
                let start = mirror.walker.collisions;
                self.follow(scene, &mut mirror, wavelengths, rng, light, counters);
                counters.collisions += u64::from(mirror.walker.collisions - start);
                path.walker.beta *= transmitted;
                other
            }
            (Some(only), _) | (None, Some(only)) => only,
            // Probabilities sum to 1, so that some outcome is possible.
            (None, None) => crate::bsdf::cross(wo, surface.ng, surface.ns, eta, rng),
        }
    }

    /// Goes on where the light entered that leaves the body here, by the body's profile; returns whether the path goes on.
    ///
    /// Light enters an open surface on the side where it leaves: on its `back`, turned round here, or its front.
    fn leave_by_profile<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        object: &Object,
        (surface, back): (&Surface, bool),
        bank: Option<(&Bank, Medium<N>)>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        let Some((bank, medium)) = bank else {
            return false;
        };
        let site = self.cloud.as_ref().and_then(|_| scene.site(object));
        let Some(exit) = Exit::new(bank, &medium, site.map_or(0.0, |s| s.1.density)) else {
            return false;
        };
        // Scattered many times.
        path.walker.collisions += 2;
        counters.probes += 1;
        if let (Some(cloud), Some((site, _)), true) = (&self.cloud, site, exit.has_points()) {
            let out = cloud.gather(site, &exit, &medium, surface.p);
            light.add(path.walker.collisions, path.walker.beta * out);
        }
        let w_o = -path.walker.d;
        let Some(entered) = exit.enter(scene, object, surface.p, surface.ng, &path.walker.beta, rng) else {
            return false;
        };
        path.walker.beta *= entered.weight;
        let (hit, at) = (entered.hit, &if back { turned(&entered.surface) } else { entered.surface });
        let slant = exit.slant(surface.p, surface.ng, w_o, at.p, at.ng);
        self.receive(scene, path, bank, slant, hit, at, wavelengths, rng, light, counters)
    }

    /// Looks for the light that enters a body at a point; returns whether the path goes on.
    fn receive<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        bank: &Bank,
        slant: Option<Slant<N>>,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        let object = &scene.objects[hit.shape as usize];
        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        path.walker.p = surface.p;
        path.walker.d = -surface.ng;
        path.stand(object, hit, true);
        // A rough boundary lets in what its facets do.
        let facets = match object.boundary {
            Boundary::Scattering => {
                let own = scene.materials.resolve(
                    object.material,
                    &scene.textures,
                    surface,
                    &point,
                    wavelengths,
                    rng.uniform(),
                );
                match own.bsdf {
                    Bsdf::Dielectric(d) => d.rough().map(|ggx| (ggx, own.frame)),
                    _ => None,
                }
            }
            _ => None,
        };
        let entry = bank.entry(facets.map(|f| f.0));
        let frame = facets.map_or_else(|| Frame::new(surface.ns), |f| f.1);
        let arriving = Arriving { slant, rough: facets.map(|_| (entry, frame)) };
        let arriving = (arriving.slant.is_some() || arriving.rough.is_some()).then_some(&arriving);
        let bsdf = Shaded { bsdf: Bsdf::Entry(entry), frame, ng: surface.ng };
        let n = Some(surface.ng);
        connect::at_surface(scene, path, object, hit, surface, &bsdf, arriving, n, wavelengths, rng, light, counters);
        let (uc, u) = (rng.uniform(), rng.uniform2());
        let Some(s) = bsdf.sample(surface.ng, uc, u) else {
            return false;
        };
        path.walker.beta *= s.weight(bsdf.cos(s.wi));
        if let Some(arriving) = arriving {
            path.walker.beta *= arriving.factor(s.wi, rng);
        }
        path.turn(s.wi, Some(s.pdf));
        path.scattered = true;
        path.normal = n;
        self.survives(path, rng)
    }

    /// Returns the light that enters a body of a model at a point of its surface: one light sample and one path.
    ///
    /// No other body reaches to there ([`crate::cloud::sites`]).
    pub(crate) fn entering<const N: usize>(
        &self,
        scene: &Scene,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Spectrum<N> {
        let object = &scene.objects[hit.shape as usize];
        let Some(bank) = scene.bank(object) else {
            return Spectrum::ZERO;
        };
        let [.., around] = scene.around(&scene.nest_at(scene.camera.origin()), wavelengths);
        let medium = scene.medium_outside(object, wavelengths, around);
        let mut path = Path::outside(Walker::new(surface.p, -surface.ng), medium, Standing::Space, None);
        let mut light = Light::default();
        if self.receive(scene, &mut path, bank, None, hit, surface, wavelengths, rng, &mut light, counters) {
            self.follow(scene, &mut path, wavelengths, rng, &mut light, counters);
        }
        light.orders[0] + light.orders[1] + light.orders[2]
    }

    /// Returns light that falls on a body at a point of its surface, by one light sample and one path: directions towards where it comes from, and radiance times cosine over density, of which the sum is the irradiance.
    pub(crate) fn falling<const N: usize>(
        &self,
        scene: &Scene,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> [Option<(Vec3, Spectrum<N>)>; 2] {
        let object = &scene.objects[hit.shape as usize];
        let [.., around] = scene.around(&scene.nest_at(scene.camera.origin()), wavelengths);
        let medium = scene.medium_outside(object, wavelengths, around);
        let from = connect::From {
            p: surface.p,
            standing: Standing::Outside(Hit { t: 0.0, exiting: false, ..hit }),
            medium,
            ambient: medium,
            inside: Nest::default(),
        };
        let sampled = connect::sampled(scene, &from, surface.ng, wavelengths, rng, counters);
        // By chance, in proportion to the cosine.
        let frame = Frame::new(surface.ng);
        let wi = frame.to_world(lambert::sample_cosine(rng.uniform2()));
        let cos = wi.dot(surface.ng);
        if cos <= 0.0 {
            return [sampled, None];
        }
        let mut path = Path::outside(Walker::new(surface.p, wi), medium, from.standing, Some(surface.ng));
        path.walker.beta = Spectrum::splat(std::f32::consts::PI);
        path.walker.direction_pdf = Some(cos * std::f32::consts::FRAC_1_PI);
        let mut light = Light::default();
        self.follow(scene, &mut path, wavelengths, rng, &mut light, counters);
        let all = light.orders[0] + light.orders[1] + light.orders[2];
        [sampled, Some((wi, all)).filter(|_| !all.is_black())]
    }

    /// Ends paths of little weight, keeping the mean.
    pub(super) fn survives<const N: usize>(&self, path: &mut Path<N>, rng: &mut Sampler) -> bool {
        path.bounces += 1;
        if path.bounces <= SURE_BOUNCES {
            return true;
        }
        // Weights may be negative where a model is.
        match self.roulette.play(path.walker.beta.map(f32::abs).max_value() * path.walker.eta_scale, rng) {
            Some(factor) => {
                path.walker.beta *= factor;
                true
            }
            None => false,
        }
    }
}
