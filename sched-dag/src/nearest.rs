//! The nearest match to a mistyped name.
//!
//! *Distance* is Damerau's (10.1145/363958.363994): the fewest insertions, deletions and
//! replacements of one character, and swaps of two neighbours, to turn one word into the other,
//! with no place changed twice. The comparison with a name stops as soon as the name is certainly
//! too far away, so many such names cost little.

use core::mem;

/// The longest name compared, in characters: the work grows with the square.
const LONGEST: usize = 200;

/// The distances of a word to each beginning of another word.
type Row = [u8; LONGEST + 1];

/// Returns the allowed name nearest to `word`, if near enough to be the intended name: at most a
/// third of the name's own length away, where a distance of 1 is always near enough. Words and
/// names longer than 200 characters match nothing.
///
/// ```
/// assert_eq!(sched_dag::nearest("lidra", &["camera", "lidar"]), Some("lidar"));
/// assert_eq!(sched_dag::nearest("sonar", &["camera", "lidar"]), None);
/// ```
pub fn nearest<'n>(word: &str, allowed: &[&'n str]) -> Option<&'n str> {
    nearest_of(word, &mut allowed.iter().copied())
}

/// Works like [`nearest`] for names from an iterator. Allocates nothing, so that a console can ask
/// during a run.
///
/// ```
/// let names = ["camera", "lidar"].map(String::from);
/// let near = sched_dag::nearest_of("lidra", &mut names.iter().map(String::as_str));
/// assert_eq!(near, Some("lidar"));
/// ```
#[must_use]
pub fn nearest_of<'n>(word: &str, allowed: &mut dyn Iterator<Item = &'n str>) -> Option<&'n str> {
    let near = allowed.filter_map(|name| {
        let most = (name.chars().count() / 3).max(1);
        Some((distance(word, name, most)?, name))
    });
    near.min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Returns the distance of two words, or `None` if it exceeds `most`.
fn distance(a: &str, b: &str, most: usize) -> Option<usize> {
    let lengths = [a, b].map(|word| word.chars().take(LONGEST + 1).count());
    if lengths[0].max(lengths[1]) > LONGEST || lengths[0].abs_diff(lengths[1]) > most {
        return None;
    }
    let most = u8::try_from(most).unwrap_or(u8::MAX);
    // Of `a[..i]`, `a[..i - 1]` and `a[..i - 2]` to each `b[..j]`. No word is longer than 200.
    let mut row: Row = core::array::from_fn(|j| u8::try_from(j).unwrap_or(u8::MAX));
    let (mut above, mut two_above): (Row, Row) = ([0; LONGEST + 1], [0; LONGEST + 1]);
    let mut before = None;
    for (i, of_a) in (1_u8..).zip(a.chars()) {
        mem::swap(&mut two_above, &mut above);
        mem::swap(&mut above, &mut row);
        row[0] = i;
        let mut left = None;
        for (j, of_b) in (1..).zip(b.chars()) {
            let replaced = above[j - 1] + u8::from(of_a != of_b);
            let mut least = replaced.min(row[j - 1] + 1).min(above[j] + 1);
            if before == Some(of_b) && left == Some(of_a) {
                least = least.min(two_above[j - 2] + 1);
            }
            row[j] = least;
            left = Some(of_b);
        }
        // All rows below are computed from these two.
        let both = row[..=lengths[1]].iter().chain(&above[..=lengths[1]]);
        if both.min().is_some_and(|&distance| distance > most) {
            return None;
        }
        before = Some(of_a);
    }
    Some(row[lengths[1]])
        .filter(|&distance| distance <= most)
        .map(usize::from)
}

#[cfg(test)]
mod tests {
    use super::{LONGEST, distance, nearest};

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
