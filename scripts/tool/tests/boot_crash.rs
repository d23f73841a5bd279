//! A crash on the machine, and its evidence: what `run` leaves without being asked shows the job
//! that crashed on the host.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use recording::{Recording, What};
use tool::system;

/// The job whose sample is no number.
const JOB: usize = 1_000;

/// A folder of the test, removed with this value.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Makes a recording of the walk in which a sensor fails.
fn poisoned(folder: &Path) -> PathBuf {
    let table = system::workspace().join("apps/gait/data/walking.csv");
    let table = fs::read_to_string(table).expect("the walk");
    let mut lines: Vec<String> = table.lines().map(String::from).collect();
    let mut cells: Vec<&str> = lines[JOB + 1].split(',').collect();
    cells[1] = "NaN";
    lines[JOB + 1] = cells.join(",");
    let table = folder.join("walk.csv");
    fs::write(&table, lines.join("\n")).expect("our folder takes a file");
    let sensor = "Sensor { acc: [f64; 3], gyr: [f64; 3], mag: [f64; 3] }";
    let schema = format!("Sample {{ upper: {sensor}, lower: {sensor} }}");
    let file = folder.join("walk.rec");
    let words = ["--dag", "gait", "--topic", "sample", "--ignore", "sample"];
    let more = ["--period", "8333333ns", "--type", &schema, "--out"];
    let words = ["--from-csv".into(), OsString::from(&table)]
        .into_iter()
        .chain(words.into_iter().chain(more).map(OsString::from))
        .chain([file.clone().into()]);
    let words: Vec<OsString> = words.collect();
    let _ = tool::recordings::recording(&words);
    file
}

fn run(module: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.args(["run", "--app=gait", "--mode=deterministic", "--cores=2"]);
    command.arg("--module").arg(module).args(words);
    command.output().expect("the tool can be started")
}

#[test]
fn a_crash_leaves_what_shows_its_job_on_the_host() {
    let folder = std::env::temp_dir().join(format!("crash-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    let folder = Folder(folder);
    let module = poisoned(&folder.0);

    let output = run(&module, &[]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let fault = "in subtask `upper` of dag `gait`, job 1000, ";
    assert!(said.contains(fault), "{said}");
    let message = "a sensor has given what is no number";
    assert!(said.contains(message), "{said}");
    let line = (said.lines()).find(|line| line.contains(": the inputs of the last jobs"));
    let (file, _) = line.and_then(|line| line.split_once(": ")).expect(&said);
    let shown = format!("`cargo run --profile host -p gait --example replay -- {file}` shows");
    assert!(said.contains(&shown), "{said}");

    let bytes = fs::read(file).expect("the file that is named");
    let recording = Recording::read(&bytes).expect("it is whole");
    assert!(recording.is_cut() && recording.lost() == 0);
    assert_eq!(recording.header().channels.len(), 1, "inputs alone");
    let values = (recording.entries()).filter(|entry| entry.what == What::Value);
    let jobs: Vec<u64> = values.map(|entry| entry.job).collect();
    assert_eq!(jobs.len(), 16, "of one source: {jobs:?}");
    assert!(jobs.is_sorted() && jobs.contains(&(JOB as u64)), "{jobs:?}");

    for words in [
        &["--cores", "1"][..],
        &["--cores", "4", "--policy", "static"],
    ] {
        let mut replay = Command::new(env!("CARGO"));
        replay.args(["run", "-q", "--profile", "host", "-p", "gait"]);
        replay.args(["--example", "replay", "--", file]);
        let output = replay.args(words).output().expect("cargo can be started");
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(
            said.contains("1 panics, first of all in this job:"),
            "{said}"
        );
        assert!(said.contains("job 1000 of dag `gait`, "), "{said}");
        assert!(said.contains(message), "{said}");
        let taken = "takes `sample`: {\"upper\":{\"acc\":[";
        assert!(said.contains(taken), "{said}");
    }
    let _ = fs::remove_file(file);

    let output = run(&module, &["--latest=0"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(!said.contains("the inputs of the last jobs"), "{said}");
}
