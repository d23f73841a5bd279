//! What goes out as text: machine lines (`json`), a DAG as one of them (`graph`), and the way of
//! all text to the platform (`console`).

pub mod console;
pub mod graph;
pub mod json;
