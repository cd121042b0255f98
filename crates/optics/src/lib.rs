//! moonmilk-optics.
