//! The `btr` command.

// No verb draws yet.
#[allow(dead_code)]
mod plot;

fn main() {}
