//! Reasons for refusing a commit, in words.
//!
//! Every fault states a fact, names the offender, and gives a remedy. The faults of the graph
//! itself are [`sched_dag::DagFault`]s; most of the other faults are visible only to this crate:
//! the shape of functions, durations, parts such as devices, the platform.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt::{self, Display};
use core::time::Duration;

use sched_dag::analysis::{NotProvenReason, TableFault, TaskError};
use sched_dag::wcets::WcetFault;
use sched_dag::{DagId, DagLabel, SubtaskId, SubtaskLabel, TaskSet, Warning, worded};

use crate::platform::LaunchError;

worded! {
    /// A reason for refusing a commit.
    ///
    /// # Examples
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::commit::Fault;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// # let machine = virtual_time::VirtualTime::new();
    /// let dag = create_dag();
    /// dag.name("demo");
    /// dag.register_periodic_subtask(
    ///     || (1, 2),
    ///     vec!["numbers"], // one topic for two results
    ///     Duration::from_millis(10),
    ///     SubtaskAttributes::named("source"),
    /// );
    /// dag.register_sink_subtask(
    ///     |(_,): (i32,)| (),
    ///     ["numbers"],
    ///     Duration::from_millis(10),
    ///     SubtaskAttributes::named("sink"),
    /// );
    /// let error = finish_create_dags(&[dag]).unwrap_err();
    /// let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
    /// assert_eq!(codes, ["output_arity"]);
    /// ```
    pub enum Fault {
        /// No platform is installed to schedule the DAGs.
        NoPlatform = "no_platform",
            "no platform is installed that could run the DAGs; boot the kernel, or make a \
             `virtual_time::VirtualTime` first";
        /// The same DAG occurs twice in one commit.
        GivenTwice { dag: DagLabel } = "given_twice",
            "{dag} is given twice in one commit; give it once";
        /// The DAG was committed before.
        AlreadyCommitted { dag: DagLabel } = "already_committed",
            "{dag} is committed already; build a new DAG and commit that";
        /// A function takes `expected` inputs, but its list names `given` topics.
        InputArity { dag: DagLabel, subtask: SubtaskLabel, expected: usize, given: usize } =
            "input_arity",
            "{subtask} of {dag} takes {} but lists {}; list one topic for each element of its \
             argument tuple", CountedNoun(*expected, "input"), CountedNoun(*given, "input topic");
        /// A function returns `expected` outputs, but its list names `given` topics.
        OutputArity { dag: DagLabel, subtask: SubtaskLabel, expected: usize, given: usize } =
            "output_arity",
            "{subtask} of {dag} returns {} but lists {}; list one topic for each element of its \
             result tuple", CountedNoun(*expected, "output"), CountedNoun(*given, "output topic");
        /// A duration, of a DAG or of one of its subtasks, does not fit into 64 bits of nanoseconds
        /// (584 years); `what` names the kind of duration.
        DurationTooLong { dag: DagLabel, subtask: Option<SubtaskLabel>, what: &'static str } =
            "duration_too_long",
            "the {what} of {}{dag} is too long; give at most {} ns", part(subtask), u64::MAX;
        /// A source states a period, in nanoseconds, other than the period given before by another
        /// source or by [`Dag::period`](crate::Dag::period); `subtask` is this source.
        PeriodsDiffer { dag: DagLabel, subtask: SubtaskLabel, first_ns: u64, second_ns: u64 } =
            "periods_differ",
            "{subtask} gives {dag} a period of {:?} where {:?} were given before; a DAG has one \
             period, make two DAGs or give the same period",
            Duration::from_nanos(*second_ns), Duration::from_nanos(*first_ns);
        /// A source of a sporadic DAG states a period, before or after the DAG was made sporadic;
        /// `subtask` is this source.
        ActivationsDiffer { dag: DagLabel, subtask: SubtaskLabel } = "activations_differ",
            "{subtask} has a period, and its {dag} is sporadic, released by a signal; make two \
             DAGs, or leave one of the two out";
        /// The file of observed WCETs does not fit the DAG.
        WcetsRefused { dag: DagLabel, fault: WcetFault } = "wcets_refused", "{fault}: {dag}";
        /// A part of a DAG is at fault, such as a signal, a device or a mode.
        Worded { code: &'static str, text: String } = of *code, "{text}";
        /// The commit has to divide the cores, and a DAG gets none, or lists of cores are stated.
        NotAssigned(error: LaunchError) = "not_assigned", "{error}";
        /// A certificate fixes the set, but something may change the running DAGs.
        NotFixed = "not_fixed",
            "a certificate fixes the set, but a subtask may pause a DAG, enter a mode or end the run, \
             or a DAG starts paused; leave that out, or the certificate";
        /// The DAG demands a proof of meeting its deadlines, and there is none; `unproven` has the
        /// reason. Reported only if there are no faults other than missing proofs.
        NotProven { dag: DagLabel, unproven: UnprovenDag } = "not_proven",
            "{dag} demands a proof that it meets its deadlines, and there is none: {unproven}";
        /// The graph or its attributes are at fault.
        Model(fault: sched_dag::DagFault) = of fault.code(), "{fault}";
        /// The platform did not take the verified plan.
        NotLaunched(error: LaunchError) = "not_launched",
            "the platform did not take the plan: {error}";
    }
}

/// Returns the part of a DAG at fault, or an empty text for the DAG itself.
fn part(subtask: &Option<SubtaskLabel>) -> impl Display {
    fmt::from_fn(move |f| match subtask {
        Some(subtask) => write!(f, "{subtask} of "),
        None => Ok(()),
    })
}

/// The reason why a DAG is not proven to meet its deadlines, with names.
///
/// Its `Display` states the fact and the remedy.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::commit::Verdict;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// dag.register_periodic_subtask(|| (1,), ["number"], period, SubtaskAttributes::named("source"));
/// dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, SubtaskAttributes::named("sink"));
///
/// let commit = finish_create_dags(&[dag]).unwrap();
/// let Verdict::NotProven(unproven) = &commit.answers()[0].verdict else {
///     panic!("nothing is known about its execution times");
/// };
/// assert_eq!(
///     unproven.to_string(),
///     "no WCET above 0 is given for subtask `source`, subtask `sink`; give every subtask one \
///      to have the DAG analysed"
/// );
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnprovenDag {
    reason: NotProvenReason,
    /// The subtasks the reason is about.
    subtasks: Vec<SubtaskLabel>,
    /// The other DAG the reason is about.
    other: Option<DagLabel>,
    /// The lock the reason is about.
    lock: String,
}

impl UnprovenDag {
    /// Returns the reason in a form that a program can decide by.
    pub const fn reason(&self) -> NotProvenReason {
        self.reason
    }

    /// Reports whether deadlines are certain to be missed when every instance takes its WCET,
    /// rather than merely not proven to be met.
    pub const fn is_certain(&self) -> bool {
        self.reason.is_certain()
    }

    pub(crate) fn new(task_set: &TaskSet, dag: DagId, reason: NotProvenReason) -> Self {
        let subtasks = match reason {
            NotProvenReason::Unknown(TaskError::MissingWcet { .. }) => {
                let subtasks = (0..).map(SubtaskId).zip(task_set.dag(dag).subtasks());
                let lacking = subtasks.filter(|(_, subtask)| subtask.wcet_ns().unwrap_or(0) == 0);
                lacking.map(|(id, _)| id).collect()
            }
            NotProvenReason::SubtaskBeyondPeriod { subtask }
            | NotProvenReason::NotRight(TableFault { subtask, .. })
            | NotProvenReason::LateInTable { subtask, .. }
            | NotProvenReason::UnboundedLock { subtask, .. } => vec![subtask],
            NotProvenReason::PathBeyondDeadline { sink, .. }
            | NotProvenReason::NoSinkBound { sink } => vec![sink],
            _ => Vec::new(),
        };
        let labels = subtasks.into_iter();
        let other = match reason {
            NotProvenReason::DelayedBy { dag }
            | NotProvenReason::NotRight(TableFault { dag, .. })
            | NotProvenReason::UnboundedLock { dag, .. } => Some(dag),
            _ => None,
        };
        let of = other.unwrap_or(dag);
        let unbounded = task_set.dag(of).unbounded_lock();
        Self {
            reason,
            subtasks: labels.map(|id| task_set.subtask_label(of, id)).collect(),
            other: other.map(|other| task_set.label(other)),
            lock: unbounded.map_or(String::new(), |of| of.lock.clone()),
        }
    }
}

/// The greatest number of subtasks without a WCET listed by name; the others are counted.
const MOST_NAMED: usize = 8;

impl fmt::Display for UnprovenDag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.reason, &self.subtasks[..], &self.other) {
            (NotProvenReason::Unknown(TaskError::MissingWcet { .. }), [first, others @ ..], _) => {
                write!(f, "no WCET above 0 is given for {first}")?;
                let (named, more) = others.split_at(others.len().min(MOST_NAMED - 1));
                named.iter().try_for_each(|other| write!(f, ", {other}"))?;
                if !more.is_empty() {
                    write!(f, " and {} more", more.len())?;
                }
                f.write_str("; give every subtask one to have the DAG analysed")
            }
            (NotProvenReason::SubtaskBeyondPeriod { .. }, [subtask, ..], _) => write!(
                f,
                "{subtask} alone takes more than a period; split it or lengthen the period"
            ),
            (NotProvenReason::UnboundedLock { .. }, [subtask, ..], Some(dag)) => write!(
                f,
                "{subtask} of {dag} enters lock `{}`, which has no longest section, and keeps what \
                 shares its cores waiting there; state one by `Lock::longest`",
                self.lock
            ),
            (NotProvenReason::NotRight(fault), [subtask, ..], Some(dag)) => write!(
                f,
                "its table is not right: {subtask} of {dag}, in job {} of the first lap, {}; change \
                 the lists, or state them without times",
                fault.job, fault.condition
            ),
            (NotProvenReason::LateInTable { bound_ns, .. }, [subtask, ..], _) => write!(
                f,
                "in its table {subtask} ends up to {:?} after the release, which is too late; start it \
                 earlier in its list, or relax the deadline",
                Duration::from_nanos(*bound_ns)
            ),
            (NotProvenReason::PathBeyondDeadline { length_ns, .. }, [sink, ..], _) => write!(
                f,
                "the longest path to {sink} alone takes {:?}, which is more than the relative \
                 deadline of that sink; shorten the path or relax the deadline",
                Duration::from_nanos(*length_ns)
            ),
            (NotProvenReason::NoSinkBound { .. }, [sink, ..], _) => write!(
                f,
                "no test bounds the response time of {sink} by the relative deadline of that sink \
                 (it may still meet it); add cores or relax the deadline"
            ),
            (NotProvenReason::DelayedBy { .. }, _, Some(other)) => write!(
                f,
                "{other}, which may delay it, is not proven itself; see to that one first"
            ),
            (reason, _, _) => reason.fmt(f),
        }
    }
}

