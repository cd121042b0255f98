//! moonmilk-render.

pub mod description;
