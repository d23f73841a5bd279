//! All text that goes out: machine lines (`json`), and the way of it to the platform
//! (`console`).

pub mod console;
pub mod json;
