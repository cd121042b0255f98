//! Exact transport, from a scene's description to the radiance along a ray, against results known in closed form.
//!
//! Significance: each comparison accepts 4.9 standard errors (1e-6 two-sided); seeds are fixed, so that a failure is a bug. With
//! `MOONMILK_SLOW=1` the numbers of samples grow to the precision that each test states. `--nocapture` prints every measurement.

#[path = "../common/mod.rs"]
mod common;

mod bodies;
mod colour;
mod connections;
mod effort;
mod environments;
mod fields;
mod furnace;
mod guided;
mod half_space;
mod hybrid;
mod instances;
mod jumps;
mod lamps;
mod limits;
mod mirrors;
mod nested;
mod path_length;
mod profiles;
mod reciprocity;
mod scale;
mod similar;
mod touching;
mod vertices;
