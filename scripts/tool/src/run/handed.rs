//! Builds the boot module handed to the guest. The module consists of the DAGs of a file behind
//! `--wcets`, or else of `--wcets`, `--replay`, `--module` and `--input`, in this order.
//!
//! The parameters given by `--params FILE` and `--set NAME=VALUE,...` become a word for the guest.
//! Only the guest knows their types and ranges; here they are only checked to fit into the word.
//! `--set` comes after the file, and so prevails.
//!
//! `--input` and `--output` belong to the guest's second serial port, an app's wire. A file of
//! bytes with their times, possibly for several wires, goes to the guest with the boot module, to
//! make runs repeatable. Standard input goes to the port as it comes. The guest's output from the
//! port goes to a file.

use std::path::{Path, PathBuf};

use text::{quoted, shown, visible};

use crate::dag_file::PreparedRun;
use crate::files::{self, NamedFile, TemporaryFile};
use crate::options::{CommandLine, Refusal};
use crate::outcome::Outcome;
use crate::proof::observed;
use crate::qemu::{Network, SecondPort};
use crate::recordings;
use crate::run_options::name;
use crate::system;
use crate::wire_script;

/// Files on their way to the guest.
pub(super) struct GuestInput {
    /// The guest's words: the parameters, and the length of each part of the module; each word
    /// follows a blank.
    pub(super) words: String,
    /// The file of the module, if the module has any content; removed when this value is dropped.
    module: TemporaryFile,
}

impl GuestInput {
    /// Reads the files named by the options, and writes the module.
    pub(super) fn read(
        options: &CommandLine,
        dags: Option<&PreparedRun>,
    ) -> Result<GuestInput, Refusal> {
        let read = |path: &Path| observed::read(path).map_err(Refusal::Usage);
        let text = options.path(name::WCETS).map(read).transpose()?;
        let text = text.unwrap_or_default();
        let replayed = read_replayed(options)?;
        let own = options
            .named(&[name::MODULE])
            .first()
            .map(files::read_named);
        let own = own.transpose().map_err(Refusal::Usage)?;
        let input = script(options)?;
        let is_empty = own.is_none() && text.is_empty() && replayed.is_empty() && input.is_empty();
        let (ending, content) = match dags {
            Some(dags) => ("dag", format!("{text}{}", dags.file).into_bytes()),
            None => {
                let own = own.unwrap_or_default();
                // The order is part of the contract: the guest cuts the parts off by their lengths.
                let parts = [text.as_bytes(), &replayed, &own, &input];
                ("module", parts.concat())
            }
        };
        let mut module = TemporaryFile(None);
        if dags.is_some() || !is_empty {
            let path = system::new_log("module")?.with_extension(ending);
            module.0 = Some(path.clone());
            files::write(&path, content)?;
        }
        let mut words = parameters(options)?;
        for (name, part) in [
            ("wcets", text.as_bytes()),
            ("replay", &replayed),
            ("input", &input),
        ] {
            // `--module` is the only part without a length, as it takes the rest.
            if !part.is_empty() {
                words += &format!(" {name}={}", part.len());
            }
        }
        Ok(GuestInput { words, module })
    }

    /// Returns the path of the written module.
    pub(super) fn module(&self) -> Option<PathBuf> {
        self.module.0.clone()
    }
}

/// Returns the bytes of the recording for the module. Returns none without a replay, or on Linux,
/// where the program reads the file itself.
fn read_replayed(options: &CommandLine) -> Result<Vec<u8>, Refusal> {
    let Some(path) = options.path(name::REPLAY) else {
        return Ok(Vec::new());
    };
    let refused = |why| Refusal::Usage(format!("`--replay` {why}"));
    let bytes = recordings::read(path).map_err(refused)?;
    recordings::parse(path, &bytes).map_err(refused)?;
    // Parsed above all the same, to refuse a damaged file before the build.
    match options.is_given(name::ON) {
        true => Ok(Vec::new()),
        false => Ok(bytes),
    }
}

