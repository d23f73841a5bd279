//! Tests of the client, with a router that is a script.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

mod mutated;
mod script;
