//! What an accepted commit tells: warnings, answers about deadlines, and what proves them.

use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use sched_dag::chains::{Chain, Sampling};
use sched_dag::{DagId, DagKey, TaskSet, Warning};

use super::answer::{Answer, Answers};
use crate::run::latest::Staleness;

/// An accepted commit.
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
/// dag.register_periodic_subtask(|| (1,), vec!["number"], period, SubtaskAttributes::named("source"));
/// dag.register_sink_subtask(|(_,): (i32,)| (), vec!["number"], period, SubtaskAttributes::named("sink"));
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
    pub(super) answers: Answers,
    pub(super) staleness: Arc<Vec<Staleness>>,
    pub(super) task_set: Arc<TaskSet>,
}

impl Commit {
    /// Returns what the commit accepted although its author may not have meant it.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let dag = create_dag();
    /// # let period = Duration::from_millis(10);
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), vec!["number"], period, SubtaskAttributes::default());
    /// let unmeasured = SubtaskAttributes::named("source").wcet(Duration::ZERO);
    /// dag.register_periodic_subtask(|| (1,), vec!["number"], period, unmeasured);
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// assert_eq!(commit.warnings()[0].code(), "zero_wcet");
    /// ```
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns for each DAG, in the order of the commit, a bound of its response
    /// time and the test that proves it, or why there is none.
    ///
    /// Bounds hold for the platform's policy, preemption and cores, with its
    /// measured overheads added to the WCETs
    /// ([`Terms::overheads`](crate::Terms::overheads)), and as long as no
    /// instance executes for longer than its WCET. A DAG that is *not proven*
    /// may meet its deadlines all the same.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let dag = create_dag();
    /// # let period = Duration::from_millis(10);
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), vec!["number"], period, SubtaskAttributes::default());
    /// # dag.register_periodic_subtask(|| (1,), vec!["number"], period, SubtaskAttributes::named("source"));
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// for answer in commit.answers() {
    ///     println!("{answer}");
    /// }
    /// ```
    #[must_use]
    pub fn answers(&self) -> &[Answer] {
        &self.answers.of_dags
    }

    /// Returns what is known of one DAG's response times, by its name or its handle.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    ///
    /// See [`answers`](Self::answers).
    #[must_use]
    #[track_caller]
    pub fn answer(&self, dag: impl DagKey) -> &Answer {
        &self.answers.of_dags[self.task_set.find(dag).index()]
    }

    /// Returns what proves the bounds, for `./scripts/check-witness` to compute again.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let dag = create_dag();
    /// # let period = Duration::from_millis(10);
    /// # let taking = |name, ms| SubtaskAttributes::named(name).wcet(Duration::from_millis(ms));
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), vec!["number"], period, taking("sink", 3));
    /// # dag.register_periodic_subtask(|| (1,), vec!["number"], period, taking("source", 2));
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// assert!(commit.witnesses().contains("bound 0 5000000 "));
    /// ```
    #[must_use]
    pub fn witnesses(&self) -> String {
        self.answers.witness(&self.task_set)
    }

    /// Returns for each subtask that samples a latest value, in the order of the
    /// commit, how old that value can be; see [`Staleness`].
    ///
    /// See [`Latest`](crate::Latest) for an example.
    #[must_use]
    pub fn staleness(&self) -> &[Staleness] {
        &self.staleness
    }

    /// Returns the first DAG that is not proven to meet its deadlines: one that
    /// cannot be analysed, else one that is certain to miss them at its WCETs,
    /// else the most urgent one for which no test gives a bound. `None` if every
    /// DAG is proven.
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// # let machine = virtual_time::VirtualTime::new();
    /// # let (dag, period) = (create_dag(), Duration::from_millis(10));
    /// # dag.name("vision");
    /// # dag.register_sink_subtask(|(_,): (i32,)| (), vec!["number"], period, SubtaskAttributes::default());
    /// # dag.register_periodic_subtask(|| (1,), vec!["number"], period, SubtaskAttributes::named("source"));
    /// let commit = finish_create_dags(&[dag]).unwrap(); // without WCETs
    /// assert_eq!(commit.first_unproven().unwrap().dag.name, "vision");
    /// ```
    #[must_use]
    pub fn first_unproven(&self) -> Option<&Answer> {
        self.answers.of_dags.get(self.answers.first_unproven?)
    }
}

