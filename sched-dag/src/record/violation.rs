//! Holding a record against the model's rules.
//!
//! The check is written from the rules alone and shares no code with the
//! scheduler, so that an error there cannot hide here.

use core::fmt;

use super::{InstanceRecord, Record};
use crate::ids::Instance;
use crate::task_set::TaskSet;

/// A breach of one of the model's rules in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Violation {
    /// R1: the instance started before its job's nominal release.
    StartedBeforeRelease {
        /// The instance.
        instance: Instance,
        /// When it started.
        start_ns: u64,
        /// The nominal release time.
        release_ns: u64,
    },
    /// R2, R3: the instance was ready, or started, before a predecessor's finish.
    ReadyBeforePredecessor {
        /// The instance.
        instance: Instance,
        /// The earlier of its ready and start times.
        ready_ns: u64,
        /// When the last predecessor finished, `None` if one never did.
        join_ns: Option<u64>,
    },
    /// R2: the instance started before its subtask's previous instance finished.
    OverlapsItself {
        /// The instance.
        instance: Instance,
        /// When it started.
        start_ns: u64,
    },
    /// R5: the instance was not run exactly once, although its job was released.
    NotRunOnce {
        /// The instance.
        instance: Instance,
        /// How many times it ran.
        runs: u32,
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StartedBeforeRelease {
                instance,
                start_ns,
                release_ns,
            } => {
                write!(
                    f,
                    "{instance} started at {start_ns} ns, before its release at {release_ns} ns"
                )
            }
            Self::ReadyBeforePredecessor {
                instance,
                ready_ns,
                join_ns: Some(join_ns),
            } => write!(
                f,
                "{instance} was ready at {ready_ns} ns, before its last predecessor finished at {join_ns} ns"
            ),
            Self::ReadyBeforePredecessor {
                instance,
                ready_ns,
                join_ns: None,
            } => write!(
                f,
                "{instance} was ready at {ready_ns} ns, although a predecessor never finished"
            ),
            Self::OverlapsItself { instance, start_ns } => write!(
                f,
                "{instance} started at {start_ns} ns, before the previous job's instance finished"
            ),
            Self::NotRunOnce { instance, runs } => {
                write!(f, "{instance} ran {runs} times, not once")
            }
        }
    }
}

/// Returns every breach of rules R1 to R5 that `record` shows.
///
/// Of R5 it checks that each instance of a released job ran exactly once; which
/// instance ran first cannot be told without preemptions. A run must have ended,
/// and no job been aborted, for that to be meaningful.
pub fn violations<'a>(
    task_set: &'a TaskSet,
    record: &'a Record,
) -> impl Iterator<Item = Violation> + 'a {
    record
        .all_instances(task_set)
        .flat_map(move |(instance, times)| {
            [
                before_release(record, instance, times),
                before_predecessor(task_set, record, instance, times),
                overlap(record, instance, times),
                not_once(record, instance, times),
            ]
            .into_iter()
            .flatten()
        })
}

fn release_ns(record: &Record, instance: Instance) -> Option<u64> {
    let job = usize::try_from(instance.job).ok()?;
    record.jobs(instance.dag).get(job)?.release_ns
}

fn before_release(
    record: &Record,
    instance: Instance,
    times: &InstanceRecord,
) -> Option<Violation> {
    let start_ns = times.start_ns?;
    let release_ns = release_ns(record, instance).unwrap_or(u64::MAX);
    (start_ns < release_ns).then_some(Violation::StartedBeforeRelease {
        instance,
        start_ns,
        release_ns,
    })
}

fn before_predecessor(
    task_set: &TaskSet,
    record: &Record,
    instance: Instance,
    times: &InstanceRecord,
) -> Option<Violation> {
    let ready_ns = [times.ready_ns, times.start_ns]
        .into_iter()
        .flatten()
        .min()?;
    if task_set
        .dag(instance.dag)
        .predecessors(instance.subtask)
        .is_empty()
    {
        return None;
    }
    let join_ns = record.join_ns(task_set, instance);
    join_ns
        .is_none_or(|join_ns| ready_ns < join_ns)
        .then_some(Violation::ReadyBeforePredecessor {
            instance,
            ready_ns,
            join_ns,
        })
}

fn overlap(record: &Record, instance: Instance, times: &InstanceRecord) -> Option<Violation> {
    let start_ns = times.start_ns?;
    let previous = Instance {
        job: instance.job.checked_sub(1)?,
        ..instance
    };
    let previous = record.instance(previous)?;
    let free = match previous.finish_ns {
        Some(finish_ns) => start_ns >= finish_ns,
        None => previous.start_ns.is_none(),
    };
    (!free).then_some(Violation::OverlapsItself { instance, start_ns })
}