/// The error of a refused commit: all its faults, and the warnings.
///
/// Its `Display` prints one line for each fault; with more than 20 faults, the first 20 and the
/// number of the others.
///
/// # Examples
///
/// ```
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = fass::create_dag(); // empty
/// let error = fass::finish_create_dags(&[dag]).unwrap_err();
/// for fault in error.faults() {
///     println!("{}: {fault}", fault.code());
/// }
/// assert_eq!(error.to_string().lines().count(), error.faults().len());
/// ```
#[derive(Clone, Debug)]
pub struct CommitError {
    pub(crate) faults: Vec<Fault>,
    pub(crate) warnings: Vec<Warning>,
}

impl CommitError {
    pub(crate) fn of(fault: Fault, warnings: Vec<Warning>) -> Self {
        let faults = Vec::from([fault]);
        Self { faults, warnings }
    }

    /// Returns the faults, at least one.
    ///
    /// ```
    /// # let machine = virtual_time::VirtualTime::new();
    /// let error = fass::finish_create_dags(&[fass::create_dag()]).unwrap_err();
    /// assert!(!error.faults().is_empty());
    /// ```
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns the warnings. They alone would not have refused the commit.
    ///
    /// ```
    /// # let machine = virtual_time::VirtualTime::new();
    /// let error = fass::finish_create_dags(&[fass::create_dag()]).unwrap_err();
    /// assert!(error.warnings().is_empty());
    /// ```
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
}

impl fmt::Display for CommitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        sched_dag::write_faults(&self.faults, f)
    }
}

impl core::error::Error for CommitError {}

/// A number of things, in the singular or the plural.
pub(crate) struct CountedNoun(pub(crate) usize, pub(crate) &'static str);

impl fmt::Display for CountedNoun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(number, thing) = self;
        let plural = if *number == 1 { "" } else { "s" };
        write!(f, "{number} {thing}{plural}")
    }
}
