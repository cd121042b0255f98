//! Ray queries over all shapes of a scene: those of the world, and objects that stand in several places.
//!
//! Two levels: the world's own shapes have a hierarchy of their own, which rays search first; a second one holds the boxes of
//! all instances, each of which hands the ray, taken to its object's space, to the hierarchy of its object. Scenes without
//! instances pay one comparison.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use moonmilk_core::Vec3;
use moonmilk_core::glam::DAffine3;
use obvhs::cwbvh::CwBvh;

use crate::bounds::Bounds;
use crate::bvh::{self, BoxRay, Quality};
use crate::clearance::Clearance;
use crate::group::{BEHIND, Candidate, FEW, Group, SLACK};
use crate::place::Placement;
use crate::ray::{Body, Facing, Hit, NONE, Prim, Ray, Surface, WORLD};
use crate::shape::{Form, Shape};
use crate::surface::{interpolate, mesh_surface, shading_normal};

/// All shapes of a scene, ready for ray queries.
#[derive(Debug)]
pub struct Accel {
    pub(crate) world: Group,
    pub(crate) groups: Vec<Group>,
    pub(crate) placements: Vec<Placement>,
    /// Boxes of all shapes of all instances.
    placed_bounds: Vec<Bounds>,
    /// Hierarchy over the instances, and their order in its leaves; empty for a few.
    pub(crate) top: CwBvh,
    pub(crate) order: Vec<u32>,
    /// Free room in each shape of each group, shared by its instances.
    pub(crate) rooms: Vec<Vec<OnceLock<Arc<Clearance>>>>,
}

impl Accel {
    /// Builds the acceleration structure with the default quality.
    ///
    /// *Panics* if the scene has more than 2^28 primitives (11 GB of leaves).
    pub fn build(shapes: Vec<Shape>) -> Self {
        Self::build_with(shapes, Quality::default())
    }

    /// Builds the acceleration structure.
    pub fn build_with(shapes: Vec<Shape>, quality: Quality) -> Self {
        Self {
            world: Group::build(shapes, quality),
            groups: Vec::new(),
            placements: Vec::new(),
            placed_bounds: Vec::new(),
            top: CwBvh::default(),
            order: Vec::new(),
            rooms: Vec::new(),
        }
    }

    /// Builds the acceleration structure of shapes in world space and of objects (shapes in a space of their own) that stand
    /// where `instances` say: number of the object, object to world.
    ///
    /// Shapes are numbered: those of the world, then those of the first instance, of the second, and so on.
    ///
    /// *Errors*: the number of the first instance whose transform is singular or not finite, or whose object does not exist.
    /// *Panics* as [`Accel::build`] does, for the world and for each object.
    pub fn with_instances(
        shapes: Vec<Shape>,
        objects: Vec<Vec<Shape>>,
        instances: &[(u32, DAffine3)],
    ) -> Result<Self, usize> {
        let mut accel = Self::build(shapes);
        accel.groups = objects.into_iter().map(|o| Group::build(o, Quality::default())).collect();
        accel.rooms = accel.groups.iter().map(|g| g.shapes.iter().map(|_| OnceLock::new()).collect()).collect();
        let mut next = accel.world.shapes.len() as u32;
        for (i, (group, to_world)) in instances.iter().enumerate() {
            let shapes = accel.groups.get(*group as usize).ok_or(i)?;
            let placement = Placement::new(*group, next, to_world).ok_or(i)?;
            accel.placed_bounds.extend(shapes.bounds.iter().map(|b| placement.image(b)));
            next += shapes.shapes.len() as u32;
            accel.placements.push(placement);
        }
        // Boxes hold whatever rounding may take a point on or inside of an instance to.
        let boxes: Vec<Bounds> = accel
            .placements
            .iter()
            .map(|p| {
                let group = &accel.groups[p.group as usize];
                let b = p.bounds(group);
                if b.is_empty() { b } else { b.grown(BEHIND * p.slack(&group.all(), &b)) }
            })
            .collect();
        let some: Vec<u32> = (0..boxes.len() as u32).filter(|&i| !boxes[i as usize].is_empty()).collect();
        accel.order = some;
        if accel.order.len() > FEW {
            let boxes: Vec<Bounds> = accel.order.iter().map(|&i| boxes[i as usize]).collect();
            let top = bvh::build(&boxes, Quality { leaf: 1, ..Quality::default() });
            accel.order = top.primitive_indices.iter().map(|&i| accel.order[i as usize]).collect();
            accel.top = CwBvh { primitive_indices: Vec::new(), ..top };
        }
        Ok(accel)
    }

