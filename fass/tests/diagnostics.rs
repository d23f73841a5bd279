//! What the compiler says about a wrong shape: our sentences, not only its own.
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

struct Case {
    what: &'static str,
    code: &'static str,
    says: &'static [&'static str],
}

const CASES: &[Case] = &[
    Case {
        what: "an argument that is no tuple",
        code: "fn main() { create_dag().register_subtask(|a: i32| (a,), vec![\"a\"], vec![\"b\"], named(\"f\")); }",
        says: &[
            "`i32` is not the argument of a subtask",
            "should be a tuple of messages, one for each input topic",
            "with one input topic that is `(i32,)`, comma included",
        ],
    },
    Case {
        what: "a result that is no tuple",
        code: "fn main() { create_dag().register_subtask(|(a,): (i32,)| a, vec![\"a\"], vec![\"b\"], named(\"f\")); }",
        says: &[
            "`i32` is not the result of a subtask",
            "should be a tuple of messages, one for each output topic",
            "with one output topic that is `(i32,)`, comma included",
        ],
    },
    Case {
        what: "a message that cannot be cloned",
        code: "fn main() { create_dag().register_periodic_subtask(|| (NotClone,), vec![\"a\"], period(), named(\"f\")); }",
        says: &[
            "`NotClone` cannot travel on a topic",
            "share it as `Arc<NotClone>`",
            "travels as `fass::Unique<NotClone>`",
        ],
    },
    Case {
        what: "a message that cannot change threads",
        code: "use std::rc::Rc;\nfn main() { create_dag().register_sink_subtask(|(a,): (Rc<u8>,)| (), vec![\"a\"], period(), named(\"f\")); }",
        says: &["`Rc<u8>` cannot travel on a topic"],
    },
    Case {
        what: "a tuple beyond 16 elements",
        code: "type T = (u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8, u8);\n\
               fn main() { create_dag().register_sink_subtask(|_: T| (), vec![], period(), named(\"f\")); }",
        says: &[
            "is not the argument of a subtask",
            "one tuple of at most 16 messages",
        ],
    },
    Case {
        what: "a receiver that is none",
        code: "fn receive<T: MulRecv>() {}\nfn main() { receive::<i32>(); }",
        says: &[
            "`i32` does not receive a subtask's inputs",
            "`<Args as VecToSubs>::Subs`",
        ],
    },
    Case {
        what: "a sender that is none",
        code: "fn send<T: MulSend>() {}\nfn main() { send::<i32>(); }",
        says: &[
            "`i32` does not send a subtask's outputs",
            "`<Ret as VecToPubs>::Pubs`",
        ],
    },
    Case {
        what: "a state itself instead of a use of it",
        code: "fn main() { let dag = create_dag(); let map = dag.state(\"map\", 0_u32); dag.using(map); }",
        says: &[
            "`State<u32>` is nothing that a subtask uses",
            "should be a use, or a tuple of up to 8 uses",
            "uses are `state.update()`, `state.read()`, `latest.sample()`, `signal.raising()`",
        ],
    },
    Case {
        what: "a signal itself instead of a use of it",
        code: "fn main() { let dag = create_dag(); let alarm = dag.sporadic(period()); dag.using(alarm); }",
        says: &["Signal` is nothing that a subtask uses"],
    },
    Case {
        what: "a function that can be replaced, of a subtask that samples a latest value",
        code: "fn main() { let dag = create_dag(); let pose = dag.latest::<u32>(\"pose\"); dag.using(pose.sample()).restarting(|| |_: Option<fass::Sample<'_, u32>>, (_,): (u32,)| ()); }",
        says: &[
            "a subtask that uses `Sampling<u32>` cannot be replaced after a fault",
            "let another subtask sample the latest value or raise the signal, and send along an edge",
        ],
    },
    Case {
        what: "a use among what is none",
        code: "fn main() { let dag = create_dag(); let map = dag.state(\"map\", 0_u32); dag.using((map.read(), 5)); }",
        says: &["is nothing that a subtask uses"],
    },
    Case {
        what: "a latest value of what cannot travel",
        code: "fn main() { create_dag().latest::<NotClone>(\"a\"); }",
        says: &["`NotClone` cannot travel on a topic"],
    },
    Case {
        what: "a state that cannot change threads",
        code: "use std::rc::Rc;\nfn main() { create_dag().state(\"map\", Rc::new(0)); }",
        says: &["`Rc<{integer}>` cannot be a state"],
    },
    Case {
        what: "a state that cannot be read by several threads",
        code: "use std::cell::Cell;\nfn main() { create_dag().state(\"map\", Cell::new(0)); }",
        says: &["`Cell<{integer}>` cannot be a state"],
    },
];

/// The traits whose sentences are shown, and the sentences, come from the sources:
/// a new one without a case fails here.
#[test]
fn every_sentence_has_a_case() {
    let expected: Vec<&str> = CASES.iter().flat_map(|case| case.says).copied().collect();
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
        Some(library) => CASES
            .iter()
            .for_each(|case| check(case, &library, &directory)),
        None => panic!(
            "no library next to this test can be used by the `rustc` in the path; \
             put the toolchain that built it there"
        ),
    }
    fs::remove_dir_all(&directory).expect("the directory is ours");
}

fn check(case: &Case, library: &Path, directory: &Path) {
    let (compiles, output) = compile(case.code, library, directory);
    assert!(!compiles, "{} is accepted", case.what);
    for sentence in case.says {
        assert!(
            output.contains(sentence),
            "{}: the compiler does not say \"{sentence}\", but:\n{output}",
            case.what
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

/// Checks a program, and returns whether it compiles and what the compiler says.
fn compile(code: &str, library: &Path, directory: &Path) -> (bool, String) {
    let source = directory.join("main.rs");
    fs::write(&source, format!("{PRELUDE}{code}\n")).expect("the directory is ours");
    let dependencies = library.parent().unwrap_or(Path::new("."));
    let output = Command::new(env::var_os("RUSTC").unwrap_or("rustc".into()))
        .args(["--edition=2024", "--emit=metadata", "--color=never"])
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
