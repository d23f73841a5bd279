//! Pictures of measurements: drawn by a Python script, if there is what it needs.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::system;

/// Has a script of `scripts/plot` draw what is in `out`.
///
/// # Errors
///
/// One line: what is missing, or what went wrong.
pub(super) fn draw(script: &str, out: &Path) -> Result<(), String> {
    let python = |program: &str, words: &[&OsStr]| {
        let mut command = Command::new(program);
        command.args(words).stdin(Stdio::null()).output()
    };
    // A Python of the person's own may hide the system's, which the package
    // manager installs matplotlib for.
    let mut programs = ["python3", "/usr/bin/python3"].into_iter();
    let has_matplotlib = |program: &&str| {
        let output = python(program, &["-c".as_ref(), "import matplotlib".as_ref()]);
        output.is_ok_and(|output| output.status.success())
    };
    let Some(program) = programs.find(has_matplotlib) else {
        return Err(
            "no plots: python3 with matplotlib is missing; install it (Debian, Ubuntu: \
                    apt-get install python3-matplotlib; else: pip install matplotlib) and run \
                    this again, nothing is measured twice"
                .into(),
        );
    };
    let script = system::workspace().join("scripts/plot").join(script);
    let output = python(program, &[script.as_os_str(), out.as_os_str()]);
    let output = output.map_err(|error| format!("no plots: cannot start {program}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(format!("no plots: {}: {}", script.display(), said.trim()))
}
