//! Answers of an accepted commit: warnings, bounds against deadlines, and their proofs.
//!
//! Given WCETs, the commit asks `sched_dag::analysis` about the platform's model: its policy, its
//! preemption, its cores and its overheads. The answer for a DAG is a *bound*, the greatest time of
//! any completed job from its nominal release to its completion, together with the test proving the
//! bound; or the reason why there is no proof. *Not proven* is not *infeasible*: all tests are only
//! sufficient.
//!
//! # Consequences of an answer
//!
//! - By itself an answer has no consequence: DAGs without a proof are launched like others. An app
//!   needing a proof says so with [`Dag::demand_proof`](crate::Dag::demand_proof); then the lack of
//!   a proof is a fault.
//! - A DAG *certain* to miss its deadlines at its WCETs is launched as well, with a warning, unless
//!   it demands a proof. A WCET may be far above the actual execution times, and the overrun policy
//!   handles overload, so a certain miss is not necessarily a mistake. Two exceptions are always
//!   faults of the model: a WCET of a single subtask beyond the deadline, and an overflow of times.
//! - A DAG with a missing WCET is not analysed, and neither are the DAGs possibly delayed by such a
//!   DAG; they are not proven. A WCET of 0 counts as missing.
//!
//! # How old a sampled value can be
//!
//! Let the writer's DAG have period T and a proven bound R. If the DAG survives faults, T is longer
//! by one period for each job that faults may lose in a row. Take a sample at time t and the latest
//! job k complete by then. The next job not lost, released at most T later, was not complete yet,
//! and completes within R: t < r(k) + T + R. So the *staleness*, counted from the nominal release
//! of the value's job, is less than T + R. T + R is also the term of one hop in the end-to-end
//! bound of A. Davare et al., Period Optimization for Hard Real-time Distributed Automotive
//! Systems, DAC 2007 (doi:10.1145/1278480.1278553).
//!
//! The bound holds from the writer's first completion on, and as long as jobs come: not after the
//! last job of a DAG with a limit, nor while the DAG is paused, up to the first job after the
//! pause, nor after its end. For a sporadic writer there is no such bound, because its signals may
//! stay away.

use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use sched_dag::analysis::{
    self, AnalysisSettings, NotProvenReason, OverheadSource, SchedulabilityTest,
};
use sched_dag::chains::{Chain, SampledEdge};
use sched_dag::engine::ProvenBounds;
use sched_dag::wcets::WcetSource;
use sched_dag::{
    AssignmentReason, ClusterId, DagId, DagKey, DagLabel, Subtask, SubtaskLabel, TaskSet, Warning,
};

use crate::api::latest::{SampleUse, writer_of};
use crate::draft::fault::{CountedNoun, UnprovenDag};
use crate::draft::part::Drafts;
use crate::platform::RunConfig;
use crate::run::latest::Staleness;
use crate::run::plan::CommitWords;

/// An accepted commit: its warnings, and its answers about deadlines and staleness.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// dag.register_periodic_subtask(|| (1,), ["number"], period, SubtaskAttributes::named("source"));
/// dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, SubtaskAttributes::named("sink"));
///
/// let commit = finish_create_dags(&[dag]).unwrap();
/// for warning in commit.warnings() {
///     println!("warning: {warning}");
/// }
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Commit {
    pub(super) warnings: Vec<Warning>,
    pub(super) answers: CommitAnswers,
    pub(super) staleness: Arc<Vec<Staleness>>,
    pub(super) task_set: Arc<TaskSet>,
}

