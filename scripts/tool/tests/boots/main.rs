//! The commands that boot guests, as a person calls them, and how guests are started and ended.

mod chooses_mode;
mod console;
mod crash;
mod debugger;
mod ends_in_order;
mod images;
mod keeps;
mod live_page;
mod on_host;
mod prove;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/tiny.rs"]
mod tiny;

/// The program that these tests call.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fass-tool");
