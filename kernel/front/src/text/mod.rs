//! What goes out as text: machine lines (`json`), and the way of all text to the platform
//! (`console`).

pub mod console;
pub mod json;
