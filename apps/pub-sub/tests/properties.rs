//! What must hold of any trace, on random ones. A failing test's last line of output
//! is the seed that repeats it.

#[path = "../../../sched-dag/tests/support/random.rs"]
mod random;

use std::collections::HashSet;
use std::num::NonZeroUsize;

use pub_sub::{
    AgePenalty, ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer,
};
use random::Random;

const SEEDS: u64 = 300;

/// A topic and a stamp; a message is named by its position in the trace.
type Trace = Vec<(usize, u64)>;

/// What left at one arrival.
#[derive(Debug, Default, PartialEq, Eq)]
struct Departures {
    sets: Vec<Vec<usize>>,
    dropped: Vec<usize>,
    replaced: Vec<usize>,
}

impl Outlet<usize> for Departures {
    fn emitted(&mut self, set: Set<'_, usize>) {
        self.sets.push(set.map(|stamped| stamped.message).collect());
    }

    fn dropped(&mut self, _topic: usize, message: Stamped<usize>) {
        self.dropped.push(message.message);
    }

    fn replaced(&mut self, _topic: usize, message: Stamped<usize>) {
        self.replaced.push(message.message);
    }
}

fn feed(synchronizer: &mut dyn Synchronizer<usize>, trace: &Trace) -> Vec<Departures> {
    let arrivals = trace.iter().enumerate();
    let departures = arrivals.map(|(message, &(topic, stamp_ns))| {
        let mut departures = Departures::default();
        synchronizer.arrive(topic, Stamped { stamp_ns, message }, &mut departures);
        departures
    });
    departures.collect()
}

fn for_each_seed(mut property: impl FnMut(&mut Random)) {
    for seed in 0..SEEDS {
        println!("seed {seed}");
        property(&mut Random::new(seed));
    }
}

/// Stamps that are about periodic, and repeat and go backwards.
fn wild_trace(random: &mut Random, topics: usize) -> Trace {
    let stamps = (0..200).map(|arrival| {
        let topic = random.below(topics);
        (topic, arrival / topics as u64 + random.between(0, 12))
    });
    stamps.collect()
}

/// Stamps that go up in each topic by at least a number.
fn ordered_trace(random: &mut Random, topics: usize, gaps_ns: &[u64], arrivals: u64) -> Trace {
    let mut last_ns = vec![0; topics];
    let stamps = (0..arrivals).map(|_| {
        let topic = random.below(topics);
        last_ns[topic] += gaps_ns[topic] + random.between(1, 20);
        (topic, last_ns[topic])
    });
    stamps.collect()
}

fn parameters(topics: usize, queue_size: usize) -> Parameters {
    let queue_size = NonZeroUsize::new(queue_size).expect("not 0");
    Parameters::new(topics, queue_size)
}

fn random_synchronizer(
    random: &mut Random,
    topics: usize,
    queue_size: usize,
) -> Box<dyn Synchronizer<usize>> {
    if random.between(0, 2) == 0 {
        return Box::new(ExactTime::new(topics, queue_size));
    }
    let factor = random.between(4, 12);
    let mut parameters = parameters(topics, queue_size)
        .age_penalty(AgePenalty::from_factor(factor, 2).expect("in range"))
        .lower_bound_ns(random.below(topics), random.between(0, 5));
    if random.between(0, 1) == 0 {
        parameters = parameters.max_interval_ns(random.between(0, 10));
    }
    Box::new(ApproximateTime::new(parameters))
}

