//! Answers about many DAGs, whose workloads are added up: the same as one by one.

use sched_dag::analysis::{answer, answer_compact};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, Priority, TaskSet, verify,
};

use crate::random::Random;
use crate::settings;
use crate::simulate::spec;

/// Draws a set of up to 70 DAGs, of periods and sizes that are alike or far from it, that may
/// overlap in one set of three, with deadlines of sinks in one of four.
fn set(random: &mut Random, policy: Policy) -> Vec<DagSpec> {
    let count = random.within(5, 70);
    let (may_overlap, has_sinks) = (random.within(0, 2) == 0, random.within(0, 3) == 0);
    let interleaves = random.within(0, 1) == 0;
    let (share, spread) = (random.within(2, 40), random.within(1, 20));
    let dag = |dag| {
        let most = if random.within(0, 4) == 0 { 200 } else { 9 };
        let subtasks = usize::try_from(random.within(1, 9)).expect("at most 9");
        let wcets: Vec<u64> = (0..subtasks).map(|_| random.within(1, most)).collect();
        let mut edges = Vec::new();
        for to in 1..subtasks {
            edges.extend(
                (0..to)
                    .filter(|_| random.within(0, 5) == 0)
                    .map(|from| (from, to)),
            );
        }
        let volume: u64 = wcets.iter().sum();
        let period = volume + count * share * random.within(5, 5 * spread + 5) / 5;
        let deadline = match may_overlap {
            true if random.within(0, 3) == 0 => 2 * period,
            _ => period - random.within(0, (period - volume) / 4),
        };
        let mut spec = spec(period, deadline, &wcets, &edges, 0);
        for subtask in 0..subtasks {
            let number = dag + u64::from(interleaves) * random.within(0, count / 5);
            if policy == Policy::StaticPriority {
                spec.subtasks[subtask].priority = u32::try_from(number).ok().map(Priority);
            }
            let is_sink = edges.iter().all(|&(from, _)| from != subtask);
            if has_sinks && is_sink && random.within(0, 3) == 0 {
                let least_ns = volume.min(deadline);
                spec.subtasks[subtask].relative_deadline_ns =
                    Some(random.within(least_ns, deadline));
            }
        }
        spec
    };
    (0..count).map(dag).collect()
}

fn task_set(specs: &[DagSpec], policy: Policy, cores: u32) -> Option<TaskSet> {
    let options =
        CommitOptions::new(policy, cores).with_construction(ConstructionPolicy::any_graph());
    verify(specs, &options)
        .ok()
        .map(|verified| verified.task_set)
}

#[test]
fn by_sums_and_one_by_one_the_bounds_are_the_same() {
    for (policy, preemption) in [
        (Policy::StaticPriority, Preemption::Enabled),
        (Policy::Edf, Preemption::Enabled),
        (Policy::StaticPriority, Preemption::Disabled),
        (Policy::Edf, Preemption::Disabled),
    ] {
        let (mut proven, mut failed) = (0, 0);
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let specs = set(&mut random, policy);
            let cores = [1, 2, 4, 7][usize::try_from(seed % 4).expect("below 4")];
            let Some(task_set) = task_set(&specs, policy, cores) else {
                continue;
            };
            let settings = settings((policy, preemption), cores);
            let by_sums = answer(&task_set, &settings);
            let each = answer_compact(&task_set, &settings);
            assert_eq!(by_sums, each, "seed {seed}, {policy:?}, {preemption:?}");
            proven += each.bounds.iter().filter(|bound| bound.is_some()).count();
            failed += each.bounds.iter().filter(|bound| bound.is_none()).count();
        }
        assert!(proven > 500 && failed > 200, "{proven}, {failed}");
    }
}
