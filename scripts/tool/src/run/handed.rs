//! What `--wcets`, `--replay`, `--module` and `--input` hand to the guest: all in one boot
//! module, in this order.

use std::path::{Path, PathBuf};

use super::wire;
use crate::files::{self, Temporary};
use crate::options::{Parsed, Refusal};
use crate::proof::wcets;
use crate::system;

/// Files on their way to the guest; empty if none is given.
pub(super) struct Handed {
    text: String,
    /// How many bytes at the module's end are a wire's.
    input_bytes: usize,
    /// How many bytes after it are a recording.
    replay_bytes: usize,
    /// Where the module of both files lies, if there is no other. It is removed with this
    /// value.
    module: Temporary,
}

impl Handed {
    /// Reads the files that `--wcets`, `--module` and `--input` name, if they do, and writes a
    /// module of them unless DAGs of a file are the module.
    pub(super) fn read(options: &Parsed, is_alone: bool) -> Result<Handed, Refusal> {
        let read = |path: &Path| wcets::read(path).map_err(Refusal::Usage);
        let text = options.path("wcets").map(read).transpose()?;
        let replayed = super::recording::read(options)?;
        let own = options.named(&["module"]).first().map(files::read_named);
        let own = own.transpose().map_err(Refusal::Usage)?;
        let input = wire::script(options)?;
        let mut module = Temporary(None);
        if is_alone
            && (text.is_some() || !replayed.is_empty() || own.is_some() || !input.is_empty())
        {
            let path = system::new_log("module")?;
            let path = path.with_extension("module");
            let parts = [
                text.as_deref().unwrap_or_default().as_bytes(),
                &replayed,
                &own.unwrap_or_default(),
                &input,
            ];
            module.0 = Some(path.clone());
            files::write(&path, parts.concat())?;
        }
        Ok(Handed {
            text: text.unwrap_or_default(),
            input_bytes: input.len(),
            replay_bytes: replayed.len(),
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

    /// Returns the words that tell the guest where the files end, and where the input begins,
    /// each after a blank.
    pub(super) fn guest_words(&self) -> String {
        let parts = [
            ("wcets", self.text.len()),
            ("replay", self.replay_bytes),
            ("input", self.input_bytes),
        ];
        let parts = parts.into_iter().filter(|(_, bytes)| *bytes > 0);
        parts
            .map(|(name, bytes)| format!(" {name}={bytes}"))
            .collect()
    }
}
