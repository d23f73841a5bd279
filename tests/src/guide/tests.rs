//! The guide keeps its promises; the index of pages is complete.

use std::ffi::OsString;
use std::fs;

use super::PAGES;
use crate::fault_page::{documented_faults, with_names_of};
use crate::markdown::{Block, blocks, page};
use lab::golden;
use lab::test::TEST;
use tool::new_app::NEW_APP;
use tool::options::Command;
use tool::run::RUN;
use tool::system::workspace;
use tool::trace::{CHECK_TRACE, TRACE};

#[path = "../../../fass/virtual-time/examples/vision.rs"]
#[allow(dead_code, reason = "its `main` prints what `run` returns")]
mod vision;

/// The scripts the guide may name.
const COMMANDS: [&Command; 5] = [&RUN, &TEST, &NEW_APP, &CHECK_TRACE, &TRACE];

fn guide() -> Vec<Block> {
    PAGES.iter().flat_map(|it| blocks(&page(it))).collect()
}

/// Returns the lines of all blocks of a kind.
fn lines_of(info: &str) -> Vec<String> {
    let blocks = guide().into_iter().filter(|block| block.info == info);
    let texts: Vec<String> = blocks.map(|block| block.text).collect();
    texts.concat().lines().map(String::from).collect()
}

/// Returns the names of the pages in a folder, in their order.
fn files(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(workspace().join(folder)).expect(folder);
    let entries = entries.flatten().filter(|entry| entry.path().is_file());
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.collect();
    names.retain(|name| name.ends_with(".md"));
    names.sort();
    names
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
    let library = page("tests/src/lib.rs");
    for page in PAGES {
        assert!(library.contains(&format!("#[doc = include_str!(\"../../{page}\")]")));
    }
    let manifest = page("tests/Cargo.toml");
    assert!(!manifest.contains("doctest"), "doctests are left out");
}

#[test]
fn every_command_is_one_that_its_script_accepts() {
    let mut commands = 0;
    for line in lines_of("console") {
        let words = line.strip_prefix("$ ");
        let words = words.expect("a console shows commands only");
        if words.starts_with("cd ") {
            continue;
        }
        // In an app's repository cargo hands its runner the options of `run`.
        let words = words.replace("cargo run --", "./scripts/run");
        let mut words = words.split(' ');
        let script = words.next().unwrap_or_default();
        let command = COMMANDS.iter().find(|it| it.invocation == script);
        let command =
            command.unwrap_or_else(|| panic!("`{script}` is no script that the guide may name"));
        assert!(workspace().join(script).is_file(), "{script}");
        let parsed = command.parse(&words.map(OsString::from).collect::<Vec<_>>());
        assert!(parsed.is_ok(), "{line}: {parsed:?}");
        commands += 1;
    }
    assert!(commands >= 8, "{commands} commands are left");
}

#[test]
fn what_it_says_of_the_compiler_is_what_the_compilers_test_expects() {
    let test = page("fass/tests/it/diagnostics.rs");
    let lines = lines_of("text diagnostic");
    assert!(lines.len() >= 5, "{lines:?}");
    for line in lines {
        assert!(test.contains(&line), "no test expects `{line}`");
    }
}

#[test]
fn what_they_say_of_a_fault_is_its_entrys_text_with_names_of_their_own() {
    let faults = documented_faults();
    for file in ["README.md", "docs/guide.md"] {
        let mut blocks = blocks(&page(file)).into_iter();
        let quoted = |block: &Block| block.info.starts_with("text fault-");
        let Block { info, text } = blocks.find(quoted).expect("it shows a fault");
        let fault = &faults[info.trim_start_matches("text fault-")];
        let said = with_names_of(&text, fault) + "\n";
        golden::assert_is(file, &info, &text, &said);
    }
}

#[test]
fn the_guide_shows_what_the_first_example_prints() {
    let mut blocks = blocks(&page("docs/guide.md")).into_iter();
    let shown = blocks.find(|block| block.info == "text output-vision");
    let (below, text) = (
        "cargo run --example vision",
        shown.expect("it is there").text,
    );
    let now = vision::run().expect("the DAG is sound");
    golden::assert_is("docs/guide.md", below, &text, &now);
}

#[test]
fn the_order_of_reading_has_every_page() {
    let index = page("docs/README.md");
    let mut pages = files("docs");
    pages.retain(|name| name != "README.md");
    assert!(pages.len() > 5);
    for name in pages {
        let link = format!("({name})");
        assert!(index.contains(&link), "docs/README.md lacks {link}");
    }
    // Without the decisions.
    assert!(index.contains("(decisions/README.md)"));
}

/// Returns the entries of the decisions' index: number and file.
fn listed_decisions() -> Vec<(usize, String)> {
    let entry = |row: &str| {
        let (number, rest) = row.strip_prefix("| [")?.split_once("](")?;
        let (file, _) = rest.split_once(") | ")?;
        Some((number.parse().ok()?, file.to_string()))
    };
    let index = page("docs/decisions/README.md");
    index.lines().filter_map(entry).collect()
}

#[test]
fn the_index_lists_every_decision() {
    let listed = listed_decisions();
    let mut pages = files("docs/decisions");
    pages.retain(|name| name != "README.md");
    assert!(pages.len() >= 19, "{pages:?}");
    let listed_files: Vec<&String> = listed.iter().map(|(_, file)| file).collect();
    assert_eq!(listed_files, pages.iter().collect::<Vec<_>>());
    for (number, file) in &listed {
        let page = page(&format!("docs/decisions/{file}"));
        assert!(page.starts_with(&format!("# {number}. ")), "{file}");
        assert!(file.starts_with(&format!("{number:04}-")), "{file}");
    }
}

#[test]
fn the_architecture_lists_every_lock() {
    let sources = sources_below("kernel");
    let statics = sources.split("static ").skip(1);
    let names = statics.filter_map(|rest| rest.split_once(": SpinLock<"));
    let is_name = |name: &&str| name.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    let mut locks: Vec<_> = names.map(|(name, _)| name).filter(is_name).collect();
    let page = page("docs/architecture.md");
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
    let sources = ["sched-dag/src", "fass/src"].map(sources_below).concat();
    let mut found = 0;
    let page = page("docs/glossary.md");
    for row in page.lines().filter(|row| row.starts_with("| **")) {
        let word = row.split(" | ").next().expect("the word");
        for name in word.split('`').skip(1).step_by(2) {
            let kinds = ["struct", "enum", "trait"];
            let mut items = kinds.map(|kind| format!("pub {kind} {name}")).into_iter();
            // Ids are declared by a macro, one a line.
            let is_id = sources.contains(&format!("\n    {name};\n"));
            let is_there = is_id || items.any(|item| sources.contains(&item));
            assert!(is_there, "`{name}` of the glossary is no public type");
            found += 1;
        }
    }
    assert!(found >= 10, "{found}");
}
