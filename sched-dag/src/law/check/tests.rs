//! A schedule by the rules, broken in one place at a time.

use super::*;
use crate::ids::CoreId;
use crate::law::Rule;
use crate::{CommitOptions, DagSpec, Policy, SubtaskSpec, verify};

const DAG: DagId = DagId(0);

/// Subtask 0 before subtask 1, every 10 ns with a deadline of 10 ns.
fn chain_of_two(change: impl FnOnce(&mut DagSpec)) -> TaskSet {
    let subtask = |name: &str| SubtaskSpec {
        name: name.into(),
        ..SubtaskSpec::default()
    };
    let mut spec = DagSpec {
        period_ns: Some(10),
        relative_deadline_ns: Some(10),
        jobs: Some(3),
        subtasks: vec![subtask("u"), subtask("v")],
        edges: vec![(0, 1)],
        ..DagSpec::default()
    };
    change(&mut spec);
    let options = CommitOptions::new(Policy::Edf, 1);
    verify(&[spec], &options).unwrap().task_set
}

fn at(job: u64, subtask: u32) -> Instance {
    Instance {
        dag: DAG,
        job,
        subtask: SubtaskId(subtask),
    }
}

/// Three jobs at 0, 10 and 20; `u` runs in [0, 2) and `v` in [2, 5) of each.
fn good(task_set: &TaskSet, precision: Precision) -> Record {
    let mut record = Record::with_jobs(task_set, precision, |_| 0..3).unwrap();
    for job in 0..3 {
        let release = 10 * job;
        *record.job_mut(DAG, job).unwrap() = JobRecord {
            release_ns: Some(release),
            released_ns: Some(release),
            ended_ns: Some(release + 5),
            outcome: Some(JobOutcome::Met),
            ..JobRecord::default()
        };
        for (subtask, start, finish) in [(0, 0, 2), (1, 2, 5)] {
            *record.instance_mut(at(job, subtask)).unwrap() = InstanceRecord {
                ready_ns: Some(release + start),
                start_ns: Some(release + start),
                finish_ns: Some(release + finish),
                core: Some(CoreId(0)),
                runs: 1,
                ..InstanceRecord::default()
            };
        }
    }
    record
}

fn found_in(
    task_set: &TaskSet,
    precision: Precision,
    change: impl FnOnce(&mut Record),
) -> Vec<Violation> {
    let mut record = good(task_set, precision);
    change(&mut record);
    violations(task_set, &record).collect()
}

/// Returns what is found in exact and in measured times.
fn found(change: impl Fn(&mut Record)) -> [Vec<Violation>; 2] {
    let task_set = chain_of_two(|_| {});
    [Precision::Exact, Precision::Measured]
        .map(|precision| found_in(&task_set, precision, |record| change(record)))
}

fn both(violations: &[Violation]) -> [Vec<Violation>; 2] {
    [violations.to_vec(), violations.to_vec()]
}

fn only_exact(violation: Violation) -> [Vec<Violation>; 2] {
    [vec![violation], vec![]]
}

fn instance(record: &mut Record, job: u64, subtask: u32) -> &mut InstanceRecord {
    record.instance_mut(at(job, subtask)).unwrap()
}

fn job(record: &mut Record, job: u64) -> &mut JobRecord {
    record.job_mut(DAG, job).unwrap()
}

#[test]
fn finds_nothing_in_a_schedule_by_the_rules() {
    assert_eq!(found(|_| {}), both(&[]));
}

#[test]
fn r1_finds_releases_off_the_grid_and_at_the_wrong_time() {
    let off_grid = Violation::OffGrid {
        dag: DAG,
        job: 1,
        release_ns: 9,
        grid_ns: 10,
    };
    assert_eq!(
        found(|record| job(record, 1).release_ns = Some(9))[1],
        [off_grid]
    );
    let wrong = |released_ns| Violation::ReleasedAtWrongTime {
        dag: DAG,
        job: 2,
        released_ns,
        expected_ns: Some(20),
    };
    let release = |released_ns| move |record: &mut Record| job(record, 2).released_ns = released_ns;
    assert!(found(release(Some(19)))[1].contains(&wrong(19)));
    let [exact, measured] = found(|record| {
        release(Some(21))(record);
        instance(record, 2, 0).ready_ns = Some(21);
        instance(record, 2, 0).start_ns = Some(21);
    });
    assert_eq!((exact, measured), (vec![wrong(21)], vec![]));
}

