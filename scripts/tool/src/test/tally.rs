//! The count of everything that ran, failed, or could not run.

use std::collections::BTreeSet;
use std::fmt;
use std::time::{Duration, Instant};

/// How many parts are shown with the time that they took.
const SHOWN_PARTS: usize = 12;

/// The count, and the names behind it.
#[derive(Debug, Default)]
pub struct Tally {
    passed: u64,
    failures: Vec<String>,
    skips: Vec<String>,
    parts: Vec<(String, Duration)>,
    blessed: BTreeSet<String>,
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

    /// Runs a test or check, counts it, and notes how long it took.
    pub fn run(&mut self, name: &str, check: impl FnOnce() -> Result<(), String>) {
        let start = Instant::now();
        let result = check();
        self.took(name, start.elapsed());
        self.add(name, result);
    }

    /// Notes how long a part took.
    pub fn took(&mut self, part: &str, time: Duration) {
        self.parts.push((part.into(), time));
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

    /// Notes the files of a list, a line each, as rewritten.
    pub fn bless(&mut self, list: &str) {
        self.blessed.extend(list.lines().map(String::from));
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
        self.write_times(f)?;
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

impl Tally {
    /// Writes the parts that took longest, and the sum of all.
    fn write_times(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts: Vec<_> = self.parts.iter().collect();
        parts.sort_by_key(|(_, time)| std::cmp::Reverse(*time));
        let (shown, rest) = parts.split_at(parts.len().min(SHOWN_PARTS));
        let sum = |parts: &[&(String, Duration)]| parts.iter().map(|(_, time)| *time).sum();
        let mut line = |time: Duration, part: &str| {
            let seconds = time.as_secs_f64();
            writeln!(f, "{seconds:>8.1} s  {part}")
        };
        for (part, time) in shown {
            line(*time, part)?;
        }
        if !rest.is_empty() {
            line(sum(rest), &format!("{} other parts", rest.len()))?;
        }
        if parts.len() > 1 {
            line(sum(&parts), "all parts")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{SHOWN_PARTS, Tally};
    use std::time::Duration;

    #[test]
    fn the_longest_parts_are_shown_and_the_others_summed() {
        let mut tally = Tally::default();
        for (part, ms) in (0..SHOWN_PARTS + 2).zip((0..).step_by(100)) {
            tally.took(&format!("part {part}"), Duration::from_millis(ms));
        }
        tally.run("a check", || Err("left is not right".into()));
        let text = tally.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "     1.3 s  part 13");
        let [last, others, all] = [0, 1, 2].map(|after| lines[SHOWN_PARTS + after]);
        assert_eq!(last, "     0.2 s  part 2");
        assert_eq!(others, "     0.1 s  3 other parts");
        assert_eq!(all, "     9.1 s  all parts");
        assert_eq!(lines.last(), Some(&"0 passed, 1 failed"));
    }

    #[test]
    fn the_last_line_counts_and_the_reasons_stand_above() {
        let mut tally = Tally::default();
        assert!(tally.is_empty());
        tally.pass(12);
        assert!(!tally.is_empty());
        assert_eq!(tally.to_string(), "\n12 passed, 0 failed\n");
        tally.fail("a::b", "left is not right\nmore");
        tally.skip("c", "there is no /dev/kvm");
        tally.bless("b.md\na.md\nb.md\n");
        let expected = "\nskipped: c: there is no /dev/kvm\nfailed: a::b: left is not right\n\
                        blessed: a.md; read `git diff`\nblessed: b.md; read `git diff`\n\
                        12 passed, 1 failed, 1 skipped\n";
        assert_eq!(tally.to_string(), expected);
    }
}
