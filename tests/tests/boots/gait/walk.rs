//! The recorded walk, in virtual time, against an independent implementation.

use super::{Walked, walk};
use fass::Policy;
use gait::{DAG, Sample, TOPIC};

const REFERENCE: &str = include_str!("../../../../apps/gait/data/madgwick.csv");

#[test]
fn every_value_is_that_of_the_reference_on_all_cores_and_by_all_policies() {
    let recording = Walked::new().read();
    let digest = |cores, policy| walk(&recording, cores, policy).digest();
    let walk = walk(&recording, 2, Policy::Edf);
    for cores in [1, 4, 8] {
        assert_eq!(digest(cores, Policy::Edf), walk.digest());
        assert_eq!(digest(cores, Policy::StaticPriority), walk.digest());
    }
    let mut lines = REFERENCE.lines().skip(1);
    let mut most = 0.0_f64;
    for (row, line) in walk.rows().zip(&mut lines) {
        let wanted = line.split(',').skip(1);
        let wanted = wanted.map(|cell| cell.parse::<f64>().expect("a number"));
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
    let recording = Walked::new().read();
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
