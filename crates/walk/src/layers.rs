//! Walks through stacks of plane layers with different coefficients, laws of scattering and indices.
//!
//! A layer is a domain of its own ([`Layer`]); light that leaves it through an inner boundary goes on in the next one with a new free flight, which
//! is exact because flights have no memory. Depths are counted within each layer, so that thin layers keep their digits on
//! thick ones.

use moonmilk_core::Random;

use crate::classic::{Limits, Outcome, walk};
use crate::domain::layer::Layer;
use crate::domain::planar::Face;
use crate::medium::Medium;
use crate::phase::PhaseFunction;
use crate::tally::Tally;
use crate::walker::Walker;

/// A stack of layers below one another, from z = 0 downwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack<P> {
    layers: Vec<(Layer, Medium<1, P>)>,
}

/// A recorder that is told in which layer the walk is.
pub trait StackTally<R: Random, P>: Tally<1, R, P> {
    /// Called before the walk flies in a layer.
    fn enter(&mut self, _layer: usize) {}
}

impl<P: PhaseFunction> Stack<P> {
    /// Returns a stack of (thickness \[length\], index, medium), between indices `n_above` and `n_below`.
    ///
    /// *Domain*: at least one layer, thicknesses > 0, indices > 0; only the last layer may be infinitely thick.
    pub fn new(n_above: f32, layers: Vec<(f32, f32, Medium<1, P>)>, n_below: f32) -> Self {
        let indices: Vec<f32> = layers.iter().map(|l| l.1).collect();
        let layers = layers.into_iter().enumerate().map(|(i, (thickness, n, medium))| {
            let before = if i == 0 { n_above } else { indices[i - 1] };
            let after = indices.get(i + 1).copied().unwrap_or(n_below);
            (Layer { thickness, eta_front: n / before, eta_back: n / after }, medium)
        });
        Self { layers: layers.collect() }
    }

    /// Returns the number of layers.
    pub fn len(&self) -> usize {
        self.layers.len()
    }

    /// Returns whether there are no layers.
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// Returns the boundaries and thickness of a layer.
    pub fn layer(&self, i: usize) -> &Layer {
        &self.layers[i].0
    }

    /// Returns the medium of a layer.
    pub fn medium(&self, i: usize) -> &Medium<1, P> {
        &self.layers[i].1
    }
}

/// Walks from a point of layer `start` (depth within that layer) until the path leaves the stack or ends.
///
/// The walker's direction is then that outside, after refraction. *Errors of the result*: as [`walk`].
pub fn walk_stack<P, T, R>(
    stack: &Stack<P>,
    start: usize,
    limits: &Limits,
    walker: &mut Walker<1>,
    tally: &mut T,
    rng: &mut R,
) -> Outcome<Face>
where
    P: PhaseFunction,
    T: StackTally<R, P>,
    R: Random,
{
    let mut i = start;
    loop {
        let (layer, medium) = &stack.layers[i];
        tally.enter(i);
        match walk(layer, medium, limits, walker, tally, rng) {
            Outcome::Left(Face::Front) if i > 0 => {
                i -= 1;
                walker.p.z = stack.layers[i].0.thickness;
            }
            Outcome::Left(Face::Back) if i + 1 < stack.layers.len() => {
                i += 1;
                walker.p.z = 0.0;
            }
            out => return out,
        }
        // What was known of the room is of the other layer.
        walker.room = 0.0;
    }
}

impl<R: Random, P> StackTally<R, P> for crate::tally::NoTally {}
impl<R: Random, P> StackTally<R, P> for crate::tally::PathLength {}
