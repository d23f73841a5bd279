//! The count of everything that ran, failed, or could not run.

use std::fmt;

/// The count, and the names behind it.
#[derive(Debug, Default)]
pub struct Tally {
    passed: u64,
    failures: Vec<String>,
    skips: Vec<String>,
}

impl Tally {
    /// Counts one test or check and says on standard output how it went.
    pub fn add(&mut self, name: &str, result: Result<(), String>) {
        match result {
            Ok(()) => {
                println!("{name}: ok");
                self.passed += 1;
            }
            Err(why) => {
                println!("{name}: FAILED: {why}");
                self.fail(name, &why);
            }
        }
    }

    /// Counts tests that passed.
    pub fn pass(&mut self, tests: u64) {
        self.passed += tests;
    }

    /// Counts a failure.
    pub fn fail(&mut self, name: &str, why: &str) {
        let first = why.lines().next().unwrap_or_default();
        self.failures.push(format!("{name}: {first}"));
    }

    /// Counts something that could not run.
    pub fn skip(&mut self, name: &str, why: &str) {
        self.skips.push(format!("{name}: {why}"));
    }

    /// Returns the number of failures.
    #[must_use]
    pub fn failed(&self) -> usize {
        self.failures.len()
    }

    /// Returns whether anything passed or failed, rather than being skipped.
    #[must_use]
    pub fn has_run(&self) -> bool {
        self.passed > 0 || !self.failures.is_empty()
    }

    /// Returns whether nothing was counted at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
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
        write!(f, "{} passed, {} failed", self.passed, self.failures.len())?;
        match self.skips.len() {
            0 => writeln!(f),
            skipped => writeln!(f, ", {skipped} skipped"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tally;

    #[test]
    fn the_last_line_counts_and_the_reasons_stand_above() {
        let mut tally = Tally::default();
        assert!(tally.is_empty());
        tally.pass(12);
        assert!(!tally.is_empty());
        assert_eq!(tally.to_string(), "\n12 passed, 0 failed\n");
        tally.fail("a::b", "left is not right\nmore");
        tally.skip("c", "there is no /dev/kvm");
        assert_eq!(
            tally.to_string(),
            "\nskipped: c: there is no /dev/kvm\nfailed: a::b: left is not right\n\
             12 passed, 1 failed, 1 skipped\n"
        );
    }
}
