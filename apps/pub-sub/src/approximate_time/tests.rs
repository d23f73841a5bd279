//! Each numbered step on traces small enough to follow by hand. The age penalty is 0
//! unless said.

use core::num::NonZeroUsize;

use super::{AgePenalty, ApproximateTime, Ends, Parameters};
use crate::synchronizer::Written;
use crate::{Stamped, Synchronizer};

fn parameters(topics: usize, queue_size: usize) -> Parameters {
    let queue_size = NonZeroUsize::new(queue_size).unwrap();
    let no_penalty = AgePenalty::from_factor(1, 0).unwrap();
    Parameters::new(topics, queue_size).age_penalty(no_penalty)
}

/// A synchronizer and what left it; message i is the i-th arrival.
struct Bench {
    synchronizer: ApproximateTime<u64>,
    written: Written,
    arrivals: u64,
}

impl Bench {
    fn new(parameters: Parameters) -> Self {
        Self {
            synchronizer: ApproximateTime::new(parameters),
            written: Written::default(),
            arrivals: 0,
        }
    }

    /// Feeds (topic, stamp) and returns the sets that came out.
    fn feed(&mut self, arrivals: &[(usize, u64)]) -> Vec<Vec<u64>> {
        for &(topic, stamp_ns) in arrivals {
            let message = self.arrivals;
            let message = Stamped { stamp_ns, message };
            self.synchronizer.arrive(topic, message, &mut self.written);
            self.arrivals += 1;
        }
        core::mem::take(&mut self.written.sets)
    }

    fn dropped(&mut self) -> Vec<(usize, u64)> {
        core::mem::take(&mut self.written.dropped)
    }

    fn cursors(&self) -> Vec<usize> {
        let rings = self.synchronizer.rings.iter();
        rings.map(|ring| ring.cursor()).collect()
    }

    fn lossy(&self) -> Vec<bool> {
        let rings = self.synchronizer.rings.iter();
        rings.map(|ring| ring.lossy).collect()
    }
}

const NONE: [[u64; 2]; 0] = [];

#[test]
fn step_5_without_a_candidate_all_cursors_are_at_the_front() {
    let mut bench = Bench::new(parameters(2, 5).max_interval_ns(3));
    bench.feed(&[(0, 0), (0, 1), (1, 9)]);
    assert!(bench.synchronizer.candidate.is_none());
    assert_eq!(bench.cursors(), [0, 0]);
    bench.feed(&[(0, 8)]);
    assert!(bench.synchronizer.candidate.is_some());
    assert_eq!(bench.cursors(), [1, 0]);
}

#[test]
fn step_6_the_search_sees_one_entry_more_than_the_queue_size() {
    let mut bench = Bench::new(parameters(2, 1));
    assert_eq!(bench.feed(&[(0, 0), (1, 10)]), NONE);
    assert_eq!(bench.feed(&[(0, 30)]), [[0, 1]], "an overflow would drop 0");
    assert_eq!(bench.dropped(), []);
}

#[test]
fn step_7_an_overflow_drops_the_front_and_forgets_the_candidate() {
    let mut bench = Bench::new(parameters(2, 1));
    bench.feed(&[(0, 0), (1, 10)]);
    assert!(bench.synchronizer.candidate.is_some());
    assert_eq!(bench.feed(&[(1, 20)]), NONE);
    assert!(bench.synchronizer.candidate.is_none());
    assert_eq!(bench.lossy(), [false, true]);
    assert_eq!(
        bench.dropped(),
        [(1, 1), (0, 0)],
        "the second by the search that follows: 10 may have been nearer to 0"
    );
}

#[test]
fn step_8_ties_go_to_the_lowest_and_the_highest_topic() {
    let ends = |stamps: [i128; 3]| {
        let ends = Ends::of(stamps.into_iter()).unwrap();
        (ends.earliest, ends.latest)
    };
    assert_eq!(ends([5, 5, 5]), (0, 2));
    assert_eq!(ends([6, 5, 5]), (1, 0));
    assert_eq!(ends([6, 6, 5]), (2, 1));
}

#[test]
fn step_9_a_topic_that_is_not_the_latest_ceases_to_be_lossy() {
    let mut bench = Bench::new(parameters(2, 1));
    bench.feed(&[(1, 10), (1, 20), (0, 3)]);
    assert_eq!(bench.lossy(), [false, true], "20 is the latest");
    assert_eq!(bench.dropped(), [(1, 0), (0, 2)]);
    bench.feed(&[(0, 21)]);
    assert_eq!(bench.lossy(), [false, false]);
    assert_eq!(bench.feed(&[(1, 40)]), [[3, 1]]);
}

#[test]
fn step_10_the_longest_interval_is_inclusive() {
    let mut bench = Bench::new(parameters(2, 5).max_interval_ns(10));
    bench.feed(&[(0, 0), (1, 11)]);
    assert_eq!(bench.dropped(), [(0, 0)]);
    bench.feed(&[(0, 1)]);
    assert_eq!(bench.feed(&[(0, 40)]), [[2, 1]]);
}

#[test]
fn step_11_better_heads_replace_the_candidate_but_not_the_pivot() {
    let mut bench = Bench::new(parameters(2, 5));
    bench.feed(&[(0, 0), (1, 10)]);
    assert_eq!(bench.feed(&[(0, 19)]), [[2, 1]], "9 later, but 10 nearer");
    assert_eq!(bench.dropped(), [(0, 0)]);
}

#[test]
fn step_11_a_tie_keeps_the_candidate() {
    let mut bench = Bench::new(parameters(2, 5));
    assert_eq!(bench.feed(&[(0, 0), (1, 10), (0, 20)]), [[0, 1]]);
    assert_eq!(bench.dropped(), []);
}

