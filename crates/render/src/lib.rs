//! moonmilk-render.
