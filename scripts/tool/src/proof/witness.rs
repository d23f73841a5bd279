//! The witnesses of a guest's bounds, in files for `./scripts/check-witness`.

use std::path::{Path, PathBuf};

use sched_dag::analysis;

use crate::files;
use crate::record::model::Committed;

/// Writes the witness of each commit, and returns what to say of them. Those of later
/// commits go to files of their own, with the commit's number as their last extension.
///
/// # Errors
///
/// In words: nothing was committed, or a file cannot be written.
pub fn write(path: &Path, commits: &[Committed]) -> Result<String, String> {
    let mut names = Vec::new();
    for commit in commits {
        let path = file(path, commit.number);
        let text = analysis::witness(&commit.task_set, &commit.settings());
        files::write_named("witness", &path, text)?;
        names.push(files::place(&path));
    }
    match names.join(" ") {
        none if none.is_empty() => Err("the guest has committed no DAG".into()),
        names => Ok(format!(
            "{names}: what proves the bounds; `./scripts/check-witness {names}` checks it"
        )),
    }
}

fn file(path: &Path, commit: usize) -> PathBuf {
    match commit {
        0 => path.into(),
        later => {
            let mut name = path.as_os_str().to_owned();
            name.push(format!(".{later}"));
            name.into()
        }
    }
}