#[test]
fn every_message_leaves_once_or_is_held() {
    for_each_seed(|random| {
        let topics = 1 + random.below(5);
        let queue_size = 1 + random.below(8);
        let trace = wild_trace(random, topics);
        let mut synchronizer = random_synchronizer(random, topics, queue_size);
        let mut left = HashSet::new();
        for (message, &(topic, stamp_ns)) in trace.iter().enumerate() {
            let mut departures = Departures::default();
            let stamped = Stamped { stamp_ns, message };
            synchronizer.arrive(topic, stamped, &mut departures);
            for set in &departures.sets {
                let of: Vec<_> = set.iter().map(|&message| trace[message].0).collect();
                assert_eq!(of, (0..topics).collect::<Vec<_>>(), "one of each topic");
            }
            let leaving = departures.sets.iter().flatten();
            let others = departures.dropped.iter().chain(&departures.replaced);
            for &leaving in leaving.chain(others) {
                assert!(leaving <= message, "before it arrives");
                assert!(left.insert(leaving), "{leaving} leaves twice");
            }
            let held: Vec<_> = (0..topics).map(|topic| synchronizer.held(topic)).collect();
            assert!(held.iter().all(|&held| held <= queue_size), "{held:?}");
            assert_eq!(held.iter().sum::<usize>() + left.len(), message + 1);
        }
    });
}

#[test]
fn approximate_sets_are_in_the_order_of_arrival_in_each_topic() {
    for_each_seed(|random| {
        let topics = 1 + random.below(5);
        let queue_size = 1 + random.below(8);
        let trace = wild_trace(random, topics);
        let mut approximate = ApproximateTime::new(parameters(topics, queue_size));
        let departures = feed(&mut approximate, &trace);
        let sets: Vec<_> = departures.iter().flat_map(|at| &at.sets).collect();
        for pair in sets.windows(2) {
            let mut topics = pair[0].iter().zip(pair[1]);
            assert!(topics.all(|(before, after)| before < after), "{pair:?}");
        }
    });
}

/// Exact time as plainly as it can be said: a list of what is held, searched from
/// end to end.
fn exact_by_brute_force(trace: &Trace, topics: usize, queue_size: usize) -> Vec<Departures> {
    let mut held: Vec<usize> = Vec::new();
    let mut all = Vec::new();
    for (message, &(_, stamp_ns)) in trace.iter().enumerate() {
        let mut departures = Departures::default();
        if let Some(older) = held.iter().position(|&held| trace[held] == trace[message]) {
            departures.replaced.push(held.remove(older));
        }
        held.push(message);
        let same_stamp = |topic| held.iter().find(|&&held| trace[held] == (topic, stamp_ns));
        let set: Vec<usize> = (0..topics).filter_map(same_stamp).copied().collect();
        let mut oldest_ns = 0;
        if set.len() == topics {
            held.retain(|message| !set.contains(message));
            departures.sets.push(set);
            oldest_ns = stamp_ns;
        }
        let mut stamps_ns: Vec<u64> = held.iter().map(|&held| trace[held].1).collect();
        stamps_ns.sort_unstable();
        stamps_ns.dedup();
        stamps_ns.retain(|&ns| ns >= oldest_ns);
        let kept_ns = stamps_ns.split_off(stamps_ns.len().saturating_sub(queue_size));
        (held, departures.dropped) = held
            .into_iter()
            .partition(|&held| kept_ns.contains(&trace[held].1));
        let by_stamp = |&message: &usize| (trace[message].1, trace[message].0);
        departures.dropped.sort_unstable_by_key(by_stamp);
        all.push(departures);
    }
    all
}

#[test]
fn exact_agrees_with_brute_force() {
    for_each_seed(|random| {
        let topics = 1 + random.below(4);
        let queue_size = 1 + random.below(8);
        let trace = wild_trace(random, topics);
        let expected = exact_by_brute_force(&trace, topics, queue_size);
        assert_eq!(
            feed(&mut ExactTime::new(topics, queue_size), &trace),
            expected
        );
        let unlimited = exact_by_brute_force(&trace, topics, usize::MAX);
        assert_eq!(feed(&mut ExactTime::new(topics, 0), &trace), unlimited);
    });
}

/// Returns the least distance from the earliest to the latest of one message of each
/// topic, of which one is given.
fn least_size(topics: &[Vec<u64>], given: usize, given_ns: u64) -> u64 {
    let mut ends = vec![(given_ns, given_ns)];
    for (topic, stamps_ns) in topics.iter().enumerate() {
        if topic != given {
            let wider = ends.iter().flat_map(|&(earliest_ns, latest_ns)| {
                let widen = move |&ns: &u64| (earliest_ns.min(ns), latest_ns.max(ns));
                stamps_ns.iter().map(widen)
            });
            ends = wider.collect();
        }
    }
    let sizes = ends
        .iter()
        .map(|(earliest_ns, latest_ns)| latest_ns - earliest_ns);
    sizes.min().expect("every topic has a message")
}

