//! Every type, trait and free function of the crates used by apps has an example, or names the item
//! with an example showing it. The example of a type shows its methods, too.
//!
//! The compiler demands documentation (`missing_docs`); rustdoc compiles the examples, and runs
//! them if the host can run them.

use std::fs;
use std::path::PathBuf;

use tool::system::workspace;

/// Files with items used by apps: all files of a folder, or single files.
const FOLDERS: [&str; 7] = [
    "fass/src",
    "fass/src/api",
    "fass/src/commit",
    "fass/src/draft",
    "fass/src/platform",
    "fass/src/run",
    "fass/virtual-time/src",
];
const FILES: [&str; 8] = [
    "kernel/src/lib.rs",
    "kernel/front/src/app/machine.rs",
    "sched-dag/src/engine/run.rs",
    "kernel/front/src/options.rs",
    "kernel/front/src/text/json.rs",
    "kernel/src/app/event.rs",
    "sched-dag/src/law/distribution.rs",
    "kernel/front/src/text/mod.rs",
];

/// Items public only for their own crate, in a private module, or only for the kernel, which does
/// not export them.
const INTERNAL: [&str; 5] = [
    "MessageType",
    "ResettableState",
    "Reset",
    "report",
    "whole_number",
];

/// The words beginning an item that can have an example.
const ITEMS: [&str; 6] = [
    "pub fn ",
    "pub const fn ",
    "pub struct ",
    "pub enum ",
    "pub trait ",
    "pub unsafe fn ",
];

fn files() -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = FILES.iter().map(|file| workspace().join(file)).collect();
    for folder in FOLDERS {
        let entries = fs::read_dir(workspace().join(folder)).expect("a crate's sources");
        let paths = entries.flatten().map(|entry| entry.path());
        files.extend(paths.filter(|path| path.extension().is_some_and(|kind| kind == "rs")));
    }
    files
}

/// Returns the number of items of a source, and the names of those without example.
fn items(source: &str) -> (usize, Vec<String>) {
    let (mut found, mut bare) = (0, Vec::new());
    let mut documentation = String::new();
    let mut in_attribute = false;
    for written in source.lines() {
        let line = written.trim_start();
        if line == "mod tests {" {
            break;
        }
        if line.starts_with("///") {
            documentation += line;
            continue;
        }
        // Attributes stand between an item and its documentation.
        in_attribute = match in_attribute {
            true if line == ")]" => {
                in_attribute = false;
                continue;
            }
            true => continue,
            false => line.starts_with("#[") && !line.ends_with(']'),
        };
        if line.starts_with("#[") {
            continue;
        }
        let rest = ITEMS.iter().find_map(|item| written.strip_prefix(item));
        let name = rest.and_then(|rest| {
            rest.split(|c: char| !c.is_alphanumeric() && c != '_')
                .next()
        });
        if let Some(name) = name.filter(|name| !INTERNAL.contains(name)) {
            found += 1;
            if !documentation.contains("```") && !documentation.contains("See [`") {
                bare.push(name.to_string());
            }
        }
        documentation.clear();
    }
    (found, bare)
}

#[test]
fn every_item_that_apps_use_has_an_example() {
    let mut found = 0;
    let mut bare = Vec::new();
    for file in files() {
        let source = fs::read_to_string(&file).expect("a source");
        let (items, without) = items(&source);
        found += items;
        let place = file.strip_prefix(workspace()).unwrap_or(&file).display();
        bare.extend(without.iter().map(|name| format!("{place}: {name}")));
    }
    assert!(found > 100, "only {found} items were found");
    assert!(bare.is_empty(), "without example: {bare:#?}");
}
