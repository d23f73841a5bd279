//! From a case to DAGs that execute for its times.
//!
//! Every instance holds its core for the case's execution time, in units of a
//! chosen length. In the reference nothing but execution takes time, and every
//! event falls on a whole unit. On the machine a start comes a little after its
//! unit, for the scheduler, the switch and the interrupt take time too; along a
//! chain of instances that would add up until it is a unit. So, as WCETs do, the
//! execution times *include* what the kernel took: each unit of execution lasts
//! up to the end of a whole unit of time, the one in which it began. Only what the kernel takes
//! while a unit of execution is under way, by
//! preempting and resuming it, makes that unit end later (or earlier, if it was
//! suspended later than it was resumed).
//!
//! A unit of execution further ends a *guard* before the unit of time does: in
//! the reference, completions of an instant come before its releases, and a
//! deadline at the instant of the completion is met.
//!
//! A wait goes on to the end of a unit of time. Its limit on the machine is half a unit longer than
//! the case's, for what the kernel takes; whether it ended by an answer or by its limit is not told.
//!
//! A unit of execution may begin with [`Computing`], after which the core is held for what
//! is left of the unit. So functions that never wait are preempted in the middle of what
//! they compute, and the schedule is still the reference's.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, UntypedSubtask, create_dag};
use fork_join::Pace;
use sched_dag::{DagId, Instance, SubtaskId};

use crate::case::Case;

/// How the times of a case become times of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// The length of a unit, in nanoseconds, at least 1.
    pub unit_ns: u64,
    /// How long before the end of a unit of time a unit of execution ends.
    pub guard_ns: u64,
}

/// The computation at the beginning of each unit of execution.
#[derive(Clone, Copy, Debug)]
pub struct Computing {
    /// How fast.
    pub pace: Pace,
    /// For how long, if it were alone: longer than the guard, and short enough that all
    /// cores are through before the unit ends, even if they compute one after the other.
    pub time: Duration,
}

/// Time 0 of a run, on the clock of [`fass::now_ns`], to be set before it.
#[derive(Clone, Debug, Default)]
pub struct Epoch(Arc<AtomicU64>);

impl Epoch {
    /// Sets time 0.
    pub fn set(&self, ns: u64) {
        self.0.store(ns, Ordering::Relaxed);
    }

    fn elapsed_ns(&self) -> u64 {
        fass::now_ns().saturating_sub(self.0.load(Ordering::Relaxed))
    }
}

impl Scale {
    /// Returns how long a unit of execution goes on that is under way `ns` after time 0. A
    /// quarter of a unit is more than it may begin early by.
    fn left_at(self, ns: u64) -> u64 {
        let unit = ns.saturating_add(self.unit_ns / 4) / self.unit_ns;
        let end_ns = unit.saturating_add(1).saturating_mul(self.unit_ns);
        end_ns.saturating_sub(self.guard_ns).saturating_sub(ns)
    }

    /// Returns how long a wait of so many units goes on that begins `ns` after time 0, at about the
    /// end of a unit of time: to the end of one.
    fn wait_at(self, ns: u64, units: u64) -> Duration {
        let end = ns.saturating_add(self.unit_ns / 2) / self.unit_ns;
        let end_ns = end.saturating_add(units).saturating_mul(self.unit_ns);
        Duration::from_nanos(if units == 0 {
            0
        } else {
            end_ns.saturating_sub(ns)
        })
    }

    /// Executes for `units` units, inside a subtask. The core is held meanwhile, but for what it
    /// computes.
    fn execute(self, units: u64, epoch: &Epoch, computing: Option<Computing>) {
        for _ in 0..units {
            if let Some(computing) = computing {
                computing.pace.compute_for(computing.time);
            }
            let ns = self.left_at(epoch.elapsed_ns());
            fass::execute_for(Duration::from_nanos(ns), Occupation::Hold);
        }
    }

    fn duration(self, units: u64) -> Result<Duration, String> {
        let ns = self.unit_ns.checked_mul(units);
        ns.map(Duration::from_nanos).ok_or_else(|| {
            format!(
                "{units} units of {} ns are more than 64 bits hold; choose a shorter unit",
                self.unit_ns
            )
        })
    }
}

