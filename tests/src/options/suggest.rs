//! The nearest match to a mistyped name.
//!
//! *Distance* is Damerau's (10.1145/363958.363994): the fewest insertions, deletions and
//! replacements of one character, and swaps of two neighbours, that turn one word into
//! the other, no place being changed twice.

/// Returns the allowed name nearest to `word`, if one is near enough to be
/// what was meant: at most a third of its length away, but at least 1.
#[must_use]
pub fn nearest<'n>(word: &str, allowed: &[&'n str]) -> Option<&'n str> {
    let ranked = allowed.iter().map(|name| (distance(word, name), *name));
    let (distance, name) = ranked.min_by_key(|(distance, _)| *distance)?;
    (distance <= (name.len() / 3).max(1)).then_some(name)
}

fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    // `rows[i][j]`: the distance between `a[..i]` and `b[..j]`.
    let mut rows = vec![(0..=b.len()).collect::<Vec<usize>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(row[j - 1] + 1).min(rows[i - 1][j] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
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
        assert_eq!(distance("coers", "cores"), 1);
        assert_eq!(distance("tset", "test"), 1);
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
}
