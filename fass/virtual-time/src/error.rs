//! Why a run could not go on.

use std::error::Error;
use std::fmt;

use sched_dag::{DagLabel, SubtaskLabel};

use crate::report::Report;

/// Why a run in virtual time ended early, or could not begin.
///
/// ```
/// use virtual_time::{RunError, VirtualTime};
///
/// let machine = VirtualTime::new(); // and nothing is committed
/// assert!(matches!(machine.try_run(), Err(RunError::NothingToRun)));
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub enum RunError {
    /// Nothing has been committed on this thread since the machine was made, or
    /// an earlier run has failed.
    NothingToRun,
    /// A run to the end was asked for, but this DAG has no end.
    Endless {
        /// The DAG.
        dag: DagLabel,
    },
    /// A subtask's function panicked, and the machine was not told to
    /// [contain](crate::VirtualTime::contain_panics) that. No function runs
    /// after it.
    Panicked {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The job.
        job: u64,
        /// The panic's message.
        message: String,
        /// What happened up to the panic.
        report: Box<Report>,
    },
    /// A job of a DAG was asked for that is not in the commit.
    NoSuchDag {
        /// The name.
        name: String,
        /// Those that are there.
        there: String,
    },
    /// An instance would finish after `u64::MAX` nanoseconds.
    TimeOverflow {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The job.
        job: u64,
    },
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingToRun => f.write_str(
                "there is nothing to run; commit DAGs on this thread after making the `VirtualTime`",
            ),
            Self::Endless { dag } => write!(
                f,
                "{dag} has no limit of jobs, so its run has no end; set `jobs` or use `run_for`"
            ),
            Self::Panicked {
                dag,
                subtask,
                job,
                message,
                ..
            } => write!(f, "{subtask} of {dag} panicked in job {job}: {message}"),
            Self::NoSuchDag { name, there } => {
                write!(f, "there is no dag `{name}`; there are {there}")
            }
            Self::TimeOverflow { dag, subtask, job } => write!(
                f,
                "{subtask} of {dag} would finish job {job} after {} ns, the last time there is; \
                 execute for less",
                u64::MAX
            ),
        }
    }
}

impl Error for RunError {}
