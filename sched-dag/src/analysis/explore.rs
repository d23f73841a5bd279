//! The exploration of a schedule-abstraction graph on a host. [`check_closed`](super::check_closed)
//! checks the resulting list.

use alloc::vec;
use alloc::vec::Vec;

use super::abstraction::{AbstractState, AbstractionSet, FinishInterval, NotClosed};

/// The most states of a list worth searching for.
pub const STATE_LIMIT: usize = 2_000;

/// Searches for a closed list of states, level by level; a level has all states after the same
/// number of dispatches. States with the same dispatched instances are merged unless some core's
/// intervals leave a gap.
///
/// # Errors
///
/// A sink may be late, or there are more states than the limit.
pub fn explore(set: &AbstractionSet, limit: usize) -> Result<Vec<AbstractState>, NotClosed> {
    let mut expanded: Vec<AbstractState> = Vec::new();
    let mut level = vec![set.initial()];
    let mut bounds = set.no_bounds();
    while !level.is_empty() {
        let mut next: Vec<AbstractState> = Vec::new();
        for state in level {
            if expanded.iter().any(|known| set.includes(known, &state)) {
                continue;
            }
            if expanded.len() >= limit {
                return Err(NotClosed::Limit);
            }
            set.successors(&state, &mut bounds, &mut |state| {
                let place = next.iter().position(|other| touch(other, &state));
                match place {
                    Some(place) => next[place] = set.normal(hull(set, &next[place], &state)),
                    None => next.push(state),
                }
                Ok(())
            })?;
            expanded.push(state);
        }
        level = next;
    }
    Ok(expanded)
}

/// Reports whether two states have the same dispatched instances and no gap between the intervals
/// of a core.
fn touch(one: &AbstractState, other: &AbstractState) -> bool {
    let [low, high] = &one.free_ns;
    let [other_low, other_high] = &other.free_ns;
    (one.laps, &one.counts) == (other.laps, &other.counts)
        && (0..low.len())
            .all(|core| low[core] <= other_high[core] + 1 && other_low[core] <= high[core] + 1)
}

/// Returns the least state that includes both.
fn hull(set: &AbstractionSet, one: &AbstractState, other: &AbstractState) -> AbstractState {
    let pairs = |which: usize, of: fn(i64, i64) -> i64| {
        let pairs = one.free_ns[which].iter().zip(&other.free_ns[which]);
        pairs.map(|(one, other)| of(*one, *other)).collect()
    };
    // An instance missing in a state has finished by then.
    let [now_ns, other_now_ns] = [one, other].map(|state| set.now_ns(state));
    let mut finishes = Vec::new();
    for (own, others, then_ns) in [
        (&one.finishes, &other.finishes, other_now_ns),
        (&other.finishes, &one.finishes, now_ns),
    ] {
        for finish in own {
            let same = |of: &&FinishInterval| (of.vertex, of.job) == (finish.vertex, finish.job);
            let (low_ns, high_ns) = match others.iter().find(same) {
                Some(known) => (known.low_ns, known.high_ns),
                None => (then_ns, then_ns),
            };
            let hull = FinishInterval {
                low_ns: finish.low_ns.min(low_ns),
                high_ns: finish.high_ns.max(high_ns),
                ..*finish
            };
            if !finishes.contains(&hull) {
                finishes.push(hull);
            }
        }
    }
    AbstractState {
        laps: one.laps,
        counts: one.counts.clone(),
        free_ns: [pairs(0, i64::min), pairs(1, i64::max)],
        finishes,
    }
}
