//! Journals that are too small for their run, and two as one.

use crate::{ClusterId, CommitOptions, CoreDivision, DagId, DagSpec, Instance, Policy, SubtaskId};
use crate::{SubtaskSpec, verify};

use super::*;
use crate::law;

/// Jobs of one subtask, one each 10 ns.
const JOBS: u64 = 50;

/// One DAG in each of so many clusters of one core.
fn task_set(clusters: u32, jobs: Option<u64>) -> Arc<TaskSet> {
    let spec = |cluster| DagSpec {
        cluster: Some(ClusterId(cluster)),
        period_ns: Some(10),
        relative_deadline_ns: Some(10),
        jobs,
        subtasks: vec![SubtaskSpec::default()],
        ..DagSpec::default()
    };
    let specs: Vec<DagSpec> = (0..clusters).map(spec).collect();
    let divided = CoreDivision::Of(vec![1; specs.len()]);
    let options = CommitOptions::new(Policy::Edf, clusters).with_clusters(divided);
    Arc::new(verify(&specs, &options).expect("it is right").task_set)
}

/// Writes a job of a DAG down that ends after so long.
fn run(journal: &mut Journal, dag: DagId, job: u64, end_ns: u64) {
    let subtask = SubtaskId(0);
    let of_job = EventSubject::of_job(dag, job);
    let instance = EventSubject::of(Instance { dag, job, subtask });
    for (time_ns, what, subject) in [
        (0, EventKind::Released, of_job),
        (0, EventKind::Ready, instance),
        (1, EventKind::Start, instance),
        (end_ns, EventKind::Finish, instance),
        (end_ns, EventKind::Completed, of_job),
    ] {
        journal.write(CoreId(0), what, 10 * job + time_ns, subject);
    }
}

/// Writes jobs of DAG 0 down that run for 3 to 5 ns.
fn run_all(journal: &mut Journal, jobs: core::ops::Range<u64>) {
    jobs.for_each(|job| run(journal, DagId(0), job, 4 + job % 3));
}

/// A journal with room for 12 events, after all jobs.
fn whole(task_set: &Arc<TaskSet>, free_bytes: usize) -> Journal {
    Journal::of_cluster(task_set, ClusterId(0), free_bytes, u64::MAX)
}

fn violations(journal: &Journal, task_set: &TaskSet) -> Vec<law::Violation> {
    law::violations(
        task_set,
        law::JudgeOptions::whole(u64::MAX),
        journal.events(),
    )
}

fn small() -> Journal {
    let mut journal = whole(&task_set(1, Some(JOBS)), 12 * 24 * 4);
    run_all(&mut journal, 0..JOBS);
    journal
}

#[test]
fn what_is_written_together_is_kept_one_by_one_where_room_ends() {
    let mut journal = whole(&task_set(1, Some(JOBS)), 4 * 24 * 4);
    let subject = EventSubject::of_job(DagId(0), 0);
    let at = |time_ns| (EventKind::Released, time_ns, subject);
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
    let kept = journal.events().map(|event| (event.job, event.what));
    let kept: Vec<(u64, EventKind)> = kept.collect();
    assert_eq!(
        kept[..2],
        [(47, EventKind::Finish), (47, EventKind::Completed)]
    );
    assert_eq!(
        (kept[2], kept[11]),
        ((48, EventKind::Released), (49, EventKind::Completed))
    );
}

#[test]
fn statistics_are_those_of_all_jobs() {
    let journal = small();
    let statistics = journal
        .statistics(&task_set(1, Some(JOBS)), FINEST)
        .expect("all were counted");
    let responses = statistics.dag(DagId(0)).response_time.distribution();
    assert_eq!(
        (responses.count(), responses.min(), responses.max()),
        (JOBS, 4, 6)
    );
    // In so little memory 4 to 7 ns are one bucket.
    assert_eq!(responses.per_mille(500), 6);
    // A journal that has room for all is counted after the run, more exactly.
    let task_set = task_set(1, Some(JOBS));
    let mut large = whole(&task_set, 1 << 20);
    run_all(&mut large, 0..JOBS);
    assert_eq!(large.lost(), 0);
    let all = large.statistics(&task_set, FINEST).expect("all are there");
    let all = all.dag(DagId(0)).response_time.distribution();
    assert_eq!((all.count(), all.per_mille(500)), (JOBS, 5));
}

#[test]
fn a_dag_without_end_takes_no_more_than_its_room() {
    let mut journal = whole(&task_set(1, None), 1 << 16);
    let room = (1 << 16) / 4 / 24;
    run_all(&mut journal, 0..room as u64);
    assert_eq!(journal.events().count(), room);
    assert_eq!(journal.lost(), 4 * room as u64);
}

#[test]
fn what_is_forgotten_or_not_recorded_counts_as_lost() {
    let task_set = task_set(1, Some(JOBS));
    let mut journal = whole(&task_set, 1 << 20);
    run_all(&mut journal, 0..1);
    journal.record_events(false);
    assert!(journal.has_room() && !journal.is_recording());
    assert_eq!((journal.events().count(), journal.lost()), (0, 5));
    run_all(&mut journal, 1..2);
    assert_eq!((journal.events().count(), journal.lost()), (0, 10));
    journal.record_events(true);
    run_all(&mut journal, 2..3);
    assert_eq!((journal.events().count(), journal.lost()), (5, 10));
    // Some were not counted.
    assert!(journal.statistics(&task_set, FINEST).is_none());
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

/// Journals of two clusters, with room for so many bytes each, after 20 jobs of 3 and of 4 ns.
fn merged(free_bytes: [usize; 2]) -> (Arc<TaskSet>, Journal) {
    let task_set = task_set(2, Some(20));
    let journal = |cluster: u32| {
        let (id, bytes) = (ClusterId(cluster), free_bytes[cluster as usize]);
        let mut journal = Journal::of_cluster(&task_set, id, bytes, u64::MAX);
        let end_ns = 3 + u64::from(cluster);
        (0..20).for_each(|job| run(&mut journal, DagId(cluster), job, end_ns));
        journal
    };
    let mut first = journal(0);
    first.absorb(journal(1), ClusterId(1), 1);
    (task_set, first)
}

#[test]
fn events_of_two_clusters_stand_in_the_order_of_time() {
    let (task_set, journal) = merged([1 << 20; 2]);
    let times: Vec<u64> = journal.events().map(|event| event.time_ns).collect();
    assert!(times.is_sorted());
    assert_eq!((times.len(), journal.lost()), (200, 0));
    assert!(journal.events().all(|event| event.core.0 == event.dag.0));
    assert!(violations(&journal, &task_set).is_empty());
}

#[test]
fn statistics_are_those_of_both_whichever_has_lost_events() {
    for free_bytes in [[1 << 20; 2], [2000, 1 << 20], [1 << 20, 2000], [2000; 2]] {
        let (task_set, journal) = merged(free_bytes);
        let small = free_bytes.iter().filter(|bytes| **bytes == 2000).count() as u64;
        assert_eq!(journal.lost(), small * 80, "{free_bytes:?}");
        let statistics = journal
            .statistics(&task_set, FINEST)
            .expect("all were counted");
        for (dag, response_ns) in [(0, 3), (1, 4)] {
            let times = statistics.dag(DagId(dag)).response_time.distribution();
            let found = (times.count(), times.max());
            assert_eq!(found, (20, response_ns), "{free_bytes:?}");
        }
        assert!(violations(&journal, &task_set).is_empty(), "{free_bytes:?}");
    }
}