/// A chain of subtasks from a source to a sink, from DAG to DAG by samples of latest values, and
/// how long an effect can take along it. Made by [`Commit::chains`] and
/// [`Commit::chains_between`]; measured after a run by the platform's `latencies`.
///
/// [`sched_dag::chains`] says what the times are, and why the bounds hold.
///
/// ```
/// use core::time::Duration;
/// use fass::{Sample, SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new().silent(virtual_time::Silent::Wcet);
/// let ms = Duration::from_millis;
/// let taking = |name, time| SubtaskAttributes::named(name).wcet(ms(time));
/// let camera = create_dag();
/// camera.name("camera").jobs(100).relative_deadline(ms(30));
/// camera.register_periodic_subtask(|| (1,), vec!["image"], ms(30), taking("expose", 5));
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
    /// How old an output of it can be at its finish, counted from the nominal release of the job
    /// that it goes back to; `None` if a DAG of the chain has no proven bound, or one but the
    /// last is sporadic.
    pub output_age: Option<Duration>,
    /// The longest reaction time, and the longest data age; `None` if a DAG of the chain has no
    /// proven bound, or is sporadic.
    pub reaction: Option<Duration>,
    names: String,
}

impl fmt::Display for EndToEnd {
    /// Writes the subtasks at which it enters and leaves DAGs.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.names)
    }
}

impl Commit {
    /// Returns the chains that cross DAGs, from each source that samples nothing to each sink
    /// that no DAG samples; at most 1000.
    ///
    /// See [`EndToEnd`].
    #[must_use]
    pub fn chains(&self) -> Vec<EndToEnd> {
        let chains = Chain::all(&self.task_set, &self.samplings());
        self.with_bounds(chains)
    }

    /// Returns the chains from one subtask to another, each named as `dag/subtask`, by name or
    /// number; none if there is no such subtask, or nothing leads there.
    ///
    /// See [`EndToEnd`].
    #[must_use]
    pub fn chains_between(&self, from: &str, to: &str) -> Vec<EndToEnd> {
        let [Some(from), Some(to)] = [from, to].map(|name| Chain::place(&self.task_set, name))
        else {
            return Vec::new();
        };
        let chains = Chain::between(&self.task_set, &self.samplings(), from, to);
        self.with_bounds(chains)
    }

    fn samplings(&self) -> Vec<Sampling> {
        let of_sample = |sample: &Staleness| {
            let (writer, reader) = (sample.writer_dag.id, sample.reader_dag.id);
            let topics = self.task_set.dag(writer).topics();
            let topic = topics.iter().find(|topic| topic.name == sample.topic)?;
            Some(Sampling {
                writer: (writer, topic.writer),
                reader: (reader, sample.reader.id),
            })
        };
        self.staleness.iter().filter_map(of_sample).collect()
    }

    fn with_bounds(&self, chains: Vec<Chain>) -> Vec<EndToEnd> {
        let responses_ns = self.answers.proven().bounds_ns;
        let of_chain = |chain: Chain| {
            let time = |ns: Result<u64, DagId>| ns.ok().map(Duration::from_nanos);
            let names = chain.names(&self.task_set).map(|name| name.to_string());
            let names: Vec<String> = names.collect();
            EndToEnd {
                output_age: time(chain.output_age_bound_ns(&self.task_set, &responses_ns)),
                reaction: time(chain.reaction_bound_ns(&self.task_set, &responses_ns)),
                names: names.join(" > "),
                chain,
            }
        };
        chains.into_iter().map(of_chain).collect()
    }
}
