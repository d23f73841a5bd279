//! The scheduler against a brute-force reference, on random sets of DAGs.
//!
//! Each set is run twice: in virtual time, and by a driver that takes every way that
//! the scheduler offers (`drive.rs`). Starts, finishes, preemptions, all that is
//! reported and all counters have to be those of the reference.
//!
//! Each set comes from a seed. When the scheduler and the reference differ, the
//! set is shrunk as long as they still do, and printed with its seed. More or
//! other sets: `SCHED_DAG_SETS=100000 SCHED_DAG_SEED=7 cargo test -p sched-dag
//! --test properties`.

mod drive;
mod pair;
mod record;
mod reference;
mod replay;
mod set;
mod shrink;
#[path = "../support/mod.rs"]
mod support;

use sched_dag::DagStatistics;
use set::Set;
use support::number;
pub(crate) use support::random;
use support::random::Random;

/// What can be asked of both: everything that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Outcome {
    /// For each DAG, job and subtask.
    instances: Vec<Vec<Vec<InstanceOutcome>>>,
    /// For each DAG and job.
    jobs: Vec<Vec<JobOutcome>>,
    /// For each DAG.
    statistics: Vec<DagStatistics>,
    /// For each DAG and subtask how many jobs it was late in, if it is a sink.
    sink_misses: Vec<Vec<Option<u64>>>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct InstanceOutcome {
    ready_ns: Option<u64>,
    start_ns: Option<u64>,
    finish_ns: Option<u64>,
    failed_ns: Option<u64>,
    cancelled_ns: Option<u64>,
    preemptions: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct JobOutcome {
    /// When it was due, if it was released or skipped.
    nominal_ns: Option<u64>,
    released_ns: Option<u64>,
    skipped_ns: Option<u64>,
    aborted_ns: Option<u64>,
    ended_ns: Option<u64>,
    missed_ns: Option<u64>,
    /// Whether the DAG was ended while the job was in flight.
    is_cut: bool,
    /// Whether a fault has cut it, and the DAG went on.
    has_failed: bool,
}

/// Returns the first difference between the scheduler and the reference.
fn difference(set: &Set) -> Option<String> {
    let expected = reference::simulate(set);
    let is_disturbed =
        (set.dags.iter()).any(|dag| !dag.pauses_ns.is_empty() || dag.stop_ns.is_some());
    // Virtual time knows neither pauses nor stops, and tells of no nominal release.
    let mut untold = expected.clone();
    let jobs = untold.jobs.iter_mut().flatten();
    jobs.for_each(|job| job.nominal_ns = None);
    let replayed = (!is_disturbed).then(|| ("virtual time", &untold, replay::replay(set)));
    let driven = [("any driver", &expected, drive::drive(set))];
    let runs = replayed.into_iter().chain(driven);
    runs.into_iter().find_map(|(by, expected, happened)| {
        let difference = match happened {
            Ok(happened) => first_difference(expected, &happened),
            Err(reason) => Some(reason),
        };
        difference.map(|difference| format!("by {by}: {difference}"))
    })
}

fn first_difference(expected: &Outcome, happened: &Outcome) -> Option<String> {
    let jobs = expected.jobs.iter().enumerate();
    for (dag, job) in jobs.flat_map(|(dag, jobs)| (0..jobs.len()).map(move |job| (dag, job))) {
        for subtask in 0..expected.instances[dag][job].len() {
            let one = expected.instances[dag][job][subtask];
            let other = happened.instances[dag][job][subtask];
            if one != other {
                return Some(format!(
                    "dag {dag} job {job} subtask {subtask}:\nexpected {one:?}\nhappened {other:?}"
                ));
            }
        }
        let (one, other) = (expected.jobs[dag][job], happened.jobs[dag][job]);
        if one != other {
            return Some(format!(
                "dag {dag} job {job}:\nexpected {one:?}\nhappened {other:?}"
            ));
        }
    }
    if expected.sink_misses != happened.sink_misses {
        let (expected, happened) = (&expected.sink_misses, &happened.sink_misses);
        return Some(format!(
            "misses of sinks:\nexpected {expected:?}\nhappened {happened:?}"
        ));
    }
    (expected.statistics != happened.statistics).then(|| {
        let (expected, happened) = (&expected.statistics, &happened.statistics);
        format!("statistics:\nexpected {expected:?}\nhappened {happened:?}")
    })
}

/// Compares `count` sets that `draw` makes with the reference.
fn compare(what: &str, count: u64, draw: fn(&mut Random) -> Set) {
    look_for(difference, what, count, draw);
}

fn look_for(
    difference: fn(&Set) -> Option<String>,
    what: &str,
    count: u64,
    draw: fn(&mut Random) -> Set,
) {
    let count = number("SCHED_DAG_SETS", count);
    let first_seed = number("SCHED_DAG_SEED", 1);
    println!("{what}: {count} sets from seed {first_seed} on");
    for seed in (first_seed..).take(usize::try_from(count).expect("a count")) {
        let set = draw(&mut Random::new(seed));
        if difference(&set).is_some() {
            let smallest = shrink::shrink(set, |set| difference(set).is_some());
            panic!(
                "{what}: the scheduler is wrong\nseed {seed}, shrunk to\n{smallest}\n{}",
                difference(&smallest).unwrap_or_default()
            );
        }
    }
}

#[test]
fn schedules_are_those_of_the_definition() {
    compare("schedules", 10_000, |random| {
        set::draw(random, set::Overruns::Never)
    });
}

#[test]
fn overruns_are_those_of_the_rules() {
    compare("overruns", 10_000, |random| {
        set::draw(random, set::Overruns::Often)
    });
}

#[test]
fn ended_dags_leave_the_others_alone() {
    compare("ends", 10_000, set::draw_failing);
}

#[test]
fn signals_pauses_and_stops_are_those_of_the_rules() {
    compare("disturbances", 10_000, set::draw_disturbed);
}

#[test]
fn the_short_ways_are_the_long_one() {
    look_for(pair::difference, "short ways", 10_000, set::draw_disturbed);
}
