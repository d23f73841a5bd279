//! Reasons why a commit is refused, in words.
//!
//! Every fault states a fact, names the offender, and says what to do. The
//! faults of the graph itself are [`sched_dag::Fault`]s; the ones here can only
//! be seen from this side: the shape of functions, durations, the platform.

use alloc::string::String;
use core::fmt::{self, Display};
use core::time::Duration;

use sched_dag::wcets::WcetFault;
use sched_dag::{DagLabel, SubtaskLabel, worded};

use super::answer::Unproven;
use super::count::Count;
use crate::draft::flaw::{Flaw, WordedFault};
use crate::platform::LaunchError;

worded! {
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
    pub enum Fault {
        /// No platform is installed that could schedule the DAGs.
        NoPlatform = "no_platform",
            "no platform is installed that could run the DAGs; boot the kernel, or make a \
             `virtual_time::VirtualTime` first";
        /// The same DAG stands twice in one commit.
        GivenTwice { dag: DagLabel } = "given_twice",
            "{dag} is given twice in one commit; give it once";
        /// The DAG was committed before.
        AlreadyCommitted { dag: DagLabel } = "already_committed",
            "{dag} is committed already; build a new DAG and commit that";
        /// A function takes another number of inputs, `expected`, than its list names
        /// topics, `given`.
        InputArity { dag: DagLabel, subtask: SubtaskLabel, expected: usize, given: usize } =
            "input_arity",
            "{subtask} of {dag} takes {} but lists {}; list one topic for each element of its \
             argument tuple", Count(*expected, "input"), Count(*given, "input topic");
        /// A function returns another number of outputs, `expected`, than its list names
        /// topics, `given`.
        OutputArity { dag: DagLabel, subtask: SubtaskLabel, expected: usize, given: usize } =
            "output_arity",
            "{subtask} of {dag} returns {} but lists {}; list one topic for each element of its \
             result tuple", Count(*expected, "output"), Count(*given, "output topic");
        /// A duration, of a DAG or of one of its subtasks, does not fit into 64 bits of
        /// nanoseconds (584 years); `what` says what it is for.
        DurationTooLong { dag: DagLabel, subtask: Option<SubtaskLabel>, what: &'static str } =
            "duration_too_long",
            "the {what} of {}{dag} is too long; give at most {} ns", part(subtask), u64::MAX;
        /// Two sources of one DAG state different periods, in nanoseconds; `subtask` the
        /// second one.
        PeriodsDiffer { dag: DagLabel, subtask: SubtaskLabel, first_ns: u64, second_ns: u64 } =
            "periods_differ",
            "{subtask} gives {dag} a period of {:?} where {:?} were given before; a DAG has one \
             period, make two DAGs or give the same period",
            Duration::from_nanos(*second_ns), Duration::from_nanos(*first_ns);
        /// Of two sources of one DAG one is periodic and one sporadic; `subtask` is the one
        /// registered second.
        ActivationsDiffer { dag: DagLabel, subtask: SubtaskLabel } = "activations_differ",
            "{subtask} has a period, and its {dag} is sporadic, released by a signal; make two \
             DAGs, or leave one of the two out";
        /// The file of observed WCETs does not fit the DAG.
        WcetsRefused { dag: DagLabel, fault: WcetFault } = "wcets_refused", "{fault}: {dag}";
        /// A subtask samples a latest value of a DAG that is not in the commit.
        LatestNotCommitted { dag: DagLabel, subtask: SubtaskLabel, topic: String } =
            "latest_not_committed",
            "{subtask} of {dag} samples the latest value of topic `{topic}`, whose dag is not in \
             the commit; commit both dags in one call";
        /// A subtask may raise the signal of a DAG that is not in the commit.
        SignalNotCommitted { dag: DagLabel, subtask: SubtaskLabel } = "signal_not_committed",
            "{subtask} of {dag} may raise the signal of a dag that is not in the commit; commit \
             both dags in one call";
        /// A subtask may pause a DAG that is not in the commit.
        SwitchedNotCommitted { dag: DagLabel, subtask: SubtaskLabel } = "switched_not_committed",
            "{subtask} of {dag} may pause a dag that is not in the commit; commit both dags in one \
             call";
        /// Something is wrong with the modes, or with what enters from outside.
        Worded(fault: WordedFault) = of fault.code, "{fault}";
        /// A subtask has a function for after a fault, and a fault ends its DAG.
        ReplacedInVain { dag: DagLabel, subtask: SubtaskLabel } = "replaced_in_vain",
            "{subtask} of {dag} has another function for after a fault, and a fault ends the dag; \
             let the dag survive faults by `survive_faults`, or register one function";
        /// A DAG goes on after faults, and no subtask has a function for that.
        NothingReplaceable { dag: DagLabel } = "nothing_replaceable",
            "{dag} drops a job at a fault and goes on, and no subtask of it has another function \
             for that; register one by `restarting` or `falling_back`";
        /// A subtask that has a function for after a fault uses a state that has no value
        /// for that.
        StateWithoutReset { dag: DagLabel, subtask: SubtaskLabel, state: String } =
            "state_without_reset",
            "{subtask} of {dag} has another function for after a fault, and the state `{state}`, \
             which it uses, no other value; give it one by `reset_to`";
        /// The commit is to find the clusters, and a DAG gets no cores.
        NotAssigned(error: LaunchError) = "not_assigned", "{error}";
        /// The DAG demands a proof that it meets its deadlines, and there is none, for that
        /// reason. Found only where nothing else is wrong.
        NotProven { dag: DagLabel, unproven: Unproven } = "not_proven",
            "{dag} demands a proof that it meets its deadlines, and there is none: {unproven}";
        /// The graph or its attributes are at fault.
        Model(fault: sched_dag::Fault) = of fault.code(), "{fault}";
        /// The platform did not take the verified plan.
        NotLaunched(error: LaunchError) = "not_launched",
            "the platform did not take the plan: {error}";
    }
}

impl Fault {
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

/// Returns which part of a DAG is at fault, if it is not the DAG itself.
fn part(subtask: &Option<SubtaskLabel>) -> impl Display {
    fmt::from_fn(move |f| match subtask {
        Some(subtask) => write!(f, "{subtask} of "),
        None => Ok(()),
    })
}
