//! What can be wrong with a commit, in words.
//!
//! Every fault states a fact, names the offender, and says what to do. The
//! faults of the graph itself are [`sched_dag::Fault`]s; the ones here can only
//! be seen from this side: the shape of functions, durations, the platform.

use alloc::string::String;
use core::fmt;
use core::time::Duration;

use sched_dag::wcets::WcetFault;
use sched_dag::{DagLabel, SubtaskLabel};

use super::answer::Unproven;
use super::count::Count;
use crate::draft::flaw::{Flaw, WordedFault};
use crate::platform::LaunchError;

/// One reason why a commit was refused.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{Fault, SubtaskAttributes, create_dag, finish_create_dags};
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
///     vec!["numbers"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("sink"),
/// );
/// let error = finish_create_dags(&[dag]).unwrap_err();
/// let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
/// assert_eq!(codes, ["output_arity"]);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// No platform is installed that could schedule the DAGs.
    NoPlatform,
    /// The same DAG stands twice in one commit.
    GivenTwice {
        /// The DAG.
        dag: DagLabel,
    },
    /// The DAG was committed before.
    AlreadyCommitted {
        /// The DAG.
        dag: DagLabel,
    },
    /// A function takes another number of inputs than its list names topics.
    InputArity {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The number of elements of the argument tuple.
        expected: usize,
        /// The number of topics given.
        given: usize,
    },
    /// A function returns another number of outputs than its list names topics.
    OutputArity {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The number of elements of the result tuple.
        expected: usize,
        /// The number of topics given.
        given: usize,
    },
    /// A duration does not fit into 64 bits of nanoseconds (584 years).
    DurationTooLong {
        /// The DAG.
        dag: DagLabel,
        /// The subtask, or `None` if the duration is the DAG's.
        subtask: Option<SubtaskLabel>,
        /// What the duration is for.
        what: &'static str,
    },
    /// Two sources of one DAG state different periods.
    PeriodsDiffer {
        /// The DAG.
        dag: DagLabel,
        /// The subtask that states the second period.
        subtask: SubtaskLabel,
        /// The period stated first, in nanoseconds.
        first_ns: u64,
        /// The other period, in nanoseconds.
        second_ns: u64,
    },
    /// Of two sources of one DAG one is periodic and one sporadic.
    ActivationsDiffer {
        /// The DAG.
        dag: DagLabel,
        /// The source registered second.
        subtask: SubtaskLabel,
    },
    /// The file of observed WCETs does not fit the DAG.
    WcetsRefused {
        /// The DAG.
        dag: DagLabel,
        /// What does not fit.
        fault: WcetFault,
    },
    /// A subtask samples a latest value of a DAG that is not in the commit.
    LatestNotCommitted {
        /// The DAG of the subtask.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The topic.
        topic: String,
    },
    /// A subtask may raise the signal of a DAG that is not in the commit.
    SignalNotCommitted {
        /// The DAG of the subtask.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
    },
    /// A subtask may pause a DAG that is not in the commit.
    SwitchedNotCommitted {
        /// The DAG of the subtask.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
    },
    /// Something is wrong with the modes, or with what enters from outside.
    Worded(WordedFault),
    /// A subtask has a function for after a fault, and a fault ends its DAG.
    ReplacedInVain {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
    },
    /// A DAG goes on after faults, and no subtask has a function for that.
    NothingReplaceable {
        /// The DAG.
        dag: DagLabel,
    },
    /// A subtask that has a function for after a fault uses a state that has no value for
    /// that.
    StateWithoutReset {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The name of the state.
        state: String,
    },
    /// The commit is to find the clusters, and a DAG gets no cores.
    NotAssigned(LaunchError),
    /// The DAG demands a proof that it meets its deadlines, and there is none.
    /// Found only where nothing else is wrong.
    NotProven {
        /// The DAG.
        dag: DagLabel,
        /// Why there is no proof.
        unproven: Unproven,
    },
    /// The graph or its attributes are at fault.
    Model(sched_dag::Fault),
    /// The platform did not take the verified plan.
    NotLaunched(LaunchError),
}