/// Returns the word for the guest's parameters after a blank; empty without parameters.
fn parameters(options: &CommandLine) -> Result<String, Refusal> {
    let mut parts = Vec::new();
    if let Some(path) = options.path(name::PARAMS) {
        let place = files::shown_path(path);
        let option = "params";
        let bytes = files::read_named(&NamedFile { option, path }).map_err(Refusal::Usage)?;
        let text = String::from_utf8_lossy(&bytes);
        parts.extend(of_file(&text).map_err(|line| Refusal::Usage(format!("{place}:{line}")))?);
    }
    if let Some(text) = options.text(name::SET) {
        for part in text.split(',') {
            let shown = shown(part);
            let why = format!("`--set {shown}`: give it as NAME=VALUE, without blanks");
            parts.push(pair(part).ok_or(Refusal::Usage(why))?);
        }
    }
    Ok(match parts.is_empty() {
        true => String::new(),
        false => format!(" set={}", parts.join(",")),
    })
}

/// Reads the lines of a file, each `NAME=VALUE`; a `#` begins a comment.
fn of_file(text: &str) -> Result<Vec<String>, String> {
    let lines = (1..).zip(text.lines()).map(|(number, line)| {
        let said = line.split('#').next().unwrap_or_default().trim();
        (number, said)
    });
    let said = lines.filter(|(_, said)| !said.is_empty());
    said.map(|(number, said)| {
        pair(said)
            .ok_or_else(|| format!("{number}: {} is not NAME=VALUE; write it so", quoted(said)))
    })
    .collect()
}

/// Returns `NAME=VALUE` without blanks around name and value; `None` if the text is malformed.
fn pair(text: &str) -> Option<String> {
    let (name, value) = text.split_once('=')?;
    let parts = [name.trim(), value.trim()];
    let is_word =
        |part: &str| !part.is_empty() && !part.contains(|c: char| c.is_whitespace() || c == ',');
    let is_pair = parts.into_iter().all(is_word);
    is_pair.then(|| parts.join("="))
}

/// The name for standard input.
const STREAM: &str = "-";

/// Reports whether standard input goes to the port.
pub(super) fn is_live(options: &CommandLine) -> bool {
    options.path(name::INPUT) == Some(Path::new(STREAM))
}

/// Returns the file named by `--input`, unless the name means standard input.
pub(super) fn input(options: &CommandLine) -> Vec<NamedFile<'_>> {
    match is_live(options) {
        true => Vec::new(),
        false => options.named(&[name::INPUT]),
    }
}

/// Makes sure that `--input` and `--output` are compatible with the other options.
pub(super) fn check(options: &CommandLine) -> Result<(), Refusal> {
    let usage = |line: &str| Err(Refusal::Usage(line.into()));
    if is_live(options) && options.is_given(name::CONSOLE) {
        return usage(
            "`--input -` and `--console` both take standard input; give one, or a file to --input",
        );
    }
    if options.path(name::OUTPUT) == Some(Path::new(STREAM)) {
        return usage("`--output -`: standard output is the guest's text; name a file");
    }
    if !options.is_given(name::DAG) {
        return Ok(());
    }
    let why = "and `--dag` exclude each other: DAGs of a file have no wire; give --app";
    let wire = options.check_without(&[name::INPUT, name::OUTPUT], why);
    wire.map_err(Refusal::Usage)
}

/// Returns the script for the guest from the file named by `--input`; empty without a file.
fn script(options: &CommandLine) -> Result<Vec<u8>, Refusal> {
    let Some(path) = options.path(name::INPUT).filter(|_| !is_live(options)) else {
        return Ok(Vec::new());
    };
    let place = files::shown_path(path);
    let text = files::read_text(path).map_err(|why| Refusal::Usage(format!("`--input`: {why}")))?;
    let entries = wire_script::read(&text)
        .map_err(|why| Refusal::Usage(format!("`--input`: {place}:{why}")))?;
    if entries.is_empty() {
        let why = format!("`--input {place}`: it has no bytes; write lines such as 4ms \"on\\n\"");
        return Err(Refusal::Usage(why));
    }
    let append = options.text(name::APPEND).unwrap_or_default();
    for entry in &entries {
        let word = entry.wire.as_ref().map(|wire| format!("wire.{wire}=file"));
        // The guest refuses the word if the app has no such wire.
        if let Some(word) = word.filter(|word| append.split_whitespace().all(|own| own != word)) {
            let line = entry.line;
            let why = format!(
                "no word gives its wire the file; give --append {}",
                visible(&word)
            );
            return Err(Refusal::Usage(format!("`--input`: {place}:{line}: {why}")));
        }
    }
    Ok(wire_script::for_guest(&entries))
}

