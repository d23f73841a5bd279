//! The walk, from the data to the results.

use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;

use fass::{Policy, finish_create_dags};
use gait::{DAG, Sample, TOPIC, Walk, build};
use recording::{Recordable, Recording};
use virtual_time::VirtualTime;

/// The recording that `./scripts/recording` makes of the data, removed with this value.
pub(crate) struct File(pub(crate) PathBuf);

impl File {
    /// Makes it.
    pub(crate) fn new() -> File {
        Self::of(concat!(env!("CARGO_MANIFEST_DIR"), "/data/walking.csv"))
    }

    /// Makes it of another table.
    pub(crate) fn of(table: &str) -> File {
        let name = format!("walking-{:?}.rec", std::thread::current().id());
        let out = std::env::temp_dir().join(format!("{}-{name}", std::process::id()));
        let schema = Sample::schema().to_string();
        let words = [
            "--from-csv",
            table,
            "--dag",
            DAG,
            "--topic",
            TOPIC,
            "--ignore",
            "sample",
        ];
        let more = ["--period", "8333333ns", "--type", &schema, "--out"];
        let words = words.into_iter().chain(more).map(OsString::from);
        let words: Vec<OsString> = words.chain([out.clone().into()]).collect();
        let _ = tool::recordings::recording(&words);
        File(out)
    }

    /// Reads it.
    pub(crate) fn read(&self) -> Recording<'static> {
        let bytes = fs::read(&self.0).expect("the recording");
        Recording::read(bytes.leak()).expect("it is whole")
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Walks in virtual time.
pub(crate) fn walk(recording: &Recording<'static>, cores: u32, policy: Policy) -> Walk {
    let machine = VirtualTime::new().cores(cores).policy(policy);
    let (dag, walk) = build(recording).expect("it has the samples");
    let commit = finish_create_dags(&[dag]).expect("the DAG is proven");
    assert!(commit.answers()[0].verdict.bound().is_some());
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert_eq!(report.dag("gait").statistics().completed, 3_511);
    walk
}
