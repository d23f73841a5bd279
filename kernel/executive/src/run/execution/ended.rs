//! A run that has ended: what its clusters have left behind.
//!
//! The bodies, and the values that waited for them, are dropped at once, DAG by DAG: outside any
//! instance, so a `drop` of the app's that panics or never returns cannot be contained. It can be
//! named ([`look_at_clearing`]).

use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{DagId, Instance, Journal, Scheduler, SchedulerOptions, SubtaskId, TaskSet};

use super::{Execution, Loan, cluster, divided};
use crate::machine::spinlock::SpinLock;
use crate::machine::{clock, this_core};

/// The DAG whose bodies are being dropped, and since when.
static CLEARING: SpinLock<Option<(Arc<TaskSet>, DagId, u64)>> = SpinLock::new(None);

/// Hands over the name of the DAG whose bodies are being dropped, if that goes on, and since when
/// it does.
pub fn look_at_clearing<R>(look: impl FnOnce(&str, u64) -> R) -> Option<R> {
    let clearing = CLEARING.try_lock()?;
    let (task_set, dag, since_ns) = clearing.as_ref()?;
    Some(look(task_set.dag(*dag).name(), *since_ns))
}

/// A run, taken out.
pub struct Ended {
    /// By cluster; the first one's journal is the run's.
    parts: Vec<Execution>,
}

impl Ended {
    /// Makes one of what the clusters had; `None` if that is nothing.
    pub(super) fn of(mut parts: Vec<Execution>) -> Option<Self> {
        let (first, others) = parts.split_first_mut()?;
        if cluster::MAY_DIVIDE {
            divided::merge(first, others);
        }
        Some(Self { parts })
    }

    /// Drops what it has left behind, and gives back what faults have left.
    pub(super) fn clear(&mut self) {
        let task_set = Arc::clone(self.task_set());
        for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
            let engine = &mut self.parts[dag.cluster().index()].engine;
            *CLEARING.lock() = Some((Arc::clone(&task_set), id, clock::now_ns()));
            let of_dag = |lost: &mut Loan| lost.instance.dag == id;
            let lost = engine.lost.extract_if(.., of_dag);
            lost.for_each(|lost| lost.give_back().body.forget());
            for subtask in (0..).map(SubtaskId).take(dag.subtasks().len()) {
                let any = Instance {
                    dag: id,
                    job: 0,
                    subtask,
                };
                drop(
                    engine
                        .placement
                        .take(task_set.vertex(any))
                        .map(Loan::give_back),
                );
            }
            drop(CLEARING.lock().take());
        }
    }

    /// Returns the scheduler of a DAG, for its counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn scheduler(&self, dag: DagId) -> &Scheduler {
        &self.parts[self.task_set().dag(dag).cluster().index()]
            .engine
            .scheduler
    }

    /// Returns how all cores were told to work.
    #[must_use]
    pub fn options(&self) -> SchedulerOptions {
        SchedulerOptions {
            cores: u32::try_from(this_core::all().len()).unwrap_or(u32::MAX),
            ..self.parts[0].engine.scheduler.options()
        }
    }

    /// Returns the response time that is proven of a DAG, if one is.
    #[must_use]
    pub fn bound_ns(&self, dag: DagId) -> Option<u64> {
        *self.parts[0].proven.bounds_ns.get(dag.index())?
    }

    /// Returns the response time that is proven of a sink, if one is.
    #[must_use]
    pub fn sink_bound_ns(&self, dag: DagId, sink: SubtaskId) -> Option<u64> {
        let place = self.task_set().dag(dag).sinks().binary_search(&sink).ok()?;
        let of_dag = self.parts[0].proven.sink_bounds_ns.get(dag.index())?;
        *of_dag.get(place)?
    }

    /// Returns what has happened.
    #[must_use]
    pub fn journal(&self) -> &Journal {
        &self.parts[0].engine.scheduler.log.journal
    }

    /// Returns the model.
    #[must_use]
    pub fn task_set(&self) -> &Arc<TaskSet> {
        self.parts[0].task_set()
    }
}
