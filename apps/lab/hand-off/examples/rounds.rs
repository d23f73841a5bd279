//! The graphs of `hand-off` on Linux, job after job, for a counter of instructions.
//!
//! One worker polls, and idle time is skipped. Bodies are empty; no event is kept. The source calls
//! [`round`] in the first job of each round. A counter of instructions between two such calls
//! counts whole rounds, without the start of the run and its end.
//!
//! Words: the shape, its size, the number of DAGs, of jobs in a round, and of rounds.

use std::env;
use std::hint::black_box;
use std::time::Duration;

use hand_off::{Shape, commit, empty};
use linux::{Linux, Mechanism};

fn main() {
    let words: Vec<String> = env::args().collect();
    let number = |place: usize| words[place].parse::<u16>().expect("a number");
    let subtasks = usize::from(number(2));
    let shape = match &*words[1] {
        "chain" => Shape::Chain(subtasks),
        "fork-join" => Shape::ForkJoin(subtasks),
        _ => Shape::Layered { subtasks, seed: 1 },
    };
    let (dags, jobs_a_round, rounds) = (number(3), number(4), number(5));
    let linux = Linux::new(1, Mechanism::Poll).expect("this computer has a processor");
    let linux = linux.with(|terms| terms.most_events = 0);
    let linux = linux.skipping_idle_time();
    let mut left = 1;
    let source = move || {
        left -= 1;
        if left == 0 {
            left = jobs_a_round;
            round();
        }
    };
    let jobs = u64::from(jobs_a_round) * u64::from(rounds) + 1;
    // No job is as long as the period.
    let period = Duration::from_secs(1);
    commit(shape, jobs, period, vec![empty(shape, dags, source)]);
    drop(linux.run().expect("DAGs are committed"));
}

/// Marks the beginning of a round; a counter knows the function by its name.
#[inline(never)]
fn round() {
    black_box(());
}
