//! The command `proxel`.
fn main() {}
