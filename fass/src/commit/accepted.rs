//! What an accepted commit tells: warnings, answers about deadlines, and what proves them.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{DagKey, TaskSet, Warning};

use super::answer::{Answer, Answers};
use crate::run::staleness::Staleness;

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
