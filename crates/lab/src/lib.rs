//! Experiments on light in translucent bodies without a renderer: begun, and empty so far.
//!
//! This crate is to hold searchlights, slabs, layers and bodies with their tallies, the models' profiles measured against them, and
//! fits. It is kept apart from `moonmilk-render` on purpose: neither may use the other. Until it holds something, the exact results to measure
//! with are in [`moonmilk_optics::halfspace`] and [`moonmilk_optics::slab`], the walk in [`moonmilk_walk::classic`], and its comparison with them in that
//! crate's tests.
