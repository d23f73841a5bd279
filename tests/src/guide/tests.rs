//! The guide holds what it promises; the README's index of pages is complete.

use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;

use super::{PAGES, read, without_numbers};
use crate::fault_page::{documented_faults, with_names_of};
use crate::markdown::{Block, blocks};
use tool::golden::Golden;
use tool::new_app::NEW_APP;
use tool::options::{Command, Request};
use tool::run::RUN;
use tool::system::workspace;
use tool::test::TEST;
use tool::trace::{CHECK_TRACE, TRACE};

#[path = "../../../fass/virtual-time/examples/vision.rs"]
#[allow(dead_code, reason = "its `main` prints what `run` returns")]
mod vision;

/// The scripts that the guide may name.
const COMMANDS: [&Command; 5] = [&RUN, &TEST, &NEW_APP, &CHECK_TRACE, &TRACE];

fn guide() -> Vec<Block> {
    blocks(&read().expect("the page"))
}

#[test]
fn every_block_is_of_a_kind_that_is_checked() {
    let mut examples = 0;
    for Block { info, text } in guide() {
        match info.as_str() {
            // Doctests; `rust,no_run` is for what only the machine can run.
            "rust" | "rust,no_run" => examples += 1,
            "console" | "cpp" | "text diagnostic" => {}
            text if text.starts_with("text output-") || text.starts_with("text fault-") => {}
            other => panic!("a block of the kind `{other}` is checked by nobody:\n{text}"),
        }
    }
    assert!(examples >= 9, "{examples} examples are left");
    // The lines by which the examples become tests.
    let library = fs::read_to_string(workspace().join("tests/src/lib.rs")).expect("the library");
    for page in PAGES {
        assert!(library.contains(&format!("#[doc = include_str!(\"../../{page}\")]")));
    }
    let manifest = fs::read_to_string(workspace().join("tests/Cargo.toml")).expect("the manifest");
    assert!(!manifest.contains("doctest"), "doctests are left out");
}

#[test]
fn every_command_is_one_that_its_script_accepts() {
    let mut commands = 0;
    let consoles = guide().into_iter().filter(|block| block.info == "console");
    for line in consoles.flat_map(|block| {
        let lines = block.text.lines().map(String::from);
        lines.collect::<Vec<_>>()
    }) {
        let words = line
            .strip_prefix("$ ")
            .expect("a console shows commands only");
        if words.starts_with("cd ") {
            continue;
        }
        // In an app's repository cargo hands its runner the options of `run`.
        let words = words.replace("cargo run --", "./scripts/run");
        let mut words = words.split(' ');
        let script = words.next().unwrap_or_default();
        let command = COMMANDS
            .iter()
            .find(|command| command.invocation == script)
            .unwrap_or_else(|| panic!("`{script}` is no script that the guide may name"));
        assert!(workspace().join(script).is_file(), "{script}");
        let parsed = command.parse(&words.map(OsString::from).collect::<Vec<_>>());
        assert!(matches!(parsed, Ok(Request::Work(_))), "{line}: {parsed:?}");
        commands += 1;
    }
    assert!(commands >= 8, "{commands} commands are left");
}

#[test]
fn what_it_says_of_the_compiler_is_what_the_compilers_test_expects() {
    let test = workspace().join("fass/tests/diagnostics.rs");
    let test = fs::read_to_string(test).expect("the test");
    let said = guide()
        .into_iter()
        .filter(|block| block.info == "text diagnostic");
    let mut lines = 0;
    for line in said.flat_map(|block| {
        let lines = block.text.lines().map(String::from);
        lines.collect::<Vec<_>>()
    }) {
        assert!(test.contains(&line), "no test expects `{line}`");
        lines += 1;
    }
    assert!(lines >= 5, "{lines} lines are left");
}

