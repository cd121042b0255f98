//! moonmilk-io.
