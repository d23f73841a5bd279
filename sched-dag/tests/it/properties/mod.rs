//! The scheduler against its rules, on random sets of DAGs and in every order of events.
//!
//! The rules are judged by the law ([`sched_dag::law`]), which shares no code with the scheduler,
//! and where that does not judge by `releases.rs` and `waits.rs`; which instances run, by `tables.rs`, too.
//! `walk.rs` is the driver. That the
//! law finds what is wrong is shown in `tests/it/journal.rs`.
//!
//! Each set comes from a seed. More or other sets: `SCHED_DAG_SETS=100000 SCHED_DAG_SEED=7 cargo
//! test -p sched-dag --test it properties`.

mod explore;
mod releases;
mod tables;
mod waits;
mod walk;

use crate::support::number;
use crate::support::set::{self, Set};
use random::Random;
use releases::SAID;
use sched_dag::journal::EventKind;
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::{DagId, Instance};
use walk::{Step, Walk};

/// Judges `count` sets that `draw` makes; a judge says what is wrong.
fn check(
    count: u64,
    draw: impl Fn(&mut Random) -> Set,
    mut judge: impl FnMut(&Set, &mut Random) -> Result<(), String>,
) {
    let count = number("SCHED_DAG_SETS", count);
    let first_seed = number("SCHED_DAG_SEED", 1);
    println!("{count} sets from seed {first_seed} on");
    for seed in first_seed..first_seed + count {
        let mut random = Random::new(seed);
        let set = draw(&mut random);
        if let Err(found) = judge(&set, &mut random) {
            panic!("seed {seed}: {found}\n{set:?}");
        }
    }
}

/// Takes instants at random, up to the end of all.
fn walk(set: &Set, random: &mut Random, is_late: bool, told: &mut [u64]) -> Result<(), String> {
    let mut walk = Walk::new(set);
    let mut way = Vec::new();
    for number in 0..400 {
        let next_ns = walk.scheduler.next_event_ns();
        let later_ns = walk.now_ns + random.within(1..=8);
        let now_ns = match (random.within(0..=5), next_ns) {
            (0, _) => walk.now_ns,
            (1..4, Some(next_ns)) => next_ns,
            (_, Some(next_ns)) if !is_late => later_ns.min(next_ns),
            _ => later_ns,
        };
        // In the end everything ends.
        let is_calm = number > 80;
        let steps = match number {
            0 => Vec::new(),
            _ => steps(&walk, random, is_late, is_calm),
        };
        let taken = walk.instant(now_ns, &steps);
        way.push((now_ns, steps));
        taken.map_err(|found| format!("{found}\nafter {way:?}"))?;
        if is_calm && walk.is_over() {
            for event in walk.scheduler.log.journal.events() {
                told[event.what as usize] += 1;
            }
            return walk.judged(true);
        }
    }
    Err(format!("it does not end\n{way:?}"))
}

fn steps(walk: &Walk<'_>, random: &mut Random, is_late: bool, is_calm: bool) -> Vec<Step> {
    let mut may_end: Vec<Instance> = match is_late {
        true => walk.started(),
        false => walk.running().collect(),
    };
    let dag = DagId(u32::try_from(random.index(walk.set.specs.len())).expect("few DAGs"));
    let faults = if walk.set.choices.is_multiple_of(2) {
        2
    } else {
        30
    };
    let mut steps = Vec::new();
    for _ in 0..random.within(0..=2) {
        let present: Vec<WaitId> = walk.waits.present().collect();
        if !present.is_empty() && random.chance(30) {
            let mut wait = present[random.index(present.len())];
            // Some answer another wait of the instance, or one of another job.
            match random.index(6) {
                0 => wait.number ^= 1,
                1 => wait.instance.job ^= 1,
                _ => {}
            }
            steps.push(Step::Ask(Request::Answer(wait)));
            continue;
        }
        let kind = random.within(0..=if is_calm { 69 } else { 99 });
        if kind < 70 && !may_end.is_empty() {
            let instance = may_end.swap_remove(random.index(may_end.len()));
            let fails = !is_calm && random.chance(faults);
            steps.push(match (fails, random.chance(80)) {
                (false, _) => Step::Complete(instance),
                (true, true) => Step::Replace(instance),
                (true, false) => Step::Fail(instance),
            });
            continue;
        }
        let request = match kind {
            70 => Some(Request::End(dag)),
            71 => Some(Request::Close(dag)),
            72..78 => Some(Request::Pause(dag)),
            78..88 => Some(Request::Resume(dag)),
            88.. if walk.set.is_sporadic(dag) => Some(Request::Signal(dag)),
            _ => None,
        };
        steps.extend(request.map(Step::Ask));
    }
    steps
}

/// Walks through sets, which have to be worth it: all that may happen has to happen somewhere.
fn check_walks(is_late: bool) {
    let mut told = [0; 256];
    check(3_000, set::draw_disturbed, |set, random| {
        walk(set, random, is_late, &mut told)
    });
    if number("SCHED_DAG_SETS", 3_000) >= 3_000 {
        let lacks = |what: &EventKind| told[*what as usize] < 100;
        assert_eq!(SAID.into_iter().find(lacks), None, "it is rare");
    }
}

#[test]
fn a_punctual_driver_keeps_the_rules() {
    check_walks(false);
}

#[test]
fn a_late_driver_keeps_the_rules() {
    check_walks(true);
}

#[test]
fn every_order_of_events_keeps_the_rules() {
    check(40, set::draw_tiny, |set, _| {
        let states = explore::explore(set)?;
        println!("{states} states");
        Ok(())
    });
}
