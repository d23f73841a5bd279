//! Random sets of DAGs, with all that a run has to bear: preemption, overload, panics, exceeded
//! budgets, cores that are divided, and a thread that pauses, resumes and stops DAGs meanwhile.
//! All rules hold in each run, and in the end the program has the threads and files that it
//! began with.
//!
//! `LINUX_SETS` says how many sets (12), `LINUX_SEED` which (1).

#[path = "../../../sched-dag/tests/support/random.rs"]
mod random;
mod support;

use std::fs;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use fass::{
    ConstructionPolicy, Dag, Occupation, OverrunPolicy, Policy, SubtaskAttributes, create_dag,
    execute_for, finish_create_dags_with,
};
use linux::{Control, Linux, Mechanism, Run};
use random::Random;
use sched_dag::DagId;
use support::{alone, breaches, ms, spin};

#[test]
fn random_sets_keep_the_rules() {
    let (sets, first) = (number("LINUX_SETS", 12), number("LINUX_SEED", 1));
    let before = held();
    for seed in first..first + sets {
        let mut random = Random::new(seed);
        let policy = [Policy::StaticPriority, Policy::Edf][random.below(2)];
        let mechanisms = [Mechanism::Fifo, Mechanism::Poll, Mechanism::Normal];
        let alone = alone(1 + random.small(2), mechanisms[random.below(3)]);
        alone
            .machine
            .change(|terms| terms.scheduler.policy = policy);
        let run = run(&alone.machine, &mut random);
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

impl Random {
    fn small(&mut self, limit: usize) -> u32 {
        u32::try_from(self.below(limit)).expect("it is small")
    }

    fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }

    /// Returns so many milliseconds, at least and at most.
    fn ms(&mut self, least: u64, most: u64) -> Duration {
        ms(self.between(least, most))
    }
}

/// Commits a drawn set on the machine and runs it.
fn run(machine: &Linux, random: &mut Random) -> Run {
    let dags: Vec<Dag> = (0..=random.below(4))
        .map(|number| dag(number, random))
        .collect();
    let sizes: &[u32] = match machine.terms().scheduler.cores {
        2 if random.one_in(2) => &[1, 1],
        _ => &[],
    };
    machine.change(|terms| terms.divide(sizes));
    if !sizes.is_empty() {
        dags.iter().for_each(|dag| _ = dag.cluster(random.small(2)));
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("the set is sound");
    let control = machine.control().expect("it is committed");
    let meddler = meddle(control, dags.len(), random.clone());
    let run = machine.run().expect("it is committed");
    meddler.join().expect("it does not panic");
    run
}

fn dag(number: usize, random: &mut Random) -> Dag {
    let dag = create_dag();
    let period = random.ms(2, 10);
    dag.name(&format!("dag {number}"))
        .jobs(random.between(5, 24));
    dag.period(period).relative_deadline(period);
    dag.in_flight(1 + random.small(3));
    let overruns = [
        OverrunPolicy::Queue,
        OverrunPolicy::Skip,
        OverrunPolicy::Abort,
    ];
    dag.overrun(overruns[random.small(3) as usize]);
    let faulty = random.one_in(8).then(|| random.between(0, 9));
    let subtasks: Vec<_> = (0..=random.below(6))
        .map(|subtask| {
            let us = random.between(0, 1_499);
            let mut attributes =
                SubtaskAttributes::named(&format!("subtask {subtask}")).priority(random.small(10));
            if random.one_in(5) {
                attributes = attributes.non_preemptive();
            }
            if random.one_in(20) {
                // Sometimes it is exceeded.
                attributes = attributes.budget(ms(1));
            }
            let holds = random.one_in(4);
            let function = move |job| {
                match holds {
                    true => execute_for(Duration::from_micros(us), Occupation::Hold),
                    false => spin(us),
                }
                assert!(subtask > 0 || faulty != Some(job), "meant");
            };
            dag.register_untyped_subtask(function, attributes)
        })
        .collect();
    for (place, later) in subtasks.iter().enumerate().skip(1) {
        // Two at most, so that some join.
        let earlier = [random.below(place), random.below(place)];
        dag.precede(&subtasks[earlier[0]], later);
        if earlier[0] != earlier[1] {
            dag.precede(&subtasks[earlier[1]], later);
        }
    }
    dag
}

/// Pauses, resumes and stops DAGs for a while.
fn meddle(control: Control, dags: usize, mut random: Random) -> JoinHandle<()> {
    thread::spawn(move || {
        for _ in 0..random.below(8) {
            thread::sleep(random.ms(1, 8));
            let dag = DagId(random.small(dags));
            match random.below(10) {
                0 => control.stop(dag),
                1..5 => control.pause(dag),
                _ => control.resume(dag),
            }
        }
    })
}
