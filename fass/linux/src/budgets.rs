//! Budgets: how long instances may execute, and which thread checks.
//!
//! A budget is in processor time, and a thread uses that up only while it runs. Reading the
//! processor-time clock is a system call, so instances do not read it at their start. Instead, the
//! release thread looks at least once per shortest budget, and begins counting when it first sees
//! an instance. So an instance ends after its budget, and later by at most the shortest budget of
//! all plus 20 us, if the release thread runs in time and the instance keeps its core. After a
//! preemption, counting may begin anew. The instance's thread cannot be ended: it is demoted for
//! good.
//!
//! An instance that waits may go on in another thread. So, for waiting subtasks, each worker reads
//! its clock at both ends of a turn, and adds up the instance's time. At the end of a turn the
//! worker itself checks the sum against the budget.

use sched_dag::{CoreId, Vertex};

use crate::state::State;
use crate::sys;
use crate::worker::Worker;

/// The latest look at an instance with a budget.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// The subtask, the job, and the time taken by its earlier turns.
    what: Option<(Vertex, u64, u64)>,
    /// The processor time of the instance's thread at that look.
    processor_ns: u64,
}

/// The budgets of a run's subtasks, and the latest looks at the instances on each core.
#[derive(Debug)]
pub(crate) struct Budgets {
    by_vertex: Box<[u64]>,
    shortest_ns: u64,
    seen: Box<[Seen]>,
}

impl Budgets {
    /// Takes each subtask's budget, or `wcets` times its WCET; with 0, subtasks without a stated
    /// budget have none.
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

    /// Looks at the running instances. Returns the time of the next look. The error is a core whose
    /// instance has exceeded its budget. `taken_ns` returns the time taken by a vertex's earlier
    /// turns.
    pub(crate) fn look(
        &mut self,
        (state, workers): (&State, &[Worker]),
        taken_ns: impl Fn(Vertex) -> u64,
        now_ns: u64,
    ) -> Result<u64, CoreId> {
        if self.shortest_ns == u64::MAX {
            return Ok(u64::MAX);
        }
        // An instance may start right after this look, so the next look comes within the shortest
        // budget.
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
            // Another instance or turn: counting begins anew at this look.
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

/// Returns how long to sleep between two looks at an instance with `rest_ns` of its budget left.
/// The sleep ends when the instance can have used up the rest, and lasts at least 20 us: this
/// thread may occupy the instance's own core, and then the instance makes no progress until we
/// sleep.
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
