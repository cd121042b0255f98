//! Free room inside one shape of a scene: the grid of its object, shared by all instances, and a small one for what else is there.
//!
//! Under a transform that stretches lengths by at least s, a distance in the object is at least s times as long in the world.
//! So the grid of an object serves all its instances, and memory does not grow with their number. What does not belong to the
//! instance but may reach into it (the ground it stands on, its neighbours) is marked in a coarse grid of the instance's own,
//! only where there is such a thing.

use std::sync::Arc;

use moonmilk_core::Vec3;
use moonmilk_core::glam::DAffine3;

use crate::accel::Accel;
use crate::bounds::Bounds;
use crate::clearance::{Clearance, Marks};
use crate::group::Group;
use crate::place::Placement;
use crate::ray::WORLD;
use crate::search::in_boxes;
use crate::shape::{Form, Shape};

/// Cells of the grid of what reaches into a shape of the world from instances: 64^3.
const FOREIGN_CELLS: usize = 1 << 18;
/// Cells of such grids of all instances together; of one instance at least 4^3 and at most 32^3.
const FOREIGN_BUDGET: usize = 1 << 26;

/// A lower bound of the distance to all surfaces, inside one shape of a scene.
#[derive(Clone, Debug)]
pub struct Room {
    own: Arc<Clearance>,
    placed: Option<Placed>,
    /// Surfaces of other instances, or of anything else.
    foreign: Option<Clearance>,
}

#[derive(Clone, Debug)]
struct Placed {
    to_object: DAffine3,
    stretch: f32,
    /// What rounding may move a point by in object space \[L\].
    rounding: f32,
}

impl Room {
    /// Returns a lower bound of the distance from p to the surfaces \[L\]; 0 outside the shape's box.
    #[inline]
    pub fn bound(&self, p: Vec3) -> f32 {
        let own = match &self.placed {
            None => self.own.bound(p),
            Some(m) => {
                let local = m.to_object.transform_point3(p.as_dvec3()).as_vec3();
                m.stretch * (self.own.bound(local) - m.rounding).max(0.0)
            }
        };
        match &self.foreign {
            None => own,
            Some(f) => own.min(f.bound(p)),
        }
    }

    /// Returns about the largest distance to the shape's own surfaces that there is inside \[L\].
    pub fn depth(&self) -> f32 {
        self.own.depth() * self.placed.as_ref().map_or(1.0, |m| m.stretch)
    }

    /// Returns how far below the true distance a bound may be near surfaces \[L\].
    pub fn coarseness(&self) -> f32 {
        let own = self.own.coarseness() * self.placed.as_ref().map_or(1.0, |m| m.stretch);
        own.max(self.foreign.as_ref().map_or(0.0, Clearance::coarseness))
    }

    /// Returns the bytes that are this shape's alone.
    pub fn memory(&self) -> usize {
        let own = if self.placed.is_none() { self.own.memory() } else { 0 };
        size_of::<Self>() + own + self.foreign.as_ref().map_or(0, Clearance::memory)
    }
}

impl Accel {
    /// Builds the bound inside a shape, with about `max_cells` bytes for a shape of the world, or for all instances of one.
    ///
    /// *Use when* many queries follow; see [`Clearance::build`].
    pub fn room(&self, shape: u32, max_cells: usize) -> Room {
        let bounds = self.shape_bounds(shape);
        let (_, placed) = self.placed(shape);
        let Some(p) = placed else {
            let inside = |s: &usize| self.world.bounds[*s].overlaps(&bounds);
            let shapes: Vec<&Shape> =
                (0..self.world.shapes.len()).filter(inside).map(|s| &self.world.shapes[s]).collect();
            let own = Arc::new(Clearance::build(&shapes, bounds, max_cells));
            let foreign = (!self.placements.is_empty())
                .then(|| Clearance::of_marks(|m| self.mark_instances(m, &bounds, WORLD), bounds, FOREIGN_CELLS));
            return Room { own, placed: None, foreign: foreign.flatten() };
        };

        // The object's own surfaces, once for all its instances.
        let group = &self.groups[p.group as usize];
        let index = (shape - p.first_shape) as usize;
        let own = self.rooms[p.group as usize][index].get_or_init(|| {
            let bounds = group.bounds[index];
            let inside = |s: &usize| group.bounds[*s].overlaps(&bounds);
            let shapes: Vec<&Shape> = (0..group.shapes.len()).filter(inside).map(|s| &group.shapes[s]).collect();
            Arc::new(Clearance::build(&shapes, bounds, max_cells))
        });

        // Whatever else reaches into this instance.
        let instance = self.placements.partition_point(|q| q.first_shape <= shape) as u32 - 1;
        let cells = (FOREIGN_BUDGET / self.placements.len()).clamp(64, 1 << 15);
        let mark = |marks: &Marks| {
            mark_group(marks, &self.world, None, &bounds);
            self.mark_instances(marks, &bounds, instance);
        };
        let foreign = Clearance::of_marks(mark, bounds, cells);
        // Two roundings of 2^-24 of the object's coordinates: of the point, and of the vertices against it.
        let rounding = 0.5f32.powi(22) * group.bounds[index].magnitude();
        let placed = Placed { to_object: p.to_object, stretch: p.stretch[0] as f32 * (1.0 - 1e-6), rounding };
        Room { own: Arc::clone(own), placed: Some(placed), foreign }
    }

    /// Marks the surfaces of all instances but one in a box.
    fn mark_instances(&self, marks: &Marks, bounds: &Bounds, except: u32) {
        let mut visit = |k: u32| {
            let i = self.order[k as usize];
            if i != except {
                let p = &self.placements[i as usize];
                mark_group(marks, &self.groups[p.group as usize], Some(p), bounds);
            }
        };
        if self.top.nodes.is_empty() {
            (0..self.order.len() as u32).for_each(visit);
        } else {
            in_boxes(&self.top, |b| b.overlaps(bounds), &mut visit);
        }
    }
}

/// Marks the surfaces of a group in a box of the world.
fn mark_group(marks: &Marks, group: &Group, placed: Option<&Placement>, bounds: &Bounds) {
    let mut visit = |i: u32| {
        let leaf = &group.leaves[i as usize];
        if !leaf.is_quadric() {
            let corners = leaf.corners().map(|c| placed.map_or(c, |p| p.point(c)));
            if Bounds::of(corners).overlaps(bounds) {
                marks.add_corners(corners);
            }
            return;
        }
        if let Form::Quadric(q) = &group.shapes[group.locate(leaf.prim()).0 as usize].form {
            // A transform that leaves nothing of a quadric leaves nothing to mark.
            let moved = placed.map_or_else(|| Some(q.clone()), |p| q.moved(&p.to_world));
            moved.into_iter().for_each(|q| marks.add(&q.into()));
        }
    };
    if group.bvh.nodes.is_empty() {
        (0..group.leaves.len() as u32).for_each(visit);
    } else {
        // What is no larger than a cell is marked by its box.
        let enter = |b: &Bounds| {
            let b = placed.map_or(*b, |p| p.image(b));
            let there = b.overlaps(bounds);
            let small = there && b.extent().max_element() <= marks.cell();
            if small {
                marks.add_box(&b);
            }
            there && !small
        };
        in_boxes(&group.bvh, enter, &mut visit);
    }
}
