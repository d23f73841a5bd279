//! A breach of a rule, in words.
//!
//! The rules are those of the model, R1 to R5, and two that every machine must
//! keep whatever the model says: an instance has one life, and a core runs one
//! instance at a time.

use std::fmt;

/// What was broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// R1: nothing of a job runs before its nominal release.
    Release,
    /// R2: an instance waits for its predecessors in its job, and for its
    /// subtask's instance in the job before.
    Join,
    /// R3: what waits for an instance is released when that has finished, all
    /// at once.
    CompletionBoundary,
    /// R4: a job is complete with its last instance, and its deadline is judged
    /// by that.
    Completion,
    /// R5: the instances with the smallest keys run, and no core idles while
    /// one waits.
    Dispatch,
    /// An instance starts once and finishes once, is suspended and resumed in
    /// turns, and is on one core at a time.
    OneLife,
    /// A core runs one instance at a time.
    OneCore,
}

/// One breach.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// What was broken.
    pub rule: Rule,
    /// When, in nanoseconds since the run's epoch.
    pub time_ns: u64,
    /// Who did what, where, and why it must not be.
    pub text: String,
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Rule::Release => "R1 release",
            Rule::Join => "R2 join",
            Rule::CompletionBoundary => "R3 completion boundary",
            Rule::Completion => "R4 completion",
            Rule::Dispatch => "R5 dispatch",
            Rule::OneLife => "one life",
            Rule::OneCore => "one core",
        })
    }
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {} ns, {}: {}", self.time_ns, self.rule, self.text)
    }
}
