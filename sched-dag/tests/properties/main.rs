//! The scheduler against a brute-force reference, on random sets of DAGs.
//!
//! Each set comes from a seed. When the scheduler and the reference differ, the
//! set is shrunk as long as they still do, and printed with its seed. More or
//! other sets: `SCHED_DAG_SETS=100000 SCHED_DAG_SEED=7 cargo test -p sched-dag
//! --test properties`.

#[path = "../support/random.rs"]
mod random;
mod reference;
mod replay;
mod set;
mod shrink;

use random::Random;
use set::Set;

/// What can be asked of both: everything that happened.
#[derive(Debug, PartialEq, Eq)]
struct Outcome {
    /// For each DAG, job and subtask: start, finish, preemptions.
    instances: Vec<Vec<Vec<InstanceOutcome>>>,
    /// For each DAG and job.
    jobs: Vec<Vec<JobOutcome>>,
    /// For each DAG the releases that still waited at its end.
    dropped: Vec<u64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct InstanceOutcome {
    start_ns: Option<u64>,
    finish_ns: Option<u64>,
    failed_ns: Option<u64>,
    cancelled_ns: Option<u64>,
    preemptions: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct JobOutcome {
    released_ns: Option<u64>,
    skipped_ns: Option<u64>,
    aborted_ns: Option<u64>,
    ended_ns: Option<u64>,
    missed_ns: Option<u64>,
    /// Whether the DAG was ended while the job was in flight.
    is_cut: bool,
}

/// Returns the first difference between the scheduler and the reference.
fn difference(set: &Set) -> Option<String> {
    let expected = reference::simulate(set);
    let replayed = match replay::replay(set) {
        Ok(replayed) => replayed,
        Err(reason) => return Some(reason),
    };
    for (dag, jobs) in expected.jobs.iter().enumerate() {
        for job in 0..jobs.len() {
            for subtask in 0..expected.instances[dag][job].len() {
                let (one, other) = (
                    expected.instances[dag][job][subtask],
                    replayed.instances[dag][job][subtask],
                );
                if one != other {
                    return Some(format!(
                        "dag {dag} job {job} subtask {subtask}:\nexpected {one:?}\nreplayed {other:?}"
                    ));
                }
            }
            let (one, other) = (expected.jobs[dag][job], replayed.jobs[dag][job]);
            if one != other {
                return Some(format!(
                    "dag {dag} job {job}:\nexpected {one:?}\nreplayed {other:?}"
                ));
            }
        }
    }
    (expected.dropped != replayed.dropped).then(|| {
        let (expected, replayed) = (&expected.dropped, &replayed.dropped);
        format!("dropped releases:\nexpected {expected:?}\nreplayed {replayed:?}")
    })
}

fn number(variable: &str, default: u64) -> u64 {
    let given = std::env::var(variable).ok();
    given.map_or(default, |text| text.parse().expect("a whole number"))
}

/// Compares `count` sets that `draw` makes.
fn compare(what: &str, count: u64, draw: fn(&mut Random) -> Set) {
    let count = number("SCHED_DAG_SETS", count);
    let first_seed = number("SCHED_DAG_SEED", 1);
    println!("{what}: {count} sets from seed {first_seed} on");
    for seed in (first_seed..).take(usize::try_from(count).expect("a count")) {
        let set = draw(&mut Random::new(seed));
        if difference(&set).is_some() {
            let smallest = shrink::shrink(set, |set| difference(set).is_some());
            panic!(
                "{what}: the scheduler differs from the reference\nseed {seed}, shrunk to\n{smallest}\n{}",
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
