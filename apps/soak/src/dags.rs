//! From a drawn set to DAGs that execute for its times.
//!
//! Every instance executes for a time that its subtask's seed and the job's number
//! give, and counts what it has done. Mostly it holds its core, which halts meanwhile:
//! so all cores execute at once even where busy processors share one clock. Or it
//! computes for that time ([`Executed::by_computing`]).

use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::hint::black_box;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fork_join::compute;

use fass::{Dag, Occupation, OverrunPolicy, SubtaskAttributes, Untyped, create_dag};

use crate::set::{DagPlan, LEAST_PERCENT};
use common::random::{nth, scale};

/// What the instances of a round have counted themselves.
#[derive(Clone, Debug, Default)]
pub struct Executed {
    counters: Arc<Counters>,
    /// How long a round of work takes, where instances compute.
    round_ns: Option<u64>,
}

#[derive(Debug, Default)]
struct Counters {
    instances: AtomicU64,
    ns: AtomicU64,
}

impl Executed {
    /// Lets instances compute instead of holding their cores, where a round of
    /// [`compute`] takes so long.
    #[must_use]
    pub fn by_computing(round_ns: u64) -> Self {
        Self {
            round_ns: Some(round_ns.max(1)),
            ..Self::default()
        }
    }

    /// Returns how many instances have run.
    #[must_use]
    pub fn instances(&self) -> u64 {
        self.counters.instances.load(Ordering::Relaxed)
    }

    /// Returns for how long they were to execute, in all.
    #[must_use]
    pub fn ns(&self) -> u64 {
        self.counters.ns.load(Ordering::Relaxed)
    }

    fn execute_for(&self, ns: u64) {
        self.counters.ns.fetch_add(ns, Ordering::Relaxed);
        match self.round_ns {
            None => fass::execute_for(Duration::from_nanos(ns), Occupation::Hold),
            Some(round_ns) => {
                black_box(compute(ns / round_ns, ns));
            }
        }
        self.counters.instances.fetch_add(1, Ordering::Relaxed);
    }
}

/// Builds the DAGs, each of which releases as many jobs as `length` has room
/// for, but at least one. They are to be committed with any shape of graph
/// allowed.
#[must_use]
pub fn build(
    plans: &[DagPlan],
    length: Duration,
    overrun: OverrunPolicy,
    executed: &Executed,
) -> Vec<Dag> {
    let length_ns = u64::try_from(length.as_nanos()).unwrap_or(u64::MAX);
    let dags = plans.iter().enumerate();
    dags.map(|(number, plan)| {
        let dag = create_dag();
        dag.name(&format!("dag-{number}"))
            .period(Duration::from_nanos(plan.period_ns))
            .relative_deadline(Duration::from_nanos(plan.relative_deadline_ns))
            .offset(Duration::from_nanos(plan.offset_ns))
            .jobs((length_ns / plan.period_ns).max(1))
            .in_flight(plan.in_flight)
            .overrun(overrun);
        register(&dag, plan, executed);
        dag
    })
    .collect()
}

fn register(dag: &Dag, plan: &DagPlan, executed: &Executed) {
    let subtasks: Vec<Untyped> = (plan.subtasks.iter().enumerate())
        .map(|(number, subtask)| {
            let (seed, wcet_ns) = (subtask.seed, subtask.wcet_ns);
            let executed = executed.clone();
            let execute = move |job| executed.execute_for(execution_ns(seed, job, wcet_ns));
            let mut attributes = SubtaskAttributes::named(&format!("subtask-{number}"))
                .priority(plan.priority)
                .wcet(Duration::from_nanos(wcet_ns));
            if subtask.non_preemptive {
                attributes = attributes.non_preemptive();
            }
            dag.register_untyped_subtask(execute, attributes)
        })
        .collect();
    for &(earlier, later) in &plan.edges {
        dag.precede(&subtasks[earlier], &subtasks[later]);
    }
}

/// Returns how long a job's instance of a subtask executes.
fn execution_ns(seed: u64, job: u64, wcet_ns: u64) -> u64 {
    let least_ns = wcet_ns / 100 * LEAST_PERCENT;
    scale(nth(seed, job), least_ns..=wcet_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn execution_times_are_spread_between_the_least_and_the_wcet() {
        let times = || (0..10_000).map(|job| execution_ns(1, job, 1_000_000));
        assert!(times().all(|ns| (400_000..=1_000_000).contains(&ns)));
        let mean = times().sum::<u64>() / 10_000;
        assert!((690_000..=710_000).contains(&mean), "{mean}");
    }
}