impl Commit {
    /// Returns the warnings about oddities accepted by the commit.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let dag = create_dag();
    /// # let period = Duration::from_millis(10);
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, SubtaskAttributes::default());
    /// let unmeasured = SubtaskAttributes::named("source").wcet(Duration::ZERO);
    /// dag.register_periodic_subtask(|| (1,), ["number"], period, unmeasured);
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// assert_eq!(commit.warnings()[0].code(), "zero_wcet");
    /// ```
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns the answer for each DAG, in the order of the commit: a bound of the response time
    /// and the test proving the bound, or the reason why there is none.
    ///
    /// Bounds hold for the platform's policy, preemption and cores, with the platform's measured
    /// overheads added to the WCETs
    /// ([`RunConfig::overheads`](crate::platform::RunConfig::overheads)), and as long as no
    /// instance executes for longer than its WCET, and no section of a lock takes longer than
    /// declared. A bound that is based on a [certificate](crate::platform::RunConfig::certificate)
    /// also ends with a fault. A DAG that is *not proven* may meet its deadlines all the same.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let dag = create_dag();
    /// # let period = Duration::from_millis(10);
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, SubtaskAttributes::default());
    /// # dag.register_periodic_subtask(|| (1,), ["number"], period, SubtaskAttributes::named("source"));
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// for answer in commit.answers() {
    ///     println!("{answer}");
    /// }
    /// ```
    pub fn answers(&self) -> &[DagAnswer] {
        &self.answers.of_dags
    }

    /// Returns the answer about one DAG, by its name or its handle.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    ///
    /// See [`answers`](Self::answers).
    #[track_caller]
    pub fn answer(&self, dag: impl DagKey) -> &DagAnswer {
        &self.answers.of_dags[self.task_set.find(dag).index()]
    }

    /// Returns the witnesses of the bounds, for recomputation by `./scripts/check-witness`.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let dag = create_dag();
    /// # let period = Duration::from_millis(10);
    /// # let taking = |name, ms| SubtaskAttributes::named(name).wcet(Duration::from_millis(ms));
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, taking("sink", 3));
    /// # dag.register_periodic_subtask(|| (1,), ["number"], period, taking("source", 2));
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// assert!(commit.witnesses().contains("bound 0 5000000 "));
    /// ```
    pub fn witnesses(&self) -> String {
        self.answers.witness(&self.task_set)
    }

    /// Returns the greatest age of each sampled latest value, where it has a bound: one entry for
    /// each sample declared by a subtask, in the order of the commit; see [`Staleness`].
    ///
    /// See [`Latest`](crate::shared::Latest) for an example.
    pub fn staleness(&self) -> &[Staleness] {
        &self.staleness
    }

    /// Returns the first DAG not proven to meet its deadlines, in the first cluster with such a
    /// DAG: a DAG that cannot be analysed, else a DAG certain to miss its deadlines at its WCETs,
    /// else the most urgent DAG without a bound from any test. Returns `None` if every DAG is
    /// proven.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let (dag, period) = (create_dag(), Duration::from_millis(10));
    /// # dag.name("vision");
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, SubtaskAttributes::default());
    /// # dag.register_periodic_subtask(|| (1,), ["number"], period, SubtaskAttributes::named("source"));
    /// let commit = finish_create_dags(&[dag]).unwrap(); // without WCETs
    /// assert_eq!(commit.first_unproven().unwrap().dag.name, "vision");
    /// ```
    #[must_use]
    pub fn first_unproven(&self) -> Option<&DagAnswer> {
        self.answers.of_dags.get(self.answers.first_unproven?)
    }
}

