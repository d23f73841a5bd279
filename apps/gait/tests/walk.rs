//! The recorded walk, in virtual time, against an independent implementation.

mod support;

use std::process::{Command, Output};

use fass::Policy;
use gait::{DAG, Sample, TOPIC};
use support::{File, walk};

const REFERENCE: &str = include_str!("../data/madgwick.csv");

#[test]
fn every_value_is_that_of_the_reference() {
    let walk = walk(&File::new().read(), 2, Policy::Edf);
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
    println!("{} values, at most {most:e} from the reference", 3_511 * 12);
    assert!(most < 1e-9, "{most:e}");
    let angles: Vec<f64> = walk.knee_degrees().collect();
    let largest = angles.iter().copied().fold(0.0, f64::max);
    println!("the knee's angle is {largest} degrees at most");
    assert!((56.0..58.0).contains(&largest), "{largest}");
}

#[test]
fn all_cores_and_policies_give_the_same_bits() {
    let recording = File::new().read();
    let digests: Vec<u64> = [1, 2, 4, 8]
        .into_iter()
        .flat_map(|cores| [Policy::Edf, Policy::StaticPriority].map(|policy| (cores, policy)))
        .map(|(cores, policy)| walk(&recording, cores, policy).digest())
        .collect();
    println!("{digests:#x?}");
    assert_eq!(digests, [digests[0]; 8]);
}

#[test]
fn a_recording_of_something_else_is_refused_in_words() {
    let recording = File::new().read();
    let other = recording
        .values::<[f64; 18]>(DAG, TOPIC)
        .expect_err("another type");
    let said = other.to_string();
    assert!(
        said.starts_with(
            "topic `sample` of dag `gait` has values of type Sample { upper: Sensor {"
        ),
        "{said}"
    );
    assert!(
        said.ends_with(", and [f64; 18] is wanted; record it again"),
        "{said}"
    );
    let other = recording
        .values::<Sample>("knee", TOPIC)
        .expect_err("another DAG");
    assert_eq!(
        other.to_string(),
        "there is nothing of topic `sample` of dag `knee`; there is topic `sample` of dag `gait`"
    );
}

/// Runs the example `replay`, as a person does.
fn replay(file: &File, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO"));
    command.args(["run", "-q", "-p", "gait", "--example", "replay", "--"]);
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
    let output = replay(&file, &["--until", "gait/4000"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let output = replay(&file, &["--until", "gait"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}
