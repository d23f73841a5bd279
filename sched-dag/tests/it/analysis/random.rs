//! Random task sets from a seed.

use common::random::Random;
use sched_dag::analysis::{AnalysisSettings, Overheads};
use sched_dag::{
    Activation, ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, DagSpec, Policy,
    Preemption, SubtaskOrder, TaskSet, Wait, verify,
};

use super::drawn::set;

/// A task set with the platform it runs on.
#[derive(Debug)]
pub(crate) struct Sample {
    pub(crate) specs: Vec<DagSpec>,
    pub(crate) policy: Policy,
    pub(crate) preemption: Preemption,
    pub(crate) cores: u32,
    pub(crate) clusters: CoreDivision,
}

impl Sample {
    pub(crate) fn settings(&self) -> AnalysisSettings {
        AnalysisSettings {
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
    let kind = Kind::number(random.index(Kind::COUNT));
    sample_of(kind, random)
}

/// Draws a task set for up to 5 cores.
pub(crate) fn sample_of(kind: Kind, random: &mut Random) -> Sample {
    let cores = random.within(1 + u32::from(kind.is_divided)..=5);
    let first = random.within(1..=(cores - 1).max(1));
    let sizes = match kind.is_divided {
        true => vec![first, cores - first],
        false => vec![cores],
    };
    let mut specs = set(random, 1, &sizes);
    for (spec, number) in specs.iter_mut().zip(0..) {
        for (position, subtask) in spec.subtasks.iter_mut().enumerate() {
            let first = number == 0 && position == 0;
            subtask.non_preemptive = kind.keeps.is_none() && (first || random.once_in(2));
        }
        if kind.has_sinks && (number == 0 || random.once_in(3)) {
            draw_sinks(random, spec);
        }
        if kind.is_fixed && (number == 0 || random.once_in(3)) {
            spec.order = SubtaskOrder::Fixed;
        }
        if random.once_in(8) {
            spec.activation = Activation::Sporadic;
        }
        if random.once_in(10) {
            spec.in_flight = Some(random.within(1..=2));
        }
        spec.cluster = kind.is_divided.then_some(ClusterId(number % 2));
    }
    Sample {
        specs,
        policy: [Policy::StaticPriority, Policy::Edf][usize::from(kind.is_edf)],
        preemption: match kind.keeps {
            Some(true) => Preemption::Disabled,
            _ => Preemption::Enabled,
        },
        cores,
        clusters: match kind.is_divided {
            true => CoreDivision::Of(sizes),
            false => CoreDivision::Undivided,
        },
    }
}

/// Gives most sinks a deadline of their own.
fn draw_sinks(random: &mut Random, spec: &mut DagSpec) {
    let deadline = spec.relative_deadline_ns.expect("given");
    let wcets = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    let least = wcets.max().unwrap_or(1).min(deadline).max(deadline / 4);
    for (position, subtask) in spec.subtasks.iter_mut().enumerate() {
        if spec.edges.iter().all(|&(from, _)| from != position) && !random.once_in(3) {
            subtask.relative_deadline_ns = Some(random.within(least..=deadline));
        }
    }
}

/// Gives some subtasks waits, whose segments may be unknown.
pub(crate) fn draw_waits(random: &mut Random, specs: &mut [DagSpec]) {
    for spec in specs {
        let room = spec
            .period_ns
            .unwrap_or(8)
            .min(spec.relative_deadline_ns.unwrap_or(8))
            / 8;
        for subtask in &mut spec.subtasks {
            let mut left_ns = subtask.wcet_ns.unwrap_or(0);
            let are_known = !random.once_in(5);
            while random.once_in(4) && left_ns > 1 {
                let segment_ns = random.within(1..=left_ns - 1);
                left_ns -= segment_ns;
                subtask.waits.push(Wait {
                    limit_ns: random.within(0..=room),
                    segment_ns: are_known.then_some(segment_ns),
                });
            }
        }
    }
}