/// A chain of subtasks, mostly from a source to a sink, and the longest time of an effect along the
/// chain, where there is a bound. A chain crosses DAGs where a subtask samples a latest value. Made
/// by [`Commit::chains`] and [`Commit::chains_between`]; measured after a run by the platform's
/// `latencies`.
///
/// [`sched_dag::chains`] defines the times, and proves the bounds.
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Sample;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new().silent(virtual_time::Silent::Wcet);
/// let ms = Duration::from_millis;
/// let taking = |name, time| SubtaskAttributes::named(name).wcet(ms(time));
/// let camera = create_dag();
/// camera.name("camera").jobs(100).relative_deadline(ms(30));
/// camera.register_periodic_subtask(|| (1,), ["image"], ms(30), taking("expose", 5));
/// let image = camera.latest::<i32>("image");
/// let motor = create_dag();
/// motor.name("motor").jobs(300).relative_deadline(ms(10));
/// motor
///     .period(ms(10))
///     .using(image.sample())
///     .source(|_: Option<Sample<'_, i32>>| ())
///     .register(taking("drive", 1));
/// let commit = finish_create_dags(&[camera, motor]).unwrap();
/// let chains = commit.chains();
/// assert_eq!(chains[0].to_string(), "camera/expose > motor/drive");
/// assert_eq!(chains, commit.chains_between("camera/expose", "motor/drive"));
///
/// let report = machine.run();
/// let latencies = report.latencies(&chains[0].chain);
/// let longest = latencies.reaction_ns.iter().max().unwrap();
/// // What the camera just misses at 0 is in the image of 30 ms, which is complete at 36 ms, and
/// // moves the motor from 40 to 41 ms.
/// assert_eq!(*longest, 41_000_000);
/// assert!(chains[0].reaction.is_some_and(|bound| bound >= ms(41)));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EndToEnd {
    /// The chain.
    pub chain: Chain,
    /// The greatest age of an output at its finish, counted from the nominal release of the job at
    /// the chain's beginning from which the output derives. `None` if a DAG of the chain has no
    /// proven bound, or if a DAG before the last is sporadic.
    pub output_age: Option<Duration>,
    /// The longest reaction time, and the longest data age; `None` if a DAG of the chain has no
    /// proven bound, or is sporadic.
    pub reaction: Option<Duration>,
    names: String,
}

impl fmt::Display for EndToEnd {
    /// Writes the subtasks at which the chain enters and leaves DAGs.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.names)
    }
}

impl Commit {
    /// Returns the chains crossing DAGs, from each source without samples to each sink not sampled
    /// by any DAG; at most 1000.
    ///
    /// See [`EndToEnd`].
    pub fn chains(&self) -> Vec<EndToEnd> {
        let chains = Chain::all(&self.task_set, &self.samplings());
        self.with_bounds(chains)
    }

    /// Returns the chains from one subtask to another, each subtask given as `dag/subtask`, by name
    /// or number; at most 1000. The list is empty if there is no such subtask, or no path between
    /// the two.
    ///
    /// See [`EndToEnd`].
    pub fn chains_between(&self, from: &str, to: &str) -> Vec<EndToEnd> {
        let [Some(from), Some(to)] = [from, to].map(|name| Chain::find(&self.task_set, name))
        else {
            return Vec::new();
        };
        let chains = Chain::between(&self.task_set, &self.samplings(), from, to);
        self.with_bounds(chains)
    }

    fn samplings(&self) -> Vec<SampledEdge> {
        let of_sample = |sample: &Staleness| {
            let (writer, reader) = (sample.writer_dag.id, sample.reader_dag.id);
            let topics = self.task_set.dag(writer).topics();
            // An uncommitted writer has no topic; the commit has reported that already.
            let topic = topics.iter().find(|topic| topic.name == sample.topic)?;
            Some(SampledEdge {
                writer: (writer, topic.writer),
                reader: (reader, sample.reader.id),
            })
        };
        self.staleness.iter().filter_map(of_sample).collect()
    }

    fn with_bounds(&self, chains: Vec<Chain>) -> Vec<EndToEnd> {
        let responses_ns = &self.answers.proven.bounds_ns;
        let of_chain = |chain: Chain| {
            // One unproven DAG on the way leaves the chain without a bound.
            let time = |ns: Result<u64, DagId>| ns.ok().map(Duration::from_nanos);
            let names = chain.names(&self.task_set).map(|name| name.to_string());
            let names: Vec<String> = names.collect();
            EndToEnd {
                output_age: time(chain.output_age_bound_ns(&self.task_set, responses_ns)),
                reaction: time(chain.reaction_bound_ns(&self.task_set, responses_ns)),
                names: names.join(" > "),
                chain,
            }
        };
        chains.into_iter().map(of_chain).collect()
    }
}

