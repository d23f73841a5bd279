//! Paths: files and folders named by a page or a comment must exist.
//!
//! A path is a word between backquotes with a slash inside. The word begins with a folder of the
//! root, or ends in a slash or in a file's usual ending. A path may start from the root or from a
//! folder above the file naming it, or be the end of a longer path. A page's links start from the
//! page's folder.
//!
//! The CHANGELOG is exempt: past files may be gone.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use super::{SourceFile, none_of};

/// Paths created by a reader, standing for any path, or from other projects' sources.
const ELSEWHERE: [&str; 6] = [
    "target/",
    "x/",
    "apps/first-steps",
    "examples/first-steps-linux.rs",
    ".cargo/config.toml",
    "docs/misc/pvh.pandoc",
];

/// Endings by which a word with a slash counts as a file's name.
const ENDINGS: [&str; 8] = [".rs", ".md", ".s", ".ld", ".txt", ".toml", ".dag", ".svg"];

/// Compares the paths in pages and comments with the existing files.
///
/// # Errors
///
/// Each path leading nowhere, with its file and line.
pub(super) fn check(sources: &[SourceFile]) -> Result<(), String> {
    let mut there = BTreeSet::new();
    for SourceFile { name, .. } in sources {
        there.extend(Path::new(name).ancestors());
    }
    let exists = |path: &Path| there.contains(path) || there.iter().any(|it| it.ends_with(path));
    let top = |word: &str| {
        let first = word.split('/').next().unwrap_or_default();
        !first.is_empty() && there.contains(Path::new(first))
    };
    let mut faults = Vec::new();
    for SourceFile { name, text } in sources {
        let is_page = name.ends_with(".md") && name != "CHANGELOG.md";
        let folder = Path::new(name).parent().unwrap_or(Path::new(""));
        for (number, line) in (1..).zip(text.lines()) {
            let comment = line.trim_start();
            if !(is_page || name.ends_with(".rs") && comment.starts_with("//")) {
                continue;
            }
            let words = line.split('`').skip(1).step_by(2);
            let words = words.map(|word| word.trim_start_matches("./"));
            let named = words.filter(|word| is_path(word, &top)).map(PathBuf::from);
            let links = line.split("](").skip(1).filter(|_| is_page);
            let links = links.filter_map(link);
            let links = links.map(|link| plain(&folder.join(link)));
            let lost = named
                .chain(links)
                .filter(|path| !exists(path) && !exists(&folder.join(path)));
            faults.extend(lost.map(|path| format!("{name}:{number} names {}", path.display())));
        }
    }
    none_of(faults).map_err(|lost| format!("{lost}; no such file or folder is there"))
}

fn is_path(word: &str, is_top: &dyn Fn(&str) -> bool) -> bool {
    let is_plain = |it: char| it.is_ascii_alphanumeric() || "._-/".contains(it);
    word.len() > 1
        && word.contains('/')
        && word.chars().all(is_plain)
        && !ELSEWHERE.iter().any(|path| word.starts_with(path))
        && (word.ends_with('/') || ENDINGS.iter().any(|it| word.ends_with(it)) || is_top(word))
}

/// Returns the file of a link within the tree.
fn link(rest: &str) -> Option<&str> {
    let path = rest.split([')', '#']).next()?;
    (!path.is_empty() && !path.contains(':')).then_some(path)
}

/// Returns the path with each `..` resolved.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(plain.pop()),
            part => plain.push(part),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::check;
    use crate::test::made::file;

    #[test]
    fn a_path_that_leads_nowhere_is_named_with_its_line() {
        let right = "`docs/a.md`, `./docs/`, [b](../a/b.rs#L1), `b.rs`, `a/b.rs`, `x / y`, `n/m`";
        let sources = [file("docs/a.md", right), file("a/b.rs", "// `../b`\n")];
        assert_eq!(check(&sources), Ok(()));
        let wrong = [
            file("docs/a.md", "fine\n`docs/b.md` and [c](c.md)"),
            file("a/b.rs", "let it = \"`a/d.rs`\";\n//! See `a/c.rs`."),
        ];
        let expected = "docs/a.md:2 names docs/b.md; docs/a.md:2 names docs/c.md; \
                        a/b.rs:2 names a/c.rs; no such file or folder is there";
        assert_eq!(check(&wrong), Err(expected.into()));
    }
}
