//! From a drawn set to DAGs that execute for its times.
//!
//! Every instance executes for a time that its subtask's seed and the job's number
//! give, and counts what it has done. Mostly it holds its core, which halts meanwhile:
//! so all cores execute at once even where busy processors share one clock. Or it
//! computes for that time ([`Executed::by_computing`]).
//!
//! A DAG that is to have a fault has one subtask more, without edges, and without a WCET, as the
//! report of a fault takes its time. What a fault pins is then the same in every round.

use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::hint::black_box;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fork_join::compute;

use fass::{
    Dag, FaultLimit, Occupation, OverrunPolicy, SubtaskAttributes, Switch, Untyped, create_dag,
};

use crate::set::{DagPlan, LEAST_PERCENT};
use crate::trouble::{FaultPlan, Then, Trouble};
use common::random::{nth, scale};

/// What the instances of a round have counted themselves.
#[derive(Clone, Debug, Default)]
pub struct Executed {
    counters: Arc<Counters>,
    /// Of each DAG the subtask that is to have a fault. Apart, as a fault keeps what it shares.
    frail: Vec<Option<Arc<Frail>>>,
    /// How long a round of work takes, where instances compute.
    round_ns: Option<u64>,
}

#[derive(Debug, Default)]
struct Counters {
    instances: AtomicU64,
    ns: AtomicU64,
}

/// A subtask of which one call panics.
#[derive(Debug)]
struct Frail {
    fatal_call: u64,
    round_ns: Option<u64>,
    calls: AtomicU64,
    instances: AtomicU64,
    panics: AtomicU64,
}

impl Frail {
    fn call(&self) {
        /// How long each call executes.
        const NS: u64 = 20_000;
        let call = self.calls.fetch_add(1, Ordering::Relaxed) + 1;
        occupy(NS, self.round_ns);
        if call == self.fatal_call {
            self.panics.fetch_add(1, Ordering::Relaxed);
            panic!("this call is drawn to fail");
        }
        self.instances.fetch_add(1, Ordering::Relaxed);
    }
}

/// Executes for some time.
fn occupy(ns: u64, round_ns: Option<u64>) {
    match round_ns {
        None => fass::execute_for(Duration::from_nanos(ns), Occupation::Hold),
        Some(round_ns) => {
            black_box(compute(ns / round_ns, ns));
        }
    }
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
        let frail = self.frail.iter().flatten();
        let frail = frail.map(|frail| frail.instances.load(Ordering::Relaxed));
        self.counters.instances.load(Ordering::Relaxed) + frail.sum::<u64>()
    }

    /// Returns how many instances of a DAG have panicked.
    #[must_use]
    pub fn panics(&self, number: usize) -> u64 {
        let frail = self.frail.get(number).and_then(Option::as_ref);
        frail.map_or(0, |frail| frail.panics.load(Ordering::Relaxed))
    }

    /// Returns for how long they were to execute, in all.
    #[must_use]
    pub fn ns(&self) -> u64 {
        self.counters.ns.load(Ordering::Relaxed)
    }

    fn execute_for(&self, ns: u64) {
        self.counters.ns.fetch_add(ns, Ordering::Relaxed);
        occupy(ns, self.round_ns);
        self.counters.instances.fetch_add(1, Ordering::Relaxed);
    }
}

/// Builds the DAGs, each of which releases as many jobs as `length` has room
/// for, but at least one. They are to be committed with any shape of graph
/// allowed, on cores that are divided as the trouble says.
#[must_use]
pub fn build(
    plans: &[DagPlan],
    length: Duration,
    overrun: OverrunPolicy,
    trouble: &Trouble,
    executed: &mut Executed,
) -> Vec<Dag> {
    let length_ns = u64::try_from(length.as_nanos()).unwrap_or(u64::MAX);
    // First all of them, since one may pause one that comes later.
    let dags: Vec<Dag> = plans.iter().map(|_| create_dag()).collect();
    for ((number, plan), dag) in plans.iter().enumerate().zip(&dags) {
        let jobs = (length_ns / plan.period_ns).max(1);
        dag.name(&format!("dag-{number}"))
            .period(Duration::from_nanos(plan.period_ns))
            .relative_deadline(Duration::from_nanos(plan.relative_deadline_ns))
            .offset(Duration::from_nanos(plan.offset_ns))
            .jobs(jobs)
            .in_flight(plan.in_flight)
            .overrun(overrun);
        let of_dag = trouble.of(number);
        if !trouble.clusters.is_empty() {
            dag.cluster(of_dag.cluster);
        }
        let pauses = of_dag.pauses.map(|other| &dags[other]);
        register(dag, plan, pauses, executed);
        let frail = of_dag.fault.map(|fault| {
            let calls = 1..=jobs.div_ceil(2);
            Arc::new(Frail {
                fatal_call: scale(fault.call, calls),
                round_ns: executed.round_ns,
                calls: AtomicU64::new(0),
                instances: AtomicU64::new(0),
                panics: AtomicU64::new(0),
            })
        });
        if let (Some(fault), Some(frail)) = (of_dag.fault, &frail) {
            register_frail(dag, plan.priority, fault, frail);
        }
        executed.frail.push(frail);
    }
    dags
}

fn register(dag: &Dag, plan: &DagPlan, pauses: Option<&Dag>, executed: &Executed) {
    let subtasks: Vec<Untyped> = (plan.subtasks.iter().enumerate())
        .map(|(number, subtask)| {
            let (seed, wcet_ns) = (subtask.seed, subtask.wcet_ns);
            let counters = Executed {
                frail: Vec::new(),
                ..executed.clone()
            };
            let execute = move |job| counters.execute_for(execution_ns(seed, job, wcet_ns));
            let mut attributes = SubtaskAttributes::named(&format!("subtask-{number}"))
                .priority(plan.priority)
                .wcet(Duration::from_nanos(wcet_ns));
            if subtask.non_preemptive {
                attributes = attributes.non_preemptive();
            }
            match pauses.filter(|_| number == 0) {
                None => dag.register_untyped_subtask(execute, attributes),
                Some(other) => {
                    let switch = move |mut other: Switch<'_>, job| {
                        execute(job);
                        // Of four jobs the second one pauses, the fourth one resumes.
                        match job % 4 {
                            1 => other.pause(),
                            3 => other.resume(),
                            _ => {}
                        }
                    };
                    (dag.using(other.switching())).register_untyped_subtask(switch, attributes)
                }
            }
        })
        .collect();
    for &(earlier, later) in &plan.edges {
        dag.precede(&subtasks[earlier], &subtasks[later]);
    }
}

/// Registers the subtask of which one call panics.
fn register_frail(dag: &Dag, priority: u32, fault: FaultPlan, frail: &Arc<Frail>) {
    let attributes = SubtaskAttributes::named("frail").priority(priority);
    let frail = Arc::clone(frail);
    if fault.then != Then::End {
        dag.survive_faults(FaultLimit {
            faults: 1,
            window: 1,
            in_all: 1,
        });
    }
    let call = |frail: &Arc<Frail>| {
        let frail = Arc::clone(frail);
        move |()| frail.call()
    };
    match fault.then {
        Then::End => {
            dag.register_untyped_subtask(move |_| frail.call(), attributes);
        }
        Then::Restart => (dag.restarting(move || call(&frail))).register(attributes),
        Then::FallBack => (dag.falling_back(call(&frail), call(&frail))).register(attributes),
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