    /// Returns the number of shapes, those of all instances included.
    pub fn shape_count(&self) -> usize {
        self.world.shapes.len() + self.placed_bounds.len()
    }

    /// Returns the number of shapes of the world itself.
    pub fn world_count(&self) -> u32 {
        self.world.shapes.len() as u32
    }

    /// Returns a shape: of the world in world space, of an instance in its object's space.
    pub fn shape(&self, shape: u32) -> &Shape {
        self.placed(shape).0
    }

    /// Returns the box around all shapes.
    pub fn bounds(&self) -> Bounds {
        self.placed_bounds.iter().fold(self.world.all(), |a, &b| a.union(b))
    }

    /// Returns the box around a shape.
    pub fn shape_bounds(&self, shape: u32) -> Bounds {
        let i = shape as usize;
        let own = self.world.bounds.len();
        if i < own { self.world.bounds[i] } else { self.placed_bounds[i - own] }
    }

    /// Returns the shape of a primitive and its number in it.
    pub fn locate(&self, prim: Prim) -> (u32, u32) {
        let (group, placed) = self.group_of(prim.instance);
        let (shape, index) = group.locate(prim.number);
        (placed.map_or(0, |p| p.first_shape) + shape, index)
    }

    /// Returns the closed surface made of consecutive shapes, of the world or of one instance, for [`Facing`].
    pub fn body(&self, shapes: Range<u32>) -> Body {
        let all = (shapes.start..shapes.end).fold(Bounds::EMPTY, |a, s| a.union(self.shape_bounds(s)));
        let instance = self.instance_of(shapes.start);
        let (group, placed) = self.group_of(instance);
        let origin = placed.map_or(0, |p| p.first_shape);
        let [start, end] = [shapes.start, shapes.end].map(|s| (s - origin) as usize);
        let slack = match placed {
            None => SLACK * all.magnitude(),
            Some(p) => p.slack(&group.bounds[start..end].iter().fold(Bounds::EMPTY, |a, &b| a.union(b)), &all),
        };
        Body { instance, first: group.first[start], end: group.first[end], slack }
    }

    /// Returns the corners of a triangle of a shape in the world; `None` for a quadric.
    pub fn corners(&self, shape: u32, triangle: u32) -> Option<[Vec3; 3]> {
        let (shape, placed) = self.placed(shape);
        let corners = shape.mesh()?.corners(triangle);
        Some(placed.map_or(corners, |placed| corners.map(|v| placed.point(v))))
    }

    /// Returns the bytes held: leaves, trees and the shapes' own arrays; of each object once.
    pub fn memory(&self) -> usize {
        let rooms = self.rooms.iter().flatten().filter_map(OnceLock::get).map(|c| c.memory()).sum::<usize>();
        self.world.memory()
            + self.groups.iter().map(Group::memory).sum::<usize>()
            + self.placements.capacity() * size_of::<Placement>()
            + self.placed_bounds.capacity() * size_of::<Bounds>()
            + self.top.nodes.capacity() * 80
            + rooms
    }

    /// Returns the instance that a shape belongs to, or [`WORLD`].
    fn instance_of(&self, shape: u32) -> u32 {
        if (shape as usize) < self.world.shapes.len() {
            return WORLD;
        }
        self.placements.partition_point(|p| p.first_shape <= shape) as u32 - 1
    }

    /// Returns the group of an instance and where it stands.
    #[inline(always)]
    pub(crate) fn group_of(&self, instance: u32) -> (&Group, Option<&Placement>) {
        if instance == WORLD {
            return (&self.world, None);
        }
        let p = &self.placements[instance as usize];
        (&self.groups[p.group as usize], Some(p))
    }

    /// Returns a shape and where it stands.
    pub(crate) fn placed(&self, shape: u32) -> (&Shape, Option<&Placement>) {
        let (group, placed) = self.group_of(self.instance_of(shape));
        (&group.shapes[(shape - placed.map_or(0, |p| p.first_shape)) as usize], placed)
    }

    /// Returns the shape at a hit and where it stands.
    #[inline(always)]
    pub(crate) fn shape_at(&self, hit: &Hit) -> (&Shape, Option<&Placement>) {
        if hit.prim.instance == WORLD {
            return (&self.world.shapes[hit.shape as usize], None);
        }
        let (group, placed) = self.group_of(hit.prim.instance);
        (&group.shapes[(hit.shape - placed.map_or(0, |p| p.first_shape)) as usize], placed)
    }

