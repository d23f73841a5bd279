//! What `--input` and `--output` say of the guest's second serial port, which is an app's wire.
//!
//! A file of bytes with their times goes to the guest with the boot module, so that runs repeat.
//! Standard input goes to the port, as it comes. What the guest sends goes to a file.

use std::path::{Path, PathBuf};

use crate::files::{self, Named};
use crate::options::{Parsed, Refusal};
use crate::outcome::Outcome;
use crate::qemu::Second;
use crate::wire_script;

/// What stands for standard input.
const STREAM: &str = "-";

/// Reports whether standard input goes to the port.
pub(super) fn is_live(options: &Parsed) -> bool {
    options.path("input") == Some(Path::new(STREAM))
}

/// Returns the file that `--input` names, if it names one.
pub(super) fn input(options: &Parsed) -> Vec<Named<'_>> {
    match is_live(options) {
        true => Vec::new(),
        false => options.named(&["input"]),
    }
}

/// Makes sure that both go with the other options.
pub(super) fn check(options: &Parsed) -> Result<(), Refusal> {
    let usage = |line: &str| Err(Refusal::Usage(line.into()));
    if is_live(options) && options.is_given("console") {
        return usage(
            "`--input -` and `--console` both take standard input; give one, or a file to --input",
        );
    }
    if options.path("output") == Some(Path::new(STREAM)) {
        return usage("`--output -`: standard output is the guest's text; name a file");
    }
    let wire = options.given_of(&["input", "output"]);
    match wire.filter(|_| options.is_given("dag")) {
        Some(name) => Err(Refusal::Usage(format!(
            "`--{name}` and `--dag` exclude each other: DAGs of a file have no wire; give --app"
        ))),
        None => Ok(()),
    }
}

/// Returns the script for the guest of the file that `--input` names; empty if it names none.
pub(super) fn script(options: &Parsed) -> Result<Vec<u8>, Refusal> {
    let Some(path) = options.path("input").filter(|_| !is_live(options)) else {
        return Ok(Vec::new());
    };
    let place = files::place(path);
    let text = files::read_text(path)
        .map_err(|why| Refusal::Usage(format!("`--input`: {why}; name another file")))?;
    let entries = wire_script::read(&text)
        .map_err(|why| Refusal::Usage(format!("`--input`: {place}:{why}")))?;
    if entries.is_empty() {
        let why = format!("`--input {place}`: it has no bytes; write lines such as 4ms \"on\\n\"");
        return Err(Refusal::Usage(why));
    }
    Ok(wire_script::for_guest(&entries))
}

/// Returns what the port is connected to, if either is given.
pub(super) fn second(options: &Parsed) -> Option<Second> {
    let output = options.path("output").map(PathBuf::from);
    (output.is_some() || options.is_given("input")).then(|| Second {
        is_live: is_live(options),
        output,
    })
}

/// Returns what to say if the app has no wire, and so nothing was sent.
pub(super) fn warning(options: &Parsed, outcome: &Outcome) -> Option<String> {
    let file = options.path("output").map(files::place)?;
    let has_wire = outcome.transcript.of_kind("wire").next().is_some();
    (!has_wire).then(|| format!("{file}: the app has connected no wire, and so it is empty"))
}

#[cfg(test)]
mod tests {
    use super::{check, second};
    use crate::options::Refusal;
    use crate::qemu::Second;
    use crate::run::RUN;

    #[test]
    fn what_standard_streams_cannot_do_is_refused() {
        for (line, says) in [
            ("--input - --console", "`--input -` and `--console` both"),
            ("--output -", "`--output -`: standard output is"),
            ("--dag x --output y", "`--output` and `--dag` exclude"),
        ] {
            match check(&RUN.right(line)) {
                Err(Refusal::Usage(why)) => assert!(why.starts_with(says), "{why}"),
                other => panic!("`{line}`: {other:?}"),
            }
        }
        assert!(check(&RUN.right("--input - --output x")).is_ok());
    }

    #[test]
    fn the_port_is_there_if_something_is_connected() {
        for (line, expected) in [
            ("--console", None),
            ("--input a", Some((false, None))),
            ("--input - --output b", Some((true, Some("b")))),
            ("--output b", Some((false, Some("b")))),
        ] {
            let expected = expected.map(|(is_live, output)| Second {
                is_live,
                output: output.map(Into::into),
            });
            assert_eq!(second(&RUN.right(line)), expected, "{line}");
        }
    }
}
