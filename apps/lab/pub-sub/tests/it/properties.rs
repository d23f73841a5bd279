//! Properties of any trace, checked on random ones, of stamps that repeat and go backwards; and what
//! no trace of the originals has. (That both policies do what those do, step by step, is for
//! `./scripts/oracle synchronizer`.) The last line of output of a failing test is the seed that repeats it.

#[path = "../../../../../sched-dag/tests/it/counting.rs"]
mod counting;

use std::collections::HashSet;
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};

use pub_sub::{
    AgePenalty, ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer,
};
use random::Random;

const SEEDS: u64 = 300;

/// The messages that left at one arrival. A message is named by its position in the trace.
#[derive(Debug, Default)]
struct Departures {
    sets: Vec<Vec<usize>>,
    others: Vec<usize>,
}

impl Outlet<usize> for Departures {
    fn emitted(&mut self, set: Set<'_, usize>) {
        self.sets.push(set.map(|stamped| stamped.message).collect());
    }

    fn dropped(&mut self, _topic: usize, message: Stamped<usize>) {
        self.others.push(message.message);
    }

    fn replaced(&mut self, _topic: usize, message: Stamped<usize>) {
        self.others.push(message.message);
    }
}

fn approximate(random: &mut Random, topics: usize, queue_size: usize) -> ApproximateTime<usize> {
    let queue_size = NonZeroUsize::new(queue_size).expect("not 0");
    let factor = random.within(4..=12);
    let mut parameters = Parameters::new(topics, queue_size);
    parameters.age_penalty = AgePenalty::from_factor(factor, 2).expect("in range");
    let topic = random.index(topics);
    parameters.lower_bounds_ns[topic] = random.within(0..=5);
    if random.chance(50) {
        parameters.max_interval_ns = Some(random.within(0..=10));
    }
    ApproximateTime::new(parameters)
}

#[test]
fn every_message_leaves_once_or_is_held_and_approximate_sets_are_in_order() {
    for seed in 0..SEEDS {
        println!("seed {seed}");
        let mut random = Random::new(seed);
        let topics = 1 + random.index(5);
        let queue_size = 1 + random.index(8);
        let is_exact = random.chance(33);
        let mut synchronizer: Box<dyn Synchronizer<usize>> = match is_exact {
            true => Box::new(ExactTime::new(topics, queue_size)),
            false => Box::new(approximate(&mut random, topics, queue_size)),
        };
        let mut left = HashSet::new();
        let mut last_set: Option<Vec<usize>> = None;
        let mut topic_of = Vec::new();
        for message in 0..200 {
            let topic = random.index(topics);
            topic_of.push(topic);
            let stamp_ns = (message / topics) as u64 + random.within(0..=12);
            let mut departures = Departures::default();
            synchronizer.arrive(topic, Stamped { stamp_ns, message }, &mut departures);
            for set in &departures.sets {
                let of = set.iter().map(|&message| topic_of[message]);
                assert!(of.eq(0..topics), "one of each topic");
                let last = last_set.replace(set.clone()).unwrap_or_default();
                let rises = last.iter().zip(set).all(|(before, after)| before < after);
                assert!(is_exact || rises, "{last:?} {set:?}");
            }
            for &leaving in departures.sets.iter().flatten().chain(&departures.others) {
                assert!(leaving <= message, "before it arrives");
                assert!(left.insert(leaving), "{leaving} leaves twice");
            }
            // One that vanished without notice would count as held for good.
            let mut held = vec![0; topics];
            (0..=message)
                .filter(|it| !left.contains(it))
                .for_each(|it| held[topic_of[it]] += 1);
            assert!(held.iter().all(|&held| held <= queue_size), "{held:?}");
        }
    }
}

#[test]
fn the_largest_stamps_and_bounds_are_no_trouble() {
    let (most, mut departures) = (u64::MAX, Departures::default());
    let mut parameters = Parameters::new(2, NonZeroUsize::new(2).expect("not 0"));
    let penalty = AgePenalty::from_factor(AgePenalty::MOST_FACTOR, 0);
    parameters.age_penalty = penalty.expect("in range");
    parameters.lower_bounds_ns[0] = most;
    let mut synchronizer = ApproximateTime::new(parameters);
    for (message, (topic, stamp_ns)) in [(0, most - 1), (1, most), (0, 0), (1, 0)]
        .into_iter()
        .enumerate()
    {
        synchronizer.arrive(topic, Stamped { stamp_ns, message }, &mut departures);
    }
    assert_eq!(departures.sets, [[0, 1], [2, 3]]);
    assert_eq!(departures.others, [0; 0]);
}

/// One of each policy.
fn both(topics: usize, queue_size: usize) -> [Box<dyn Synchronizer<usize>>; 2] {
    let approximate = approximate(&mut Random::new(1), topics, queue_size);
    let exact = ExactTime::new(topics, queue_size);
    [Box::new(exact), Box::new(approximate)]
}

#[test]
fn an_unknown_topic_is_refused() {
    for mut synchronizer in both(2, 1) {
        let (stamp_ns, message) = (0, 0);
        let arrival = Stamped { stamp_ns, message };
        let arrive = || synchronizer.arrive(2, arrival, &mut Departures::default());
        let panic = catch_unwind(AssertUnwindSafe(arrive)).expect_err("there are two");
        let said = panic.downcast::<String>().expect("text");
        assert!(said.starts_with("there is no topic 2"), "{said}");
    }
}

/// Counts what leaves.
struct Counted(usize);

impl Outlet<usize> for Counted {
    fn emitted(&mut self, set: Set<'_, usize>) {
        self.0 += set.len();
    }

    fn dropped(&mut self, _topic: usize, _message: Stamped<usize>) {
        self.0 += 1;
    }
}

#[test]
fn nothing_is_allocated_after_construction() {
    for mut synchronizer in both(3, 4) {
        let mut counted = Counted(0);
        let (before, ..) = counting::allocated();
        for message in 0..999 {
            let stamp_ns = (message * message % 17) as u64;
            synchronizer.arrive(message % 3, Stamped { stamp_ns, message }, &mut counted);
        }
        let (after, ..) = counting::allocated();
        assert_eq!(after, before);
        assert!(counted.0 > 800, "{}", counted.0);
    }
}
