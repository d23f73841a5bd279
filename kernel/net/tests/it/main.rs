//! Tests of the network's protocols, without a network.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

mod dhcp;
mod frames;
mod mutated;
mod mutation;