/// The answer about the deadlines of one DAG.
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
/// let taking = |name, ms| SubtaskAttributes::named(name).wcet(Duration::from_millis(ms));
/// dag.name("demo");
/// dag.register_periodic_subtask(|| (1,), ["number"], period, taking("source", 2));
/// dag.register_sink_subtask(|(_,): (i32,)| (), ["number"], period, taking("sink", 3));
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
pub struct DagAnswer {
    /// The DAG.
    pub dag: DagLabel,
    /// The DAG's cluster; `None` if the cores are not divided.
    pub cluster: Option<ClusterPlacement>,
    /// The DAG's table, if the DAG is in lists of cores.
    pub table: Option<TablePlacement>,
    /// The verdict on the DAG.
    pub verdict: Verdict,
    /// The answer about each sink, in the order of registration.
    pub sinks: Vec<SinkAnswer>,
    /// The origin of the overheads charged to each instance.
    pub overheads: OverheadSource,
    /// The origin of each subtask's WCET, in the order of registration.
    pub wcets: Vec<WcetSource>,
}

/// The cluster of a DAG.
///
/// ```
/// use fass::commit::{ClusterId, ClusterPlacement};
///
/// let mut placement = ClusterPlacement { cluster: ClusterId(1), cores: vec![1, 2], why: None };
/// assert_eq!(placement.to_string(), "in cluster 1, on 2 cores from core 1 on");
/// placement.cores = vec![1, 4];
/// assert_eq!(placement.to_string(), "in cluster 1, on cores 1, 4");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClusterPlacement {
    /// The number of the cluster.
    pub cluster: ClusterId,
    /// The numbers of the cores allowed to execute the DAG, ascending.
    pub cores: Vec<u32>,
    /// The reason why the commit has chosen the cluster; `None` if the app has chosen.
    pub why: Option<AssignmentReason>,
}

/// The table of a DAG: the cores executing its subtasks in an order stated by the app or chosen by
/// the commit.
///
/// ```
/// use fass::commit::TablePlacement;
///
/// let mut table = TablePlacement { cores: vec![0, 2], dags: 3, is_first: false };
/// assert_eq!(table.to_string(), "in a table of 3 DAGs, on cores 0, 2");
/// table.is_first = true;
/// let told = "in a table of 3 DAGs, on cores 0, 2, where an overrun of one delays all, unless a budget \
///             of its WCET ends it";
/// assert_eq!(table.to_string(), told);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TablePlacement {
    /// The numbers of the cores with lists, ascending.
    pub cores: Vec<u32>,
    /// The number of DAGs in the table.
    pub dags: usize,
    /// Whether the DAG is the first in the table.
    pub is_first: bool,
}

/// The answer about the deadline of one sink.
///
/// ```
/// use core::time::Duration;
/// use fass::commit::{ConstructionPolicy, finish_create_dags_with};
/// use fass::{SubtaskAttributes, create_dag};
///
/// # let machine = virtual_time::VirtualTime::new().policy(fass::Policy::Edf);
/// let ms = Duration::from_millis;
/// let taking = |name, time| SubtaskAttributes::named(name).wcet(ms(time));
/// let dag = create_dag();
/// dag.name("arm");
/// dag.register_periodic_subtask(|| (1, 2), ["angle", "record"], ms(20), taking("plan", 1));
/// dag.register_sink_subtask(|_: (i32,)| (), ["angle"], ms(4), taking("act", 2));
/// dag.register_sink_subtask(|_: (i32,)| (), ["record"], ms(20), taking("log", 9));
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
    /// The deadline of the sink's finish, from the nominal release.
    pub relative_deadline: Duration,
    /// The greatest time from a job's nominal release to the sink's finish, if the DAG is proven.
    pub bound: Option<Duration>,
}

