//! What `--wcets FILE` and `--module FILE` hand to the guest: both in one boot module, the WCETs
//! first.

use std::fs;
use std::path::{Path, PathBuf};

use super::Refusal;
use crate::files;
use crate::options::Parsed;
use crate::proof::wcets;
use crate::system;

/// A file of WCETs on its way to the guest; empty if none is given.
pub(super) struct Wcets {
    text: String,
    /// Where the module of both files lies, if there is no other. It is removed with this
    /// value.
    module: Temporary,
}

/// A file of ours, removed when it is of no more use.
pub(super) struct Temporary(pub(super) Option<PathBuf>);

impl Drop for Temporary {
    fn drop(&mut self) {
        // It is in the way of no one if it cannot be removed.
        let _ = self.0.take().map(fs::remove_file);
    }
}

impl Wcets {
    /// Reads the files that `--wcets` and `--module` name, if they do, and writes a module of
    /// them unless DAGs of a file are the module.
    pub(super) fn read(options: &Parsed, is_alone: bool) -> Result<Wcets, Refusal> {
        let read = |path: &Path| wcets::read(path).map_err(Refusal::Usage);
        let text = options.path("wcets").map(read).transpose()?;
        let own = options.path("module").map(read_module).transpose()?;
        let mut module = Temporary(None);
        if is_alone && (text.is_some() || own.is_some()) {
            let path = system::new_log("module").map_err(Refusal::Failure)?;
            let path = path.with_extension("module");
            let parts = [
                text.as_deref().unwrap_or_default().as_bytes(),
                &own.unwrap_or_default(),
            ];
            let written = fs::write(&path, parts.concat());
            module.0 = Some(path.clone());
            written.map_err(|error| {
                Refusal::Failure(format!("cannot write `{}`: {error}", path.display()))
            })?;
        }
        Ok(Wcets {
            text: text.unwrap_or_default(),
            module,
        })
    }

    /// Returns what stands before all else in the module.
    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Returns the module that was written.
    pub(super) fn module(&self) -> Option<PathBuf> {
        self.module.0.clone()
    }

    /// Returns the word that tells the guest where the file ends, after a blank.
    pub(super) fn guest_word(&self) -> String {
        match self.text.len() {
            0 => String::new(),
            bytes => format!(" wcets={bytes}"),
        }
    }
}

/// Reads a person's boot module.
fn read_module(path: &Path) -> Result<Vec<u8>, Refusal> {
    files::read(path).map_err(|why| {
        let place = files::place(path);
        Refusal::Usage(format!("`--module {place}` {why}; name another file"))
    })
}
