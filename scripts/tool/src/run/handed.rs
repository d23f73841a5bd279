//! What is handed to the guest as its boot module: DAGs of a file behind `--wcets`, or else
//! `--wcets`, `--replay`, `--module` and `--input`, in this order.

use std::path::{Path, PathBuf};

use super::wire;
use crate::dag_file::Prepared;
use crate::files::{self, Temporary};
use crate::options::{Parsed, Refusal};
use crate::proof::wcets;
use crate::recordings;
use crate::system;

/// Files on their way to the guest.
pub(super) struct Handed {
    /// How many bytes at the module's beginning are WCETs.
    wcets_bytes: usize,
    /// How many bytes at the module's end are a wire's.
    input_bytes: usize,
    /// How many bytes after the WCETs are a recording.
    replay_bytes: usize,
    /// Where the module lies, if there is something in it. It is removed with this value.
    module: Temporary,
}

impl Handed {
    /// Reads the files that the options name, if they do, and writes a module of them.
    pub(super) fn read(options: &Parsed, dags: Option<&Prepared>) -> Result<Handed, Refusal> {
        let read = |path: &Path| wcets::read(path).map_err(Refusal::Usage);
        let text = options.path("wcets").map(read).transpose()?;
        let text = text.unwrap_or_default();
        let replayed = read_replayed(options)?;
        let own = options.named(&["module"]).first().map(files::read_named);
        let own = own.transpose().map_err(Refusal::Usage)?;
        let input = wire::script(options)?;
        let is_empty = own.is_none() && text.is_empty() && replayed.is_empty() && input.is_empty();
        let (ending, content) = match dags {
            Some(dags) => ("dag", format!("{text}{}", dags.file).into_bytes()),
            None => {
                let own = own.unwrap_or_default();
                let parts = [text.as_bytes(), &replayed, &own, &input];
                ("module", parts.concat())
            }
        };
        let mut module = Temporary(None);
        if dags.is_some() || !is_empty {
            let path = system::new_log("module")?.with_extension(ending);
            module.0 = Some(path.clone());
            files::write(&path, content)?;
        }
        Ok(Handed {
            wcets_bytes: text.len(),
            input_bytes: input.len(),
            replay_bytes: replayed.len(),
            module,
        })
    }

    /// Returns the module that was written.
    pub(super) fn module(&self) -> Option<PathBuf> {
        self.module.0.clone()
    }

    /// Returns the words that tell the guest where the files end, and where the input begins,
    /// each after a blank.
    pub(super) fn guest_words(&self) -> String {
        let parts = [
            ("wcets", self.wcets_bytes),
            ("replay", self.replay_bytes),
            ("input", self.input_bytes),
        ];
        let parts = parts.into_iter().filter(|(_, bytes)| *bytes > 0);
        parts
            .map(|(name, bytes)| format!(" {name}={bytes}"))
            .collect()
    }
}

/// Returns the recording to replay that belongs into the module, if there is one; a program of
/// Linux reads the file itself.
fn read_replayed(options: &Parsed) -> Result<Vec<u8>, Refusal> {
    let Some(path) = options.path("replay") else {
        return Ok(Vec::new());
    };
    let refused = |why| Refusal::Usage(format!("`--replay` {why}"));
    let bytes = recordings::read(path).map_err(refused)?;
    recordings::parse(path, &bytes).map_err(refused)?;
    match options.is_given("on") {
        true => Ok(Vec::new()),
        false => Ok(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::Handed;
    use crate::run::{RUN, prepare};
    use crate::system::workspace;
    use std::fs;

    #[test]
    fn dags_of_a_file_are_a_module_that_goes_with_its_value() {
        let demo = workspace().join("apps/dag-file/examples/demo.dag");
        let options = RUN.right("--jobs 3").with("dag", demo);
        let dags = prepare(&options).unwrap().unwrap();
        let handed = Handed::read(&options, Some(&dags)).unwrap();
        let module = handed.module().unwrap();
        assert_eq!(fs::read_to_string(&module).unwrap(), dags.file.to_string());
        drop(handed);
        assert!(!module.exists());
    }
}
