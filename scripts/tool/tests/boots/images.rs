//! `run --image FILE`: an image names its app, and runs as no other; the memory that `run` chooses
//! by itself; and an image that is not optimized.

use std::ffi::OsStr;
use std::fs;

use tool::{image, system::workspace};

use crate::support::{call, folder, refusal, succeed};

fn words_of(app: &str) -> [String; 4] {
    let image = image::build(app).expect("it builds");
    let image = image.to_str().expect("a path of text").into();
    [
        "run".into(),
        "--mode=deterministic".into(),
        "--image".into(),
        image,
    ]
}

#[test]
fn an_image_of_another_app_is_2_before_it_boots() {
    let fork_join = words_of("fork-join");
    for (option, value, wanted) in [
        ("--dag", "apps/dag-file/examples/demo.dag", "dag-file"),
        ("--app", "hand-off", "hand-off"),
        ("--app", "re\nplay", "re\\nplay"),
    ] {
        let words = fork_join.iter().map(String::as_str).chain([option, value]);
        let said = refusal(workspace(), words);
        let why = format!("the image is of app `fork-join`, and `{wanted}` is wanted; name an");
        assert!(said.contains(&why), "{said}");
    }
}

#[test]
fn an_image_alone_runs_as_what_it_is() {
    let said = call(workspace(), words_of("hand-off")).out;
    assert!(said.starts_with("app hand-off, guest words: "), "{said}");
}

#[test]
fn a_log_is_as_it_was_where_the_guest_refuses_its_words() {
    let folder = folder("refused");
    fs::write(folder.join("log"), "kept").expect("the tests' folder takes a file");
    let log = || fs::read(folder.join("log")).expect("the file");
    let run = |option, value| {
        let words = words_of("fork-join").into_iter();
        let words = words.chain([option, value, "--serial", "log"].map(String::from));
        call(&folder, words).code
    };
    assert_eq!(run("--append", "frobnicate=1"), Some(2));
    assert_eq!(log(), b"kept");
    assert_eq!(run("--jobs", "1"), Some(0));
    assert!(log().len() > 100);
}

#[test]
fn the_usual_memory_suffices_for_as_many_processors_as_there_may_be() {
    for cores in [24, 32, 64] {
        let words = "run --mode deterministic --jobs 2 --subtasks 2 --cores";
        succeed(workspace(), &format!("{words} {cores}"));
    }
}

#[test]
fn without_optimization_the_stacks_hold_and_a_run_is_evaluated() {
    for (app, words, result) in [
        ("fork-join", "jobs=2 work=compute", "\"kind\":\"fork_join\""),
        ("fork-join", "jobs=20 subtasks=6", "\"joins\":20,"),
        ("drone", "seconds=1", "\"kind\":\"drone\""),
    ] {
        let image = image::build_target(app, "gdb", ["--bin", app], None).expect("it builds");
        let words = format!("budget_factor=0 {words}");
        let run = [
            "run",
            "--mode=deterministic",
            "--cores=4",
            "--append",
            &words,
            "--image",
        ];
        let words = run.iter().map(OsStr::new).chain([image.as_os_str()]);
        let called = call(workspace(), words);
        let said = called.out + &called.complaint;
        assert!(said.contains(result), "{said}");
        for never in ["fault:", "panic", "\"kind\":\"fault\""] {
            assert!(!said.contains(never), "{said}");
        }
    }
}
