//! How old a sampled value can be, as the commit says it; `commit/staleness.rs` has the
//! theory.

use alloc::string::String;
use core::fmt;
use core::time::Duration;

use sched_dag::{DagLabel, SubtaskLabel};

/// How old the value that a subtask samples can be at its start.
///
/// ```
/// use core::time::Duration;
/// use fass::{Sample, SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let period = Duration::from_millis(10);
/// let taking = |name, ms| SubtaskAttributes::named(name).wcet(Duration::from_millis(ms));
/// let writer = create_dag();
/// writer.name("writer").jobs(3).relative_deadline(period);
/// writer.register_periodic_subtask(|| (1,), vec!["pose"], period, taking("localize", 2));
/// let pose = writer.latest::<i32>("pose");
/// let reader = create_dag();
/// reader.name("reader").jobs(3).relative_deadline(period);
/// reader
///     .period(period)
///     .using(pose.sample())
///     .source(|_: Option<Sample<'_, i32>>| ())
///     .register(taking("plan", 1));
/// let commit = finish_create_dags(&[writer, reader]).unwrap();
/// assert!(commit.staleness()[0].bound.is_some_and(|bound| bound >= Duration::from_millis(12)));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Staleness {
    /// The DAG of the subtask that samples.
    pub reader_dag: DagLabel,
    /// The subtask that samples.
    pub reader: SubtaskLabel,
    /// The DAG that writes.
    pub writer_dag: DagLabel,
    /// The topic.
    pub topic: String,
    /// The time, never reached, from the nominal release of the job that the value is
    /// of to the start of the instance that samples it. `None` if the writer has no
    /// proven bound, or is sporadic.
    pub bound: Option<Duration>,
}

impl fmt::Display for Staleness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            reader_dag,
            reader,
            writer_dag,
            topic,
            bound,
        } = self;
        write!(
            f,
            "{reader} of {reader_dag} samples topic `{topic}` of {writer_dag}, "
        )?;
        match bound {
            Some(bound) => write!(f, "less than {bound:?} old"),
            None => f.write_str("of unknown age"),
        }
    }
}
