//! The recorded walk, in virtual time, against an independent implementation.

use std::process::{Command, Output};

use super::{File, walk};
use fass::Policy;
use gait::{DAG, Sample, TOPIC};

const REFERENCE: &str = include_str!("../../../../apps/gait/data/madgwick.csv");

#[test]
fn every_value_is_that_of_the_reference_on_all_cores_and_by_all_policies() {
    let recording = File::new().read();
    let digest = |cores, policy| walk(&recording, cores, policy).digest();
    let walk = walk(&recording, 2, Policy::Edf);
    for cores in [1, 4, 8] {
        assert_eq!(digest(cores, Policy::Edf), walk.digest());
        assert_eq!(digest(cores, Policy::StaticPriority), walk.digest());
    }
    let mut lines = REFERENCE.lines().skip(1);
    let mut most = 0.0_f64;
    for (row, line) in walk.rows().zip(&mut lines) {
        let wanted = line
            .split(',')
            .skip(1)
            .map(|cell| cell.parse::<f64>().expect("a number"));
        let wanted: Vec<f64> = wanted.collect();
        assert_eq!(wanted.len(), row.len());
        for (found, wanted) in row.iter().zip(wanted) {
            most = most.max((found - wanted).abs());
        }
    }
    assert_eq!((walk.rows().len(), lines.next()), (3_511, None));
    assert!(most < 1e-9, "{most:e}");
    let angles: Vec<f64> = walk.knee_degrees().collect();
    let largest = angles.iter().copied().fold(0.0, f64::max);
    assert!((56.0..58.0).contains(&largest), "{largest}");
}

#[test]
fn a_recording_of_something_else_is_refused_in_words() {
    let recording = File::new().read();
    let other = recording.values::<[f64; 18]>(DAG, TOPIC);
    let said = other.expect_err("another type").to_string();
    let begin = "topic `sample` of dag `gait` has values of type Sample { upper: Sensor {";
    let end = ", and [f64; 18] is wanted; record it again";
    assert!(said.starts_with(begin) && said.ends_with(end), "{said}");
    let other = recording.values::<Sample>("knee", TOPIC);
    let said = other.expect_err("another DAG").to_string();
    let wanted =
        "there is nothing of topic `sample` of dag `knee`; there is topic `sample` of dag `gait`";
    assert_eq!(said, wanted);
}

/// Runs the example `replay`, as a person does.
fn replay(file: &File, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO"));
    let run = "run -q --profile linux -p gait --example replay --";
    command.args(run.split(' '));
    command.arg(&file.0).args(words);
    command.output().expect("cargo can be started")
}

#[test]
fn a_job_of_the_walk_is_shown_with_what_each_subtask_got_and_gave() {
    let file = File::new();
    let output = replay(&file, &["--until", "gait/17", "--cores", "2"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{output:?}");
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(
        lines[0],
        "job 17 of dag `gait`, due at 141666661 ns: in time"
    );
    for begin in [
        "    gives `sample`: {\"upper\":{\"acc\":[-9.59389,-1.84951,-0.82632]",
        "    takes `upper`: [0.9999755321028306,-0.0026631076828920095",
        "    gives `lower`: [0.9999799045885773,-0.001814252697080297",
    ] {
        assert!(lines.iter().any(|line| line.starts_with(begin)), "{said}");
    }
    for (place, code) in [("gait/4000", 1), ("gait", 2)] {
        let output = replay(&file, &["--until", place]);
        assert_eq!(output.status.code(), Some(code), "{output:?}");
    }
}
