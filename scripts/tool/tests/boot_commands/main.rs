//! The commands that boot guests, as a person calls them.

mod chooses_mode;
mod console;
mod crash;
mod debugger;
mod ends_in_order;
mod images;
mod keeps;
mod prove;
#[path = "../support/mod.rs"]
mod support;
