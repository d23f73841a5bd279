//! Pictures: drawn by a Python script, if there is what it needs.

use std::fs;
use std::path::Path;

use crate::bench::plots;

/// The files that the script writes.
const PICTURES: [&str; 5] = [
    "join_latency.svg",
    "cover_delay.svg",
    "response.svg",
    "distribution.svg",
    "gantt.svg",
];

/// Draws the pictures into `out/plots`.
///
/// # Errors
///
/// One line: what is missing, or what went wrong.
pub(super) fn draw(out: &Path) -> Result<(), String> {
    for file in PICTURES {
        // Those of earlier figures would be wrong; mostly there are none.
        let _ = fs::remove_file(out.join("plots").join(file));
    }
    plots::draw("join_latency.py", out)
}
