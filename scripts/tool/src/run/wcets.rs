//! What `--wcets FILE` hands to the guest: the file as the first part of the boot module.

use std::fs;
use std::path::{Path, PathBuf};

use super::Refusal;
use crate::options::Parsed;
use crate::proof::wcets;
use crate::system;

/// A file of WCETs on its way to the guest; empty if none is given.
pub(super) struct Wcets {
    text: String,
    /// Where it lies as a module of its own, if there is no other. It is removed with this
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
    /// Reads the file that `--wcets` names, if it does, and writes a module if there is none.
    pub(super) fn read(options: &Parsed, is_alone: bool) -> Result<Wcets, Refusal> {
        let read = |path: &Path| wcets::read(path).map_err(Refusal::Usage);
        let text = options.path("wcets").map(read).transpose()?;
        let mut module = Temporary(None);
        if let (Some(text), true) = (&text, is_alone) {
            let path = system::new_log("wcets").map_err(Refusal::Failure)?;
            let path = path.with_extension("wcets");
            let written = fs::write(&path, text);
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

    /// Returns the module, if it has nothing else.
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
