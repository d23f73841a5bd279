//! The nearest match to a mistyped name.
//!
//! *Distance* is Levenshtein's: the fewest insertions, deletions and
//! replacements of one character that turn one word into the other.

/// Returns the allowed name nearest to `word`, if one is near enough to be
/// what was meant: at most a third of its length away, but at least 1.
#[must_use]
pub fn nearest<'n>(word: &str, allowed: &[&'n str]) -> Option<&'n str> {
    let ranked = allowed.iter().map(|name| (distance(word, name), *name));
    let (distance, name) = ranked.min_by_key(|(distance, _)| *distance)?;
    (distance <= (name.len() / 3).max(1)).then_some(name)
}

fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    // `row[j]`: the distance between the part of `a` read so far and `b[..j]`.
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, left) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, right) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(left != *right);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::{distance, nearest};

    #[test]
    fn counts_single_character_edits() {
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("abc", ""), 3);
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("cores", "cores"), 0);
    }

    #[test]
    fn suggests_only_what_is_near() {
        let allowed = ["cores", "jobs", "seed"];
        assert_eq!(nearest("core", &allowed), Some("cores"));
        assert_eq!(nearest("sede", &["seed"]), None);
        assert_eq!(nearest("job", &allowed), Some("jobs"));
        assert_eq!(nearest("frobnicate", &allowed), None);
        assert_eq!(nearest("x", &[]), None);
    }
}
