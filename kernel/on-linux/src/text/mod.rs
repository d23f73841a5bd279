//! What goes out as text, and what comes in as words: the executive's files, and a console.

pub mod console;
#[path = "../../../executive/src/text/graph.rs"]
pub mod graph;
#[path = "../../../executive/src/text/json.rs"]
pub mod json;
#[path = "../../../executive/src/text/options.rs"]
pub mod options;
