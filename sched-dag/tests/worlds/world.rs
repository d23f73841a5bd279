//! The worlds: one or two DAGs of one to three subtasks, two jobs each, on one or two cores.

use sched_dag::{
    Activation, DagSpec, FaultLimit, OnFault, OverrunPolicy, Policy, Preemption, Priority,
    SchedulerOptions, SubtaskSpec,
};

/// How many jobs each DAG has.
pub(crate) const JOBS: usize = 2;

/// Of a DAG.
pub(crate) const MOST_SUBTASKS: usize = 3;

#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) options: SchedulerOptions,
    pub(crate) dags: Vec<Dag>,
}

#[derive(Clone, Debug)]
pub(crate) struct Dag {
    pub(crate) period_ns: u64,
    pub(crate) deadline_ns: u64,
    pub(crate) in_flight: usize,
    pub(crate) overrun: OverrunPolicy,
    pub(crate) is_sporadic: bool,
    /// One for each subtask.
    pub(crate) priorities: Vec<u32>,
    pub(crate) edges: &'static [(usize, usize)],
    /// Whether its first subtask, once started, keeps its core.
    pub(crate) is_first_non_preemptive: bool,
    /// How many faults it survives, in a window of how many jobs; two in all.
    pub(crate) survives: Option<FaultLimit>,
}

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
pub(crate) fn all() -> Vec<World> {
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

fn add(options: SchedulerOptions, worlds: &mut Vec<World>) {
    for (number, &first) in SHAPES.iter().enumerate() {
        for overrun in OVERRUNS {
            for in_flight in 1..=JOBS {
                for is_sporadic in [false, true] {
                    let mut dag = dag(first, 2, overrun, in_flight);
                    dag.is_sporadic = is_sporadic;
                    dag.survives = Some(one_in(in_flight as u64));
                    let dags = vec![dag];
                    worlds.push(World { options, dags });
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
            urgent.is_first_non_preemptive = (number + other) % 4 == 3;
            other_dag.is_sporadic = (number + 2 * other) % 3 == 0;
            urgent.survives = (other % 2 == 0).then(|| one_in(1));
            // The first subtasks of both are next to each other in the order.
            for (at, priority) in other_dag.priorities.iter_mut().enumerate() {
                *priority = u32::from(at > 0);
            }
            let dags = vec![urgent, other_dag];
            worlds.push(World { options, dags });
        }
    }
}

fn dag(
    (subtasks, edges): (usize, &'static [(usize, usize)]),
    period_ns: u64,
    overrun: OverrunPolicy,
    in_flight: usize,
) -> Dag {
    Dag {
        period_ns,
        deadline_ns: period_ns - 1,
        in_flight,
        overrun,
        is_sporadic: false,
        // The last one is the most urgent.
        priorities: (0..3).rev().take(subtasks).collect(),
        edges,
        is_first_non_preemptive: false,
        survives: None,
    }
}

impl World {
    /// Returns the most disturbances (faults, stops, pauses, resumptions, signals) on one
    /// way: two in a DAG alone, so that both jobs may be signalled, and one of two DAGs.
    pub(crate) fn disturbances(&self) -> u8 {
        match self.dags.len() {
            1 => 2,
            _ => 1,
        }
    }

    /// Returns when nothing but completions can happen any more.
    pub(crate) fn horizon_ns(&self) -> u64 {
        let last = |dag: &Dag| dag.period_ns * (JOBS as u64 - 1) + dag.deadline_ns + 1;
        self.dags.iter().map(last).max().unwrap_or(0)
    }

    pub(crate) fn subtasks(&self) -> usize {
        self.dags.iter().map(Dag::subtasks).sum()
    }

    pub(crate) fn specs(&self) -> Vec<DagSpec> {
        self.dags.iter().map(Dag::spec).collect()
    }
}

impl Dag {
    pub(crate) fn subtasks(&self) -> usize {
        self.priorities.len()
    }

    pub(crate) fn is_sink(&self, subtask: usize) -> bool {
        self.edges.iter().all(|edge| edge.0 != subtask)
    }

    fn spec(&self) -> DagSpec {
        let subtask = |(at, &priority): (usize, &u32)| SubtaskSpec {
            priority: Some(Priority(priority)),
            non_preemptive: at == 0 && self.is_first_non_preemptive,
            ..SubtaskSpec::default()
        };
        DagSpec {
            period_ns: Some(self.period_ns),
            relative_deadline_ns: Some(self.deadline_ns),
            jobs: Some(JOBS as u64),
            in_flight: u32::try_from(self.in_flight).ok(),
            overrun: self.overrun,
            on_fault: self.survives.map_or(OnFault::EndDag, OnFault::DropJob),
            activation: match self.is_sporadic {
                true => Activation::Sporadic,
                false => Activation::default(),
            },
            subtasks: self.priorities.iter().enumerate().map(subtask).collect(),
            edges: self.edges.to_vec(),
            ..DagSpec::default()
        }
    }
}
