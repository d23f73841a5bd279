//! What goes out as text: the executive's files, and a console.

pub mod console;
#[path = "../../../executive/src/text/graph.rs"]
pub mod graph;
#[path = "../../../executive/src/text/json.rs"]
pub mod json;
