//! Pictures of measurements: drawn by a Python script, if there is what it needs.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::system;

/// Has a script of `scripts/plot` draw into `out/plots` what is in `out`.
///
/// # Errors
///
/// One line: what is missing, or what went wrong.
pub(in crate::bench) fn draw(script: &str, out: &Path) -> Result<(), String> {
    let before = fs::read_dir(out.join("plots"));
    for picture in before.into_iter().flatten().flatten() {
        let path = picture.path();
        if path.extension().is_some_and(|ending| ending == "svg") {
            // One of earlier figures would be wrong.
            let _ = fs::remove_file(path);
        }
    }
    let script = system::workspace().join("scripts/plot").join(script);
    let mut complaint = String::new();
    // A Python of the person's own may hide the system's, which the package
    // manager installs matplotlib for.
    for program in ["python3", "/usr/bin/python3"] {
        let mut command = Command::new(program);
        match command.args([&script, out]).stdin(Stdio::null()).output() {
            Ok(output) if output.status.success() => return Ok(()),
            Ok(output) => complaint = String::from_utf8_lossy(&output.stderr).into_owned(),
            Err(error) => complaint = format!("cannot start {program}: {error}"),
        }
    }
    let last = complaint.lines().last().unwrap_or_default();
    Err(format!(
        "no plots: {last}; they need python3 with matplotlib: install it (Debian, Ubuntu: \
         apt-get install python3-matplotlib; else: pip install matplotlib) and run this again, \
         nothing is measured twice"
    ))
}