#[test]
fn what_they_say_of_a_fault_is_its_entrys_text_with_names_of_their_own() {
    let faults = documented_faults().expect("the page");
    for file in ["README.md", "docs/guide.md"] {
        let page = fs::read_to_string(workspace().join(file)).expect("the page");
        let mut blocks = blocks(&page).into_iter();
        let quoted = |block: &Block| block.info.starts_with("text fault-");
        let Block { info, text } = blocks.find(quoted).expect("it shows a fault");
        let fault = &faults[info.trim_start_matches("text fault-")];
        let said = with_names_of(&text, &fault.text) + "\n";
        let below = &info;
        Golden {
            file,
            below,
            text: &text,
        }
        .assert_is(&said);
    }
}

#[test]
fn the_readme_shows_what_the_first_command_prints() {
    let readme = fs::read_to_string(workspace().join("README.md")).expect("the page");
    let mut blocks = blocks(&readme).into_iter();
    let shown = blocks
        .find(|block| block.info == "text")
        .expect("it is there");
    let golden = Golden {
        file: "README.md",
        below: "The first command prints",
        text: &shown.text,
    };
    golden.assert_is(&vision::run().expect("the DAG is sound"));
}

#[test]
fn the_readme_lists_every_page() {
    let readme = fs::read_to_string(workspace().join("README.md")).expect("the page");
    let index = readme.split("\n## More\n").nth(1).expect("the index");
    let pages = fs::read_dir(workspace().join("docs")).expect("the pages");
    let mut found = 0;
    for page in pages.flatten() {
        let name = page.file_name().to_string_lossy().into_owned();
        assert!(
            index.contains(&format!("(docs/{name})")),
            "the README's list of pages lacks docs/{name}"
        );
        found += 1;
    }
    assert!(found > 5);
}

/// Returns the entries of the decisions' index: number, file, and the last column.
fn listed_decisions() -> Vec<(usize, String, String)> {
    let index = workspace().join("docs/decisions/README.md");
    let index = fs::read_to_string(index).expect("the index");
    let entry = |row: &str| {
        let (number, rest) = row.strip_prefix("| [")?.split_once("](")?;
        let (file, rest) = rest.split_once(") | ")?;
        let (_, successor) = rest.trim_end_matches('|').rsplit_once('|')?;
        let number = number.parse().ok()?;
        Some((number, file.to_string(), successor.trim().to_string()))
    };
    index.lines().filter_map(entry).collect()
}

#[test]
fn the_index_lists_every_decision() {
    let listed = listed_decisions();
    let folder = fs::read_dir(workspace().join("docs/decisions")).expect("the decisions");
    let names = folder
        .flatten()
        .map(|page| page.file_name().to_string_lossy().into_owned());
    let mut pages: Vec<String> = names.filter(|name| name != "README.md").collect();
    pages.sort();
    assert!(pages.len() >= 19, "{pages:?}");
    let files: Vec<&String> = listed.iter().map(|(_, file, _)| file).collect();
    assert_eq!(files, pages.iter().collect::<Vec<_>>());
    for (number, file, successor) in &listed {
        let page = fs::read_to_string(workspace().join("docs/decisions").join(file));
        let page = page.expect("the decision");
        assert!(page.starts_with(&format!("# {number}. ")), "{file}");
        assert!(file.starts_with(&format!("{number:04}-")), "{file}");
        let is_there = |of: &str| pages.iter().any(|page| page == of);
        let link = successor
            .split("](")
            .nth(1)
            .and_then(|rest| rest.split(')').next());
        assert!(
            successor.is_empty() || link.is_some_and(is_there),
            "{file}: {successor}"
        );
    }
}

