//! What the commit answers about deadlines.
//!
//! Where WCETs are given, the commit asks `sched_dag::analysis` for the model
//! that the platform will run: its policy, its preemption, its cores and its
//! overheads. The answer for a DAG is a *bound*, the most time that any of its
//! jobs takes from its release to its completion, with the test that proves it;
//! or that there is no proof, and why. *Not proven* is not *infeasible*: all
//! tests are sufficient ones.
//!
//! # What follows from an answer
//!
//! - By itself nothing: DAGs that are not proven are launched as others are.
//!   Whether a proof is needed is for the app to say, with
//!   [`Dag::demand_proof`](crate::Dag::demand_proof); then its lack is a fault.
//! - A DAG that is *certain* to miss its deadlines at its WCETs is launched as
//!   well, with a warning. A WCET may be far above what instances take, and
//!   overload has its rules (the overrun policy), so it is no mistake by
//!   itself. Two exceptions are faults of the model whatever is demanded: the
//!   WCET of a single subtask beyond the deadline, and times that overflow.
//! - A DAG without all its WCETs is not analysed, and neither are those that
//!   it may delay; they are not proven. A WCET of 0 is none.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;
use core::time::Duration;

use sched_dag::analysis::{self, OverheadSource, Reason, Settings, Test};
use sched_dag::engine::Proven;
use sched_dag::wcets::WcetSource;
use sched_dag::{ClusterId, DagId, DagLabel, Subtask, SubtaskLabel, TaskSet, Why};

use crate::draft::fault::{Count, Unproven};
use crate::platform::Terms;

/// What is known at commit about the deadlines of one DAG.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, Verdict, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// let taking = |name, ms| SubtaskAttributes::named(name).wcet(Duration::from_millis(ms));
/// dag.name("demo");
/// dag.register_periodic_subtask(|| (1,), vec!["number"], period, taking("source", 2));
/// dag.register_sink_subtask(|(_,): (i32,)| (), vec!["number"], period, taking("sink", 3));
///
/// let commit = finish_create_dags(&[dag]).unwrap();
/// let answer = &commit.answers()[0];
/// assert!(matches!(
///     answer.verdict,
///     Verdict::Proven { bound, .. } if bound == Duration::from_millis(5)
/// ));
/// assert_eq!(
///     answer.to_string(),
///     "dag `demo` takes at most 5ms, by multiple paths"
/// );
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The DAG.
    pub dag: DagLabel,
    /// Where it runs; `None` if the cores are not divided.
    pub cluster: Option<Placement>,
    /// What is known.
    pub verdict: Verdict,
    /// What is known of each sink, in the order of registration.
    pub sinks: Vec<SinkAnswer>,
    /// Where the overheads are from that each instance was charged.
    pub overheads: OverheadSource,
    /// Where the WCET of each subtask is from, in the order of registration.
    pub wcets: Vec<WcetSource>,
}

/// The cluster of a DAG.
///
/// ```
/// use fass::{ClusterId, Placement};
///
/// let placement = Placement { cluster: ClusterId(1), cores: 1..3, why: None };
/// assert_eq!(placement.to_string(), "in cluster 1, on 2 cores from core 1 on");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Which it is.
    pub cluster: ClusterId,
    /// The numbers of its cores.
    pub cores: Range<u32>,
    /// Why the commit has put it there; `None` if the app has.
    pub why: Option<Why>,
}

/// What is known at commit about the deadline of one sink.
///
/// ```
/// use core::time::Duration;
/// use fass::{ConstructionPolicy, SubtaskAttributes, create_dag, finish_create_dags_with};
///
/// # let machine = virtual_time::VirtualTime::new().policy(fass::Policy::Edf);
/// let ms = Duration::from_millis;
/// let taking = |name, time| SubtaskAttributes::named(name).wcet(ms(time));
/// let dag = create_dag();
/// dag.name("arm");
/// dag.register_periodic_subtask(|| (1, 2), vec!["angle", "record"], ms(20), taking("plan", 1));
/// dag.register_sink_subtask(|_: (i32,)| (), vec!["angle"], ms(4), taking("act", 2));
/// dag.register_sink_subtask(|_: (i32,)| (), vec!["record"], ms(20), taking("log", 9));
///
/// let commit = finish_create_dags_with(&[dag], ConstructionPolicy::any_graph()).unwrap();
/// let [act, log] = &commit.answers()[0].sinks[..] else { panic!("it has two") };
/// assert_eq!((act.relative_deadline, act.bound), (ms(4), Some(ms(3))));
/// assert_eq!((log.relative_deadline, log.bound), (ms(20), Some(ms(12))));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SinkAnswer {
    /// The sink.
    pub sink: SubtaskLabel,
    /// By when it shall have finished, from the nominal release.
    pub relative_deadline: Duration,
    /// The most time from a job's nominal release to the sink's finish, if the DAG is
    /// proven.
    pub bound: Option<Duration>,
}

/// Whether a DAG is proven to meet its deadlines.
///
/// ```
/// use core::time::Duration;
/// use fass::{Test, Verdict};
///
/// let bound = Duration::from_millis(5);
/// let verdict = Verdict::Proven { bound, test: Test::Edf };
/// assert_eq!(verdict.bound(), Some(bound));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every job is complete within a bound, which is at most the deadline, as
    /// long as no instance takes longer than its WCET.
    Proven {
        /// The most time from a job's nominal release to its completion.
        bound: Duration,
        /// The test that gave it.
        test: Test,
    },
    /// No test gives a bound.
    NotProven(Unproven),
}

