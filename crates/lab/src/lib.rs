//! moonmilk-lab.