/// Returns the README, CONTRIBUTING.md and all pages of `docs/`, with their texts.
fn pages() -> Vec<(PathBuf, String)> {
    let docs = workspace().join("docs");
    let mut paths = ["README.md", "CONTRIBUTING.md"]
        .map(|page| workspace().join(page))
        .to_vec();
    for folder in [docs.clone(), docs.join("decisions")] {
        let entries = fs::read_dir(folder).expect("the pages").flatten();
        paths.extend(entries.map(|entry| entry.path()));
    }
    paths.retain(|path| path.is_file());
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("the page");
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

#[test]
fn the_architecture_lists_every_lock() {
    let sources = sources_below("kernel");
    let statics = sources.split("static ").skip(1);
    let names = statics.filter_map(|rest| rest.split_once(": SpinLock<"));
    let is_name = |name: &&str| name.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    let mut locks: Vec<_> = names.map(|(name, _)| name).filter(is_name).collect();
    let page = workspace().join("docs/architecture.md");
    let page = fs::read_to_string(page).expect("the page");
    let table = page.split("| lock | protects |").nth(1).expect("the table");
    let rows = table.lines().skip(2).take_while(|row| row.starts_with('|'));
    let listed = rows.filter_map(|row| row.split('`').nth(1));
    let (of_values, mut listed): (Vec<_>, Vec<_>) = listed.partition(|name| name.contains("::"));
    locks.sort_unstable();
    listed.sort_unstable();
    assert!(locks.len() >= 5, "{locks:?}");
    assert_eq!(listed, locks);
    let fields = sources.lines();
    let fields = fields.filter(|line| line.contains(": SpinLock<") && line.ends_with(','));
    assert_eq!(of_values.len(), fields.count(), "{of_values:?}");
}

/// Returns all Rust files below a folder of the workspace, as one text.
fn sources_below(folder: &str) -> String {
    let mut folders = vec![workspace().join(folder)];
    let mut text = String::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of sources").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|kind| kind == "rs") {
                text += &fs::read_to_string(&path).expect("a source file");
            }
        }
    }
    text
}

#[test]
fn the_glossary_names_types_that_there_are() {
    let page = workspace().join("docs/glossary.md");
    let page = fs::read_to_string(page).expect("the page");
    let sources = ["sched-dag/src", "fass/src"].map(sources_below).concat();
    let mut found = 0;
    for row in page.lines().filter(|row| row.starts_with("| **")) {
        let word = row.split(" | ").next().expect("the word");
        for name in word.split('`').skip(1).step_by(2) {
            let is_there = ["struct", "enum", "trait"]
                .iter()
                .any(|kind| sources.contains(&format!("pub {kind} {name}")));
            assert!(
                is_there,
                "the glossary names `{name}`, which is no public type"
            );
            found += 1;
        }
    }
    assert!(found >= 10, "{found}");
}

#[test]
fn every_link_between_pages_leads_somewhere() {
    for (page, text) in pages() {
        let links = text.split("](").skip(1);
        for link in links.filter_map(|rest| rest.split(')').next()) {
            let target = link.split('#').next().unwrap_or_default();
            if target.is_empty() || target.contains("://") || target.contains(' ') {
                continue;
            }
            let path = page.parent().expect("a folder").join(target);
            assert!(path.exists(), "{}: `{link}` leads nowhere", page.display());
        }
    }
}

#[test]
fn every_file_that_a_page_names_is_there() {
    const FOLDERS: [&str; 8] = [
        "scripts",
        "sched-dag",
        "fass",
        "kernel",
        "boot",
        "apps",
        "tests",
        "docs",
    ];
    // Files that `new-app` makes.
    const NEW_APPS: [&str; 2] = ["apps/first-steps", "tests/virtual_time.rs"];
    let mut named = 0;
    for (page, text) in pages() {
        for word in text.split('`').skip(1).step_by(2) {
            let is_path = word.split_once('/').is_some_and(|(folder, rest)| {
                FOLDERS.contains(&folder) && !rest.contains([' ', '*', '{', '<'])
            });
            let is_of_new_app = NEW_APPS.iter().any(|app| word.starts_with(app));
            if is_path && !is_of_new_app {
                let path = workspace().join(word);
                assert!(path.exists(), "{}: there is no `{word}`", page.display());
                named += 1;
            }
        }
    }
    assert!(named > 100, "only {named} files are named");
}

#[test]
fn numbers_are_left_out() {
    assert_eq!(without_numbers("at most 4.805 ms, 12"), "at most N ms, N");
}
