//! One cluster in virtual time: its scheduler, and what its cores execute.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;

use super::Workload;
use crate::ids::{CoreId, Instance};
use crate::scheduler::heap::IndexedHeap;
use crate::scheduler::{Decision, Scheduler};
use crate::task_set::TaskSet;

/// What runs by itself.
#[derive(Debug)]
pub(super) struct Cluster {
    pub(super) scheduler: Scheduler,
    pub(super) cores: Cores,
}

/// What the cores of one cluster execute, and what is left of it.
#[derive(Debug)]
pub(super) struct Cores {
    /// How many cores other clusters have before.
    first: u32,
    /// When the instance on each busy core finishes if nothing intervenes; at
    /// one instant the core with the smaller number comes first.
    finish_times: IndexedHeap<(u64, CoreId)>,
    /// What each core executes.
    pub(super) executing: Box<[Option<Instance>]>,
    /// What is left of each preempted instance, by its vertex.
    remaining_ns: Box<[u64]>,
    task_set: Arc<TaskSet>,
}

impl Cluster {
    pub(super) fn new(scheduler: Scheduler, first: u32) -> Self {
        let cores = scheduler.options().cores as usize;
        let subtasks = scheduler.task_set().vertices();
        Self {
            cores: Cores {
                first,
                finish_times: IndexedHeap::new(cores),
                executing: vec![None; cores].into_boxed_slice(),
                remaining_ns: vec![0; subtasks].into_boxed_slice(),
                task_set: Arc::clone(scheduler.task_set()),
            },
            scheduler,
        }
    }
}

impl Cores {
    /// Returns a core's number among those of all clusters.
    pub(super) const fn number(&self, core: CoreId) -> CoreId {
        CoreId(self.first + core.0)
    }

    pub(super) fn next_finish_ns(&self) -> Option<u64> {
        self.finish_times.peek().map(|((at_ns, _), _)| at_ns)
    }

    /// Takes an instance that finishes at `now_ns` from its core.
    pub(super) fn take_finished(&mut self, now_ns: u64) -> Option<(Instance, CoreId)> {
        let ((_, core), index) = self
            .finish_times
            .peek()
            .filter(|((at_ns, _), _)| *at_ns <= now_ns)?;
        self.finish_times.remove(index);
        Some((self.executing[index].take()?, core))
    }

    /// Carries out a decision. An instance that cannot finish is the error.
    pub(super) fn carry_out(
        &mut self,
        decision: Decision,
        now_ns: u64,
        workload: &mut impl Workload,
    ) -> Result<(), Instance> {
        let (core, instance) = (decision.core(), decision.instance());
        let (number, index) = (self.number(core), self.task_set.vertex(instance).index());
        let remaining_ns = match decision {
            Decision::Preempt { .. } => {
                let finish_ns = self.finish_times.key(core.index());
                self.remaining_ns[index] = finish_ns.map_or(now_ns, |(at_ns, _)| at_ns) - now_ns;
                workload.preempted(instance, number, now_ns);
                return Ok(());
            }
            Decision::Resume { .. } => {
                workload.resumed(instance, number, now_ns);
                self.remaining_ns[index]
            }
            Decision::Start { .. } => {
                workload.started(instance, number, now_ns);
                workload.execute(instance, now_ns)
            }
        };
        let finish_ns = now_ns.checked_add(remaining_ns).ok_or(instance)?;
        self.finish_times.set(core.index(), (finish_ns, core));
        self.executing[core.index()] = Some(instance);
        Ok(())
    }
}