#[test]
fn with_no_penalty_each_set_is_the_smallest_around_its_pivot() {
    let mut sets = 0;
    for_each_seed(|random| {
        let topics = 2 + random.below(2);
        let trace = ordered_trace(random, topics, &[0; 3], 36);
        let no_penalty = AgePenalty::from_factor(1, 0).unwrap();
        let parameters = parameters(topics, 100).age_penalty(no_penalty);
        let departures = feed(&mut ApproximateTime::new(parameters), &trace);
        // What the search can choose from, those yet to arrive included.
        let mut left: Vec<Vec<u64>> = vec![Vec::new(); topics];
        for &(topic, stamp_ns) in &trace {
            left[topic].push(stamp_ns);
        }
        for set in departures.iter().flat_map(|at| &at.sets) {
            let first_ns = left.iter().map(|stamps_ns| stamps_ns[0]).enumerate();
            let (pivot, pivot_ns) = first_ns.max_by_key(|&(_, ns)| ns).unwrap();
            let stamps_ns: Vec<u64> = set.iter().map(|&message| trace[message].1).collect();
            assert_eq!(stamps_ns[pivot], pivot_ns, "the pivot is in the set");
            let size = stamps_ns.iter().max().unwrap() - stamps_ns.iter().min().unwrap();
            assert_eq!(size, least_size(&left, pivot, pivot_ns));
            for (left, &stamp_ns) in left.iter_mut().zip(&stamps_ns) {
                left.retain(|&ns| ns > stamp_ns);
            }
            sets += 1;
        }
    });
    assert!(sets > 1000, "only {sets} sets were looked at");
}

#[test]
fn lower_bounds_that_hold_change_when_sets_come_but_not_which() {
    let mut sooner = 0;
    for_each_seed(|random| {
        let topics = 2 + random.below(3);
        let gaps_ns: Vec<u64> = (0..topics).map(|_| random.between(0, 30)).collect();
        let trace = ordered_trace(random, topics, &gaps_ns, 100);
        let unbounded = parameters(topics, 100);
        let bounded = gaps_ns
            .iter()
            .enumerate()
            .fold(unbounded.clone(), |parameters, (topic, &gap_ns)| {
                parameters.lower_bound_ns(topic, gap_ns)
            });
        let sets = |parameters| {
            let departures = feed(&mut ApproximateTime::new(parameters), &trace);
            let arrivals = departures.into_iter().enumerate();
            let sets =
                arrivals.flat_map(|(at, all)| all.sets.into_iter().map(move |set| (at, set)));
            sets.collect::<Vec<_>>()
        };
        let (later, earlier) = (sets(unbounded), sets(bounded));
        assert!(later.len() <= earlier.len());
        for ((later_at, later_set), (earlier_at, earlier_set)) in later.iter().zip(&earlier) {
            assert_eq!(later_set, earlier_set);
            assert!(earlier_at <= later_at);
            sooner += usize::from(earlier_at < later_at);
        }
    });
    assert!(sooner > 100, "only {sooner} sets came sooner");
}

#[test]
fn only_differences_of_stamps_matter() {
    for_each_seed(|random| {
        let topics = 1 + random.below(4);
        let queue_size = 1 + random.below(8);
        let trace = wild_trace(random, topics);
        let later = trace
            .iter()
            .map(|&(topic, ns)| (topic, u64::MAX - 1000 + ns));
        let later: Trace = later.collect();
        let mut again = random.clone();
        let mut synchronizer = random_synchronizer(random, topics, queue_size);
        let mut same = random_synchronizer(&mut again, topics, queue_size);
        assert_eq!(feed(&mut *synchronizer, &trace), feed(&mut *same, &later));
    });
}
