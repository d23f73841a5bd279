//! Every bound against virtual time, in sets that have all features together.
//!
//! A set is drawn for a pair of [`FEATURES`], and with any of the others besides. Of its runs the
//! worst so far is varied, again and again: its releases, executions and waits, as long as what
//! responds comes no further away from its bound. Every other run has faults, pauses or modes, too.
//! No job or sink that has a bound may respond later, miss a deadline, or find no room, and the law
//! judges the first run of each climb. Offsets and activations are no matter of the analysis:
//! half of the climbs have sporadic DAGs alone, so that any job may come at any time.
//!
//! Of what the commit's own assignment divides it has proven each DAG. A WCET that is not known,
//! or 0, proves nothing of its DAG. (That each wait ends as it should, `properties` hold.)
//!
//! A failure prints its seed, set and run. `ANALYSIS_SEED=n` draws its set alone;
//! `ANALYSIS_JOBS=n` simulates so many jobs, on all processors. How many jobs had a bound is printed
//! by pairs of features; of 10^8 each pair that has any has 10^5.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;

use random::Random;
use sched_dag::analysis::{AnalysisResult, NotProvenReason, SchedulabilityTest, TaskError, answer};
use sched_dag::{Activation, AssignmentReason, LendingAttempt, SubtaskId, TaskSet};

use super::climb::{Case, Climbed};
use super::random::{FEATURES, Sample, bit, sample_with};
use crate::support::number;

/// How many jobs are simulated where no other number is wanted.
const JOBS: u64 = 400_000;

/// How many runs of a climb are drawn, and how often the worst one is varied.
const RUNS: [u64; 2] = [4, 10];

/// How many there are in the long form, where a pair of features has a thousandth of them.
const ENOUGH: u64 = 100_000_000;

const COUNT: usize = FEATURES.len();

const PAIRS: u64 = (COUNT * COUNT) as u64;

/// The counts of simulated jobs.
#[derive(Default)]
struct Coverage {
    /// Drawn, and those of their DAGs that have a bound.
    dags: u64,
    bounds: u64,
    jobs: u64,
    by_test: BTreeMap<String, u64>,
    /// Jobs of DAGs with a bound, by two features that their cluster or their run has.
    of_pairs: [[u64; COUNT]; COUNT],
    /// Sinks with a smaller bound than their job.
    tighter_sinks: u64,
    /// Divided sets by how cores are lent, those with groups, and those that are refused.
    by_attempt: [u64; LendingAttempt::ALL.len()],
    with_groups: u64,
    refused: u64,
    breaches: Vec<String>,
}

impl Coverage {
    /// Returns a pair of features with the fewest jobs of those that have any, and how many.
    fn rarest(&self) -> (u64, u64) {
        let jobs = (0..).zip(self.of_pairs.iter().flatten().copied());
        let rarest = jobs.filter(|(_, jobs)| *jobs > 0).min_by_key(|of| of.1);
        rarest.unwrap_or_default()
    }

    fn is_over(&self, wanted: u64) -> bool {
        let is_thin = wanted >= ENOUGH && self.rarest().1 < ENOUGH / 1000;
        let has_enough = self.jobs >= wanted && !(is_thin && self.jobs < 2 * wanted);
        has_enough || self.breaches.len() > 9
    }

    fn add(&mut self, task_set: &TaskSet, answer: &AnalysisResult) {
        self.dags += answer.bounds.len() as u64;
        self.tighter_sinks += tighter(answer);
        for bound in answer.bounds.iter().flatten() {
            self.bounds += 1;
            *self.by_test.entry(bound.test.to_string()).or_default() += 1;
        }
        if let Some(attempt) = attempt(task_set) {
            self.by_attempt[attempt] += 1;
            let mut dags = task_set.dags().iter();
            self.with_groups += u64::from(dags.any(|dag| !dag.affinity().is_empty()));
        }
    }

    /// Adds the jobs of each set of features.
    fn count(&mut self, climbed: Climbed) {
        for (features, jobs) in climbed {
            self.jobs += jobs;
            let has = |feature: &usize| features >> feature & 1 == 1;
            for one in (0..COUNT).filter(has) {
                for other in (0..COUNT).filter(has) {
                    self.of_pairs[one][other] += jobs;
                }
            }
        }
    }
}

/// Returns by which attempt cores are lent, if they are.
fn attempt(task_set: &TaskSet) -> Option<usize> {
    use AssignmentReason::{Member, Owner, Table, Whole};
    let attempt = match task_set.dags()[0].why_there()? {
        Whole { .. } => LendingAttempt::Whole,
        Owner { attempt, .. } | Table { attempt, .. } | Member { attempt, .. } => attempt,
        _ => return None,
    };
    LendingAttempt::ALL.iter().position(|of| *of == attempt)
}

/// Draws the set of a seed, and climbs.
fn climb(seed: u64, runs: [u64; 2], all: &Mutex<Coverage>) {
    let mut random = Random::new(seed);
    let all = || all.lock().expect("no thread panics with it");
    let pair = [seed % PAIRS / COUNT as u64, seed % COUNT as u64];
    let mut sample = sample_with(1 << pair[0] | 1 << pair[1], &mut random);
    for is_sporadic in [false, true] {
        for spec in sample.specs.iter_mut().filter(|_| is_sporadic) {
            spec.activation = Activation::Sporadic;
        }
        let settings = sample.settings();
        let Some(task_set) = sample.charged(&settings) else {
            all().refused += u64::from(sample.is_lent);
            return;
        };
        let features = sample.features(&task_set);
        let answer = answer(&task_set, &settings);
        if !is_consistent(&sample, &task_set, &answer) {
            let found = format!("seed {seed}: {answer:?} of {sample:?}");
            all().breaches.push(found);
        }
        if !is_sporadic {
            all().add(&task_set, &answer);
        }
        let task_set = Arc::new(task_set);
        let case = Case {
            task_set,
            settings,
            answer,
            features,
        };
        for is_disturbed in [false, true] {
            match case.climb(&mut random, is_disturbed, runs) {
                Ok(climbed) => all().count(climbed),
                Err(found) => {
                    let found = format!("seed {seed}: {found}\n{sample:?}\n{:?}", case.answer);
                    return all().breaches.push(found);
                }
            }
        }
    }
}

