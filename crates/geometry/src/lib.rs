//! moonmilk-geometry.
