//! Random task sets from a seed, without any other crate.

use sched_dag::analysis::{Overheads, Settings};
use sched_dag::{
    ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagSpec, Order, Policy, Preemption,
    Priority, TaskSet, verify,
};

use crate::simulate::spec;
use crate::support::random::Random;

/// A task set with the platform it runs on.
#[derive(Debug)]
pub(crate) struct Sample {
    pub(crate) specs: Vec<DagSpec>,
    pub(crate) policy: Policy,
    pub(crate) preemption: Preemption,
    pub(crate) cores: u32,
    pub(crate) clusters: Clusters,
}

impl Sample {
    pub(crate) fn settings(&self) -> Settings {
        Settings {
            policy: self.policy,
            preemption: self.preemption,
            cores: self.cores,
            overheads: Overheads::default(),
        }
    }

    /// Returns what a commit makes of it, if it does not refuse a path beyond a deadline.
    pub(crate) fn task_set(&self) -> Option<TaskSet> {
        let options = CommitOptions::new(self.policy, self.cores)
            .with_construction(ConstructionPolicy::any_graph())
            .with_clusters(self.clusters.clone());
        Some(verify(&self.specs, &options).ok()?.task_set)
    }
}

/// A kind of task sets, which differ in what the analysis has cases for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kind {
    pub(crate) is_edf: bool,
    /// Whether each subtask keeps its core; `None`: some do.
    pub(crate) keeps: Option<bool>,
    pub(crate) is_divided: bool,
    /// Whether some sinks have deadlines of their own.
    pub(crate) has_sinks: bool,
    /// Whether an order is fixed for some DAGs.
    pub(crate) is_fixed: bool,
}

impl Kind {
    pub(crate) const COUNT: usize = 48;

    /// Returns the kind of a number below the count.
    pub(crate) const fn number(number: usize) -> Self {
        Self {
            is_edf: number % 2 == 1,
            is_divided: number / 2 % 2 == 1,
            has_sinks: number / 4 % 2 == 1,
            is_fixed: number / 8 % 2 == 1,
            keeps: [Some(false), Some(true), None][number / 16],
        }
    }
}

/// Draws a task set of any kind.
pub(crate) fn sample(random: &mut Random) -> Sample {
    let kind = Kind::number(random.below(Kind::COUNT));
    sample_of(kind, random)
}

/// Draws a task set: up to 4 DAGs of up to 8 subtasks, from light to full load,
/// deadlines below, at and beyond the period, priorities by DAG or by subtask.
pub(crate) fn sample_of(kind: Kind, random: &mut Random) -> Sample {
    let cores = random.between(1 + u64::from(kind.is_divided), 5);
    let count = random.between(1 + u64::from(kind.is_divided), 4);
    let pipelined = random.between(0, 2) == 0;
    let by_subtask = random.between(0, 3) == 0;
    let load = random.between(1, 8);
    let first = random.between(1, (cores - 1).max(1));
    let cores_of = |dag: u64| match (kind.is_divided, dag % 2) {
        (false, _) => cores,
        (true, 0) => first,
        (true, _) => cores - first,
    };
    let mut specs = Vec::new();
    for dag in 0..count {
        let own = cores_of(dag);
        specs.push(draw_dag(random, own, count * load, pipelined));
        let spec = specs.last_mut().expect("just pushed");
        spec.name = format!("{dag} of {count}");
        let levels = random.between(1, 6);
        for (position, subtask) in spec.subtasks.iter_mut().enumerate() {
            let number = if by_subtask {
                random.between(0, levels)
            } else {
                dag
            };
            subtask.priority = u32::try_from(number).ok().map(Priority);
            let first = dag == 0 && position == 0;
            subtask.non_preemptive = kind.keeps.is_none() && (first || random.between(0, 1) == 0);
        }
        if kind.has_sinks && (dag == 0 || random.between(0, 2) == 0) {
            draw_sinks(random, spec);
        }
        if kind.is_fixed && (dag == 0 || random.between(0, 2) == 0) {
            spec.order = Order::Fixed;
        }
        if random.between(0, 9) == 0 {
            spec.in_flight = u32::try_from(random.between(1, 2)).ok();
        }
        let cluster = u32::try_from(dag % 2).expect("0 or 1");
        spec.cluster = kind.is_divided.then_some(ClusterId(cluster));
    }
    let sizes = [first, cores - first].map(|size| u32::try_from(size).expect("at most 5"));
    Sample {
        specs,
        policy: [Policy::StaticPriority, Policy::Edf][usize::from(kind.is_edf)],
        preemption: match kind.keeps {
            Some(true) => Preemption::Disabled,
            _ => Preemption::Enabled,
        },
        cores: u32::try_from(cores).expect("at most 5"),
        clusters: match kind.is_divided {
            true => Clusters::Of(sizes.to_vec()),
            false => Clusters::Undivided,
        },
    }
}

fn draw_dag(random: &mut Random, cores: u64, share: u64, pipelined: bool) -> DagSpec {
    let subtasks = usize::try_from(random.between(1, 8)).expect("at most 8");
    // Some DAGs have longer subtasks, which others may have to wait for.
    let scale = [1, 1, 6][random.below(3)];
    let wcets: Vec<u64> = (0..subtasks)
        .map(|_| scale * random.between(1, 9))
        .collect();
    let density = random.between(1, 6);
    let mut edges = Vec::new();
    for to in 1..subtasks {
        for from in 0..to {
            if random.between(0, density) == 0 {
                edges.push((from, to));
            }
        }
    }
    let volume: u64 = wcets.iter().sum();
    let longest = wcets.iter().max().copied().unwrap_or(1);
    let period = (volume * share).div_ceil(cores * 4) + random.between(0, 10);
    let (period, deadline) = if pipelined {
        let period = period.max(longest);
        (
            period,
            period * random.between(1, 4) + random.between(0, period),
        )
    } else {
        let period = period.max(volume / cores + longest);
        (period, period - random.between(0, period / 4))
    };
    let mut spec = spec(period, deadline, &wcets, &edges, 0);
    spec.offset_ns = random.between(0, 2) * random.between(0, period);
    spec
}

/// Gives most sinks a deadline of their own.
fn draw_sinks(random: &mut Random, spec: &mut DagSpec) {
    let deadline = spec.relative_deadline_ns.expect("given");
    let wcets = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    let least = wcets.max().unwrap_or(1).min(deadline).max(deadline / 4);
    for (position, subtask) in spec.subtasks.iter_mut().enumerate() {
        if spec.edges.iter().all(|&(from, _)| from != position) && random.between(0, 2) > 0 {
            subtask.relative_deadline_ns = Some(random.between(least, deadline));
        }
    }
}
