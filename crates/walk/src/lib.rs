//! moonmilk-walk.
