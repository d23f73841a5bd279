//! Sharing a total out at random, with a limit for each share.
//!
//! Shares are first drawn uniformly among all ways to share out the total: the
//! distances between sorted random points. (UUniFast draws from the same
//! distribution by powers; Bini and Buttazzo, Real-Time Systems 30, 2005,
//! doi 10.1007/s11241-005-0507-9.) If a share exceeds its limit, all are moved
//! halfway towards shares in proportion to their limits, until none does.

use alloc::vec::Vec;

use common::random::Random;

/// Shares `total` out: as many shares as limits, each at most its limit.
///
/// The sum may fall short of `total` by one for each share, for rounding, and
/// exceeds it never. If the limits do not allow the total, each share is at its
/// limit.
pub(crate) fn share_out(total: u64, limits: &[u64], random: &mut Random) -> Vec<u64> {
    let sum: u64 = limits.iter().sum();
    if sum <= total {
        return limits.to_vec();
    }
    let proportional = |limit: u64| {
        let share = u128::from(total) * u128::from(limit) / u128::from(sum.max(1));
        u64::try_from(share).unwrap_or(limit)
    };
    let mut points: Vec<u64> = limits
        .iter()
        .skip(1)
        .map(|_| random.within(0..=total))
        .collect();
    points.sort_unstable();
    points.push(total);
    let mut last = 0;
    let mut shares: Vec<u64> = points
        .into_iter()
        .map(|point| point - core::mem::replace(&mut last, point))
        .collect();
    let exceeds = |shares: &[u64]| {
        shares
            .iter()
            .zip(limits)
            .any(|(share, limit)| share > limit)
    };
    // Proportional shares are below the limits, so 64 halvings would do at most.
    for _ in 0..64 {
        if !exceeds(&shares) {
            break;
        }
        for (share, &limit) in shares.iter_mut().zip(limits) {
            *share = share.midpoint(proportional(limit));
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_share_exceeds_its_limit_and_little_is_lost() {
        let mut random = Random::new(3);
        for total in [10, 1000, 1_000_000] {
            for count in 1..12 {
                let limits: Vec<_> = (1..=count).map(|place| total * place / 4 + 1).collect();
                let shares = share_out(total, &limits, &mut random);
                assert!(
                    shares
                        .iter()
                        .zip(&limits)
                        .all(|(share, limit)| share <= limit)
                );
                let possible = total.min(limits.iter().sum());
                let sum: u64 = shares.iter().sum();
                assert!(
                    sum <= possible && possible - sum <= 64 * count,
                    "{sum} of {possible}"
                );
            }
        }
    }

    #[test]
    fn limits_that_are_too_low_are_reached() {
        assert_eq!(share_out(10, &[3, 3], &mut Random::new(1)), [3, 3]);
    }
}
