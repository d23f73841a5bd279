//! The API as an app uses it: its shapes, its faults, and what the paper's figures say.

mod bodies;
mod commit_faults;
mod diagnostics;
mod no_allocation;
mod paper;
mod support;
mod waits;
