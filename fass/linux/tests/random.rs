//! Random scenarios, with all that a run has to bear: preemption, overload, panics, exceeded
//! budgets, cores that are divided, and a thread that pauses, resumes and ends DAGs meanwhile.
//! All rules hold in each run, and in the end the program has the threads and files that it
//! began with.
//!
//! `LINUX_SETS` says how many sets (12), `LINUX_SEED` which (1).

mod support;

use std::fs;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use linux::{Control, Linux, Mechanism, Run};
use random::Random;
use scenarios::Scenario;
use sched_dag::DagId;
use support::{alone, breaches, ms};

#[test]
fn random_sets_keep_the_rules() {
    let (sets, first) = (number("LINUX_SETS", 12), number("LINUX_SEED", 1));
    let before = held();
    for seed in first..first + sets {
        let mut random = Random::new(seed);
        let mechanisms = [Mechanism::Fifo, Mechanism::Poll, Mechanism::Normal];
        let alone = alone(random.within(1..=2), random.one_of(&mechanisms));
        let run = run(&alone.machine, seed, &mut random);
        let found = breaches(&run);
        assert!(found.is_empty(), "LINUX_SEED={seed}: {found:?}");
    }
    // A thread whose budget was exceeded ends after the run.
    let begin = Instant::now();
    while held() != before && begin.elapsed() < Duration::from_secs(10) {
        thread::sleep(ms(10));
    }
    assert_eq!(held(), before, "threads and files");
}

fn number(name: &str, otherwise: u64) -> u64 {
    let text = std::env::var(name).ok();
    text.map_or(otherwise, |text| text.parse().expect("a whole number"))
}

/// Counts the program's threads and files.
fn held() -> [usize; 2] {
    ["/proc/self/task", "/proc/self/fd"]
        .map(|folder| fs::read_dir(folder).expect("Linux has it").count())
}

/// Commits a drawn scenario on the machine and runs it.
fn run(machine: &Linux, seed: u64, random: &mut Random) -> Run {
    let mut set = Scenario::random(seed, 0, machine.terms().scheduler.cores, ms(150));
    for subtask in set.dags.iter_mut().flat_map(|dag| &mut dag.subtasks) {
        subtask.priority = Some(random.within(0..=9));
        subtask.computes = !random.once_in(4);
        // Sometimes it is exceeded.
        subtask.budget = (subtask.waits.is_empty() && random.once_in(20)).then(|| ms(1));
        if let (Some(budget), Some(wcet)) = (subtask.budget, &mut subtask.wcet) {
            *wcet = budget.min(*wcet);
        }
    }
    machine.change(|terms| {
        terms.scheduler.policy = set.policy;
        terms.scheduler.preemption = set.preemption;
        terms.divide(&set.clusters);
    });
    set.commit().expect("the set is sound");
    let control = machine.control().expect("it is committed");
    let last = u32::try_from(set.dags.len() - 1).expect("few DAGs");
    let meddler = meddle(control, last, random.clone());
    let run = machine.run().expect("it is committed");
    meddler.join().expect("it does not panic");
    run
}

/// Pauses, resumes and ends DAGs for a while.
fn meddle(control: Control, last: u32, mut random: Random) -> JoinHandle<()> {
    thread::spawn(move || {
        for _ in 0..random.within(0..=7) {
            thread::sleep(ms(random.within(1..=20)));
            let dag = DagId(random.within(0..=last));
            match random.within(0..=9) {
                0 => control.end(dag),
                1..5 => control.pause(dag),
                _ => control.resume(dag),
            }
        }
    })
}
