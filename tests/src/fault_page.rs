//! The page `docs/commit-faults.md`, as the tests read it: what a commit says
//! of each fault is compared with it word for word, on the host and in the
//! guest, so it cannot go stale.
//!
//! A fault's section is headed by its name in backquotes; the first indented
//! line in it is its text.

use std::collections::BTreeMap;
use std::fs;

use crate::system;

/// Reads the page: the text of each fault by the fault's name.
///
/// # Errors
///
/// In words: the page cannot be read or has no sections, or one has no text.
pub fn documented_faults() -> Result<BTreeMap<String, String>, String> {
    let path = system::workspace().join("docs/commit-faults.md");
    let page = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    read(&page)
}

fn read(page: &str) -> Result<BTreeMap<String, String>, String> {
    let sections = page.split("\n### `").skip(1);
    let read_one = |section: &str| {
        let (fault, rest) = section.split_once('`')?;
        let text = rest.lines().find_map(|line| line.strip_prefix("    "))?;
        Some((fault.to_string(), text.to_string()))
    };
    let named = |section| read_one(section).ok_or_else(|| format!("no text in `{section}`"));
    let faults: BTreeMap<String, String> = sections.map(named).collect::<Result<_, _>>()?;
    if faults.is_empty() {
        return Err("the page has no section".into());
    }
    Ok(faults)
}

#[cfg(test)]
mod tests {
    use super::read;

    #[test]
    fn a_section_is_a_name_and_a_text() {
        let faults = read("# Faults\n\n### `cycle`\n\nWords.\n\n    a -> b; cut it\n").unwrap();
        assert_eq!(
            faults.get("cycle").map(String::as_str),
            Some("a -> b; cut it")
        );
        let error = read("\n### `cycle`\n\nWords.\n").unwrap_err();
        assert!(error.starts_with("no text in `cycle`"), "{error}");
    }
}
