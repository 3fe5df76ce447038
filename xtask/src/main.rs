//! Chores: `cargo xtask test`, `cargo xtask lint`, `cargo xtask repro NAME --out DIR`.
fn main() {}