/// Whether a DAG is proven to meet its deadlines.
///
/// ```
/// use core::time::Duration;
/// use fass::commit::{SchedulabilityTest, Verdict};
///
/// let bound = Duration::from_millis(5);
/// let verdict = Verdict::Proven { bound, test: SchedulabilityTest::Edf };
/// assert_eq!(verdict.bound(), Some(bound));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every job not cut by a fault is complete within a bound not beyond the deadline, under the
    /// conditions of [`Commit::answers`].
    Proven {
        /// The greatest time from a job's nominal release to its completion.
        bound: Duration,
        /// The test proving the bound.
        test: SchedulabilityTest,
    },
    /// No test gives a bound.
    NotProven(UnprovenDag),
}

impl Verdict {
    /// Returns the bound, if there is one.
    pub const fn bound(&self) -> Option<Duration> {
        match self {
            Self::Proven { bound, .. } => Some(*bound),
            Self::NotProven(_) => None,
        }
    }

    /// Returns the reason why there is no bound, or `None` for a proven DAG.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::commit::{SchedulabilityTest, Verdict};
    ///
    /// let bound = Duration::from_millis(5);
    /// assert_eq!(Verdict::Proven { bound, test: SchedulabilityTest::Edf }.unproven(), None);
    /// ```
    pub const fn unproven(&self) -> Option<&UnprovenDag> {
        match self {
            Self::Proven { .. } => None,
            Self::NotProven(unproven) => Some(unproven),
        }
    }
}

/// The answers of one commit.
#[derive(Clone, Debug)]
pub(crate) struct CommitAnswers {
    pub(crate) of_dags: Arc<[DagAnswer]>,
    /// The position of the first DAG without a proof.
    pub(crate) first_unproven: Option<usize>,
    /// The bounds, for the platform.
    pub(crate) proven: ProvenBounds,
    settings: AnalysisSettings,
}

impl CommitAnswers {
    /// Analyses the task set a platform will run on the given terms.
    pub(crate) fn new(task_set: &TaskSet, terms: &RunConfig) -> Self {
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
                    let reason = reason.unwrap_or(NotProvenReason::NoBound);
                    Verdict::NotProven(UnprovenDag::new(task_set, dag, reason))
                }
            };
            let cluster = task_set.dag(dag).cluster();
            DagAnswer {
                // On undivided cores there is nothing to report.
                cluster: task_set.is_divided().then(|| ClusterPlacement {
                    cluster,
                    cores: task_set.cores_of_dag(dag, settings.cores),
                    why: task_set.dag(dag).why_there(),
                }),
                table: table(task_set, dag, settings.cores),
                sinks: sinks(task_set, dag, &answer.sinks_ns[dag.index()]),
                wcets: (task_set.dag(dag).subtasks().iter())
                    .map(Subtask::wcet_source)
                    .collect(),
                dag: task_set.label(dag),
                overheads: terms.overhead_source,
                verdict,
            }
        });
        let bounds_ns = (answer.bounds.iter()).map(|bound| Some(bound.as_ref()?.bound_ns));
        Self {
            of_dags: of_dags.collect(),
            proven: ProvenBounds {
                bounds_ns: bounds_ns.collect(),
                sink_bounds_ns: answer.sinks_ns,
            },
            first_unproven: answer.first_failing.map(|failing| failing.dag.index()),
            settings,
        }
    }

    /// Returns a witness for the proven bounds of the DAGs in `task_set`.
    pub(crate) fn witness(&self, task_set: &TaskSet) -> String {
        analysis::witness(task_set, &self.settings)
    }

    /// Returns the DAGs certain to miss their deadlines, each with the reason, for warnings.
    pub(crate) fn certain_misses(&self) -> impl Iterator<Item = (DagLabel, String)> {
        self.of_dags.iter().filter_map(|answer| {
            let unproven = answer.verdict.unproven()?;
            let certain = unproven.is_certain();
            certain.then(|| (answer.dag.clone(), unproven.to_string()))
        })
    }
}

