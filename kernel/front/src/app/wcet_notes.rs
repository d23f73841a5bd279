//! Calls that took longer than their WCETs, told after each run.
//!
//! What is proven rests on the WCETs, so a WCET that does not hold is worth a line even
//! where every bound has held. A call includes the kernel's own work for it; so a subtask
//! is named only if its longest call is above its WCET by more than the commit has charged
//! for that.

use fass::Overheads;
use sched_dag::{DagId, Instance, SubtaskId};

use crate::report::Ns;
use crate::text::json;
use sched_dag::engine::Run;

/// Names the subtasks of a run that took longer than their WCET and these overheads, which are
/// those of the commit.
pub(super) fn note(run: &Run, overheads: Overheads) {
    let set = run.task_set();
    let mut subtasks = set.dags().iter().flat_map(|dag| dag.subtasks());
    if !subtasks.any(|subtask| subtask.wcet_ns().is_some()) {
        return;
    }
    let charged_ns = overheads.of_an_instance_ns(run.options().preemption);
    let (Some(charged_ns), Some(counts)) = (charged_ns, run.coarse_times()) else {
        return;
    };
    for (dag, model) in (0..).map(DagId).zip(set.dags()) {
        for (subtask, of_subtask) in (0..).map(SubtaskId).zip(model.subtasks()) {
            let Some(wcet_ns) = of_subtask.wcet_ns() else {
                continue;
            };
            let job = 0;
            let counted = counts.subtask(set.vertex(Instance { dag, job, subtask }));
            let times = counted.execution_time.distribution();
            let (calls, longest_ns) = (times.count(), times.max());
            if longest_ns <= wcet_ns.saturating_add(charged_ns) {
                continue;
            }
            crate::println!(
                "WCET exceeded: subtask `{}` of dag `{}`, {} of {} calls, by {} at most; its WCET \
                 is {}",
                of_subtask.name(),
                model.name(),
                counted.beyond_wcet,
                calls,
                Ns(longest_ns - wcet_ns),
                Ns(wcet_ns)
            );
            json::emit("wcet_exceeded", |line| {
                line.number("dag", dag.0)
                    .text("dag_name", model.name())
                    .number("subtask", subtask.0)
                    .text("subtask_name", of_subtask.name())
                    .number("calls", calls)
                    .number("beyond", counted.beyond_wcet)
                    .number("longest_ns", longest_ns)
                    .number("wcet_ns", wcet_ns);
            });
        }
    }
}
