//! The cost of the platform's own work in a run: two figures from its journal.
//!
//! An instance is *owed* a core as long as R5 says to run it and it does not run: from its
//! readiness, or from the finish or wait of the instance before it on its core, until its first (or
//! next) instruction. In theory this takes no time. On a machine the time covers all the platform's
//! work between two instances: the interrupt, the scheduler's step, the journal, the hand-off to
//! another core, the switch of contexts, the alarm of a budget. So the longest time owed is an
//! upper bound for the cost of each such moment, however its parts share the cost. The time before
//! the readiness of a source is the release's *lateness*, from the nominal to the actual release.

use alloc::vec::Vec;
use core::fmt;

use crate::ids::Instance;
use crate::journal::{Event, EventKind};
use crate::task_set::TaskSet;

/// Measured costs of the platform, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeasuredCosts {
    /// The number of dispatched instances.
    pub dispatches: u64,
    /// The longest time for which an instance was owed a core.
    pub owed_ns: u64,
    /// The number of released jobs.
    pub releases: u64,
    /// The longest time from a nominal to an actual release, of periodic jobs that were not queued.
    pub late_ns: u64,
}

impl MeasuredCosts {
    /// Measures the events of a whole run, given in their order, core by core. An instance is owed
    /// a core from the instant when the instance gets in line, or from the latest finish or wait of
    /// another instance on its next core, if later. If a fault ended the other instance, the other
    /// instance's begin counts instead, so all its time counts as the cost of the fault.
    /// ([`judge_dispatch`](super::judge_dispatch) asks the rule itself, with ten times the code:
    /// the instance to be run, on any core.)
    pub fn of_cores(task_set: &TaskSet, events: impl Iterator<Item = Event> + Clone) -> Self {
        let mut costs = Self::of_releases(task_set, events.clone());
        let mut waiting: Vec<(Instance, u64)> = Vec::new();
        // By core: when it last finished an instance, and when it last began one.
        let mut cores: Vec<(u64, u64)> = Vec::new();
        for event in events {
            let Some(instance) = event.instance() else {
                continue;
            };
            let core = event.core.0 as usize;
            cores.resize(cores.len().max(core + 1), (0, 0));
            let (free_ns, begun_ns) = &mut cores[core];
            match event.what {
                EventKind::Ready | EventKind::Suspend | EventKind::Wake => {
                    waiting.push((instance, event.time_ns))
                }
                EventKind::Finish | EventKind::Wait => *free_ns = event.time_ns,
                EventKind::Ended => *free_ns = *begun_ns,
                EventKind::Start | EventKind::Resume => {
                    costs.dispatches += u64::from(event.what == EventKind::Start);
                    *begun_ns = event.time_ns;
                    let waits = waiting.iter().position(|(other, _)| *other == instance);
                    let since_ns = waits.map(|place| waiting.swap_remove(place).1.max(*free_ns));
                    // An instance without a known readiness or suspension is owed nothing.
                    let owed_ns = event.time_ns.saturating_sub(since_ns.unwrap_or(u64::MAX));
                    costs.owed_ns = costs.owed_ns.max(owed_ns);
                }
                _ => {}
            }
        }
        costs
    }

    /// Measures the releases alone.
    pub fn of_releases(task_set: &TaskSet, events: impl Iterator<Item = Event> + Clone) -> Self {
        let mut costs = Self::default();
        for event in events
            .clone()
            .filter(|event| event.what == EventKind::Released)
        {
            costs.releases += 1;
            let dag = task_set.dag(event.dag);
            let late_ns = event.time_ns.saturating_sub(dag.grid_ns(event.job));
            // A sporadic job's nominal release is its signal, already seen by the step; a queued
            // job waited for an older job.
            let is_longer = late_ns > costs.late_ns && !dag.is_sporadic();
            let waited = |other: Event| {
                other.what == EventKind::Queued && (other.dag, other.job) == (event.dag, event.job)
            };
            if is_longer && !events.clone().any(waited) {
                costs.late_ns = late_ns;
            }
        }
        costs
    }
}

/// Writes the costs as a phrase.
impl fmt::Display for MeasuredCosts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            dispatches,
            owed_ns,
            releases,
            late_ns,
        } = self;
        write!(
            f,
            "at most {owed_ns} ns until one of {dispatches} instances had its core, and {late_ns} \
             ns until one of {releases} releases was made"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::{CoreId, DagId, SubtaskId};
    use crate::law;
    use crate::law::dispatch::tests::dags;
    use crate::policies::{Policy, SchedulerOptions};
    use crate::policy::Preemption;

    fn events(happened: &[(u64, EventKind, u32, u64)]) -> Vec<Event> {
        let event = |&(time_ns, what, dag, job): &(u64, EventKind, u32, u64)| Event {
            time_ns,
            what,
            core: CoreId(0),
            dag: DagId(dag),
            job,
            subtask: (!what.is_of_job() || what.is_of_machine()).then_some(SubtaskId(0)),
        };
        happened.iter().map(event).collect()
    }

    #[test]
    fn a_core_owes_from_its_last_finish_and_from_what_waits() {
        use EventKind::{Finish, Ready, Released, Resume, Start, Suspend};
        let task_set = dags(&[0, 0], false);
        let events = events(&[
            (2, Released, 1, 0),
            (2, Ready, 1, 0),
            (5, Start, 1, 0), // owed for 3
            (101, Released, 0, 1),
            (101, Ready, 0, 1),
            (109, Suspend, 1, 0),
            (112, Start, 0, 1), // owed for 11, of which another instance had 8
            (120, Finish, 0, 1),
            (127, Resume, 1, 0), // owed for 7, after 11 in which another one ran
            (140, Finish, 1, 0),
        ]);
        let costs = MeasuredCosts::of_cores(&task_set, events.iter().copied());
        let expected = MeasuredCosts {
            dispatches: 2,
            owed_ns: 11,
            releases: 2,
            late_ns: 2,
        };
        assert_eq!(costs, expected);
        // The rule itself finds the same.
        let options = SchedulerOptions {
            policy: Policy::StaticPriority,
            preemption: Preemption::Enabled,
            cores: 1,
        };
        let terms = law::JudgeOptions::whole(u64::MAX);
        let dispatch = law::judge_dispatch(&task_set, &options, terms, events.iter().copied());
        assert_eq!(dispatch.waits.longest_owed_ns, 11);
        // The last one counts from the finish before.
        let without = events[5..].iter().copied();
        assert_eq!(MeasuredCosts::of_cores(&task_set, without).owed_ns, 7);
    }

    #[test]
    fn all_time_of_what_a_fault_ends_is_owed_to_others() {
        use EventKind::{Ended, Ready, Start};
        let happened = events(&[
            (0, Ready, 0, 0),
            (1, Start, 0, 0),
            (2, Ready, 1, 0),
            (9, Ended, 0, 0),
            (12, Start, 1, 0),
        ]);
        let costs = MeasuredCosts::of_cores(&dags(&[0, 0], false), happened.into_iter());
        assert_eq!(costs.owed_ns, 10);
    }

    #[test]
    fn a_release_that_waited_for_an_older_job_is_not_late() {
        use EventKind::{Queued, Released};
        let task_set = dags(&[0, 0], false);
        let happened = [
            (0, Released, 0, 0),
            (104, Queued, 0, 1),
            (150, Released, 0, 1),
        ];
        let late_ns = |happened: &[_]| {
            MeasuredCosts::of_releases(&task_set, events(happened).iter().copied()).late_ns
        };
        assert_eq!(late_ns(&happened), 0);
        assert_eq!(late_ns(&[happened[0], happened[2]]), 50);
    }
}
