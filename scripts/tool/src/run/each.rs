//! The files of a folder, one after the other, whatever is run of each.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::RUN;
use crate::files;
use crate::options::Refusal;
use crate::protocol::Status;

/// Runs each file; one that is refused or fails does not keep the others from running. Returns
/// how many were refused, and how many failed.
pub(super) fn each(
    files: &[PathBuf],
    mut run: impl FnMut(&Path) -> Result<Status, Refusal>,
) -> Result<(usize, usize), Refusal> {
    let (mut refused, mut failed) = (0, 0);
    for file in files {
        let status = match run(file) {
            Ok(status) => status,
            Err(Refusal::Usage(lines)) => {
                RUN.complain(&lines);
                Status::Usage
            }
            Err(Refusal::Failure(line)) => {
                RUN.complain(&format!("{}: {line}", files::place(file)));
                Status::Failure
            }
            Err(refusal) => return Err(refusal),
        };
        refused += usize::from(status == Status::Usage);
        failed += usize::from(status == Status::Failure);
    }
    Ok((refused, failed))
}

/// Returns the exit code of the worst of the files.
pub(super) fn worst(refused: usize, failed: usize) -> ExitCode {
    match (refused, failed) {
        (0, 0) => ExitCode::SUCCESS,
        (0, _) => ExitCode::FAILURE,
        _ => ExitCode::from(2),
    }
}
