//! The machine on Linux: runs by each mechanism, their ends, recordings, wires and UDP.

mod ends;
mod lives;
mod locks;
mod panics;
mod recordings;
#[path = "../support/mod.rs"]
mod support;
mod udp;
mod waits;
mod wires;
