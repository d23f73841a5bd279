//! The serial protocol, host side: the one reader of what a guest prints.
//!
//! A *machine line* begins with `{` in column 0 and is one JSON object with a
//! text member `kind`; every other line is for people. A [`Transcript`] is a
//! whole serial log taken apart into both. The last line of every run is the
//! *verdict*, a machine line of kind `verdict`; a run without it has failed,
//! whatever else it printed.
//!
//! The reader is strict: a line that begins with `{` and is damaged, or lacks
//! a member that its kind must have (`kinds`), is a fault with its line
//! number. Kinds that are not listed pass, so that an app may add its own;
//! `docs/serial-protocol.md` and the pages that it names describe the listed ones for
//! people.

mod kinds;

use std::fmt;

use crate::json::{self, Value};
use kinds::kinds;

/// A machine line that was understood.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineLine {
    /// The line's number in the log, counted from 1.
    pub number: usize,
    /// What it reports.
    pub kind: String,
    /// The whole object, `kind` included.
    pub value: Value,
    /// The line as it was printed.
    pub text: String,
}

impl MachineLine {
    /// Returns the unsigned number at a path such as `join_latency_ns.max`.
    #[must_use]
    pub fn number_at(&self, path: &str) -> Option<u64> {
        let names: Vec<&str> = path.split('.').collect();
        self.value.at(&names).and_then(Value::as_u64)
    }

    /// Returns the string member `name`.
    #[must_use]
    pub fn text_at(&self, name: &str) -> Option<&str> {
        self.value.get(name).and_then(Value::as_text)
    }
}

/// A line that looks like a machine line and is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProtocolError {
    /// The line's number in the log, counted from 1.
    pub number: usize,
    /// What is wrong with it.
    pub message: String,
}

impl fmt::Display for ProtocolError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "serial line {}: {}", self.number, self.message)
    }
}

impl std::error::Error for ProtocolError {}

/// What a guest says of its own run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// All is well.
    Success,
    /// Something went wrong.
    Failure,
    /// The guest's command line was refused.
    Usage,
}

/// The last line of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// What the guest says of its run.
    pub status: Status,
    /// Why, in words; may be empty.
    pub reason: String,
}

/// A serial log taken apart.
#[derive(Clone, Debug, Default)]
pub struct Transcript {
    /// The machine lines in their order.
    pub machine: Vec<MachineLine>,
    /// The damaged ones.
    pub faults: Vec<ProtocolError>,
    /// The number of the last line that is not blank.
    last_line: usize,
}

impl Transcript {
    /// Takes a whole log apart.
    #[must_use]
    pub fn read(log: &str) -> Transcript {
        let mut transcript = Transcript::default();
        for (index, line) in log.lines().enumerate() {
            let number = index + 1;
            if !line.trim().is_empty() {
                transcript.last_line = number;
            }
            match read_line(number, line) {
                None => {}
                Some(Ok(machine)) => transcript.machine.push(machine),
                Some(Err(fault)) => transcript.faults.push(fault),
            }
        }
        transcript
    }

    /// Returns the lines of one kind in their order.
    pub fn of_kind<'t>(&'t self, kind: &'t str) -> impl Iterator<Item = &'t MachineLine> {
        self.machine.iter().filter(move |line| line.kind == kind)
    }

    /// Returns the verdict.
    ///
    /// # Errors
    ///
    /// In words: there is none, there are several, it is not the last line,
    /// or its status is not one of `success`, `failure`, `usage`.
    pub fn verdict(&self) -> Result<Verdict, String> {
        let mut verdicts = self.of_kind("verdict");
        let line = verdicts.next().ok_or("the guest printed no verdict line")?;
        if let Some(second) = verdicts.next() {
            return Err(format!(
                "there are two verdict lines, {} and {}",
                line.number, second.number
            ));
        }
        if line.number != self.last_line {
            return Err(format!(
                "the verdict stands in line {}, but the log goes on to line {}",
                line.number, self.last_line
            ));
        }
        let status = match line.text_at("status") {
            Some("success") => Status::Success,
            Some("failure") => Status::Failure,
            Some("usage") => Status::Usage,
            _ => return Err(format!("the verdict's status is unknown: {}", line.text)),
        };
        let reason = line.text_at("reason").unwrap_or_default().to_string();
        Ok(Verdict { status, reason })
    }
}

/// Returns what the guest has written of a line. A terminal's line end is no part of it, nor
/// is what a firmware has left there, which ends in a carriage return.
#[must_use]
pub fn written(line: &str) -> &str {
    let line = line.trim_end_matches(['\r', '\n']);
    line.rsplit_once('\r').map_or(line, |(_, own)| own)
}