#[test]
fn step_11_the_age_penalty_prefers_the_older_set() {
    for (seven_latest_ns, expected) in [(17, [2, 1]), (18, [0, 1])] {
        let penalty = AgePenalty::from_factor(5, 2).unwrap();
        let mut bench = Bench::new(parameters(2, 5).age_penalty(penalty));
        let sets = bench.feed(&[(0, 0), (1, 10), (0, seven_latest_ns)]);
        assert_eq!(sets, [expected], "1.25 * 7 < 10 <= 1.25 * 8");
    }
}

#[test]
fn step_12_the_earliest_head_is_passed_and_stays() {
    let mut bench = Bench::new(parameters(3, 5));
    bench.feed(&[(0, 4), (1, 2), (2, 9)]);
    assert_eq!(bench.cursors(), [0, 1, 0]);
    assert_eq!(bench.synchronizer.held(1), 1);
}

#[test]
fn step_13_passing_the_pivot_emits() {
    let mut bench = Bench::new(parameters(2, 5));
    bench.feed(&[(0, 0), (1, 10)]);
    assert_eq!(
        bench.feed(&[(0, 11)]),
        [[2, 1]],
        "better, and then 10 passes"
    );
}

#[test]
fn step_13_a_later_end_that_no_set_can_make_up_for_emits() {
    for (later_ns, sets) in [(19, vec![]), (20, vec![vec![0, 1, 2]])] {
        let mut bench = Bench::new(parameters(3, 5));
        bench.feed(&[(0, 0), (1, 5), (2, 10)]);
        assert_eq!(bench.feed(&[(0, later_ns)]), sets, "{later_ns}");
    }
}

#[test]
fn step_14_a_lower_bound_proves_the_candidate_best_at_once() {
    for (bound_ns, sets) in [(19, vec![]), (20, vec![vec![0, 1]])] {
        let mut bench = Bench::new(parameters(2, 5).lower_bound_ns(0, bound_ns));
        assert_eq!(bench.feed(&[(0, 0), (1, 10)]), sets, "{bound_ns}");
    }
}

#[test]
fn step_14_a_virtual_search_that_fails_leaves_the_cursors() {
    for (bound_ns, sets) in [(16, vec![]), (17, vec![vec![0, 1, 2]])] {
        let mut bench = Bench::new(
            parameters(3, 5)
                .lower_bound_ns(0, 15)
                .lower_bound_ns(1, bound_ns),
        );
        // Topic 1's head is passed only virtually: 5 later, and 3 nearer.
        let emitted = bench.feed(&[(0, 0), (1, 3), (2, 10)]);
        assert_eq!(emitted, sets, "{bound_ns}");
        let cursors = if emitted.is_empty() {
            [1, 0, 0]
        } else {
            [0; 3]
        };
        assert_eq!(bench.cursors(), cursors);
    }
}

#[test]
fn step_15_passed_entries_can_be_in_later_sets() {
    let mut bench = Bench::new(parameters(3, 5));
    bench.feed(&[(0, 0), (1, 1), (2, 10), (0, 15), (1, 4)]);
    assert_eq!(bench.cursors(), [1, 2, 0], "4 is no better, and passed too");
    assert_eq!(bench.feed(&[(1, 30)]), [[0, 1, 2]]);
    assert_eq!(bench.cursors(), [0, 0, 0]);
    assert_eq!(bench.synchronizer.held(1), 2, "4 waits again");
    assert_eq!(bench.dropped(), []);
}

#[test]
fn step_15_an_arrival_can_emit_several_sets() {
    let mut bench = Bench::new(parameters(2, 5));
    assert_eq!(bench.feed(&[(1, 11), (1, 20), (0, 10)]), NONE);
    assert_eq!(bench.feed(&[(0, 20)]), [[2, 0], [3, 1]]);
}

#[test]
fn equal_stamps_are_emitted_at_once() {
    let mut bench = Bench::new(parameters(2, 1));
    assert_eq!(bench.feed(&[(0, 7), (1, 7)]), [[0, 1]]);
}

#[test]
fn the_largest_stamps_and_bounds_are_no_trouble() {
    let factor = AgePenalty::from_factor(AgePenalty::MOST_FACTOR, 0).unwrap();
    let bounded = parameters(2, 2).age_penalty(factor);
    let mut bench = Bench::new(bounded.lower_bound_ns(0, u64::MAX));
    let sets = bench.feed(&[(0, u64::MAX - 1), (1, u64::MAX), (0, 0), (1, 0)]);
    assert_eq!(sets, [[0, 1], [2, 3]]);
}

#[test]
fn nothing_is_allocated_after_construction() {
    let mut bench = Bench::new(parameters(3, 4).max_interval_ns(30));
    let capacities = |bench: &Bench| {
        let synchronizer = &bench.synchronizer;
        let rings = synchronizer.rings.iter().map(|ring| ring.capacity());
        let (set, cursors) = (&synchronizer.set, &synchronizer.cursors);
        (
            rings.collect::<Vec<_>>(),
            set.capacity(),
            cursors.capacity(),
        )
    };
    let before = capacities(&bench);
    let arrivals: Vec<_> = (0..999_usize)
        .map(|i| (i * 5 % 7 % 3, (i * 7 % 640) as u64))
        .collect();
    let sets = bench.feed(&arrivals);
    assert!(!bench.dropped().is_empty() && !sets.is_empty());
    assert_eq!(capacities(&bench), before);
}

#[test]
#[should_panic(expected = "there is no topic 2")]
fn an_unknown_topic_is_refused() {
    Bench::new(parameters(2, 1)).feed(&[(2, 0)]);
}
