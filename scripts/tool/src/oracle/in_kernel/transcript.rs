//! What the app `replay` printed, case by case.

use replay::{Case, InstanceTimes};

use crate::json::Value;
use crate::protocol::Transcript;

/// What the machine did with a case. Times are in nanoseconds from its time 0.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Ran {
    /// In the order of `CaseDag::position`.
    pub(super) instances: Vec<InstanceTimes>,
    /// In the order of DAGs, then jobs.
    pub(super) jobs: Vec<RanJob>,
    /// Breaches of the model's rules.
    pub(super) violations: u64,
    /// Heap allocations while it ran.
    pub(super) allocations: u64,
}

/// What the machine did with a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RanJob {
    pub(super) release_ns: u64,
    pub(super) finish_ns: u64,
    pub(super) missed: bool,
}

/// Reads what was printed about a case; `None` unless all of it is there.
pub(super) fn read(transcript: &Transcript, case: &Case) -> Option<Ran> {
    let lines = transcript.machine.iter();
    let mut lines = lines.skip_while(|line| {
        line.kind != "replay" || line.text_at("case") != Some(case.name.as_str())
    });
    let first = lines.next()?;
    let mut ran = Ran {
        violations: first.number_at("violations")?,
        allocations: first.number_at("allocations")?,
        ..Ran::default()
    };
    let mut places = Vec::new();
    for line in lines.take_while(|line| line.kind != "replay") {
        let rows = line.value.get("rows").map_or(&[][..], Value::elements);
        for row in rows {
            let numbers: Option<Vec<u64>> = row.elements().iter().map(Value::as_u64).collect();
            match (line.kind.as_str(), numbers?.as_slice()) {
                ("replay_instances", &[dag, job, subtask, start_ns, finish_ns, preemptions]) => {
                    places.push((dag, job, subtask));
                    ran.instances.push(InstanceTimes {
                        start_ns,
                        finish_ns,
                        preemptions,
                    });
                }
                ("replay_jobs", &[_, _, release_ns, finish_ns, missed]) => ran.jobs.push(RanJob {
                    release_ns,
                    finish_ns,
                    missed: missed != 0,
                }),
                _ => return None,
            }
        }
    }
    // The order is agreed on; it is compared where a row says what it is about.
    let jobs: usize = case.jobs.iter().map(Vec::len).sum();
    let whole = ran.instances.len() == case.instances.len() && ran.jobs.len() == jobs;
    (whole && places.is_sorted()).then_some(ran)
}
