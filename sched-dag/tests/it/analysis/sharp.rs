//! The second form without its excess of 1, against the published one and against runs that change at
//! any sixth of a unit.

use random::Random;
use sched_dag::analysis::{
    InterferenceBound, SchedulabilityTest, Task, multi_path_edf, multi_path_fp,
};
use sched_dag::{DagSpec, Policy, Preemption};

use super::simulate::{commit, responses, spec};
use super::{FP, answered, settings};

type DrawnDag = (u64, u64, Vec<u64>, Vec<(usize, usize)>);

/// Draws a few DAGs with times of a few units, the most urgent first, and cores.
fn drawn(random: &mut Random) -> (Vec<DrawnDag>, u32) {
    let dags = (0..random.within(2..=5)).map(|_| {
        let subtasks = random.within(1..=3);
        let wcets: Vec<u64> = (0..subtasks).map(|_| random.within(1..=3)).collect();
        let edges: Vec<_> = random.edges(subtasks, 60).collect();
        let volume: u64 = wcets.iter().sum();
        let deadline = volume + random.within(0..=4);
        (deadline + random.within(0..=6), deadline, wcets, edges)
    });
    (dags.collect(), random.within(2..=3))
}

fn specs(dags: &[DrawnDag], unit: u64) -> Vec<DagSpec> {
    let specs = dags
        .iter()
        .zip(0..)
        .map(|((period, deadline, wcets, edges), priority)| {
            let wcets: Vec<u64> = wcets.iter().map(|wcet| wcet * unit).collect();
            spec(period * unit, deadline * unit, &wcets, edges, priority)
        });
    specs.collect()
}

#[test]
fn without_the_excess_bounds_are_never_longer_and_often_1_less() {
    let mut less = [0; 2];
    for number in 0..4_000 {
        let (dags, cores) = drawn(&mut Random::new(number));
        let tasks = dags.iter().map(|(period, deadline, wcets, edges)| {
            Task::new(*period, *deadline, wcets.clone(), edges).expect("small")
        });
        let tasks: Vec<Task> = tasks.collect();
        let all: Vec<&Task> = tasks.iter().collect();
        for (at, solve) in [multi_path_fp, multi_path_edf].into_iter().enumerate() {
            let sharp = solve(&all, cores, InterferenceBound::Sharp);
            let published = solve(&all, cores, InterferenceBound::Chains).unwrap_or_default();
            for (published, sharp) in published.into_iter().zip(sharp.unwrap_or_default()) {
                assert!(sharp <= published, "{number}: {dags:?}");
                less[at] += u64::from(sharp < published);
            }
        }
    }
    assert!(less.iter().all(|&count| count > 300), "{less:?}");
}

#[test]
fn runs_that_change_at_sixths_keep_to_the_bounds() {
    let (mut bounds, mut met) = (0, 0);
    for number in 0..4_000 {
        let random = &mut Random::new(number);
        let (dags, cores) = drawn(random);
        let kind = random.one_of(&[FP, (Policy::Edf, Preemption::Enabled)]);
        let found = answered(&specs(&dags, 1), &settings(kind, cores)).bounds;
        let is_sharp =
            |dag: usize| found[dag].is_some_and(|of| of.test == SchedulabilityTest::SharpClip);
        let sharp: Vec<usize> = (0..dags.len()).filter(|&dag| is_sharp(dag)).collect();
        let mut longest = vec![0; if sharp.is_empty() { 0 } else { dags.len() }];
        for _ in 0..20 * sharp.len() {
            let mut specs = specs(&dags, 6);
            for spec in &mut specs {
                spec.offset_ns = random.within(0..=6 * 12);
            }
            let seen = responses(
                &commit(&specs, kind.0, cores),
                (kind.0, kind.1, cores),
                600,
                |of| {
                    let wcet = dags[of.dag.index()].2[of.subtask.index()];
                    6 * wcet - random.within(0..=5) * u64::from(random.once_in(3))
                },
            );
            for (longest, seen) in longest.iter_mut().zip(seen) {
                *longest = seen.max(*longest);
            }
        }
        for (dag, longest) in longest.into_iter().enumerate() {
            let bound = found[dag].map_or(u64::MAX, |of| 6 * of.bound_ns);
            assert!(
                longest <= bound,
                "{number}, dag {dag}: {longest}, {dags:?} {found:?}"
            );
            met += u64::from(longest == bound && is_sharp(dag));
        }
        bounds += sharp.len() as u64;
    }
    println!("{met} of {bounds} bounds are met");
    assert!(bounds > 500 && 2 * met > bounds);
}
