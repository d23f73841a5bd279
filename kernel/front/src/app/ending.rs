//! How an app's function may end, besides well.

use core::fmt;

use alloc::format;
use alloc::string::String;

use fass::CommitError;
use sched_dag::DagId;
use sched_dag::engine::Run;

use crate::options::UsageError;
use crate::report;
use crate::text::json;

/// Why an app ends other than by success.
///
/// ```no_run
/// use kernel::{Ending, options::UsageError};
///
/// let ending = Ending::from(UsageError::new("`jobs=0`: give at least 1"));
/// assert!(matches!(ending, Ending::Usage(_)));
/// assert_eq!(ending.to_string(), "`jobs=0`: give at least 1");
/// ```
#[derive(Debug)]
pub enum Ending {
    /// The command line is wrong; QEMU exits with 37.
    Usage(UsageError),
    /// The DAGs could not be committed; QEMU exits with 35.
    Commit(CommitError),
    /// Something else went wrong, in words; QEMU exits with 35.
    Failure(String),
    /// A person has ended the run, at the console or by ctrl-C; QEMU exits with 33.
    Shutdown,
}

impl Ending {
    /// Tells of a run that a person has ended, and returns how its app ends.
    pub fn after_shutdown(run: &Run) -> Self {
        for (dag, model) in (0..).map(DagId).zip(run.task_set().dags()) {
            report::show_dag(run.snapshot(dag), dag, model, report::print_counts);
        }
        match run.violations().count() {
            0 => Self::Shutdown,
            count => Self::Failure(format!("shut down before its end, with {count} violations")),
        }
    }

    /// Returns a complaint of the kernel's as the ending of an app that ends well, or as a
    /// person wants it. The app's own error takes precedence.
    pub fn or_complaint(result: Result<(), Self>, complaint: Option<String>) -> Result<(), Self> {
        match (result, complaint) {
            (Ok(()) | Err(Self::Shutdown), Some(text)) => Err(Self::Failure(text)),
            (result, _) => result,
        }
    }
}

/// How an app has ended, for the program or the machine that ends with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// Well, or as a person wants it.
    Success,
    /// By a command line that is wrong.
    Usage,
    /// By anything else.
    Failure,
}

/// Prints how the app ended; the verdict is the last line.
pub fn tell(result: &Result<(), Ending>) -> Told {
    // What was said outside of runs.
    report::tell_log(|| None);
    let (told, word) = match result {
        Ok(()) | Err(Ending::Shutdown) => (Told::Success, "success"),
        Err(Ending::Usage(_)) => (Told::Usage, "usage"),
        Err(_) => (Told::Failure, "failure"),
    };
    if let Err(Ending::Commit(error)) = result {
        for fault in error.faults() {
            json::report("commit_fault", |line| {
                line.text("fault", fault.code()).text("message", fault);
            });
        }
    }
    if let Err(ending) = result {
        crate::println!("{ending}");
    }
    json::report("verdict", |line| {
        line.text("status", word);
        if let Err(ending) = result
            && told != Told::Success
        {
            line.text("reason", ending);
        }
    });
    told
}

impl From<UsageError> for Ending {
    fn from(error: UsageError) -> Self {
        Self::Usage(error)
    }
}

impl From<CommitError> for Ending {
    fn from(error: CommitError) -> Self {
        Self::Commit(error)
    }
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(error) => error.fmt(f),
            Self::Commit(error) => error.fmt(f),
            Self::Failure(message) => f.write_str(message),
            Self::Shutdown => f.write_str("shut down before its end"),
        }
    }
}
