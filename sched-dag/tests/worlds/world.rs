//! The worlds: one or two DAGs of one to three subtasks, two jobs each, on one or two cores.

use sched_dag::{FaultLimit, OverrunPolicy, Policy, Preemption, SchedulerOptions};

use crate::set::{Dag, Set, Subtask};

/// How many jobs each DAG has.
const JOBS: usize = 2;

/// All shapes of one to three subtasks, but for their names.
const SHAPES: [(usize, &[(usize, usize)]); 9] = [
    (1, &[]),
    (2, &[]),
    (2, &[(0, 1)]),
    (3, &[]),
    (3, &[(0, 1)]),
    (3, &[(0, 1), (0, 2)]),
    (3, &[(0, 2), (1, 2)]),
    (3, &[(0, 1), (1, 2)]),
    (3, &[(0, 1), (1, 2), (0, 2)]),
];

const OVERRUNS: [OverrunPolicy; 3] = [
    OverrunPolicy::Queue,
    OverrunPolicy::Skip,
    OverrunPolicy::Abort,
];

/// One fault in so many jobs, and two in all.
const fn one_in(window: u64) -> FaultLimit {
    FaultLimit {
        faults: 1,
        window,
        in_all: 2,
    }
}

/// Returns every world: each shape alone, and each pair of shapes, with each policy,
/// preemption and number of cores; overrun policies, jobs in flight, signals,
/// faults that are survived and non-preemptive subtasks go round.
pub(crate) fn all() -> Vec<Set> {
    let mut worlds = Vec::new();
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for preemption in [Preemption::Enabled, Preemption::Disabled] {
            for cores in [1, 2] {
                let options = SchedulerOptions {
                    policy,
                    preemption,
                    cores,
                };
                add(options, &mut worlds);
            }
        }
    }
    worlds
}

fn world(options: SchedulerOptions, dags: Vec<Dag>) -> Set {
    let choices = 0;
    Set {
        options,
        dags,
        choices,
    }
}

fn add(options: SchedulerOptions, worlds: &mut Vec<Set>) {
    for (number, &first) in SHAPES.iter().enumerate() {
        for overrun in OVERRUNS {
            for in_flight in 1..=JOBS {
                for is_sporadic in [false, true] {
                    let mut dag = dag(first, 2, overrun, in_flight);
                    dag.signals_ns = is_sporadic.then(Vec::new);
                    dag.fault_limit = Some(one_in(in_flight as u64));
                    let dags = vec![dag];
                    worlds.push(world(options, dags));
                }
            }
        }
        for (other, &second) in SHAPES.iter().enumerate() {
            // At most five subtasks together, so that all of it takes minutes.
            if first.0 + second.0 > 5 {
                continue;
            }
            let overrun = |at: usize| OVERRUNS[at % OVERRUNS.len()];
            let mut urgent = dag(first, 2, overrun(number + other), 1 + number % JOBS);
            let mut other_dag = dag(second, 3, overrun(number), 1 + other % JOBS);
            urgent.subtasks[0].non_preemptive = (number + other) % 4 == 3;
            other_dag.signals_ns = ((number + 2 * other) % 3 == 0).then(Vec::new);
            urgent.fault_limit = (other % 2 == 0).then(|| one_in(1));
            // The first subtasks of both are next to each other in the order.
            for (at, subtask) in other_dag.subtasks.iter_mut().enumerate() {
                subtask.priority = u32::from(at > 0);
            }
            let dags = vec![urgent, other_dag];
            worlds.push(world(options, dags));
        }
    }
}

fn dag(
    (subtasks, edges): (usize, &'static [(usize, usize)]),
    period_ns: u64,
    overrun: OverrunPolicy,
    in_flight: usize,
) -> Dag {
    let subtask = |priority| Subtask {
        priority,
        non_preemptive: false,
        executions_ns: Vec::new(),
        fails_in: None,
        is_replaceable: true,
        deadline_ns: None,
    };
    Dag {
        period_ns,
        deadline_ns: period_ns - 1,
        offset_ns: 0,
        jobs: JOBS as u64,
        in_flight: in_flight as u64,
        overrun,
        // The last one is the most urgent.
        subtasks: (0..3).rev().take(subtasks).map(subtask).collect(),
        edges: edges.to_vec(),
        signals_ns: None,
        pauses_ns: Vec::new(),
        stop_ns: None,
        fault_limit: None,
    }
}

/// Returns the most disturbances (faults, stops, pauses, resumptions, signals) on one
/// way: two in a DAG alone, so that both jobs may be signalled, and one of two DAGs.
pub(crate) fn disturbances(world: &Set) -> u8 {
    match world.dags.len() {
        1 => 2,
        _ => 1,
    }
}

/// Returns when nothing but completions can happen any more.
pub(crate) fn horizon_ns(world: &Set) -> u64 {
    let last = |dag: &Dag| dag.period_ns * (dag.jobs - 1) + dag.deadline_ns + 1;
    world.dags.iter().map(last).max().unwrap_or(0)
}

pub(crate) fn subtasks(world: &Set) -> usize {
    world.dags.iter().map(|dag| dag.subtasks.len()).sum()
}
