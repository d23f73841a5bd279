//! The commands that boot guests, as a person calls them, and how guests are started and ended.

mod chooses_mode;
mod console;
mod crash;
mod debugger;
mod ends_in_order;
mod images;
mod keeps;
mod prove;
mod soak;
#[path = "../support.rs"]
mod support;
mod tiny_guest;