/// Returns the other end of the second serial port, if `--input` or `--output` is given.
pub(super) fn second(options: &CommandLine) -> Option<SecondPort> {
    let output = options.path(name::OUTPUT).map(PathBuf::from);
    (output.is_some() || options.is_given(name::INPUT)).then(|| SecondPort {
        is_live: is_live(options),
        output,
    })
}

/// Returns the network, if `--net` is given.
pub(super) fn network(options: &CommandLine) -> Option<Network> {
    let words = options.text(name::NET)?.into();
    // Without the option ROM with which a firmware would boot from the network.
    let card = match options.text(name::CARD) {
        Some("e1000e") => "e1000e,romfile=",
        _ => "virtio-net-pci,romfile=",
    };
    let traffic = options.path(name::PCAP).map(PathBuf::from);
    Some(Network {
        words,
        card,
        traffic,
    })
}

/// Returns a warning if `--output` is given but the app has no wire and so has sent nothing.
pub(super) fn warning(options: &CommandLine, outcome: &Outcome) -> Option<String> {
    let file = options.path(name::OUTPUT).map(files::shown_path)?;
    let has_wire = outcome.transcript.of_kind("wire").next().is_some();
    (!has_wire).then(|| format!("{file}: the app has connected no wire, and so it is empty"))
}

#[cfg(test)]
mod tests {
    use super::super::{RUN, prepare};
    use super::*;
    use crate::system::workspace;
    use crate::tests::right;
    use std::fs;

    #[test]
    fn dags_of_a_file_are_a_module_that_goes_with_its_value() {
        let demo = workspace().join("apps/dag-file/examples/demo.dag");
        let options = right(&RUN, "--jobs 3").with(name::DAG, demo);
        let dags = prepare(&options).unwrap().unwrap();
        let handed = GuestInput::read(&options, Some(&dags)).unwrap();
        let module = handed.module().unwrap();
        assert_eq!(fs::read_to_string(&module).unwrap(), dags.file.to_string());
        drop(handed);
        assert!(!module.exists());
    }

    #[test]
    fn a_file_has_a_parameter_on_each_line_and_what_cannot_stand_in_a_word_is_none() {
        let text = "# the attitude loop\ngain = 0.5\n\nsteps=3   # few\n";
        assert_eq!(of_file(text), Ok(vec!["gain=0.5".into(), "steps=3".into()]));
        let wrong = "2: `gain 0.5` is not NAME=VALUE; write it so";
        assert_eq!(of_file("steps=3\ngain 0.5\n"), Err(wrong.into()));
        for text in "gain;=1;gain=;gain=1 2;ga in=1;gain=1,2;gain=1\n2".split(';') {
            assert_eq!(pair(text), None, "{text}");
        }
        // A value may contain `=`.
        assert_eq!(pair("a=b=c").as_deref(), Some("a=b=c"));
    }

    #[test]
    fn a_wire_of_the_file_needs_its_word() {
        let path = std::env::temp_dir().join(format!("{}.wires", std::process::id()));
        fs::write(&path, "1ms wire.a 0a\n2ms wire.b 0a\n").unwrap();
        let refused = |words: &str| {
            let options = right(&RUN, "--jobs 3").with(name::APPEND, words);
            script(&options.with(name::INPUT, &path)).err()
        };
        let place = files::shown_path(&path);
        let why = "2: no word gives its wire the file; give --append wire.b=file";
        let why = Refusal::Usage(format!("`--input`: {place}:{why}"));
        assert_eq!(refused("wire.a=file wire.b=serial"), Some(why));
        assert_eq!(refused("wire.a=file wire.b=file"), None);
        fs::remove_file(path).unwrap();
    }

    #[test]
    fn the_port_is_there_if_something_is_connected() {
        for (line, expected) in [
            ("--console", None),
            ("--input a", Some((false, None))),
            ("--input - --output b", Some((true, Some("b")))),
            ("--output b", Some((false, Some("b")))),
        ] {
            let expected = expected.map(|(is_live, output)| SecondPort {
                is_live,
                output: output.map(Into::into),
            });
            assert_eq!(second(&right(&RUN, line)), expected, "{line}");
        }
    }
}
