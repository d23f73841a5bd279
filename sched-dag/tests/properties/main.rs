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
mod rules;
mod set;
mod shrink;
#[path = "../support/mod.rs"]
mod support;
mod walk;

use sched_dag::journal::Event;
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::VirtualTime;
use set::Set;
pub(crate) use support::random;
use support::random::Random;
use support::{Script, number, scheduler};

/// Returns the first difference between the scheduler and the rules, or between drivers.
fn difference(set: &Set) -> Option<String> {
    let driven = match drive::drive(set) {
        Ok(driven) => driven,
        Err(found) => return Some(found),
    };
    let is_disturbed =
        (set.dags.iter()).any(|dag| !dag.pauses_ns.is_empty() || dag.stop_ns.is_some());
    if is_disturbed {
        // Virtual time knows neither pauses nor stops.
        return None;
    }
    let signals = set.signals().into_iter();
    let run = Script::new(|instance| set.execution_ns(instance))
        .failing(|instance| set.fails(instance))
        .replacing(|instance| set.is_replaceable(instance))
        .asking(signals.map(|(at_ns, dag)| (at_ns, Request::Signal(dag))))
        .run(VirtualTime::new(scheduler(&set.specs(), set.options)));
    // Core numbers apart, and the order within an instant.
    let in_order = |events: &[Event]| {
        let of = |event: &Event| {
            (
                event.time_ns,
                event.what as u8,
                event.dag,
                event.job,
                event.subtask,
            )
        };
        let mut events: Vec<_> = events.iter().map(of).collect();
        events.sort_unstable();
        events
    };
    let (driven, run) = (in_order(&driven), in_order(&run.events));
    (driven != run).then(|| format!("in virtual time\n{run:?}\nby another driver\n{driven:?}"))
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
    compare("schedules", 4_000, |random| {
        set::draw(random, set::Overruns::Never)
    });
}

#[test]
fn overruns_are_those_of_the_rules() {
    compare("overruns", 4_000, |random| {
        set::draw(random, set::Overruns::Often)
    });
}

#[test]
fn ended_dags_leave_the_others_alone() {
    compare("ends", 4_000, set::draw_failing);
}

#[test]
fn signals_pauses_and_stops_are_those_of_the_rules() {
    compare("disturbances", 4_000, set::draw_disturbed);
}

#[test]
fn the_short_ways_are_the_long_one() {
    look_for(walk::difference, "short ways", 4_000, set::draw_disturbed);
}
