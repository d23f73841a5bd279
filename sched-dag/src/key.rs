//! Keys for looking up DAGs and subtasks after the commit: a name, a number, or a handle.

use crate::ids::{DagId, SubtaskId};
use crate::nearest::nearest_of;
use crate::task_set::{Dag, Subtask, TaskSet};

/// A key of a DAG of a task set: a name, a [`DagId`], or a handle of the crate that built it.
///
/// ```
/// use sched_dag::{CommitOptions, DagId, DagSpec, Policy, SubtaskSpec, verify};
///
/// let dag = DagSpec {
///     name: "pump".into(),
///     period_ns: Some(10),
///     relative_deadline_ns: Some(10),
///     subtasks: vec![SubtaskSpec { name: "turn".into(), ..SubtaskSpec::default() }],
///     ..DagSpec::default()
/// };
/// let verified = verify(&[dag], &CommitOptions::new(Policy::Edf, 1)).unwrap();
/// let task_set = verified.task_set;
/// let pump = task_set.find("pump");
/// assert_eq!(pump, task_set.find(DagId(0)));
/// assert_eq!(task_set.dag(pump).find("turn"), task_set.dag(pump).sinks()[0]);
/// ```
pub trait DagKey {
    /// Returns the DAG's number.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, which is a mistake of the caller. But a [`DagId`] is not checked.
    fn find_in(&self, task_set: &TaskSet) -> DagId;
}

/// A key of a subtask of a DAG: a name, or a [`SubtaskId`].
///
/// See [`DagKey`].
pub trait SubtaskKey {
    /// Returns the subtask's number.
    ///
    /// # Panics
    ///
    /// If there is no such subtask, which is a mistake of the caller. But a [`SubtaskId`] is not
    /// checked.
    fn find_in(&self, dag: &Dag) -> SubtaskId;
}

impl DagKey for DagId {
    fn find_in(&self, _: &TaskSet) -> DagId {
        *self
    }
}

impl DagKey for str {
    #[track_caller]
    fn find_in(&self, task_set: &TaskSet) -> DagId {
        DagId(number_of(
            "dag",
            self,
            task_set.dags().iter().map(Dag::name),
        ))
    }
}

impl<K: DagKey + ?Sized> DagKey for &K {
    #[track_caller]
    fn find_in(&self, task_set: &TaskSet) -> DagId {
        (**self).find_in(task_set)
    }
}

impl SubtaskKey for SubtaskId {
    fn find_in(&self, _: &Dag) -> SubtaskId {
        *self
    }
}

impl SubtaskKey for str {
    #[track_caller]
    fn find_in(&self, dag: &Dag) -> SubtaskId {
        let names = dag.subtasks().iter().map(Subtask::name);
        SubtaskId(number_of("subtask", self, names))
    }
}

impl<K: SubtaskKey + ?Sized> SubtaskKey for &K {
    #[track_caller]
    fn find_in(&self, dag: &Dag) -> SubtaskId {
        (**self).find_in(dag)
    }
}

#[track_caller]
fn number_of<'n>(what: &str, name: &str, names: impl Iterator<Item = &'n str> + Clone) -> u32 {
    match (0..).zip(names.clone()).find(|(_, other)| *other == name) {
        Some((number, _)) => number,
        None => refuse(what, name, &mut { names }),
    }
}

#[cold]
#[track_caller]
fn refuse(what: &str, name: &str, names: &mut dyn Iterator<Item = &str>) -> ! {
    match nearest_of(name, names) {
        Some(near) => panic!("there is no {what} `{name}`; did you mean `{near}`?"),
        None => panic!("there is no {what} `{name}`; name one that was committed"),
    }
}

impl TaskSet {
    /// Returns the number of a DAG.
    ///
    /// # Panics
    ///
    /// If there is no such DAG. But a [`DagId`] is not checked.
    ///
    /// See [`DagKey`].
    #[track_caller]
    pub fn find(&self, dag: impl DagKey) -> DagId {
        dag.find_in(self)
    }
}

impl Dag {
    /// Returns the number of a subtask.
    ///
    /// # Panics
    ///
    /// If there is no such subtask. But a [`SubtaskId`] is not checked.
    ///
    /// See [`DagKey`].
    #[track_caller]
    pub fn find(&self, subtask: impl SubtaskKey) -> SubtaskId {
        subtask.find_in(self)
    }
}