/// Reports whether an answer says of all what it says of each, whether all is proven of what is
/// divided, and what is unknown named.
fn is_consistent(sample: &Sample, task_set: &TaskSet, answer: &AnalysisResult) -> bool {
    let is_proven = answer.bounds.iter().all(Option::is_some);
    let names_unknown = sample
        .specs
        .iter()
        .zip(&answer.reasons)
        .all(|(spec, reason)| {
            let is_unknown = |wcet_ns: Option<u64>| wcet_ns.is_none_or(|ns| ns == 0);
            let mut subtasks = (0..).map(SubtaskId).zip(&spec.subtasks);
            let unknown = subtasks.find(|(_, subtask)| is_unknown(subtask.wcet_ns));
            unknown.is_none_or(|(subtask, _)| {
                *reason == Some(NotProvenReason::Unknown(TaskError::MissingWcet { subtask }))
            })
        });
    answer.is_proven() == is_proven && (is_proven || attempt(task_set).is_none()) && names_unknown
}

#[test]
fn bounds_hold_whatever_features_come_together() {
    let only = number("ANALYSIS_SEED", 0);
    let wanted = number("ANALYSIS_JOBS", JOBS) * u64::from(only == 0);
    let threads = match wanted > JOBS {
        true => thread::available_parallelism().map_or(1, usize::from),
        false => 1,
    };
    let (drawn, all) = (AtomicU64::new(0), Mutex::new(Coverage::default()));
    let now = || all.lock().expect("no thread panics with it");
    let work = || {
        loop {
            let number = drawn.fetch_add(1, Ordering::Relaxed);
            // In the long form every other set is drawn for what is rare.
            let pair = match wanted > JOBS && number % 2 == 1 {
                true => now().rarest().0,
                false => number / 2 * 11 % PAIRS,
            };
            let seed = number * PAIRS + pair;
            climb(if only > 0 { only } else { seed }, RUNS, &all);
            if now().is_over(wanted) {
                return;
            }
        }
    };
    thread::scope(|scope| (0..threads).for_each(|_| _ = scope.spawn(work)));
    let all = now();
    println!(
        "{} bounds of {} DAGs: {:?}",
        all.bounds, all.dags, all.by_test
    );
    println!(
        "{} jobs, {} sinks with a smaller bound than their job",
        all.jobs, all.tighter_sinks
    );
    println!("divided by attempts: {:?}", all.by_attempt);
    println!("jobs with a bound, in thousands, by pairs of features:");
    for (name, row) in FEATURES.iter().zip(&all.of_pairs) {
        let row = row.iter().map(|jobs| format!("{:>7}", jobs.div_ceil(1000)));
        println!("{name:>9}{}", row.collect::<String>());
    }
    assert!(all.breaches.is_empty(), "{}", all.breaches.join("\n"));
    if only == 0 {
        assert!(all.by_test.len() >= 9, "some test was never used");
        assert!(4 * all.bounds > all.dags, "too few bounds say little");
        assert!(all.tighter_sinks > 0, "too few");
        let alone = (0..COUNT).map(|feature| all.of_pairs[feature][feature]);
        assert!(alone.min() > Some(wanted / 500), "some feature is rare");
        let (_, least) = all.rarest();
        let is_thin = wanted >= ENOUGH && least < ENOUGH / 1000;
        assert!(!is_thin, "a pair has {least} jobs");
    }
}

/// Sets of what few have by chance, each with fewer runs.
#[test]
fn bounds_hold_where_cores_are_lent_or_have_tables_or_one_has_waits() {
    let all = Mutex::new(Coverage::default());
    for names in [
        ["lent", "preempt"],
        ["tables", "tables"],
        ["waits", "one core"],
    ] {
        let [one, other] = names.map(|name| bit(name).trailing_zeros());
        let pair = u64::from(one) * COUNT as u64 + u64::from(other);
        (1..=3_000).for_each(|number| climb(number * PAIRS + pair, [1, 1], &all));
    }
    let all = all.into_inner().expect("no thread panics with it");
    assert!(all.breaches.is_empty(), "{}", all.breaches.join("\n"));
    let (attempts, groups, refused) = (all.by_attempt, all.with_groups, all.refused);
    println!(
        "{attempts:?}, {groups} with groups, {refused} refused, {:?}",
        all.by_test
    );
    // The last attempt alone accepts one set in 1,200.
    assert!(!attempts[..4].contains(&0) && groups > 20 && refused > 20);
    for (test, least) in [
        (SchedulabilityTest::Table, 1_000),
        (SchedulabilityTest::Member, 200),
        (SchedulabilityTest::InGroup, 50),
        (SchedulabilityTest::Windows, 200),
    ] {
        assert!(all.by_test[&test.to_string()] > least, "{test}");
    }
}

/// Counts the sinks with a smaller bound than their job.
fn tighter(answer: &AnalysisResult) -> u64 {
    let pairs = answer.bounds.iter().zip(&answer.sinks_ns);
    let counts = pairs.map(|(whole, sinks_ns)| {
        let whole_ns = whole.map(|whole| whole.bound_ns);
        sinks_ns.iter().filter(|&&ns| ns < whole_ns).count() as u64
    });
    counts.sum()
}
