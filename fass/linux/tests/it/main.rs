//! The machine on Linux: runs by each mechanism, their ends, recordings and wires.

mod ends;
mod lives;
mod locks;
mod panics;
mod recordings;
#[path = "../support/mod.rs"]
mod support;
mod waits;
mod wires;