impl Fault {
    /// Returns a stable name of the kind of fault, for machines to read.
    ///
    /// ```
    /// assert_eq!(fass::Fault::NoPlatform.code(), "no_platform");
    /// ```
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoPlatform => "no_platform",
            Self::GivenTwice { .. } => "given_twice",
            Self::AlreadyCommitted { .. } => "already_committed",
            Self::InputArity { .. } => "input_arity",
            Self::OutputArity { .. } => "output_arity",
            Self::DurationTooLong { .. } => "duration_too_long",
            Self::PeriodsDiffer { .. } => "periods_differ",
            Self::ActivationsDiffer { .. } => "activations_differ",
            Self::WcetsRefused { .. } => "wcets_refused",
            Self::LatestNotCommitted { .. } => "latest_not_committed",
            Self::SignalNotCommitted { .. } => "signal_not_committed",
            Self::SwitchedNotCommitted { .. } => "switched_not_committed",
            Self::Worded(fault) => fault.code,
            Self::ReplacedInVain { .. } => "replaced_in_vain",
            Self::NothingReplaceable { .. } => "nothing_replaceable",
            Self::StateWithoutReset { .. } => "state_without_reset",
            Self::NotAssigned(_) => "not_assigned",
            Self::NotProven { .. } => "not_proven",
            Self::Model(fault) => fault.code(),
            Self::NotLaunched(_) => "not_launched",
        }
    }

    /// Makes a fault of a flaw in the registrations of a DAG.
    pub(crate) fn of(flaw: Flaw, dag: DagLabel) -> Self {
        match flaw {
            Flaw::InputArity {
                subtask,
                expected,
                given,
            } => Self::InputArity {
                dag,
                subtask,
                expected,
                given,
            },
            Flaw::OutputArity {
                subtask,
                expected,
                given,
            } => Self::OutputArity {
                dag,
                subtask,
                expected,
                given,
            },
            Flaw::DurationTooLong { subtask, what } => Self::DurationTooLong { dag, subtask, what },
            Flaw::PeriodsDiffer {
                subtask,
                first_ns,
                second_ns,
            } => Self::PeriodsDiffer {
                dag,
                subtask,
                first_ns,
                second_ns,
            },
            Flaw::ActivationsDiffer { subtask } => Self::ActivationsDiffer { dag, subtask },
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoPlatform => f.write_str(
                "no platform is installed that could run the DAGs; boot the kernel, \
                 or make a `virtual_time::VirtualTime` first",
            ),
            Self::GivenTwice { dag } => {
                write!(f, "{dag} is given twice in one commit; give it once")
            }
            Self::AlreadyCommitted { dag } => write!(
                f,
                "{dag} is committed already; build a new DAG and commit that"
            ),
            Self::InputArity {
                dag,
                subtask,
                expected,
                given,
            } => write!(
                f,
                "{subtask} of {dag} takes {} but lists {}; list one topic for each element \
                 of its argument tuple",
                Count(*expected, "input"),
                Count(*given, "input topic"),
            ),
            Self::OutputArity {
                dag,
                subtask,
                expected,
                given,
            } => write!(
                f,
                "{subtask} of {dag} returns {} but lists {}; list one topic for each element \
                 of its result tuple",
                Count(*expected, "output"),
                Count(*given, "output topic"),
            ),
            Self::DurationTooLong { dag, subtask, what } => {
                write!(f, "the {what} of ")?;
                if let Some(subtask) = subtask {
                    write!(f, "{subtask} of ")?;
                }
                write!(f, "{dag} is too long; give at most {} ns", u64::MAX)
            }
            Self::PeriodsDiffer {
                dag,
                subtask,
                first_ns,
                second_ns,
            } => write!(
                f,
                "{subtask} gives {dag} a period of {:?} where {:?} were given before; a DAG has \
                 one period, make two DAGs or give the same period",
                Duration::from_nanos(*second_ns),
                Duration::from_nanos(*first_ns)
            ),
            Self::ActivationsDiffer { dag, subtask } => write!(
                f,
                "{subtask} makes a second source of {dag}, which is released by the clock for one \
                 and by a signal for the other; make two DAGs, or both sources alike"
            ),
            Self::WcetsRefused { dag, fault } => write!(f, "{fault}: {dag}"),
            Self::LatestNotCommitted {
                dag,
                subtask,
                topic,
            } => write!(
                f,
                "{subtask} of {dag} samples the latest value of topic `{topic}`, whose dag is not \
                 in the commit; commit both dags in one call"
            ),
            Self::SignalNotCommitted { dag, subtask } => write!(
                f,
                "{subtask} of {dag} may raise the signal of a dag that is not in the commit; \
                 commit both dags in one call"
            ),
            Self::SwitchedNotCommitted { dag, subtask } => write!(
                f,
                "{subtask} of {dag} may pause a dag that is not in the commit; commit both dags in \
                 one call"
            ),
            Self::Worded(fault) => fault.fmt(f),
            Self::ReplacedInVain { dag, subtask } => write!(
                f,
                "{subtask} of {dag} has another function for after a fault, and a fault ends the \
                 dag; let the dag survive faults by `survive_faults`, or register one function"
            ),
            Self::NothingReplaceable { dag } => write!(
                f,
                "{dag} drops a job at a fault and goes on, and no subtask of it has another function \
                 for that; register one by `restarting` or `falling_back`"
            ),
            Self::StateWithoutReset {
                dag,
                subtask,
                state,
            } => write!(
                f,
                "{subtask} of {dag} has another function for after a fault, and the state `{state}`, \
                 which it uses, no other value; give it one by `reset_to`"
            ),
            Self::NotAssigned(error) => error.fmt(f),
            Self::NotProven { dag, unproven } => write!(
                f,
                "{dag} demands a proof that it meets its deadlines, and there is none: {unproven}"
            ),
            Self::Model(fault) => fault.fmt(f),
            Self::NotLaunched(error) => write!(f, "the platform did not take the plan: {error}"),
        }
    }
}
