//! Exhaustive small worlds: every order of events, in every state that can be reached.
//!
//! A *world* is a small set of DAGs with its options. From its first state on each step
//! that a driver may take is taken: time goes on, at once or past what was due (a driver
//! that comes late); of the instances that have started one or two complete or fail, on
//! their core or after they have lost it, and a fault may cost the DAG or a job; a DAG is stopped, closed, paused or resumed, or
//! gets a signal. After each step the scheduler has to be as the rules say (`rules`), which are
//! written there once more, without a queue, a counter or a timer. States are told apart by
//! the hashes of both, so each is entered once.
//!
//! By default a selection of worlds is explored. All of them, in some minutes:
//! `WORLDS=all cargo test --release -p sched-dag --test worlds -- --nocapture`.

mod explore;
#[path = "../support/random.rs"]
mod random;
#[allow(dead_code, reason = "its own test uses all of it")]
#[path = "../properties/rules/mod.rs"]
mod rules;
#[allow(dead_code, reason = "its own test uses all of it")]
#[path = "../properties/set.rs"]
mod set;
mod world;

use explore::{Counts, explore};

#[test]
fn every_order_of_events_is_scheduled_by_the_rules() {
    let all = std::env::var("WORLDS").is_ok_and(|worlds| worlds == "all");
    let mut worlds = world::all();
    let there_are = worlds.len();
    if !all {
        worlds.retain(|world| world::subtasks(world) <= 3);
        worlds = worlds.into_iter().step_by(29).collect();
    }
    let mut counts = Counts::default();
    for world in &worlds {
        if let Err(found) = explore(world, &mut counts) {
            panic!("{world}\n{found}");
        }
    }
    println!("{counts} of {there_are}");
    // Time, completions, faults of two kinds, stops, closings, pauses, resumptions, signals.
    assert_eq!(counts.kinds.len(), 9, "{counts}");
}
