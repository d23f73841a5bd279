//! A crash on the machine, and its evidence: the file that `run` leaves without being asked shows
//! the job that crashed on the host.

use std::fs;
use std::path::Path;
use std::process::Command;

use recording::{EntryKind, Recording, Role};
use tool::system::workspace;

use crate::support::{Called, call, folder};

/// The job whose sample is no number.
const JOB: usize = 1_000;

const MESSAGE: &str = "a sensor has given what is no number";

/// Makes a recording of the walk in which a sensor fails, `walk.rec`.
fn poison(folder: &Path) {
    let table = workspace().join("apps/gait/data/walking.csv");
    let table = fs::read_to_string(table).expect("the walk");
    let mut lines: Vec<String> = table.lines().map(String::from).collect();
    let mut cells: Vec<&str> = lines[JOB + 1].split(',').collect();
    cells[1] = "NaN";
    lines[JOB + 1] = cells.join(",");
    fs::write(folder.join("walk.csv"), lines.join("\n")).expect("our folder takes a file");
    let sensor = "Sensor { acc: [f64; 3], gyr: [f64; 3], mag: [f64; 3] }";
    let schema = format!("Sample {{ upper: {sensor}, lower: {sensor} }}");
    let line = "recording --from-csv walk.csv --out walk.rec --dag gait --topic sample --ignore \
                sample --period 8333333ns --type";
    let made = call(folder, line.split(' ').chain([&*schema]));
    assert_eq!(made.code, Some(0), "{}", made.complaint);
}

/// Runs the walk on the machine, which fails.
fn walk(folder: &Path, more: &str) -> String {
    let run = format!("run --app=gait --mode=deterministic --cores=2 --module walk.rec{more}");
    let called = call(folder, run.split(' '));
    assert_eq!(called.code, Some(1), "{}", called.out);
    called.out
}

#[test]
fn a_crash_leaves_what_shows_its_job_on_the_host() {
    let folder = folder("crash");
    poison(&folder);
    let said = walk(&folder, "");
    let fault = "in subtask `upper` of dag `gait`, job 1000, ";
    assert!(said.contains(fault) && said.contains(MESSAGE), "{said}");
    let line = (said.lines()).find(|line| line.contains(": the inputs of the last jobs"));
    let (file, _) = line.and_then(|line| line.split_once(": ")).expect(&said);
    let shown = format!("`cargo run --profile linux -p gait --example replay -- {file}` shows");
    assert!(said.contains(&shown), "{said}");

    let bytes = fs::read(file).expect("the file that is named");
    let recording = Recording::read(&bytes).expect("it is whole");
    assert!(recording.is_cut() && recording.lost() == 0);
    let roles = recording.header().channels.iter();
    let roles = roles.map(|channel| channel.role);
    let roles: Vec<Role> = roles.collect();
    // No results.
    assert_eq!(roles, [Role::Source, Role::State, Role::State]);
    let values = (recording.entries()).filter(|entry| entry.what == EntryKind::Value);
    let jobs = |place| -> Vec<u64> {
        let of_place = values.clone().filter(|entry| entry.place == place);
        of_place.map(|entry| entry.job).collect()
    };
    let of_source = jobs(0);
    assert_eq!(of_source.len(), 16, "{of_source:?}");
    assert!(of_source.is_sorted() && of_source.contains(&(JOB as u64)));
    assert_eq!(jobs(1), [992, 1_000], "also of the instance that failed");

    for words in ["--cores 1", "--cores 4 --policy static"] {
        let run = format!("run -q --profile linux -p gait --example replay -- {file} {words}");
        let mut replay = Command::new(env!("CARGO"));
        replay.current_dir(workspace()).args(run.split(' '));
        let called = Called::of(replay.output().expect("cargo can be started"));
        let said = called.out;
        assert_eq!(called.code, Some(1), "{said}{}", called.complaint);
        for shown in [
            "1 panics, first of all in this job:",
            "job 1000 of dag `gait`, ",
            MESSAGE,
            "takes `sample`: {\"upper\":{\"acc\":[",
            // The states of job 1,000, and perhaps of the other leg, come out of that of job 992.
            " values are compared: nothing differs\n1 panics",
            "takes `upper`: [0.",
        ] {
            assert!(said.contains(shown), "{said}");
        }
    }
    let _ = fs::remove_file(file);
    let said = walk(&folder, " --latest=0");
    assert!(!said.contains("the inputs of the last jobs"), "{said}");
}
