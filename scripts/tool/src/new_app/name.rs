//! Which names an app can have.
//!
//! The name is a package's, a folder's and, with `_` for `-`, a crate's at once,
//! so it must be possible as each: no word of the language, no library that every
//! program knows, no package that the workspace has.

use std::fs;
use std::path::{Path, PathBuf};

use replay::shown::quoted;

use crate::system::files_below;

/// The longest name, in bytes, with which the template's lines stay short.
const LONGEST: usize = 32;

/// Names that cannot be crates, because they mean something already: keywords,
/// the compiler's own crates, and folders that cargo makes.
const RESERVED: &str = "\
    abstract alloc as async await become box break build const continue core crate deps do dyn \
    else enum examples extern false final fn for gen if impl in incremental let loop macro \
    match mod move mut override priv proc-macro pub ref return self static std struct super \
    test trait true try type typeof unsafe unsized use virtual where while yield";

/// Checks that a new app of a workspace can have a name.
///
/// # Errors
///
/// One line: the name, what is wrong with it, and what is possible.
pub fn check(workspace: &Path, name: &str) -> Result<(), String> {
    check_word(name)?;
    let folder = Path::new("apps").join(name);
    if workspace.join(&folder).exists() {
        return Err(taken(name));
    }
    match package_folder(workspace, name) {
        Some(taken) => refuse(
            name,
            &format!("the package in {} has it; choose another", taken.display()),
        ),
        None => Ok(()),
    }
}

fn refuse(name: &str, why: &str) -> Result<(), String> {
    Err(format!("{} cannot be an app's name: {why}", quoted(name)))
}

/// Checks that a name can be an app's wherever that is: a package's and a crate's.
///
/// # Errors
///
/// As of [`check`].
pub(super) fn check_word(name: &str) -> Result<(), String> {
    let refuse = |why: &str| refuse(name, why);
    if name.is_empty() {
        return Err("the name is empty; give one, such as `brake-assist`".into());
    }
    if let Some(odd) = name.chars().find(|&c| !is_allowed(c)) {
        let suggestion = suggestion(name);
        return refuse(&format!(
            "{odd:?} is in it; use small letters, digits and hyphens{suggestion}"
        ));
    }
    if !name.starts_with(|first: char| first.is_ascii_lowercase()) {
        return refuse("it does not begin with a letter; put one first");
    }
    if name.ends_with('-') || name.contains("--") {
        return refuse("a hyphen in it joins nothing; write each between two words");
    }
    if name.len() > LONGEST {
        return refuse(&format!(
            "it has {} letters; give at most {LONGEST}",
            name.len()
        ));
    }
    if RESERVED.split(' ').any(|word| word == name) {
        return refuse("Rust or cargo use the word themselves; add another, such as `my-`");
    }
    Ok(())
}

/// Says that there is an app of the name.
pub(super) fn taken(name: &str) -> String {
    format!("there is an app `{name}` already; choose another name, or edit apps/{name}")
}

fn is_allowed(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-'
}

/// Says how the name could be written, if small letters and hyphens suffice.
fn suggestion(name: &str) -> String {
    let better = name.to_ascii_lowercase().replace(['_', ' '], "-");
    if better.chars().all(is_allowed) {
        return format!(", as in `{better}`");
    }
    String::new()
}

/// Returns the folder, within the workspace, of the package with such a name.
fn package_folder(workspace: &Path, name: &str) -> Option<PathBuf> {
    let manifest = files_below(workspace, |_| true).into_iter().find(|file| {
        let text = || fs::read_to_string(file).unwrap_or_default();
        file.ends_with("Cargo.toml") && names(&text()).any(|other| other == name)
    })?;
    let folder = manifest.parent()?.strip_prefix(workspace);
    folder.ok().map(Path::to_path_buf)
}

/// Returns the names that a manifest gives to a package, a library or a program, with
/// `-` for `_`. Those of examples, tests and benchmarks are in nobody's way.
fn names(manifest: &str) -> impl Iterator<Item = String> {
    let mut table = "";
    manifest.lines().filter_map(move |line| {
        if line.starts_with('[') {
            table = line.trim_end();
        }
        let (key, value) = line.split_once('=')?;
        let counts = ["[package]", "[lib]", "[[bin]]"].contains(&table);
        let is_name = counts && key.trim() == "name";
        is_name.then(|| value.trim().trim_matches('"').replace('_', "-"))
    })
}

#[cfg(test)]
mod tests {
    use super::{check, names};
    use crate::system::workspace;

    /// Names, and why they are refused.
    const BAD: &str = " | the name is empty; give one, such as `brake-assist`
Brake_Assist | `Brake_Assist` cannot be an app's name: 'B' is in it; use small letters, digits and hyphens, as in `brake-assist`
../fork | `../fork` cannot be an app's name: '.' is in it; use small letters, digits and hyphens
2nd | `2nd` cannot be an app's name: it does not begin with a letter; put one first
brake- | `brake-` cannot be an app's name: a hyphen in it joins nothing; write each between two words
a-name-that-has-more-letters-than-32 | `a-name-that-has-more-letters-than-32` cannot be an app's name: it has 36 letters; give at most 32
struct | `struct` cannot be an app's name: Rust or cargo use the word themselves; add another, such as `my-`
fork-join | there is an app `fork-join` already; choose another name, or edit apps/fork-join
virtual-time | `virtual-time` cannot be an app's name: the package in fass/virtual-time has it; choose another
tool | `tool` cannot be an app's name: the package in scripts/tool has it; choose another";

    #[test]
    fn each_bad_name_is_refused_with_what_is_possible() {
        for row in BAD.lines() {
            let (name, line) = row.split_once(" | ").expect(row);
            assert_eq!(check(workspace(), name), Err(line.to_string()));
        }
        assert_eq!(check(workspace(), "brake-assist-2"), Ok(()));
    }

    #[test]
    fn an_example_leaves_its_name_to_an_app() {
        let manifest = "[package]\nname = \"virtual-time\"\n\n[lib]\nname = \"virtual_time\"\n\
                        [[bin]]\nname = \"tool\"\n[[example]]\nname = \"vision\"\n";
        let found: Vec<String> = names(manifest).collect();
        assert_eq!(found, ["virtual-time", "virtual-time", "tool"]);
    }
}
