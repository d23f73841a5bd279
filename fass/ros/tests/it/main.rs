//! A node from outside: its messages by the bytes of others, and its traffic with a router.

#![allow(clippy::unwrap_used, reason = "a test fails by a panic")]

#[path = "../../../../sched-dag/tests/it/counting.rs"]
mod counting;
mod messages;
mod node;
