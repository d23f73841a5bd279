//! Reads reference files line by line: words, numbers, and their places.
//!
//! Reference files are records of blank-separated words, one record a line; blank lines count but
//! have no meaning. Everything unexpected is a [`Malformed`] with its line number, so a broken file
//! is never taken for a failing implementation.
//!
//! Faults of DAGs from a file are reported in the words of the file, too. The commit speaks to an
//! app's author, of attributes and registrations. A person with a file has keys and records, and
//! does not see faults that only follow from others.

use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::num::IntErrorKind;
use core::str::FromStr;

use sched_dag::{DagFault, RejectedDags, sorted_by_key};

use crate::shown::{is_seen, quoted};

/// The most cores of a machine.
pub const MOST_CORES: u32 = 64;

/// A fault of a reference file, with its line, counted from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Malformed {
    /// The line.
    pub line: usize,
    /// The fact and its remedy, in one line.
    pub reason: String,
}

/// One record.
#[derive(Clone, Debug)]
pub struct Line<'a> {
    /// The line's number, counted from 1.
    pub number: usize,
    /// The first word: the kind of the record.
    pub kind: &'a str,
    /// The other words.
    pub words: Vec<&'a str>,
}

/// The records of a file, one after the other.
#[derive(Clone, Debug)]
pub struct Lines<'a> {
    rest: core::iter::Enumerate<core::str::Lines<'a>>,
    last: usize,
}

impl<'a> Lines<'a> {
    /// Starts at the first line.
    pub fn new(text: &'a str) -> Self {
        Self {
            rest: text.lines().enumerate(),
            last: 0,
        }
    }

    /// Returns the next record, or `None` at the end of the file. A line beginning with `#` is a
    /// remark.
    pub fn next_line(&mut self) -> Option<Line<'a>> {
        for (index, text) in self.rest.by_ref() {
            self.last = index + 1;
            let mut words = text.split_whitespace();
            if let Some(kind) = words.next().filter(|kind| !kind.starts_with('#')) {
                return Some(Line {
                    number: index + 1,
                    kind,
                    words: words.collect(),
                });
            }
        }
        None
    }

    /// Returns the next record if it is of this kind; otherwise leaves the record for the next
    /// call.
    pub fn next_if(&mut self, kind: &str) -> Option<Line<'a>> {
        let mut ahead = self.clone();
        let line = ahead.next_line().filter(|line| line.kind == kind)?;
        *self = ahead;
        Some(line)
    }

    /// Reads `count` `edge` records, between `vertices` vertices.
    ///
    /// # Errors
    ///
    /// [`Malformed`] for another record, or for an edge to a missing vertex.
    pub fn edges(&mut self, count: u32, vertices: usize) -> Result<Vec<(usize, usize)>, Malformed> {
        let mut edges = Vec::new();
        for _ in 0..count {
            let line = self.expect("edge")?;
            let [from, to] = line.fixed()?;
            let end = |word| line.index("subtask", word, vertices);
            edges.push((end(from)?, end(to)?));
        }
        Ok(edges)
    }

    /// Returns the next record, which must be of this kind.
    ///
    /// # Errors
    ///
    /// [`Malformed`] if the record is of another kind, or if there is none.
    pub fn expect(&mut self, kind: &str) -> Result<Line<'a>, Malformed> {
        match self.next_line() {
            Some(line) if line.kind == kind => Ok(line),
            Some(line) => Err(line.malformed(format!(
                "expected a `{kind}` record, found {}",
                quoted(line.kind)
            ))),
            None => Err(self.ended(&format!("a `{kind}` record"))),
        }
    }

    /// Returns the error of a file that ends too early.
    pub fn ended(&self, expected: &str) -> Malformed {
        Malformed {
            line: self.last + 1,
            reason: format!("the file ends where {expected} should be"),
        }
    }
}

/// Reads a file of cases, each begun by one record; `read` reads a case from its first record on.
///
/// # Errors
///
/// [`Malformed`] for another record, for errors of `read`, for a repeated name, and for a file
/// without a case.
pub fn cases<'a, Case>(
    text: &'a str,
    read: impl Fn(&Line<'a>, &mut Lines<'a>) -> Result<Case, Malformed>,
) -> Result<Vec<Case>, Malformed> {
    blocks(text, &["case"], read)
}

