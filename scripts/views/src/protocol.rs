//! The serial protocol on the host's side: the only reader of a guest's output.
//!
//! A *machine line* begins with `{` in column 0 and is a JSON object with a text member `kind`;
//! every other line is for people. A [`Transcript`] is a whole serial log, split into both. The
//! last line of every run is the *verdict*, a machine line of kind `verdict`; a run without a
//! verdict has failed, whatever else the run printed.
//!
//! The reader is strict: a line beginning with `{` is a fault, reported with its line number, if
//! the line is damaged or lacks a required member of its kind. The page that describes the kinds
//! for people also tells the reader which members are required. A kind without a section on the
//! page passes, so an app may add kinds of its own.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::json::{self, Value};

/// The page about the kinds of machine lines, with a section for each kind and a table of the
/// kind's members.
const PAGE: &str = include_str!("../../../docs/formats.md");

/// The members of each line of a kind: from all rows of the kind's section whose first cell does
/// not call them optional.
static MEMBERS: LazyLock<BTreeMap<&str, Vec<&str>>> = LazyLock::new(|| {
    let sections = PAGE.split("\n#");
    let kinds = sections.filter_map(|section| section.strip_prefix("## `")?.split_once('`'));
    let members = |text: &'static str| {
        let rows = text.lines();
        let cells = rows.filter_map(|row| row.strip_prefix("| `")?.split(" |").next());
        // An optional member may be missing from a line, so its absence is no damage.
        let certain = cells.filter(|cell| !cell.ends_with(", optional"));
        certain
            // One row may describe several members, each in backquotes: every second piece is a
            // name.
            .flat_map(|cell| cell.split('`').step_by(2))
            .collect()
    };
    kinds.map(|(kind, text)| (kind, members(text))).collect()
});

/// A machine line, understood.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineLine {
    /// The line's number in the log, counted from 1.
    pub number: usize,
    /// The kind of report, from the member `kind`.
    pub kind: String,
    /// The whole object, `kind` included.
    pub value: Value,
    /// The line as printed.
    pub text: String,
}

impl MachineLine {
    /// Returns the unsigned number at a path such as `join_latency_ns.max`.
    pub fn number_at(&self, path: &str) -> Option<u64> {
        let names: Vec<&str> = path.split('.').collect();
        self.value.at(&names).and_then(Value::as_u64)
    }

    /// Returns the string member `name`, if there is any.
    pub fn text_at(&self, name: &str) -> Option<&str> {
        self.value.get(name).and_then(Value::as_text)
    }
}

/// A guest's own status of its run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// All is well.
    Success,
    /// Something went wrong.
    Failure,
    /// The guest's command line was refused.
    Usage,
}

/// The last line of a run, or the host's statement in place of a missing line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// The status of the run.
    pub status: Status,
    /// The reason, in one line of words; may be empty.
    pub reason: String,
}

/// A serial log taken apart.
#[derive(Clone, Debug, Default)]
pub struct Transcript {
    /// The machine lines in their order.
    pub machine: Vec<MachineLine>,
    /// The defects of damaged lines, in words, each with the number of its line.
    pub faults: Vec<String>,
    /// The number of the last line that is not blank.
    last_line: usize,
}

impl Transcript {
    /// Reads a whole log.
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
    /// In words: there is no verdict, there are several, the verdict is not the last line, or its
    /// status is none of `success`, `failure`, `usage`.
    pub fn verdict(&self) -> Result<Verdict, String> {
        let mut verdicts = self.of_kind("verdict");
        let line = verdicts.next().ok_or("the guest printed no verdict line")?;
        // A second verdict would let a guest take back a failure.
        if let Some(second) = verdicts.next() {
            return Err(format!(
                "there are two verdict lines, {} and {}",
                line.number, second.number
            ));
        }
        // Lines after the verdict show that the guest went on, so the verdict was not its end.
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

/// Returns the part of a line printed by the guest: without the line end, and without the remains
/// of a firmware's output before the last carriage return.
pub fn written(line: &str) -> &str {
    let line = line.trim_end_matches(['\r', '\n']);
    line.rsplit_once('\r').map_or(line, |(_, own)| own)
}

/// Reads one line of a log; `None` if it is a line for people.
///
/// # Errors
///
/// In words, with the line's number: the line begins with `{` and is no valid machine line.
pub fn read_line(number: usize, line: &str) -> Option<Result<MachineLine, String>> {
    let line = written(line);
    line.starts_with('{').then(|| {
        let fault = |message: &str| format!("serial line {number}: {message}");
        let value = json::parse(line).map_err(|error| fault(&error.to_string()))?;
        let kind = value.get("kind").and_then(Value::as_text);
        let kind = kind.ok_or_else(|| fault("a machine line without a text `kind`"))?;
        if let Some(missing) = missing_member(kind, &value) {
            let without = format!("a line of kind `{kind}` without `{missing}`");
            return Err(fault(&without));
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
    let mut members = MEMBERS.get(kind)?.iter();
    members.find(|member| value.get(member).is_none()).copied()
}

#[cfg(test)]
mod tests {
    use super::{MEMBERS, Status, Transcript};

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
        let expected = "\
serial line 2: column 28: the line ends where `,` or `}` must stand
serial line 3: a machine line without a text `kind`
serial line 4: a line of kind `progress` without `total`
serial line 5: a line of kind `fork_join` without `subtasks`";
        assert_eq!(faults.join("\n"), expected);
    }

    #[test]
    fn the_members_of_a_kind_are_those_that_its_page_has() {
        assert_eq!(MEMBERS["panic"], ["cpu", "place", "message"]);
        assert_eq!(MEMBERS["dag_sink"][..3], ["set", "dag", "sink"]);
        assert_eq!(MEMBERS["trace_check"][..2], ["file", "run"]);
        assert!(!MEMBERS.contains_key("of_an_app_of_ones_own"));
    }
}