impl CommitWords for Arc<[DagAnswer]> {
    fn in_words(&self) -> Vec<String> {
        self.iter().map(ToString::to_string).collect()
    }
}

fn table(task_set: &TaskSet, dag: DagId, all: u32) -> Option<TablePlacement> {
    let dags = task_set.table_of(dag)?.dags();
    Some(TablePlacement {
        cores: task_set.cores_of_dag(dag, all),
        is_first: dags.first() == Some(&dag),
        dags: dags.len(),
    })
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

impl fmt::Display for DagAnswer {
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
        // For a table with a single DAG the cluster's reason has said this already.
        let is_told = self.cluster.as_ref().is_some_and(|of| of.why.is_some());
        if let Some(table) = &self.table
            && (table.dags > 1 || !is_told)
        {
            write!(f, "; it is {table}")?;
        }
        // Observed WCETs are never called proven.
        let observed = self.wcets.iter().filter_map(|source| match source {
            WcetSource::Observed { margin_percent } => Some(margin_percent),
            _ => None,
        });
        // All observed WCETs of a commit come from one file, so they have the same margin.
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

impl fmt::Display for ClusterPlacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cluster,
            cores,
            why,
        } = self;
        write!(f, "in cluster {}, on {}", cluster.0, CoreNumbers(cores))?;
        why.map_or(Ok(()), |why| write!(f, ": {why}"))
    }
}

impl fmt::Display for TablePlacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dags = CountedNoun(self.dags, "DAG");
        write!(f, "in a table of {dags}, on {}", CoreNumbers(&self.cores))?;
        match self.is_first && self.dags > 1 {
            true => f.write_str(
                ", where an overrun of one delays all, unless a budget of its WCET ends it",
            ),
            false => Ok(()),
        }
    }
}

/// Core numbers in words.
struct CoreNumbers<'c>(&'c [u32]);

impl fmt::Display for CoreNumbers<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cores = self.0;
        let is_row = cores.windows(2).all(|pair| pair[0] + 1 == pair[1]);
        if let (Some(first), true) = (cores.first(), is_row) {
            let count = CountedNoun(cores.len(), "core");
            return write!(f, "{count} from core {first} on");
        }
        f.write_str("cores ")?;
        for (place, core) in cores.iter().enumerate() {
            let comma = if place == 0 { "" } else { ", " };
            write!(f, "{comma}{core}")?;
        }
        Ok(())
    }
}

/// Returns the staleness of each sample of all DAGs.
pub(super) fn staleness(
    drafts: &Drafts,
    task_set: &TaskSet,
    answers: &[DagAnswer],
) -> Vec<Staleness> {
    let mut found = Vec::new();
    for (draft, reader) in drafts.iter().zip(answers) {
        let draft = draft.borrow();
        for SampleUse(subtask, latest, _) in draft.all() {
            let Some(writer) = writer_of(drafts, latest) else {
                continue;
            };
            let model = &task_set.dags()[writer];
            found.push(Staleness {
                reader_dag: reader.dag.clone(),
                reader: draft.label(*subtask),
                writer_dag: answers[writer].dag.clone(),
                topic: latest.topic().into(),
                bound: bound(model, &answers[writer]),
            });
        }
    }
    found
}

/// Returns the greatest age of a DAG's values, given the answer about the DAG.
fn bound(writer: &sched_dag::Dag, answer: &DagAnswer) -> Option<Duration> {
    let response = answer.verdict.bound().filter(|_| !writer.is_sporadic())?;
    Duration::from_nanos(writer.renewal_ns()).checked_add(response)
}