/// Works like [`cases`] for a file in which a case may begin with any of these records.
///
/// # Errors
///
/// As [`cases`].
pub fn blocks<'a, Case>(
    text: &'a str,
    kinds: &[&str],
    read: impl Fn(&Line<'a>, &mut Lines<'a>) -> Result<Case, Malformed>,
) -> Result<Vec<Case>, Malformed> {
    let mut lines = Lines::new(text);
    let mut cases = Vec::new();
    let mut names: BTreeMap<&str, usize> = BTreeMap::new();
    while let Some(line) = lines.next_line() {
        if !kinds.contains(&line.kind) {
            let (expected, found) = (kinds.join("` or `"), quoted(line.kind));
            return Err(line.malformed(format!("expected a `{expected}` record, found {found}")));
        }
        cases.push(read(&line, &mut lines)?);
        // Every kind of case has its name first.
        let name = line.words.first().copied().unwrap_or_default();
        if !name.chars().all(is_seen) {
            let reason = format!("case {}: a name must be seen; rename it", quoted(name));
            return Err(line.malformed(reason));
        }
        if let Some(first) = names.insert(name, line.number) {
            let name = quoted(name);
            let reason =
                format!("case {name} stands here twice, first on line {first}; rename one");
            return Err(line.malformed(reason));
        }
    }
    if cases.is_empty() {
        return Err(lines.ended(&format!("a `{}` record", kinds.join("` or `"))));
    }
    Ok(cases)
}

impl Line<'_> {
    /// Returns an error on this line.
    pub fn malformed(&self, reason: impl Into<String>) -> Malformed {
        Malformed {
            line: self.number,
            reason: reason.into(),
        }
    }

    /// Returns the words, whose number must be `count`.
    ///
    /// # Errors
    ///
    /// [`Malformed`] if there are fewer or more.
    pub fn exactly(&self, count: usize) -> Result<&[&str], Malformed> {
        if self.words.len() == count {
            Ok(&self.words)
        } else {
            Err(self.malformed(format!(
                "`{}` takes {count} words, found {}",
                self.kind,
                self.words.len()
            )))
        }
    }

    /// Returns the words. Their number must be the caller's `N`.
    ///
    /// # Errors
    ///
    /// As [`exactly`](Self::exactly).
    pub fn fixed<const N: usize>(&self) -> Result<[&str; N], Malformed> {
        let words = self.exactly(N)?;
        Ok(core::array::from_fn(|place| words[place]))
    }

    /// Reads a number in the range of its type.
    ///
    /// # Errors
    ///
    /// [`Malformed`] if the word is not a number, or the number is too large.
    pub fn number<T: FromStr<Err = core::num::ParseIntError>>(
        &self,
        word: &str,
    ) -> Result<T, Malformed> {
        if !word.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(self.malformed(format!("{} is not a whole number", quoted(word))));
        }
        word.parse().map_err(|error: core::num::ParseIntError| {
            self.malformed(match error.kind() {
                IntErrorKind::PosOverflow => format!("{} is too large here", quoted(word)),
                _ => format!("{} is not a whole number", quoted(word)),
            })
        })
    }

    /// Reads a number of cores.
    ///
    /// # Errors
    ///
    /// As [`number`](Self::number), and if no machine has that many.
    pub fn cores(&self, word: &str) -> Result<u32, Malformed> {
        let cores = self.number(word)?;
        match (1..=MOST_CORES).contains(&cores) {
            true => Ok(cores),
            false => {
                Err(self.malformed(format!("expected 1 to {MOST_CORES} cores, found {cores}")))
            }
        }
    }

    /// Reads a count of items that must not be 0.
    ///
    /// # Errors
    ///
    /// As [`number`](Self::number), and if the count is 0.
    pub fn at_least_one(&self, word: &str) -> Result<u32, Malformed> {
        match self.number(word)? {
            0 => Err(self.malformed(format!("`{}` needs at least 1 here, found 0", self.kind))),
            number => Ok(number),
        }
    }

    /// Reads the number of one of `count` items, called `what` in messages.
    ///
    /// # Errors
    ///
    /// As [`number`](Self::number), and if there is no such item.
    pub fn index(&self, what: &str, word: &str, count: usize) -> Result<usize, Malformed> {
        let number: u64 = self.number(word)?;
        let index = usize::try_from(number).ok().filter(|index| *index < count);
        index.ok_or_else(|| self.malformed(format!("there is no {what} {number}")))
    }

    /// Reads a flag.
    ///
    /// # Errors
    ///
    /// [`Malformed`] if the word is neither 0 nor 1.
    pub fn flag(&self, word: &str) -> Result<bool, Malformed> {
        match word {
            "0" => Ok(false),
            "1" => Ok(true),
            _ => Err(self.malformed(format!("expected 0 or 1, found {}", quoted(word)))),
        }
    }

    /// Reads all words as numbers; there must be `count`.
    ///
    /// # Errors
    ///
    /// As [`exactly`](Self::exactly) and [`number`](Self::number).
    pub fn numbers<T: FromStr<Err = core::num::ParseIntError>>(
        &self,
        count: usize,
    ) -> Result<Vec<T>, Malformed> {
        let words = self.exactly(count)?;
        words.iter().map(|word| self.number(word)).collect()
    }
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.reason)
    }
}

