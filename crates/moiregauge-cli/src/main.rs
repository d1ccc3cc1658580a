//! The `moiregauge` program.

fn main() {}
