//! The compiler's errors about a wrong shape: our sentences, not only its own.
//!
//! Each case is compiled by the `rustc` in the path against the library that
//! this very test was built with. Without one (no `rustc` in the path, or one of
//! another version than built this test) the test fails: it has not run.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const PRELUDE: &str = "\
#![allow(unused)]
use core::time::Duration;
use fass::*;
fn period() -> Duration { Duration::from_millis(10) }
fn named(name: &str) -> SubtaskAttributes { SubtaskAttributes::named(name) }
struct NotClone;
";

/// A program that is wrong, and what the compiler says of it.
type Case = (&'static str, &'static [&'static str]);

const CASES: &[Case] = &[
    // an argument that is no tuple
    (
        "fn main() { create_dag().register_subtask(|a: i32| (a,), vec![\"a\"], vec![\"b\"], named(\"f\")); }",
        &[
            "`i32` is not the argument of a subtask",
            "should be a tuple of messages, one for each input topic",
            "with one input topic that is `(i32,)`, comma included",
        ],
    ),
    // a result that is no tuple
    (
        "fn main() { create_dag().register_subtask(|(a,): (i32,)| a, vec![\"a\"], vec![\"b\"], named(\"f\")); }",
        &[
            "`i32` is not the result of a subtask",
            "should be a tuple of messages, one for each output topic",
            "with one output topic that is `(i32,)`, comma included",
        ],
    ),
    // as many topics as the tuple does not have
    (
        "fn main() { create_dag().register_periodic_subtask(|| (1, 2), [\"a\"], period(), named(\"f\")); }",
        &["name one output topic for each element of the function's result"],
    ),
    (
        "fn main() { create_dag().register_sink_subtask(|(_,): (i32,)| (), [\"a\", \"b\"], period(), named(\"f\")); }",
        &["name one input topic for each element of the function's argument"],
    ),
    // a topic that is no list
    (
        "fn main() { create_dag().register_periodic_subtask(|| (1,), \"a\", period(), named(\"f\")); }",
        &[
            "`&str` is no list of topics",
            "should be an array of names",
            "a `Vec` of them is a list, too",
        ],
    ),
    // a message that cannot be cloned
    (
        "fn main() { create_dag().register_periodic_subtask(|| (NotClone,), vec![\"a\"], period(), named(\"f\")); }",
        &[
            "`NotClone` cannot travel on a topic",
            "share it as `Arc<NotClone>`",
            "travels as `fass::Unique<NotClone>`",
        ],
    ),
    // a message that cannot change threads
    (
        "use std::rc::Rc;\nfn main() { create_dag().register_sink_subtask(|(a,): (Rc<u8>,)| (), vec![\"a\"], period(), named(\"f\")); }",
        &["`Rc<u8>` cannot travel on a topic"],
    ),
    // a tuple beyond 16 elements
    (
        "type T = (u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8);\n\
               fn main() { create_dag().register_sink_subtask(|_: T| (), vec![], period(), named(\"f\")); }",
        &[
            "is not the argument of a subtask",
            "one tuple of at most 16 messages",
        ],
    ),
    // a receiver that is none
    (
        "fn receive<T: MulRecv>() {}\nfn main() { receive::<i32>(); }",
        &[
            "`i32` does not receive a subtask's inputs",
            "`<Args as VecToSubs>::Subs`",
        ],
    ),
    // a sender that is none
    (
        "fn send<T: MulSend>() {}\nfn main() { send::<i32>(); }",
        &[
            "`i32` does not send a subtask's outputs",
            "`<Ret as VecToPubs>::Pubs`",
        ],
    ),
    // a state itself instead of a use of it
    (
        "fn main() { let dag = create_dag(); let map = dag.state(\"map\", 0_u32); dag.using(map); }",
        &[
            "`State<u32>` is nothing that a subtask uses",
            "should be a use, or a tuple of up to 8 uses",
            "uses are `state.update()`, `state.read()`, `latest.sample()`, `signal.raising()`",
        ],
    ),
    // a signal itself instead of a use of it
    (
        "fn main() { let dag = create_dag(); let alarm = dag.sporadic(period()); dag.using(alarm); }",
        &["Signal` is nothing that a subtask uses"],
    ),
    // a function that can be replaced, of a subtask that samples a latest value
    (
        "fn main() { let dag = create_dag(); let pose = dag.latest::<u32>(\"pose\"); dag.using(pose.sample()).restarting(|| |_: Option<fass::shared::Sample<'_, u32>>, (_,): (u32,)| ()); }",
        &[
            "a subtask that uses `LatestUse<u32>` cannot be replaced after a fault",
            "let another subtask sample the latest value or raise the signal, and send along an edge",
        ],
    ),
    // a use among what is none
    (
        "fn main() { let dag = create_dag(); let map = dag.state(\"map\", 0_u32); dag.using((map.read(), 5)); }",
        &["is nothing that a subtask uses"],
    ),
    // a latest value of what cannot travel
    (
        "fn main() { create_dag().latest::<NotClone>(\"a\"); }",
        &["`NotClone` cannot travel on a topic"],
    ),
    // a state that cannot change threads
    (
        "use std::rc::Rc;\nfn main() { create_dag().state(\"map\", Rc::new(0)); }",
        &["`Rc<{integer}>` cannot be a state"],
    ),
    // a state that cannot be read by several threads
    (
        "use std::cell::Cell;\nfn main() { create_dag().state(\"map\", Cell::new(0)); }",
        &["`Cell<{integer}>` cannot be a state"],
    ),
];

/// The traits whose sentences are shown, and the sentences, come from the sources:
/// a new one without a case fails here.
#[test]
fn every_sentence_has_a_case() {
    let expected: Vec<&str> = CASES.iter().flat_map(|case| case.1).copied().collect();
    let mut sentences = 0;
    for file in files_in(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
        let source = fs::read_to_string(file).expect("a source");
        let attributes = source.split("on_unimplemented(").skip(1);
        for line in attributes.filter_map(|attribute| attribute.split("message = ").nth(1)) {
            let message = line.split('"').nth(1).expect("a text");
            let fixed = message.rsplit('}').next().unwrap_or(message);
            assert!(
                expected.iter().any(|said| said.contains(fixed)),
                "no case expects \"{message}\""
            );
            sentences += 1;
        }
    }
    assert!(sentences >= 7, "only {sentences} sentences were found");
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let within = entries
        .map(|entry| entry.path())
        .map(|path| match path.is_dir() {
            true => files_in(&path),
            false => vec![path],
        });
    within.flatten().collect()
}

#[test]
fn wrong_shapes_are_refused_in_our_words() {
    let directory = env::temp_dir().join(format!("fass-diagnostics-{}", std::process::id()));
    fs::create_dir_all(&directory).expect("a temporary directory");
    match usable_library(&directory) {
        Some(library) => (CASES.iter()).for_each(|case| check(case, &library, &directory)),
        None => panic!(
            "no library next to this test can be used by the `rustc` in the path; \
             put the toolchain that built it there"
        ),
    }
    fs::remove_dir_all(&directory).expect("the directory is ours");
}

fn check((code, says): &Case, library: &Path, directory: &Path) {
    let (compiles, output) = compile(code, library, directory);
    assert!(!compiles, "it is accepted: {code}");
    for sentence in *says {
        assert!(
            output.contains(sentence),
            "{code}: no \"{sentence}\", but:\n{output}"
        );
    }
}

/// Finds the newest `fass` library that a faultless program compiles against.
fn usable_library(directory: &Path) -> Option<PathBuf> {
    let test = env::current_exe().ok()?;
    let mut libraries: Vec<PathBuf> = fs::read_dir(test.parent()?)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let name = path.file_name().and_then(|name| name.to_str());
            name.is_some_and(|name| name.starts_with("libfass-") && name.ends_with(".rlib"))
        })
        .collect();
    libraries.sort_by_key(|path| fs::metadata(path).and_then(|data| data.modified()).ok());
    let faultless = "fn main() { create_dag().name(\"demo\"); }";
    let mut newest_first = libraries.into_iter().rev();
    newest_first.find(|library| compile(faultless, library, directory).0)
}

/// Compiles a program, up to what is checked for each use of a generic function, and returns
/// whether that succeeds and what the compiler says.
fn compile(code: &str, library: &Path, directory: &Path) -> (bool, String) {
    let source = directory.join("main.rs");
    fs::write(&source, format!("{PRELUDE}{code}\n")).expect("the directory is ours");
    let dependencies = library.parent().unwrap_or(Path::new("."));
    let output = Command::new(env::var_os("RUSTC").unwrap_or("rustc".into()))
        .args(["--edition=2024", "--emit=obj", "--color=never"])
        .arg("--out-dir")
        .arg(directory)
        .arg("-L")
        .arg(format!("dependency={}", dependencies.display()))
        .arg("--extern")
        .arg(format!("fass={}", library.display()))
        .arg(source)
        .output();
    match output {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            (output.status.success(), text)
        }
        Err(error) => (false, error.to_string()),
    }
}
