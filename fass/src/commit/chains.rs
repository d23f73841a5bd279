//! The chains of a commit that cross DAGs by latest values, and what is proven of them.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use sched_dag::DagId;
use sched_dag::chains::{Chain, Place, Sampling};

use super::Commit;
use crate::run::staleness::Staleness;

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
        let (Some(from), Some(to)) = (self.place(from), self.place(to)) else {
            return Vec::new();
        };
        let chains = Chain::between(&self.task_set, &self.samplings(), from, to);
        self.with_bounds(chains)
    }

    fn place(&self, name: &str) -> Option<Place> {
        Chain::place(&self.task_set, name)
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
        let answers = self.answers.of_dags.iter();
        let bounds = answers.map(|answer| answer.verdict.bound());
        let responses_ns: Vec<Option<u64>> = bounds
            .map(|bound| u64::try_from(bound?.as_nanos()).ok())
            .collect();
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