fn not_once(record: &Record, instance: Instance, times: &InstanceRecord) -> Option<Violation> {
    let expected = u32::from(release_ns(record, instance).is_some());
    (times.runs != expected).then_some(Violation::NotRunOnce {
        instance,
        runs: times.runs,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::{DagId, SubtaskId};
    use crate::record::JobRecord;
    use crate::{CommitOptions, DagSpec, Policy, SubtaskSpec, verify};

    fn chain_of_two(jobs: u64) -> TaskSet {
        let subtask = |name: &str| SubtaskSpec {
            name: name.into(),
            ..SubtaskSpec::default()
        };
        let spec = DagSpec {
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            jobs: Some(jobs),
            subtasks: vec![subtask("u"), subtask("v")],
            edges: vec![(0, 1)],
            ..DagSpec::default()
        };
        verify(&[spec], &CommitOptions::new(Policy::Edf, 1))
            .unwrap()
            .task_set
    }

    fn at(job: u64, subtask: u32) -> Instance {
        Instance {
            dag: DagId(0),
            job,
            subtask: SubtaskId(subtask),
        }
    }

    /// Two jobs at 0 and 10; `u` runs in [0, 2) and `v` in [2, 5) of each.
    fn good(task_set: &TaskSet) -> Record {
        let mut record = Record::new(task_set).unwrap();
        for job in 0..2 {
            let release = 10 * job;
            *record.job_mut(DagId(0), job).unwrap() = JobRecord {
                release_ns: Some(release),
                released_ns: Some(release),
            };
            for (subtask, start, finish) in [(0, 0, 2), (1, 2, 5)] {
                *record.instance_mut(at(job, subtask)).unwrap() = InstanceRecord {
                    ready_ns: Some(release + start),
                    start_ns: Some(release + start),
                    finish_ns: Some(release + finish),
                    core: None,
                    runs: 1,
                    preemptions: 0,
                };
            }
        }
        record
    }

    fn found(change: impl FnOnce(&mut Record)) -> Vec<Violation> {
        let task_set = chain_of_two(2);
        let mut record = good(&task_set);
        change(&mut record);
        violations(&task_set, &record).collect()
    }

    #[test]
    fn finds_nothing_in_a_schedule_by_the_rules() {
        assert_eq!(found(|_| {}), []);
    }

    #[test]
    fn r1_finds_a_start_before_the_release() {
        let breach = Violation::StartedBeforeRelease {
            instance: at(1, 0),
            start_ns: 9,
            release_ns: 10,
        };
        assert_eq!(
            found(|r| r.instance_mut(at(1, 0)).unwrap().start_ns = Some(9)),
            [breach]
        );
    }

    #[test]
    fn r2_finds_readiness_before_a_predecessor() {
        let early = Violation::ReadyBeforePredecessor {
            instance: at(0, 1),
            ready_ns: 1,
            join_ns: Some(2),
        };
        assert_eq!(
            found(|r| r.instance_mut(at(0, 1)).unwrap().ready_ns = Some(1)),
            [early]
        );
        let never = Violation::ReadyBeforePredecessor {
            instance: at(0, 1),
            ready_ns: 2,
            join_ns: None,
        };
        let lost = Violation::NotRunOnce {
            instance: at(0, 0),
            runs: 0,
        };
        let lose = |r: &mut Record| *r.instance_mut(at(0, 0)).unwrap() = InstanceRecord::default();
        assert_eq!(found(lose), [lost, never]);
    }

    #[test]
    fn r2_finds_two_jobs_of_a_subtask_at_once() {
        let breach = Violation::OverlapsItself {
            instance: at(1, 1),
            start_ns: 12,
        };
        assert_eq!(
            found(|r| r.instance_mut(at(0, 1)).unwrap().finish_ns = Some(13)),
            [breach]
        );
    }

    #[test]
    fn r5_finds_a_second_run() {
        let breach = Violation::NotRunOnce {
            instance: at(1, 1),
            runs: 2,
        };
        assert_eq!(
            found(|r| r.instance_mut(at(1, 1)).unwrap().runs = 2),
            [breach]
        );
    }

    #[test]
    fn reports_figures_of_joins_and_jobs() {
        let task_set = chain_of_two(2);
        let record = good(&task_set);
        assert_eq!(record.join_ns(&task_set, at(1, 1)), Some(12));
        assert_eq!(record.join_ns(&task_set, at(1, 0)), None);
        assert_eq!(record.completion_ns(DagId(0), 1), Some(15));
        assert!(record.instances(DagId(0), 2).is_empty());
    }
}
