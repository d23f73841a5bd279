//! A journal that is too small for its run.

use crate::{CommitOptions, DagId, DagSpec, Instance, Policy, SubtaskId, SubtaskSpec, verify};

use super::*;

/// Jobs of one subtask, one each 10 ns.
const JOBS: u64 = 50;

fn task_set(jobs: Option<u64>) -> Arc<TaskSet> {
    let spec = DagSpec {
        period_ns: Some(10),
        relative_deadline_ns: Some(10),
        jobs,
        subtasks: vec![SubtaskSpec::default()],
        ..DagSpec::default()
    };
    let verified = verify(&[spec], &CommitOptions::new(Policy::Edf, 1)).expect("it is right");
    Arc::new(verified.task_set)
}

/// Writes a job down that runs for 3 to 5 ns.
fn run(journal: &mut Journal, job: u64) {
    let (dag, subtask) = (DagId(0), SubtaskId(0));
    let (of_job, instance) = (
        Subject::of_job(dag, job),
        Subject::of(Instance { dag, job, subtask }),
    );
    let end = 4 + job % 3;
    for (time, what, subject) in [
        (0, What::Released, of_job),
        (0, What::Ready, instance),
        (1, What::Start, instance),
        (end, What::Finish, instance),
        (end, What::Completed, of_job),
    ] {
        journal.write(CoreId(0), what, 10 * job + time, subject);
    }
}

/// A journal with room for 12 events, after all jobs.
fn small() -> Journal {
    let mut journal = Journal::new(&task_set(Some(JOBS)), 12 * 24 * 4, u64::MAX);
    (0..JOBS).for_each(|job| run(&mut journal, job));
    journal
}

#[test]
fn what_is_written_together_is_kept_one_by_one_where_room_ends() {
    let mut journal = Journal::new(&task_set(Some(JOBS)), 4 * 24 * 4, u64::MAX);
    let subject = Subject::of_job(DagId(0), 0);
    let at = |time_ns| (What::Released, time_ns, subject);
    for time_ns in [0, 3, 6] {
        journal.write_all(CoreId(0), [0, 1, 2].map(|more| at(time_ns + more)));
    }
    let times: Vec<u64> = journal.events().map(|event| event.time_ns).collect();
    assert_eq!((times, journal.lost()), (vec![5, 6, 7, 8], 5));
}

#[test]
fn keeps_the_latest_events_and_counts_the_lost_ones() {
    let journal = small();
    assert_eq!(
        (journal.lost(), journal.written()),
        (5 * JOBS - 12, 5 * JOBS)
    );
    let kept: Vec<(u64, What)> = journal
        .events()
        .map(|event| (event.job, event.what))
        .collect();
    assert_eq!(
        kept[..3],
        [
            (47, What::Finish),
            (47, What::Completed),
            (48, What::Released)
        ]
    );
    assert_eq!(kept[11], (49, What::Completed));
}

#[test]
fn statistics_are_those_of_all_jobs() {
    let journal = small();
    let statistics = journal
        .statistics(&task_set(Some(JOBS)))
        .expect("all were counted");
    let responses = &statistics.dag(DagId(0)).response_time;
    assert_eq!(
        (responses.count(), responses.min(), responses.max()),
        (JOBS, 4, 6)
    );
    // In so little memory 4 to 7 ns are one bucket.
    assert_eq!(responses.per_mille(500), 6);
    // A journal that has room for all is counted after the run, more exactly.
    let task_set = task_set(Some(JOBS));
    let mut large = Journal::new(&task_set, 1 << 20, u64::MAX);
    (0..JOBS).for_each(|job| run(&mut large, job));
    assert_eq!(large.lost(), 0);
    let all = large.statistics(&task_set).expect("all are there");
    let all = &all.dag(DagId(0)).response_time;
    assert_eq!((all.count(), all.per_mille(500)), (JOBS, 5));
}

#[test]
fn a_dag_without_end_takes_no_more_than_its_room() {
    let mut journal = Journal::new(&task_set(None), 1 << 16, u64::MAX);
    let room = (1 << 16) / 4 / 24;
    (0..room as u64).for_each(|job| run(&mut journal, job));
    assert_eq!(journal.events().count(), room);
    assert_eq!(journal.lost(), 4 * room as u64);
}

#[test]
fn what_is_forgotten_or_not_recorded_counts_as_lost() {
    let task_set = task_set(Some(JOBS));
    let mut journal = Journal::new(&task_set, 1 << 20, u64::MAX);
    run(&mut journal, 0);
    journal.record_events(false);
    assert!(journal.has_room() && !journal.is_recording());
    assert_eq!((journal.events().count(), journal.lost()), (0, 5));
    run(&mut journal, 1);
    assert_eq!((journal.events().count(), journal.lost()), (0, 10));
    journal.record_events(true);
    run(&mut journal, 2);
    assert_eq!((journal.events().count(), journal.lost()), (5, 10));
    assert!(
        journal.statistics(&task_set).is_none(),
        "some were not counted"
    );
}

#[test]
fn events_are_copied_from_the_latest_one_back() {
    let journal = small();
    let mut buffer = [None; 8];
    let oldest = journal.copy_back(journal.written(), &mut buffer);
    assert_eq!(oldest, 5 * JOBS - 8);
    let copied: Vec<Event> = buffer.iter().rev().flatten().copied().collect();
    assert!(journal.events().skip(4).eq(copied));
    // Only four more are left.
    assert_eq!(journal.copy_back(oldest, &mut buffer), 5 * JOBS - 12);
    assert_eq!(buffer.iter().flatten().count(), 4);
}
