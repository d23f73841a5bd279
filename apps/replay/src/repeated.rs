//! Finding what stands twice, in n log n.

use alloc::vec::Vec;

/// Returns the first of the items that equals one before it: the positions of that one
/// and of itself.
#[must_use]
pub fn repeated<T: Ord>(items: impl IntoIterator<Item = T>) -> Option<(usize, usize)> {
    let mut sorted: Vec<(T, usize)> = items.into_iter().zip(0..).collect();
    sorted.sort_unstable();
    let pairs = sorted.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    let positions = pairs.map(|pair| (pair[0].1, pair[1].1));
    positions.min_by_key(|&(_, second)| second)
}

#[cfg(test)]
mod tests {
    use super::repeated;

    #[test]
    fn the_first_that_is_too_many_is_found() {
        assert_eq!(repeated([3, 1, 2]), None);
        assert_eq!(repeated([""; 0]), None);
        assert_eq!(repeated(["b", "a", "b", "a", "b"]), Some((0, 2)));
        assert_eq!(repeated([5, 5, 5]), Some((0, 1)));
    }
}
