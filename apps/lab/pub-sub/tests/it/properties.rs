//! Properties of any trace, checked on random ones, of stamps that repeat and go backwards.
//! A failing test's last line of output is the seed that repeats it.

use std::collections::HashSet;
use std::num::NonZeroUsize;

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