    /// Returns the nearest hit that counts, or `None`.
    ///
    /// An unbounded ray inside a closed body always has one.
    #[inline]
    pub fn nearest(&self, ray: &Ray) -> Option<Hit> {
        let mut best = None;
        let mut instance = WORLD;
        if self.placements.is_empty() {
            self.world.search(&ray.within(WORLD), |c, t_max| {
                *t_max = c.t;
                best = Some(c);
                false
            });
        } else {
            self.nearest_of_all(ray, &mut best, &mut instance);
        }
        let best = best.map(|c| self.hit(instance, c));
        match ray.facing {
            Facing::Any => best,
            Facing::Exiting(body) if best.is_none() && ray.t_max == f32::INFINITY => {
                self.rescue(body, ray.o, ray.d, true)
            }
            Facing::Exiting(body) | Facing::Entering(body) => {
                if ray.skip != NONE && body.contains(ray.skip) && self.is_shallow(ray, body) {
                    self.verified(ray, body)
                } else {
                    best
                }
            }
        }
    }

    /// Finds the nearest crossing among the world and all instances.
    #[inline(never)]
    fn nearest_of_all(&self, ray: &Ray, best: &mut Option<Candidate>, instance: &mut u32) {
        // Inside an instance its own wall comes first, most often: what lies beyond need not be searched.
        let mut keep = |i: u32, c: Candidate, limit: &mut f32| {
            *limit = c.t;
            (*best, *instance) = (Some(c), i);
            false
        };
        let own = match ray.facing {
            Facing::Exiting(b) if b.instance != WORLD => Some(b.instance),
            _ => None,
        };
        let mut limit = ray.t_max;
        if let Some(i) = own {
            self.search_instance(ray, i, &mut limit, &mut keep);
        }
        let beyond = Ray { t_max: limit, ..ray.within(WORLD) };
        self.world.search(&beyond, |c, t_max| {
            limit = c.t;
            keep(WORLD, c, t_max)
        });
        self.search_instances(ray, limit, own, keep);
    }

    /// Visits the crossings of one instance.
    #[inline(always)]
    fn search_instance(
        &self,
        ray: &Ray,
        i: u32,
        t_max: &mut f32,
        visit: &mut impl FnMut(u32, Candidate, &mut f32) -> bool,
    ) -> bool {
        let placed = &self.placements[i as usize];
        let (local, factor) = placed.ray(ray, i, *t_max);
        self.groups[placed.group as usize].search(&local, |c, t_local| {
            let t = c.t / factor;
            if t >= *t_max {
                return false;
            }
            let stop = visit(i, Candidate { t, ..c }, t_max);
            *t_local = *t_max * factor;
            stop
        })
    }

    /// Visits the crossings of all instances but one as [`Group::search`] does, with distances in the world.
    #[inline(always)]
    fn search_instances(
        &self,
        ray: &Ray,
        t_max: f32,
        except: Option<u32>,
        mut visit: impl FnMut(u32, Candidate, &mut f32) -> bool,
    ) -> bool {
        let mut try_instance = |k: u32, t_max: &mut f32| {
            let i = self.order[k as usize];
            Some(i) != except && self.search_instance(ray, i, t_max, &mut visit)
        };
        if self.top.nodes.is_empty() {
            let mut t_max = t_max;
            (0..self.order.len() as u32).any(|k| try_instance(k, &mut t_max))
        } else {
            bvh::traverse_ray(&self.top, &BoxRay::new(ray.o, ray.d, ray.low()), t_max, try_instance)
        }
    }

    /// Returns whether any hit that counts makes `blocks` return true; hits come in no order, each at most once.
    ///
    /// The closure may look through surfaces (opacity, index-matched boundaries) and leave out the primitive aimed at.
    #[inline]
    pub fn occluded(&self, ray: &Ray, mut blocks: impl FnMut(&Hit) -> bool) -> bool {
        self.world.search(&ray.within(WORLD), |c, _| blocks(&self.hit(WORLD, c)))
            || (!self.placements.is_empty()
                && self.search_instances(ray, ray.t_max, None, |i, c, _| blocks(&self.hit(i, c))))
    }

    /// Calls `visit` for every hit that counts, in no order.
    pub fn all_hits(&self, ray: &Ray, mut visit: impl FnMut(&Hit)) {
        self.occluded(ray, |h| {
            visit(h);
            false
        });
    }