/// Reads one line of a log; `None` if it is a line for people.
///
/// # Errors
///
/// The line begins with `{` and is no valid machine line.
#[must_use]
pub fn read_line(number: usize, line: &str) -> Option<Result<MachineLine, ProtocolError>> {
    let line = written(line);
    line.starts_with('{').then(|| {
        let fault = |message| ProtocolError { number, message };
        let value = json::parse(line).map_err(|error| fault(error.to_string()))?;
        let kind = value.get("kind").and_then(Value::as_text);
        let kind = kind.ok_or_else(|| fault("a machine line without a text `kind`".into()))?;
        if let Some(missing) = missing_member(kind, &value) {
            return Err(fault(format!(
                "a line of kind `{kind}` without `{missing}`"
            )));
        }
        Ok(MachineLine {
            number,
            kind: kind.to_string(),
            text: line.to_string(),
            value,
        })
    })
}

fn missing_member(kind: &str, value: &Value) -> Option<&'static str> {
    let (_, members) = kinds().find(|(name, _)| *name == kind)?;
    members.split(' ').find(|member| {
        let path: Vec<&str> = member.split('.').collect();
        value.at(&path).is_none()
    })
}

#[cfg(test)]
mod tests {
    use super::{Status, Transcript, kinds};

    const GOOD: &str = "\
hello {\r
error: no video\r{\"kind\":\"progress\",\"done\":1,\"total\":2}\r
 {\"kind\":\"indented, so not for machines\"}
{\"kind\":\"own\",\"x\":{\"y\":7}}
{\"kind\":\"verdict\",\"status\":\"success\",\"reason\":\"all is well\"}

";

    #[test]
    fn a_log_is_taken_apart() {
        let transcript = Transcript::read(GOOD);
        assert!(transcript.faults.is_empty());
        let numbers: Vec<_> = transcript.machine.iter().map(|line| line.number).collect();
        assert_eq!(numbers, [2, 4, 5]);
        let own = transcript.of_kind("own").next().unwrap();
        assert_eq!(own.number_at("x.y"), Some(7));
        assert_eq!(own.number_at("x.z"), None);
        let verdict = transcript.verdict().unwrap();
        assert_eq!(verdict.status, Status::Success);
        assert_eq!(verdict.reason, "all is well");
    }

    #[test]
    fn a_verdict_must_be_there_once_and_last() {
        let line = GOOD.lines().nth(4).unwrap();
        let verdict = |log: &str| Transcript::read(log).verdict().unwrap_err();
        assert_eq!(verdict("hello\n"), "the guest printed no verdict line");
        assert_eq!(
            verdict(&format!("{line}\n{line}\n")),
            "there are two verdict lines, 1 and 2"
        );
        assert_eq!(
            verdict(&format!("{line}\nlate words\n")),
            "the verdict stands in line 1, but the log goes on to line 2"
        );
        let strange = line.replace("success", "perhaps");
        assert!(verdict(&strange).starts_with("the verdict's status is unknown: {"));
    }

    #[test]
    fn a_damaged_line_is_named_by_its_number() {
        let log = r#"ok
{"kind":"progress","done":1
{"done":1}
{"kind":"progress","done":1}
{"kind":"fork_join"}
"#;
        let faults = Transcript::read(log).faults;
        let faults: Vec<String> = faults.iter().map(ToString::to_string).collect();
        let expected = "\
serial line 2: column 28: the line ends where `,` or `}` must stand
serial line 3: a machine line without a text `kind`
serial line 4: a line of kind `progress` without `total`
serial line 5: a line of kind `fork_join` without `subtasks`";
        assert_eq!(faults.join("\n"), expected);
    }

    #[test]
    fn the_documents_describe_every_kind_and_member() {
        let document = concat!(
            include_str!("../../../../docs/serial-protocol.md"),
            include_str!("../../../../docs/app-lines.md"),
            include_str!("../../../../docs/trace-format.md"),
        );
        for (kind, members) in kinds() {
            let heading = format!("\n### `{kind}`");
            let section = document.split(&heading).nth(1);
            let section = section.unwrap_or_else(|| panic!("no section `{kind}`"));
            let section = section.split("\n### ").next().unwrap();
            for member in members.split(' ').flat_map(|path| path.split('.').take(1)) {
                let named = section.contains(&format!("`{member}`"));
                assert!(named, "section `{kind}` does not name `{member}`");
            }
        }
    }
}
