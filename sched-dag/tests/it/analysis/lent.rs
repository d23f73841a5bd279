//! Bounds of lent cores against virtual time: divided sets keep the bounds that divided them.
//!
//! Random sets with heavy DAGs are divided by the commit's own assignment. The analysis of what
//! came of it, which knows only cores and edges, must prove each DAG; and no job may respond later
//! than its bound, with full and with shortened execution times, in phase or not, periodic or by
//! signals. Each set that is divided has 400 jobs and more. `LENT_SETS=n` draws n sets in place of 2,000.

use common::random::Random;
use sched_dag::analysis::{AnalysisSettings, SchedulabilityTest, answer, assign};
use sched_dag::{AssignmentReason, DagSpec, LendingAttempt, Policy, Preemption, Priority, TaskSet};

use super::random::draw_waits;
use super::simulate::{commit, spec};
use super::together::breach;
use super::{FP, settings};
use crate::support::number;

/// Returns a DAG that is heavy now and then, and whose deadline is not beyond its period.
fn dag(random: &mut Random, priority: u32) -> DagSpec {
    let count = 1 + random.index(9);
    let wcets: Vec<u64> = (0..count).map(|_| random.within(1..=9)).collect();
    let edges: Vec<_> = random.edges(count, 30).collect();
    let volume: u64 = wcets.iter().sum();
    let deadline = (volume * random.within(50..=200) / 100).max(9);
    let period = deadline + random.within(0..=deadline / 2);
    let mut dag = spec(period, deadline, &wcets, &edges, priority);
    dag.offset_ns = random.within(0..=period);
    if random.index(3) == 0 {
        dag.activation = sched_dag::Activation::Sporadic;
    }
    dag
}

/// Returns DAGs, and for how many cores; the one with the shorter deadline is the more urgent.
pub(super) fn set(random: &mut Random) -> (Vec<DagSpec>, u32) {
    let cores = 2 + u32::try_from(random.index(4)).expect("few");
    let count = 2 + random.index(4);
    let mut specs: Vec<DagSpec> = (0..count).map(|_| dag(random, 0)).collect();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&dag| specs[dag].relative_deadline_ns);
    for (rank, &dag) in (0..).zip(&order) {
        for subtask in &mut specs[dag].subtasks {
            subtask.priority = Some(Priority(rank));
        }
    }
    (specs, cores)
}

#[test]
fn divided_sets_keep_their_bounds() {
    let sets = number("LENT_SETS", 2_000);
    let (mut by_attempt, mut groups, mut refused) = ([0_u64; 5], 0_u64, 0_u64);
    for seed in 1..=sets {
        let mut random = Random::new(seed);
        let (specs, cores) = set(&mut random);
        let settings = settings(FP, cores);
        let mut task_set = commit(&specs, Policy::StaticPriority, cores);
        if assign(&mut task_set, &settings).is_err() {
            refused += 1;
            continue;
        }
        let attempt = match task_set.dags()[0].why_there() {
            Some(AssignmentReason::Whole { .. }) => LendingAttempt::Whole,
            Some(
                AssignmentReason::Owner { attempt, .. } | AssignmentReason::Member { attempt, .. },
            ) => attempt,
            _ => continue,
        };
        let place = LendingAttempt::ALL.iter().position(|of| *of == attempt);
        by_attempt[place.expect("one of all")] += 1;
        groups += u64::from(task_set.dags().iter().any(|dag| !dag.affinity().is_empty()));
        let answer = answer(&task_set, &settings);
        assert!(
            answer.is_proven(),
            "seed {seed}: {:?}",
            answer.first_failing
        );
        let breach = breach(&task_set, &settings, &answer, &mut random);
        let places: Vec<_> = (task_set.dags().iter())
            .map(|dag| (dag.cluster(), dag.affinity().to_vec(), dag.why_there()))
            .collect();
        assert_eq!(breach, None, "seed {seed}: {places:?}");
    }
    println!("by attempt {by_attempt:?}, with parts of clusters {groups}, refused {refused}");
    if sets >= 2_000 {
        // The last attempt alone accepts one set in 1,200.
        let often = if sets >= 20_000 { 5 } else { 4 };
        assert!(!by_attempt[..often].contains(&0), "{by_attempt:?}");
        assert!(groups > 20 && refused > 20, "{groups} {refused}");
    }
}

/// Pins subtasks as a person might: of a DAG all, some or none, to any cores. Now and then what is
/// not pinned is in one of two groups.
fn pin(specs: &mut [DagSpec], cores: u32, random: &mut Random) {
    let first = random.within(0..=2 * cores).min(cores) % cores;
    for spec in specs {
        let percent = [0, 0, 50, 100][random.index(4)];
        for subtask in &mut spec.subtasks {
            let core = random.within(0..=cores - 1);
            subtask.core = random.chance(percent).then_some(core);
        }
        if first > 0 {
            let groups = [0..first, first..cores];
            spec.affinity = groups[random.index(2)].clone().collect();
        }
    }
}

/// Adds what owners and members have not: waits, kept cores, deadlines beyond periods and EDF.
fn mix(specs: &mut [DagSpec], settings: &mut AnalysisSettings, random: &mut Random) {
    let (waits, keeps, late) = (random.chance(60), random.index(4), random.chance(20));
    for spec in specs.iter_mut() {
        // Room for all that is counted in full.
        spec.period_ns = spec.period_ns.map(|ns| ns * random.within(2..=9));
        spec.relative_deadline_ns = spec.period_ns.map(|ns| ns * if late { 2 } else { 1 });
        spec.in_flight = Some(2);
        for subtask in &mut spec.subtasks {
            subtask.non_preemptive = keeps == 1 && random.chance(30);
        }
    }
    for spec in specs.iter_mut().filter(|_| waits) {
        draw_waits(random, spec);
    }
    if keeps == 2 {
        settings.preemption = Preemption::Disabled;
    }
    if random.chance(30) {
        settings.policy = Policy::Edf;
    }
}

/// Returns a set as a person might have pinned it, which mixes all else if it is to.
pub(super) fn pinned(random: &mut Random, is_mixed: bool) -> (TaskSet, AnalysisSettings) {
    let (mut specs, cores) = set(random);
    pin(&mut specs, cores, random);
    let mut settings = settings(FP, cores);
    if is_mixed {
        mix(&mut specs, &mut settings, random);
    }
    (commit(&specs, settings.policy, cores), settings)
}

#[test]
fn what_a_person_has_pinned_keeps_its_bounds() {
    let sets = number("PINNED_SETS", 3_000);
    let (mut owners, mut members, mut beside, mut unproven) = (0_u64, 0_u64, 0_u64, 0_u64);
    for seed in 1..=sets {
        let mut random = Random::new(seed);
        let (task_set, settings) = pinned(&mut random, seed % 2 == 0);
        let answer = answer(&task_set, &settings);
        for bound in &answer.bounds {
            match bound.map(|bound| bound.test) {
                Some(SchedulabilityTest::Owner) => owners += 1,
                Some(SchedulabilityTest::Member) => members += 1,
                Some(_) => beside += 1,
                None => unproven += 1,
            }
        }
        let breach = breach(&task_set, &settings, &answer, &mut random);
        assert_eq!(breach, None, "seed {seed}: {task_set:#?}");
    }
    println!("{owners} owners, {members} members, {beside} beside, {unproven} others");
    if sets >= 3_000 {
        assert!(owners > 100 && members > 200 && beside > 2_000 && unproven > 200);
    }
}
