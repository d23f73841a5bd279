//! Which of the machine's processors become cores: the words `cores=` and `smt=`.
//!
//! A processor's *number* is its place in ACPI's table, but the one that boots is number 0, and
//! always a core. Siblings share one physical core; of these `smt=off` keeps the first.

use alloc::vec::Vec;
use core::ops::RangeInclusive;

use front::options::{UsageError, whole_number};

/// Returns the APIC ids of those that become cores, of all processors by their numbers. Siblings
/// have ids that differ in the lowest `sibling_bits` only; none are, if that is 0.
pub(super) fn select(
    ids: impl Iterator<Item = u32>,
    list: Option<&str>,
    sibling_bits: u32,
) -> Vec<u32> {
    let mut selected = Vec::new();
    for (id, number) in ids.zip(0..) {
        let is_listed = list.is_none_or(|list| names(list, number));
        if is_listed && !is_sibling(&selected, id, sibling_bits) {
            selected.push(id);
        }
    }
    selected
}

/// Counts those that have a sibling before them.
pub(super) fn siblings(ids: &[u32], sibling_bits: u32) -> usize {
    let has_one = |place: &usize| is_sibling(&ids[..*place], ids[*place], sibling_bits);
    (0..ids.len()).filter(has_one).count()
}

fn is_sibling(ids: &[u32], id: u32, sibling_bits: u32) -> bool {
    ids.iter()
        .any(|other| other >> sibling_bits == id >> sibling_bits)
}

/// Makes sure that a list names some of so many processors, the first one among them.
pub(super) fn check(list: &str, processors: usize) -> Result<(), UsageError> {
    let last = processors.saturating_sub(1) as u64;
    let is_right = |part: Option<RangeInclusive<u64>>| {
        part.is_some_and(|part| !part.is_empty() && *part.end() <= last)
    };
    if parts(list).all(is_right) && names(list, 0) {
        return Ok(());
    }
    let allowed = "allowed are numbers and ranges such as 0-3,6, with 0, which boots";
    Err(UsageError::new(alloc::format!(
        "`cores={list}`: {allowed}; the last processor is {last}"
    )))
}

fn names(list: &str, number: u64) -> bool {
    parts(list).flatten().any(|part| part.contains(&number))
}

/// Returns the ranges of a list; nothing in place of what is none.
fn parts(list: &str) -> impl Iterator<Item = Option<RangeInclusive<u64>>> {
    list.split(',').map(|part| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(whole_number(first)?..=whole_number(last)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four cores with two siblings each, and two without.
    const IDS: [u32; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10];

    fn of(list: Option<&str>, bits: u32) -> Vec<u32> {
        select(IDS.into_iter(), list, bits)
    }

    #[test]
    fn a_list_selects_by_numbers() {
        assert_eq!(of(None, 0), IDS);
        assert_eq!(of(Some("0-2,9,1"), 0), [0, 1, 2, 10]);
        assert_eq!(of(Some("0"), 0), [0]);
    }

    #[test]
    fn of_siblings_the_first_that_is_listed_stays() {
        assert_eq!(of(None, 1), [0, 2, 4, 6, 8, 10]);
        assert_eq!(of(Some("0,3,5,6,7"), 1), [0, 3, 5, 6]);
        assert_eq!(siblings(&IDS, 1), 4);
        assert_eq!(siblings(&[0, 3, 5, 6], 1), 0);
        assert_eq!(siblings(&IDS, 0), 0);
        assert_eq!(siblings(&[5, 4, 6, 7, 0], 2), 3);
    }

    #[test]
    fn a_list_names_processors_that_there_are_and_the_first() {
        for list in ["0", "0-3", "0-0,2", "3,1,0", "2-3,0-1"] {
            assert_eq!(check(list, 4), Ok(()), "{list}");
        }
        for list in [
            "", "1", "1-3", "0-4", "0,", "0-", "-1", "0-x", "3-1,0", "0 1", "0-1-2",
        ] {
            let message = check(list, 4).unwrap_err().to_string();
            assert!(message.starts_with(&format!("`cores={list}`: allowed are")));
            assert!(message.ends_with("; the last processor is 3"), "{message}");
        }
    }
}