impl core::error::Error for Malformed {}

/// Finds the first item equal to an earlier one. Returns both positions, the earlier first.
pub fn repeated<T: Ord>(items: impl IntoIterator<Item = T>) -> Option<(usize, usize)> {
    let items: Vec<T> = items.into_iter().collect();
    let order = sorted_by_key(items.len(), |position| &items[position]);
    let pairs = order.windows(2).map(|pair| (pair[0], pair[1]));
    let equal = pairs.filter(|&(first, second)| items[first] == items[second]);
    equal.min_by_key(|&(_, second)| second)
}

/// Returns the faults a person can mend, each with its message.
pub fn of_file(rejected: &RejectedDags) -> impl Iterator<Item = (&DagFault, String)> {
    let faults = rejected.faults();
    let is_cycle =
        |fault: &DagFault| matches!(fault, DagFault::Cycle { .. } | DagFault::SelfEdge { .. });
    let has_cycle = faults.iter().any(is_cycle);
    // A graph that is one cycle has no ends either; the cycle says all.
    let follows = move |fault: &&DagFault| {
        has_cycle && matches!(fault, DagFault::NoSource { .. } | DagFault::NoSink { .. })
    };
    let news = faults.iter().filter(move |fault| !follows(fault));
    news.map(|fault| (fault, reason(fault)))
}

fn reason(fault: &DagFault) -> String {
    match fault {
        DagFault::TooManyInstances {
            dag,
            in_flight,
            instances,
            limit,
        } => format!(
            "the jobs in flight need {instances} instances, more than the limit of {limit}, and \
             {dag} with {in_flight} jobs in flight needs most; lower its in-flight"
        ),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Lines, repeated};

    #[test]
    fn records_know_their_lines() {
        let mut lines = Lines::new("one 1 2\n\n  two\nthree 18446744073709551616 x\n");
        let one = lines.expect("one").unwrap();
        assert_eq!(one.numbers::<u64>(2).unwrap(), [1, 2]);
        assert_eq!(one.exactly(3).unwrap_err().line, 1);
        assert_eq!(lines.expect("one").unwrap_err().line, 3);
        let three = lines.next_line().unwrap();
        let large = three.number::<u64>(three.words[0]).unwrap_err();
        assert_eq!(
            large.to_string(),
            "line 4: `18446744073709551616` is too large here"
        );
        let word = three.number::<u64>(three.words[1]).unwrap_err();
        assert_eq!(word.to_string(), "line 4: `x` is not a whole number");
        assert_eq!(lines.expect("four").unwrap_err().line, 5);
    }

    #[test]
    fn the_first_that_is_too_many_is_found() {
        assert_eq!(repeated([3, 1, 2]), None);
        assert_eq!(repeated([""; 0]), None);
        assert_eq!(repeated(["b", "a", "b", "a", "b"]), Some((0, 2)));
        assert_eq!(repeated([5, 5, 5]), Some((0, 1)));
    }
}
