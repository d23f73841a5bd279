//! Finding what stands twice, in n log n.

use alloc::vec::Vec;

use sched_dag::sorted_by_key;

/// Returns the first of the items that equals one before it: the positions of that one
/// and of itself.
#[must_use]
pub fn repeated<T: Ord>(items: impl IntoIterator<Item = T>) -> Option<(usize, usize)> {
    let items: Vec<T> = items.into_iter().collect();
    let order = sorted_by_key(items.len(), |position| &items[position]);
    let pairs = order.windows(2).map(|pair| (pair[0], pair[1]));
    let equal = pairs.filter(|&(first, second)| items[first] == items[second]);
    equal.min_by_key(|&(_, second)| second)
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
