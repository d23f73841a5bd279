//! The recorded walk, from the data to the results, on the host, on the machine and on Linux.

mod machine;
mod walk;

use std::ffi::OsString;
use std::fs;

use fass::{Policy, finish_create_dags};
use gait::{DAG, Sample, TOPIC, WalkOrientations, build};
use harness::file::File;
use recording::{Recordable, Recording};
use tool::system::workspace;
use virtual_time::VirtualTime;

/// The table of both sensors.
const TABLE: &str = "apps/gait/data/walking.csv";

/// The recording of the data, made by `./scripts/recording`.
struct Walked(File);

impl Walked {
    /// Makes the recording.
    fn new() -> Walked {
        let table = workspace().join(TABLE);
        let table = table.to_string_lossy();
        let out = File::new("walking", "rec");
        let schema = Sample::schema().to_string();
        let words = [
            "--from-csv",
            &table,
            "--dag",
            DAG,
            "--topic",
            TOPIC,
            "--ignore",
            "sample",
        ];
        let more = ["--period", "8333333ns", "--type", &schema, "--out"];
        let words = words.into_iter().chain(more).map(OsString::from);
        let words: Vec<OsString> = words.chain([out.0.clone().into()]).collect();
        let _ = tool::recordings::recording(&words);
        Walked(out)
    }

    /// Reads the recording.
    fn read(&self) -> Recording<'static> {
        let bytes = fs::read(&self.0.0).expect("the recording");
        Recording::read(bytes.leak()).expect("it is whole")
    }
}

/// Walks in virtual time.
fn walk(recording: &Recording<'static>, cores: u32, policy: Policy) -> WalkOrientations {
    let machine = VirtualTime::new().cores(cores).policy(policy);
    let (dag, walk) = build(recording).expect("it has the samples");
    let commit = finish_create_dags(&[dag]).expect("the DAG is proven");
    assert!(commit.answers()[0].verdict.bound().is_some());
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert_eq!(report.dag("gait").statistics().completed, 3_511);
    walk
}