#[test]
fn r1_finds_a_start_before_the_release_or_without_one() {
    let early = Violation::StartedBeforeRelease {
        instance: at(1, 0),
        start_ns: 9,
        release_ns: 10,
    };
    let [exact, measured] = found(|record| instance(record, 1, 0).start_ns = Some(9));
    assert!(exact.contains(&early) && measured.contains(&early));
    let [.., measured] = found(|record| *job(record, 2) = JobRecord::default());
    let unreleased = |subtask| Violation::NotReleased {
        instance: at(2, subtask),
    };
    assert_eq!(measured, [unreleased(0), unreleased(1)]);
}

#[test]
fn r2_finds_readiness_at_the_wrong_time() {
    let wrong = |ready_ns| Violation::ReadyAtWrongTime {
        instance: at(0, 1),
        ready_ns,
        expected_ns: Some(2),
    };
    let ready = |ready_ns| move |record: &mut Record| instance(record, 0, 1).ready_ns = ready_ns;
    assert_eq!(found(ready(Some(1))), both(&[wrong(Some(1))]));
    let late = found(|record| {
        ready(Some(3))(record);
        instance(record, 0, 1).start_ns = Some(3);
    });
    assert_eq!(late, only_exact(wrong(Some(3))));
    let never = found(|record| {
        *instance(record, 0, 1) = InstanceRecord::default();
        *instance(record, 1, 1) = InstanceRecord::default();
        *instance(record, 2, 1) = InstanceRecord::default();
        for number in 0..3 {
            // In flight at the end.
            job(record, number).outcome = None;
        }
    });
    assert_eq!(never, only_exact(wrong(None)));
    let before_ready = Violation::StartedBeforeReady {
        instance: at(0, 1),
        start_ns: 2,
        ready_ns: 3,
    };
    assert_eq!(found(ready(Some(3)))[1], [before_ready]);
}

#[test]
fn r2_finds_two_jobs_of_a_subtask_at_once() {
    let overlap = Violation::OverlapsItself {
        instance: at(1, 1),
        start_ns: 12,
    };
    let [.., measured] = found(|record| instance(record, 0, 1).finish_ns = Some(13));
    assert!(measured.contains(&overlap), "{measured:?}");
    let rules: Vec<Rule> = measured.iter().map(Violation::rule).collect();
    assert!(rules.contains(&Rule::AndJoin));
}

#[test]
fn r3_finds_a_start_before_a_predecessor_finished() {
    let early = Violation::StartedBeforePredecessor {
        instance: at(0, 1),
        start_ns: 2,
        predecessor: SubtaskId(0),
        finish_ns: Some(3),
    };
    let [exact, measured] = found(|record| instance(record, 0, 0).finish_ns = Some(3));
    assert!(exact.contains(&early) && measured.contains(&early));
    assert_eq!(early.rule(), Rule::CompletionBoundary);
}

#[test]
fn r4_finds_a_wrong_end_and_a_wrong_outcome() {
    let ended = |ended_ns| Violation::EndedAtWrongTime {
        dag: DAG,
        job: 2,
        ended_ns,
        last_sink_ns: Some(25),
    };
    let end = |ended_ns| move |record: &mut Record| job(record, 2).ended_ns = Some(ended_ns);
    assert_eq!(found(end(24)), both(&[ended(24)]));
    assert_eq!(found(end(26)), only_exact(ended(26)));

    let counts = |outcome, missed, finish_ns| Violation::WrongOutcome {
        dag: DAG,
        job: 2,
        outcome,
        missed,
        finish_ns,
        deadline_ns: 30,
    };
    let false_miss = found(|record| job(record, 2).outcome = Some(JobOutcome::Missed));
    assert_eq!(
        false_miss,
        only_exact(counts(JobOutcome::Missed, false, 25))
    );
    let false_alarm = found(|record| job(record, 2).missed_ns = Some(25));
    assert_eq!(false_alarm, both(&[counts(JobOutcome::Met, true, 25)]));
    let late = found(|record| {
        instance(record, 2, 1).finish_ns = Some(31);
        job(record, 2).ended_ns = Some(31);
    });
    assert_eq!(late, both(&[counts(JobOutcome::Met, false, 31)]));
}

