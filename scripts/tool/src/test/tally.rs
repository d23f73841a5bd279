//! The count of everything that ran, failed, or could not run.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Instant;

/// Why a check has not passed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Why {
    /// It failed.
    Failed(String),
    /// It could not run.
    Skipped(String),
}

impl From<String> for Why {
    fn from(why: String) -> Why {
        Why::Failed(why)
    }
}

/// Reports that there are no faults, or which there are.
pub(super) fn none_of(faults: Vec<String>) -> Result<(), String> {
    match faults.is_empty() {
        true => Ok(()),
        false => Err(faults.join("; ")),
    }
}

/// The count, and the names behind it.
#[derive(Debug, Default)]
pub(super) struct Tally {
    passed: u64,
    failures: Vec<String>,
    skips: Vec<String>,
    blessed: BTreeSet<String>,
}

impl Tally {
    /// Runs a check, counts it, and says on standard output how it went and how long it took.
    pub(super) fn run(&mut self, name: &str, check: impl FnOnce() -> Result<(), Why>) {
        let start = Instant::now();
        let result = check();
        let seconds = start.elapsed().as_secs_f64();
        match result {
            Ok(()) => {
                println!("{name}: ok in {seconds:.1} s");
                self.passed += 1;
            }
            Err(Why::Failed(why)) => {
                println!("{name}: FAILED: {why}");
                self.fail(name, &why);
            }
            Err(Why::Skipped(why)) => self.skip(name, &why),
        }
    }

    /// Counts tests that passed.
    pub(super) fn pass(&mut self, tests: u64) {
        self.passed += tests;
    }

    /// Counts a failure.
    pub(super) fn fail(&mut self, name: &str, why: &str) {
        let first = why.lines().next().unwrap_or_default();
        self.failures.push(format!("{name}: {first}"));
    }

    /// Counts something that could not run.
    pub(super) fn skip(&mut self, name: &str, why: &str) {
        self.skips.push(format!("{name}: {why}"));
    }

    /// Notes the files of a list, a line each, as rewritten.
    pub(super) fn bless(&mut self, list: &str) {
        self.blessed.extend(list.lines().map(String::from));
    }

    /// Returns whether anything failed.
    pub(super) fn has_failed(&self) -> bool {
        !self.failures.is_empty()
    }

    /// Returns whether anything passed or failed, rather than being skipped.
    pub(super) fn has_run(&self) -> bool {
        self.passed > 0 || self.has_failed()
    }

    /// Returns whether nothing was counted at all.
    pub(super) fn is_empty(&self) -> bool {
        !self.has_run() && self.skips.is_empty()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f)?;
        for skip in &self.skips {
            writeln!(f, "skipped: {skip}")?;
        }
        for failure in &self.failures {
            writeln!(f, "failed: {failure}")?;
        }
        for file in &self.blessed {
            writeln!(f, "blessed: {file}; read `git diff`")?;
        }
        write!(f, "{} passed, {} failed", self.passed, self.failures.len())?;
        match self.skips.len() {
            0 => writeln!(f),
            skipped => writeln!(f, ", {skipped} skipped"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Tally, Why};

    #[test]
    fn the_last_line_counts_and_the_reasons_stand_above() {
        let mut tally = Tally::default();
        assert!(tally.is_empty());
        tally.pass(12);
        assert!(!tally.is_empty());
        assert_eq!(tally.to_string(), "\n12 passed, 0 failed\n");
        tally.run("a check", || Ok(()));
        tally.run("a::b", || Err("left is not right\nmore".to_string().into()));
        tally.run("c", || Err(Why::Skipped("there is no /dev/kvm".into())));
        tally.bless("b.md\na.md\nb.md\n");
        let expected = "\nskipped: c: there is no /dev/kvm\nfailed: a::b: left is not right\n\
                        blessed: a.md; read `git diff`\nblessed: b.md; read `git diff`\n\
                        13 passed, 1 failed, 1 skipped\n";
        assert_eq!(tally.to_string(), expected);
    }
}
