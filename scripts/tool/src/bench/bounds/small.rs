//! Small sets with short deadlines.
//!
//! Sizes and cores are those of the random test that came with the proof of the multi-path
//! bound, which counted 91,351 sets by it and 47,638 by Melani's form with the width under fixed
//! priorities, 53,230 and 30,335 under EDF. How that test drew WCETs,
//! edges, periods and deadlines is not known, so the ratios can be compared and the counts cannot.

use std::fmt::Write;

use sched_dag::Policy;

use super::curves::{POLICIES, verdicts};
use super::draw::small;
use crate::random::Random;

/// What is proven under one policy.
pub(super) struct Count {
    policy: Policy,
    sets: u64,
    melani: u64,
    before: u64,
    now: u64,
    /// The sets that were proven before and are not now.
    pub(super) lost: u64,
}

/// Analyses `sets` small sets.
pub(super) fn measure(sets: u64, seed: u64) -> Vec<Count> {
    let mut counts = Vec::from(POLICIES.map(|policy| Count {
        policy,
        sets,
        melani: 0,
        before: 0,
        now: 0,
        lost: 0,
    }));
    let mut random = Random::new(seed);
    for _ in 0..sets {
        let cores = u32::try_from(random.within(2, 4)).unwrap_or(2);
        let specs = small(&mut random);
        for count in &mut counts {
            let found = verdicts(&specs, count.policy, cores);
            count.melani += u64::from(found.melani);
            count.before += u64::from(found.before);
            count.now += u64::from(found.now);
            count.lost += u64::from(found.is_lost());
        }
    }
    counts
}

/// Writes a row a policy.
pub(super) fn table(counts: &[Count]) -> String {
    let mut text = String::from("small sets with short deadlines, proven\n");
    // Writing into a `String` cannot fail.
    let _ = writeln!(
        text,
        "{:>8}{:>9}{:>10}{:>10}{:>10}{:>14}{:>14}",
        "policy", "sets", "Melani", "before", "now", "now / Melani", "now / before"
    );
    for count in counts {
        let times = |other: u64| count.now as f64 / other.max(1) as f64;
        let name = match count.policy {
            Policy::StaticPriority => "G-FP",
            Policy::Edf => "G-EDF",
        };
        let _ = writeln!(
            text,
            "{name:>8}{:>9}{:>10}{:>10}{:>10}{:>14.2}{:>14.2}",
            count.sets,
            count.melani,
            count.before,
            count.now,
            times(count.melani),
            times(count.before)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{measure, table};

    #[test]
    fn of_small_sets_more_are_proven_than_before() {
        let counts = measure(2_000, 7);
        for count in &counts {
            assert_eq!(count.lost, 0, "{}", table(&counts));
            assert!(4 * count.now > 5 * count.melani, "{}", table(&counts));
        }
    }
}
