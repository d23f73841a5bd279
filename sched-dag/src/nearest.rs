//! The nearest match to a mistyped name.
//!
//! *Distance* is Damerau's (10.1145/363958.363994): the fewest insertions, deletions and
//! replacements of one character, and swaps of two neighbours, that turn one word into
//! the other, no place being changed twice. Names that are too far away are left as
//! soon as that is certain, so that many of them cost little.

use alloc::vec::Vec;
use core::mem;

/// The longest name that is compared, in characters: the work grows with the square.
const LONGEST: usize = 200;

/// Returns the allowed name nearest to `word`, if one is near enough to be
/// what was meant: at most a third of its length away, but at least 1.
///
/// ```
/// assert_eq!(sched_dag::nearest("lidra", &["camera", "lidar"]), Some("lidar"));
/// assert_eq!(sched_dag::nearest("sonar", &["camera", "lidar"]), None);
/// ```
#[must_use]
pub fn nearest<'n>(word: &str, allowed: &[&'n str]) -> Option<&'n str> {
    let word: Vec<char> = word.chars().take(LONGEST + 1).collect();
    let near = allowed.iter().filter_map(|&name| {
        let characters: Vec<char> = name.chars().take(LONGEST + 1).collect();
        let most = (characters.len() / 3).max(1);
        Some((distance(&word, &characters, most)?, name))
    });
    near.min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Returns the distance of two words, if it is at most `most`.
fn distance(a: &[char], b: &[char], most: usize) -> Option<usize> {
    if a.len().max(b.len()) > LONGEST || a.len().abs_diff(b.len()) > most {
        return None;
    }
    // Of `a[..i]`, `a[..i - 1]` and `a[..i - 2]` to each `b[..j]`.
    let mut row: Vec<usize> = (0..=b.len()).collect();
    let mut above = Vec::new();
    for i in 1..=a.len() {
        let two_above = mem::replace(&mut above, mem::take(&mut row));
        row.push(i);
        for j in 1..=b.len() {
            let replaced = above[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(row[j - 1] + 1).min(above[j] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(two_above[j - 2] + 1);
            }
            row.push(least);
        }
        // All rows below are made of these two.
        if row.iter().chain(&above).all(|&distance| distance > most) {
            return None;
        }
    }
    Some(row[b.len()]).filter(|&distance| distance <= most)
}

#[cfg(test)]
mod tests {
    use super::{LONGEST, nearest};
    use alloc::vec::Vec;

    fn distance(a: &str, b: &str, most: usize) -> Option<usize> {
        let [a, b] = [a, b].map(|word| word.chars().collect::<Vec<char>>());
        super::distance(&a, &b, most)
    }

    #[test]
    fn counts_single_character_edits() {
        for (a, b, edits) in [
            ("", "abc", 3),
            ("abc", "", 3),
            ("kitten", "sitting", 3),
            ("cores", "cores", 0),
            ("coers", "cores", 1),
            ("tset", "test", 1),
            ("badc", "abcd", 2),
        ] {
            assert_eq!(distance(a, b, 9), Some(edits), "{a} {b}");
            assert_eq!(distance(a, b, edits), Some(edits), "{a} {b}");
            if edits > 0 {
                assert_eq!(distance(a, b, edits - 1), None, "{a} {b}");
            }
        }
    }

    #[test]
    fn suggests_only_what_is_near() {
        let allowed = ["cores", "jobs", "seed"];
        assert_eq!(nearest("core", &allowed), Some("cores"));
        assert_eq!(nearest("sede", &["seed"]), Some("seed"));
        assert_eq!(nearest("dees", &["seed"]), None);
        assert_eq!(nearest("job", &allowed), Some("jobs"));
        assert_eq!(nearest("frobnicate", &allowed), None);
        assert_eq!(nearest("x", &[]), None);
    }

    #[test]
    fn what_is_very_long_is_not_compared() {
        let long = "x".repeat(LONGEST);
        assert_eq!(nearest(&long, &[&long]), Some(&*long));
        let longer = "x".repeat(LONGEST + 1);
        assert_eq!(nearest(&longer, &[&longer]), None);
    }
}
