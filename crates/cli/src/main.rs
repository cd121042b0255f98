//! The program `moonmilk`.
fn main() {}