    /// Returns the surface at a hit of a ray.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let (shape, placed) = self.shape_at(hit);
        let s = match &shape.form {
            Form::Mesh(m) => mesh_surface(m, hit.index, hit.b, shape.reverse),
            Form::Quadric(q) => {
                let p = ray.o.as_dvec3() + ray.d.as_dvec3() * f64::from(hit.t);
                let mut s = q.surface(placed.map_or(p, |placed| placed.to_object.transform_point3(p)));
                if shape.reverse {
                    (s.ng, s.ns) = (-s.ng, -s.ns);
                }
                s
            }
        };
        match placed {
            None => s,
            Some(placed) => placed.surface(s),
        }
    }

    /// Returns point and unit geometric normal at a hit: what a walk needs, without shading normal and (u, v).
    #[inline]
    pub fn point_and_normal(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3) {
        let (p, n, _) = self.normals_at(ray, hit, false);
        (p, n)
    }

    /// Returns point, unit geometric normal and unit shading normal at a hit: what a refractive wall needs.
    #[inline]
    pub fn point_and_normals(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3, Vec3) {
        self.normals_at(ray, hit, true)
    }

    #[inline(always)]
    fn normals_at(&self, ray: &Ray, hit: &Hit, shading: bool) -> (Vec3, Vec3, Vec3) {
        let (shape, placed) = self.shape_at(hit);
        let (p, n) = match &shape.form {
            Form::Mesh(m) => {
                let c = m.corners(hit.index);
                (interpolate(c, hit.b), (c[1] - c[0]).cross(c[2] - c[0]).normalize())
            }
            Form::Quadric(q) => {
                let p = ray.o.as_dvec3() + ray.d.as_dvec3() * f64::from(hit.t);
                q.point_and_normal(placed.map_or(p, |placed| placed.to_object.transform_point3(p)))
            }
        };
        let ng = if shape.reverse { -n } else { n };
        let ns = match shape.mesh() {
            Some(m) if shading && !m.normals().is_empty() => {
                shading_normal(m, hit.index, [1.0 - hit.b[0] - hit.b[1], hit.b[0], hit.b[1]], ng)
            }
            _ => ng,
        };
        match placed {
            None => (p, ng, ns),
            Some(placed) => {
                let (ng, ns) = placed.normals(ng, ns);
                (placed.point(p), ng, ns)
            }
        }
    }

    /// Returns the surface at a point of a triangle given by barycentric weights, e.g. one sampled on a light.
    pub fn triangle_surface(&self, shape: u32, triangle: u32, b: [f32; 2]) -> Option<Surface> {
        let (s, placed) = self.placed(shape);
        let surface = s.mesh().map(|m| mesh_surface(m, triangle, b, s.reverse))?;
        Some(placed.map_or(surface, |placed| placed.surface(surface)))
    }

    /// Returns the point of a body closest to p, among primitives that a ray along d exits (or enters), as a hit.
    ///
    /// For walks that rounding put on the wrong side. `None` only if nothing faces that way (never on a closed body).
    #[cold]
    pub fn rescue(&self, body: Body, p: Vec3, d: Vec3, exiting: bool) -> Option<Hit> {
        let c = self.closest_facing(body, p, |n| (n.dot(d) > 0.0) == exiting)?;
        let t = (c.p - p).dot(d).max(0.0);
        let candidate = Candidate { t, number: c.prim.number, b: c.b, exiting };
        Some(Hit { rescued: true, ..self.hit(c.prim.instance, candidate) })
    }

    /// Returns whether the side of a start on a body is in doubt, see [`Group::is_shallow`].
    fn is_shallow(&self, ray: &Ray, body: Body) -> bool {
        match self.group_of(body.instance) {
            (group, None) => group.is_shallow(ray, body),
            (group, Some(p)) => group.is_shallow(&p.ray(ray, body.instance, ray.t_max).0, p.body(body)),
        }
    }

    /// Returns the nearest hit after finding out by the count of crossings on which side of the body the ray starts.
    #[cold]
    fn verified(&self, ray: &Ray, body: Body) -> Option<Hit> {
        let inside = matches!(ray.facing, Facing::Exiting(_));
        let line = Ray { t_max: f32::INFINITY, facing: Facing::Any, ..*ray };
        let (mut count, mut nearest) = (0, None::<Hit>);
        self.all_hits(&line, |h| {
            if body.contains(h.prim) {
                // Crossings at the start, within the slack, belong to the start: what counts is the side behind them.
                let depth = h.t * self.point_and_normal(&line, h).1.dot(ray.d).abs();
                if depth <= body.slack && h.t <= BEHIND * body.slack {
                    return;
                }
                count += if h.exiting { 1 } else { -1 };
                if h.exiting != inside {
                    return;
                }
            }
            if h.t < nearest.map_or(ray.t_max, |n| n.t) {
                nearest = Some(*h);
            }
        });
        if (count > 0) == inside {
            return nearest;
        }
        let limit = nearest.map_or(ray.t_max, |h| h.t);
        self.rescue(body, ray.o, ray.d, inside).filter(|h| h.t < limit).or(nearest)
    }

    #[inline]
    fn hit(&self, instance: u32, c: Candidate) -> Hit {
        let prim = Prim { instance, number: c.number };
        let (shape, index) = self.locate(prim);
        Hit { t: c.t.max(0.0), prim, shape, index, b: c.b, exiting: c.exiting, rescued: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Quadric, generate};
    use moonmilk_core::{Mat4, Random, Stream};

    #[test]
    fn an_empty_scene_has_no_hits() {
        let a = Accel::build(vec![]);
        assert!(a.nearest(&Ray::new(Vec3::ZERO, Vec3::X)).is_none() && a.bounds().is_empty());
    }

    #[test]
    fn hits_name_shape_triangle_point_and_side() {
        let cube = generate::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
        let a = Accel::build(vec![Quadric::sphere(Vec3::X * 5.0, 1.0).unwrap().into(), Shape::from(cube).reversed()]);
        let ray = Ray::new(Vec3::new(0.3, 0.2, 9.0), Vec3::NEG_Z);
        let h = a.nearest(&ray).unwrap();
        let s = a.surface(&ray, &h);
        assert_eq!((h.shape, h.t, h.exiting), (1, 8.0, true));
        // Barycentric weights carry a rounding of 2^-24 each, times corners up to 1 and the ray's distance of 9.
        assert!(s.p.distance(Vec3::new(0.3, 0.2, 1.0)) < 1e-6 && s.p.z == 1.0);
        assert_eq!((s.ng, s.ns), (Vec3::NEG_Z, Vec3::NEG_Z));
        assert_eq!(a.locate(h.prim), (1, h.index));
        let ray = Ray::new(Vec3::new(5.0, 0.0, -4.0), Vec3::Z);
        let h = a.nearest(&ray).unwrap();
        assert_eq!((h.shape, h.index, h.t, h.exiting), (0, 0, 3.0, false));
        assert_eq!(a.surface(&ray, &h).ng, Vec3::NEG_Z);
        let mut n = 0;
        a.all_hits(&ray, |_| n += 1);
        assert_eq!(n, 2);
        assert!(!a.occluded(&ray.up_to(3.0), |_| true) && a.occluded(&ray.up_to(3.1), |_| true));
        assert!(!a.occluded(&ray, |h| h.shape == 1));
    }

    #[test]
    fn quadrics_answer_as_their_tessellations_do() {
        // An ellipsoid against a fine mesh of it: depths differ by the facets' sag, (0.02)^2 / 8 of the size.
        let m = Mat4::from_translation(Vec3::new(3.0, 1.0, -2.0))
            * Mat4::from_rotation_y(0.4)
            * Mat4::from_scale(Vec3::new(1.0, 0.5, 2.0));
        let kind = crate::QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: std::f64::consts::TAU };
        let q = Accel::build(vec![Quadric::new(kind, &m).unwrap().into()]);
        let t = Accel::build(vec![generate::bumpy_sphere(6, 0.0).transformed(&m).unwrap().into()]);
        let mut r = Stream::new(&[6]);
        let mut both = 0;
        for _ in 0..20_000 {
            let o = Vec3::new(3.0, 1.0, -2.0) + (Vec3::new(r.uniform(), r.uniform(), r.uniform()) - 0.5) * 8.0;
            let d = (Vec3::new(r.uniform(), r.uniform(), r.uniform()) - 0.5).normalize();
            if let (Some(a), Some(b)) = (q.nearest(&Ray::new(o, d)), t.nearest(&Ray::new(o, d))) {
                let ray = Ray::new(o, d);
                let (n, m) = (q.surface(&ray, &a).ng, t.surface(&ray, &b).ng);
                if n.dot(d).abs() > 0.2 && a.exiting == b.exiting {
                    both += 1;
                    assert!((a.t - b.t).abs() < 2e-3 && n.dot(m) > 0.99, "{a:?} {b:?}");
                }
            }
        }
        assert!(both > 500, "{both}");
    }
}