/// Builds the case's DAGs, to be committed with any shape of graph allowed.
/// `epoch` is to be set before they run. With `computing` they compute.
///
/// # Errors
///
/// In words: a time of the case is too long at this scale.
pub fn build(
    case: &Case,
    scale: Scale,
    epoch: &Epoch,
    computing: Option<Computing>,
) -> Result<Vec<Dag>, String> {
    let dags = case.task_set.dags().iter().zip(&case.executions_ns);
    let dags = (0..).zip(dags);
    dags.map(|(number, (model, executions_ns))| {
        let dag = create_dag();
        dag.name(&format!("{number}"))
            .period(scale.duration(model.period_ns())?)
            .relative_deadline(scale.duration(model.relative_deadline_ns())?)
            .offset(scale.duration(model.offset_ns())?)
            .jobs(model.jobs().unwrap_or(0))
            .in_flight(model.in_flight());
        if case.task_set.is_divided() {
            dag.cluster(model.cluster().0);
        }
        let subtasks: Vec<_> = (model.subtasks().iter().zip(executions_ns))
            .zip((0..).map(SubtaskId))
            .map(|((subtask, executions), id)| {
                let attributes = SubtaskAttributes::default().priority(subtask.priority().0);
                if !subtask.waits().is_empty() {
                    let of_case = (case, DagId(number), id);
                    return waiting(&dag, of_case, (scale, epoch, computing), attributes);
                }
                let (executions, epoch) = (executions.clone(), epoch.clone());
                let execute = move |job| {
                    let units = usize::try_from(job).map_or(0, |job| executions[job]);
                    scale.execute(units, &epoch, computing);
                };
                Ok(dag.register_untyped_subtask(execute, attributes))
            })
            .collect::<Result<_, String>>()?;
        for (later, id) in subtasks.iter().zip((0..).map(SubtaskId)) {
            for earlier in model.predecessors(id) {
                dag.precede(&subtasks[earlier.index()], later);
            }
        }
        for sink in model.sinks() {
            let deadline_ns = model.subtask(*sink).relative_deadline_ns();
            dag.sink_deadline(&subtasks[sink.index()], scale.duration(deadline_ns)?);
        }
        Ok(dag)
    })
    .collect()
}

/// Registers a subtask with waits, whose device answers as the case says: a wait ends where it
/// does, or at its limit.
fn waiting(
    dag: &Dag,
    (case, id, subtask): (&Case, DagId, SubtaskId),
    (scale, epoch, computing): (Scale, &Epoch, Option<Computing>),
    mut attributes: SubtaskAttributes,
) -> Result<UntypedSubtask, String> {
    let waits = case.task_set.dag(id).subtask(subtask).waits();
    for wait in waits {
        // A wait goes on to a whole unit of time, from the guard before one.
        let slack = Duration::from_nanos(scale.unit_ns / 2);
        attributes = attributes.wait(scale.duration(wait.limit_ns)? + slack);
    }
    let limits = waits.iter().map(|wait| wait.limit_ns);
    let of_job = |job| {
        let instance = Instance {
            dag: id,
            job,
            subtask,
        };
        let turns = case.turns[&instance].iter();
        let limits = limits.clone().map(Some).chain([None]);
        let waits = turns.zip(limits).map(|(turn, limit)| {
            let units = turn.answer_ns.zip(limit);
            (
                turn.execution_ns,
                units.map(|(answer, limit)| answer.min(limit)),
            )
        });
        waits.collect::<Vec<_>>()
    };
    let jobs = case.task_set.dag(id).jobs().unwrap_or(0);
    let turns: Arc<[_]> = (0..jobs).map(of_job).collect();
    let epoch = epoch.clone();
    let execute = move |job| {
        let (turns, epoch) = (Arc::clone(&turns), epoch.clone());
        async move {
            let of_job = usize::try_from(job).map_or(&[][..], |job| &turns[job]);
            for &(execution, wait) in of_job {
                scale.execute(execution, &epoch, computing);
                if let Some(units) = wait {
                    fass::sleep(scale.wait_at(epoch.elapsed_ns(), units)).await;
                }
            }
        }
    };
    Ok(dag.register_untyped_async_subtask(execute, attributes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_of_execution_ends_a_guard_before_a_unit_of_time() {
        let scale = Scale {
            unit_ns: 1000,
            guard_ns: 10,
        };
        assert_eq!(scale.left_at(5000), 990);
        assert_eq!(scale.left_at(5040), 950); // 40 ns were the kernel's
        assert_eq!(scale.left_at(4990), 1000); // the unit before ended early
        assert_eq!(scale.left_at(4760), 1230); // even earlier
        assert_eq!(scale.left_at(5740), 250); // it has computed so long
        assert_eq!(scale.left_at(u64::MAX), 0);
    }
}