#[test]
fn r5_finds_instances_that_did_not_run_once() {
    let not_once = |subtask, runs| Violation::NotRunOnce {
        instance: at(2, subtask),
        runs,
    };
    let twice = found(|record| instance(record, 2, 1).runs = 2);
    assert_eq!(twice, both(&[not_once(1, 2)]));
    let never = |record: &mut Record| instance(record, 2, 1).runs = 0;
    assert_eq!(found(never), both(&[not_once(1, 0)]));
    // A job in flight when the record ends may still run it.
    let in_flight = found(|record| {
        *instance(record, 2, 1) = InstanceRecord {
            ready_ns: Some(22),
            ..InstanceRecord::default()
        };
        (job(record, 2).outcome, job(record, 2).ended_ns) = (None, None);
    });
    assert_eq!(in_flight, both(&[]));
}

/// Job 1 is aborted at 12, when `v` is ready, and does not run it.
fn abort(record: &mut Record) {
    let times = job(record, 1);
    (times.cut_ns, times.ended_ns) = (Some(12), Some(12));
    times.outcome = Some(JobOutcome::Aborted);
    let cancelled = instance(record, 1, 1);
    (cancelled.start_ns, cancelled.finish_ns, cancelled.runs) = (None, None, 0);
}

#[test]
fn an_aborted_job_need_not_run_everything() {
    assert_eq!(found(abort), both(&[]));
    // After it "ready exactly when" is "not before".
    let late = found(|record| {
        abort(record);
        instance(record, 2, 1).ready_ns = Some(24);
        instance(record, 2, 1).start_ns = Some(24);
    });
    assert_eq!(late, both(&[]));
}

#[test]
fn a_skipped_job_is_no_precursor() {
    let skip = |record: &mut Record| {
        *job(record, 1) = JobRecord::default();
        for subtask in 0..2 {
            *instance(record, 1, subtask) = InstanceRecord::default();
        }
    };
    assert_eq!(found(skip), both(&[]));
    // Job 2 waits for what job 0 left.
    let [.., measured] = found(|record| {
        skip(record);
        instance(record, 0, 1).finish_ns = Some(24);
    });
    let overlap = Violation::OverlapsItself {
        instance: at(2, 1),
        start_ns: 22,
    };
    assert!(measured.contains(&overlap), "{measured:?}");
}

#[test]
fn a_queued_release_waits_for_the_job_in_its_way() {
    let task_set = chain_of_two(|spec| spec.in_flight = Some(1));
    let wait = |ended_ns| {
        found_in(&task_set, Precision::Exact, |record| {
            // Job 1 begins late, at 12, because job 0 does not end before.
            instance(record, 0, 1).finish_ns = Some(ended_ns);
            (job(record, 0).ended_ns, job(record, 0).missed_ns) = (Some(ended_ns), Some(11));
            job(record, 0).outcome = Some(JobOutcome::Missed);
            job(record, 1).released_ns = Some(12);
            instance(record, 1, 0).ready_ns = Some(12);
            instance(record, 1, 0).start_ns = Some(12);
        })
    };
    assert_eq!(wait(12), []);
    let early = Violation::ReleasedAtWrongTime {
        dag: DAG,
        job: 1,
        released_ns: 12,
        expected_ns: Some(13),
    };
    assert!(wait(13).contains(&early));
}

#[test]
fn a_dag_without_end_is_checked_as_far_as_it_is_recorded() {
    let task_set = chain_of_two(|spec| spec.jobs = None);
    let none = Record::with_jobs(&task_set, Precision::Measured, |_| 0..0).unwrap();
    assert_eq!(violations(&task_set, &none).count(), 0);
    let mut record = Record::with_jobs(&task_set, Precision::Exact, |_| 0..1).unwrap();
    let start_ns = Some(3);
    *record.job_mut(DAG, 0).unwrap() = JobRecord {
        release_ns: Some(0),
        released_ns: Some(0),
        ..JobRecord::default()
    };
    *instance(&mut record, 0, 0) = InstanceRecord {
        ready_ns: Some(0),
        start_ns,
        ..InstanceRecord::default()
    };
    assert_eq!(violations(&task_set, &record).count(), 0);
}

#[test]
fn reports_figures_of_joins_and_jobs() {
    let task_set = chain_of_two(|_| {});
    let record = good(&task_set, Precision::Exact);
    assert_eq!(record.join_ns(&task_set, at(1, 1)), Some(12));
    assert_eq!(record.join_ns(&task_set, at(1, 0)), None);
    assert_eq!(record.completion_ns(DAG, 1), Some(15));
    assert!(record.instances(DAG, 3).is_empty());
}

#[test]
fn what_looks_for_violations_takes_little_of_a_stack() {
    let task_set = chain_of_two(|_| ());
    let record = good(&task_set, Precision::Exact);
    let size = size_of_val(&violations(&task_set, &record));
    assert!(size <= 512, "{size} bytes");
}
