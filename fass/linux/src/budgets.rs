//! Budgets: how long instances may execute, and who looks.
//!
//! A budget is in processor time, which a thread takes only while it has a processor.
//! Reading that clock is a system call, so no instance does it at its start: the release thread
//! looks often enough, as often as the shortest budget, and begins to count when it
//! first sees the instance. So an instance ends after its budget, and no later than the
//! shortest budget of all, and 20 us, after that. The instance's thread cannot be ended: it is
//! demoted for good.
//!
//! An instance that waits may go on in another thread. So, of subtasks that wait, each worker reads
//! its clock at both ends of a turn, and adds up what the instance has taken; at the end of a turn
//! it sees for itself whether that is too much.

use sched_dag::{CoreId, Vertex};

use crate::state::State;
use crate::sys;
use crate::worker::Worker;

/// The latest look at an instance that has a budget.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// The subtask, the job, and what its earlier turns have taken.
    what: Option<(Vertex, u64, u64)>,
    /// The processor time of its thread then.
    processor_ns: u64,
}

/// The budgets of a run's subtasks, and what was seen of the instances on each core.
#[derive(Debug)]
pub(crate) struct Budgets {
    by_vertex: Box<[u64]>,
    shortest_ns: u64,
    seen: Box<[Seen]>,
}

impl Budgets {
    /// Takes each subtask's budget, or so many of its WCETs; 0: then it has none.
    pub(crate) fn new(state: &State, wcets: u64) -> Self {
        let dags = state.engine.task_set.dags().iter();
        let subtasks = dags.flat_map(|dag| dag.subtasks());
        let by_vertex: Box<[u64]> = subtasks.map(|s| s.most_execution_ns(wcets)).collect();
        Self {
            shortest_ns: by_vertex.iter().copied().min().unwrap_or(u64::MAX),
            seen: vec![Seen::default(); state.port.active.len()].into(),
            by_vertex,
        }
    }

    /// Looks at what runs. Returns a core whose instance has exceeded its budget, or when
    /// to look again. `taken_ns` tells of a vertex how much earlier turns have taken.
    pub(crate) fn look(
        &mut self,
        (state, workers): (&State, &[Worker]),
        taken_ns: impl Fn(Vertex) -> u64,
        now_ns: u64,
    ) -> Result<u64, CoreId> {
        if self.shortest_ns == u64::MAX {
            return Ok(u64::MAX);
        }
        let mut next_ns = now_ns.saturating_add(self.shortest_ns);
        for (core, seen) in (0..).map(CoreId).zip(&mut self.seen) {
            let Some(vertex) = state.engine.placement.current(core.index()) else {
                continue;
            };
            let budget_ns = self.by_vertex[vertex.index()];
            let worker = &workers[state.port.active[core.index()]];
            let processor_ns = worker.thread().and_then(sys::processor_time_ns);
            let (Some(processor_ns), true) = (processor_ns, budget_ns < u64::MAX) else {
                continue;
            };
            let job = state.engine.scheduler.instance_of(vertex).job;
            let taken_ns = taken_ns(vertex);
            let what = Some((vertex, job, taken_ns));
            if seen.what != what {
                *seen = Seen { what, processor_ns };
            }
            let used_ns = taken_ns + processor_ns.saturating_sub(seen.processor_ns);
            if used_ns > budget_ns {
                *seen = Seen::default();
                return Err(core);
            }
            next_ns = next_ns.min(now_ns.saturating_add(pause_ns(budget_ns - used_ns)));
        }
        Ok(next_ns)
    }
}

/// Returns how long to sleep between two looks at an instance that has so much of its budget
/// left: not before it can have used that up, and for a while in any case. This thread may stand
/// on the instance's own core, and then that uses nothing up until we sleep.
fn pause_ns(rest_ns: u64) -> u64 {
    const LEAST_NS: u64 = 20_000;
    rest_ns.saturating_add(1).max(LEAST_NS)
}

#[cfg(test)]
mod tests {
    use super::pause_ns;

    #[test]
    fn an_instance_at_the_end_of_its_budget_gets_time_to_exceed_it() {
        // Were it 1 ns, this thread would look without end, on the core that the instance needs.
        assert!([0, 1, 100].map(pause_ns).iter().all(|ns| *ns >= 10_000));
        assert_eq!(pause_ns(5_000_000), 5_000_001);
    }
}
