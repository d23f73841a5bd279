//! A guest's output, with a test's queries: a missing line ends in a panic showing the end of the
//! log.

use tool::Outcome;
use tool::trace;
use views::findings::check;
use views::protocol::{MachineLine, Transcript};
use views::record::Run;

/// Queries of a run's output.
pub trait Said {
    /// Returns the output, parsed.
    fn transcript(&self) -> &Transcript;

    /// Returns the end of the output, for a person.
    fn end(&self) -> String;

    /// Returns all lines of a kind.
    fn lines(&self, kind: &str) -> Vec<&MachineLine> {
        let all = self.transcript().machine.iter();
        all.filter(|line| line.kind == kind).collect()
    }

    /// Returns the first line of a kind.
    #[track_caller]
    fn line(&self, kind: &str) -> &MachineLine {
        let first = self.lines(kind).into_iter().next();
        first.unwrap_or_else(|| panic!("no line of kind `{kind}`\n{}", self.end()))
    }

    /// Returns the only line of a kind.
    #[track_caller]
    fn only(&self, kind: &str) -> &MachineLine {
        let count = self.lines(kind).len();
        assert_eq!(count, 1, "lines of kind `{kind}`\n{}", self.end());
        self.line(kind)
    }

    /// Returns the verdict's reason.
    #[track_caller]
    fn reason(&self) -> String {
        let verdict = self.transcript().verdict();
        verdict.expect("it gives a verdict").reason
    }
}

impl Said for Transcript {
    fn transcript(&self) -> &Transcript {
        self
    }

    fn end(&self) -> String {
        let last = self.machine.iter().rev().take(20).rev();
        last.map(|line| format!("{}\n", line.text)).collect()
    }
}

impl Said for Outcome {
    fn transcript(&self) -> &Transcript {
        &self.transcript
    }

    fn end(&self) -> String {
        self.tail()
    }
}

/// Queries of a machine line's members.
pub trait Members {
    /// Returns the number at a path such as `join_latency_ns.max`.
    fn number(&self, path: &str) -> u64;

    /// Returns the text of a member.
    fn member(&self, name: &str) -> &str;

    /// Asserts the values of numbers, each at its path.
    fn has<const COUNT: usize>(&self, numbers: [(&str, u64); COUNT]);

    /// Asserts the values of texts, each by its member's name.
    fn reads<const COUNT: usize>(&self, texts: [(&str, &str); COUNT]);
}

impl Members for MachineLine {
    #[track_caller]
    fn number(&self, path: &str) -> u64 {
        let number = self.number_at(path);
        number.unwrap_or_else(|| panic!("no number `{path}` in {}", self.text))
    }

    #[track_caller]
    fn member(&self, name: &str) -> &str {
        let text = self.text_at(name);
        text.unwrap_or_else(|| panic!("no text `{name}` in {}", self.text))
    }

    #[track_caller]
    fn has<const COUNT: usize>(&self, numbers: [(&str, u64); COUNT]) {
        for (path, number) in numbers {
            assert_eq!(self.number(path), number, "`{path}` in {}", self.text);
        }
    }

    #[track_caller]
    fn reads<const COUNT: usize>(&self, texts: [(&str, &str); COUNT]) {
        for (name, text) in texts {
            assert_eq!(self.member(name), text, "`{name}` in {}", self.text);
        }
    }
}

/// Reads the traces of a log, and checks each run by the rules: nothing is overdue by more than
/// `bound_ns`.
///
/// # Panics
///
/// Panics with the breaches of the rules, or if there is no trace.
#[track_caller]
pub fn lawful_runs(outcome: &Outcome, bound_ns: u64) -> Vec<Run> {
    let runs = trace::read(&outcome.serial);
    let runs = runs.unwrap_or_else(|fault| panic!("{fault}"));
    assert!(!runs.is_empty(), "no trace\n{}", outcome.tail());
    for run in &runs {
        let breaches = check(run, bound_ns).breaches;
        let breaches: Vec<String> = breaches.iter().map(ToString::to_string).collect();
        assert!(breaches.is_empty(), "run {}: {breaches:#?}", run.number);
    }
    runs
}