impl Verdict {
    /// Returns the bound, if there is one.
    ///
    /// See [`Verdict`].
    #[must_use]
    pub const fn bound(&self) -> Option<Duration> {
        match self {
            Self::Proven { bound, .. } => Some(*bound),
            Self::NotProven(_) => None,
        }
    }

    /// Returns why there is no bound, if there is none.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{Test, Verdict};
    ///
    /// let bound = Duration::from_millis(5);
    /// assert_eq!(Verdict::Proven { bound, test: Test::Edf }.unproven(), None);
    /// ```
    #[must_use]
    pub const fn unproven(&self) -> Option<&Unproven> {
        match self {
            Self::Proven { .. } => None,
            Self::NotProven(unproven) => Some(unproven),
        }
    }
}

/// The answers of one commit.
#[derive(Clone, Debug)]
pub(crate) struct Answers {
    pub(crate) of_dags: Vec<Answer>,
    /// The position of the first DAG that fails.
    pub(crate) first_unproven: Option<usize>,
    settings: Settings,
}

impl Answers {
    /// Analyses what a platform will run on these terms.
    pub(crate) fn new(task_set: &TaskSet, terms: &Terms) -> Self {
        let settings = terms.settings();
        let answer = analysis::answer(task_set, &settings);
        let found = answer.bounds.iter().zip(&answer.reasons);
        let of_dags = (0..).map(DagId).zip(found).map(|(dag, (bound, reason))| {
            let verdict = match (bound, reason) {
                (Some(bound), _) => Verdict::Proven {
                    bound: Duration::from_nanos(bound.bound_ns),
                    test: bound.test,
                },
                (None, reason) => {
                    let reason = reason.unwrap_or(Reason::NoBound);
                    Verdict::NotProven(Unproven::new(task_set, dag, reason))
                }
            };
            let cluster = task_set.dag(dag).cluster();
            Answer {
                cluster: task_set.is_divided().then(|| Placement {
                    cluster,
                    cores: task_set.cores_of(cluster, settings.cores),
                    why: task_set.dag(dag).why_there(),
                }),
                sinks: sinks(task_set, dag, &answer.sinks_ns[dag.index()]),
                wcets: (task_set.dag(dag).subtasks().iter())
                    .map(Subtask::wcet_source)
                    .collect(),
                dag: task_set.label(dag),
                overheads: terms.overhead_source,
                verdict,
            }
        });
        Self {
            of_dags: of_dags.collect(),
            first_unproven: answer.first_failing.map(|failing| failing.dag.index()),
            settings,
        }
    }

    /// Returns a witness for the bounds of the DAGs that they were made for.
    pub(crate) fn witness(&self, task_set: &TaskSet) -> String {
        analysis::witness(task_set, &self.settings)
    }

    /// Returns the bounds, for the platform.
    pub(crate) fn proven(&self) -> Proven {
        let bound = |answer: &Answer| in_ns(answer.verdict.bound());
        let sinks = |answer: &Answer| answer.sinks.iter().map(|sink| in_ns(sink.bound)).collect();
        Proven {
            bounds_ns: self.of_dags.iter().map(bound).collect(),
            sink_bounds_ns: self.of_dags.iter().map(sinks).collect(),
        }
    }

    /// Returns the warnings that follow: DAG and reason of what is certain.
    pub(crate) fn certain_misses(&self) -> impl Iterator<Item = (DagLabel, String)> {
        self.of_dags.iter().filter_map(|answer| {
            let unproven = answer.verdict.unproven()?;
            let certain = unproven.is_certain();
            certain.then(|| (answer.dag.clone(), unproven.to_string()))
        })
    }
}

fn in_ns(bound: Option<Duration>) -> Option<u64> {
    u64::try_from(bound?.as_nanos()).ok()
}

fn sinks(task_set: &TaskSet, dag: DagId, bounds_ns: &[Option<u64>]) -> Vec<SinkAnswer> {
    let model = task_set.dag(dag);
    let sinks = model.sinks().iter().zip(bounds_ns);
    let answers = sinks.map(|(&sink, bound_ns)| SinkAnswer {
        sink: task_set.subtask_label(dag, sink),
        relative_deadline: Duration::from_nanos(model.subtask(sink).relative_deadline_ns()),
        bound: bound_ns.map(Duration::from_nanos),
    });
    answers.collect()
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dag = &self.dag;
        match &self.verdict {
            Verdict::Proven { bound, test } => {
                write!(f, "{dag} takes at most {bound:?}, by {test}")
            }
            Verdict::NotProven(unproven) => {
                write!(f, "{dag} is not proven to meet its deadlines: {unproven}")
            }
        }?;
        if let Some(placement) = &self.cluster {
            write!(f, "; it runs {placement}")?;
        }
        // What is observed is never called proven.
        let observed = self.wcets.iter().filter_map(|source| match source {
            WcetSource::Observed { margin_percent } => Some(margin_percent),
            _ => None,
        });
        if let Some(margin) = observed.clone().next() {
            let (count, all) = (observed.count(), self.wcets.len());
            write!(
                f,
                "; {count} of {all} WCETs are observed ones and {margin} %"
            )?;
        }
        match self.overheads {
            OverheadSource::Stated => Ok(()),
            OverheadSource::Measured {
                dispatches,
                margin_percent,
            } => write!(
                f,
                "; overheads are the longest of {dispatches} measured and {margin_percent} %"
            ),
        }
    }
}

impl fmt::Display for Placement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cluster,
            cores,
            why,
        } = self;
        let (count, first) = (Count(cores.len(), "core"), cores.start);
        let cluster = cluster.0;
        write!(f, "in cluster {cluster}, on {count} from core {first} on")?;
        why.map_or(Ok(()), |why| write!(f, ": {why}"))
    }
}
