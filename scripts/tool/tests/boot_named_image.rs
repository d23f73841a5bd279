//! `run --image FILE`: an image says whose it is, and is run as nothing else.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tool::{image, system};

fn built(app: &str) -> PathBuf {
    image::build(app).expect("it builds").path
}

fn run(image: &Path, words: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.args(["run", "--mode=deterministic", "--image"]);
    command.arg(image).args(words.split(' '));
    command.output().expect("the tool can be started")
}

#[test]
fn an_image_of_another_app_is_2_before_it_boots() {
    let fork_join = built("fork-join");
    let demo = system::workspace().join("apps/dag-file/examples/demo.dag");
    let dag = format!("--dag {}", demo.display());
    for (words, wanted) in [
        (&*dag, "dag-file"),
        ("--app replay", "replay"),
        ("--app re\nplay", "re\\nplay"),
    ] {
        let output = run(&fork_join, words);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert_eq!(output.stdout, b"", "{said}");
        let why = format!("the image is of app `fork-join`, and `{wanted}` is wanted; name an");
        assert!(said.contains(&why), "{said}");
    }
}

#[test]
fn an_image_alone_runs_as_what_it_is() {
    let replay = built("replay");
    let output = run(&replay, "--plain");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.starts_with("app replay, guest words: "), "{said}");
}

#[test]
fn a_log_is_as_it_was_where_the_guest_refuses_its_words() {
    let image = built("fork-join");
    let log = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("refused.log");
    fs::write(&log, "kept").expect("the tests' folder takes a file");
    let words = format!("--append frobnicate=1 --serial {}", log.display());
    let output = run(&image, &words);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert_eq!(fs::read(&log).expect("the file"), b"kept");
    let output = run(&image, &format!("--jobs 1 --serial {}", log.display()));
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(fs::read(&log).expect("the file").len() > 100);
}
