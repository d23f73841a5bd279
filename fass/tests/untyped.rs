//! Graphs given at run time: their edges hold, for every job, and their faults
//! are found.

use core::time::Duration;
use std::sync::{Arc, Mutex};

use fass::{ConstructionPolicy, Dag, Occupation, SubtaskAttributes, Untyped, create_dag};
use fass::{execute_for, finish_create_dags, finish_create_dags_with};
use virtual_time::VirtualTime;

const PERIOD: Duration = Duration::from_millis(10);

/// What ended, in order: job and subtask.
type Log = Arc<Mutex<Vec<(u64, usize)>>>;

/// Builds a DAG whose subtasks execute for `times_ms` and note their ends.
fn graph(times_ms: &[u64], edges: &[(usize, usize)], jobs: u64) -> (Dag, Vec<Untyped>, Log) {
    let log = Log::default();
    let dag = create_dag();
    dag.jobs(jobs).period(PERIOD).relative_deadline(PERIOD);
    let subtasks: Vec<Untyped> = (times_ms.iter().enumerate())
        .map(|(subtask, &ms)| {
            let log = Arc::clone(&log);
            let work = move |job| {
                execute_for(Duration::from_millis(ms), Occupation::Hold);
                log.lock().expect("no panic before").push((job, subtask));
            };
            dag.register_untyped_subtask(work, SubtaskAttributes::default())
        })
        .collect();
    for &(earlier, later) in edges {
        dag.precede(&subtasks[earlier], &subtasks[later]);
    }
    (dag, subtasks, log)
}

#[test]
fn a_join_of_forty_waits_for_all() {
    let machine = VirtualTime::new().cores(4);
    let edges: Vec<_> = (1..=40).flat_map(|v| [(0, v), (v, 41)]).collect();
    let (dag, _, log) = graph(&[1; 42], &edges, 3);
    finish_create_dags(&[dag]).unwrap();
    let report = machine.run();
    assert_eq!(report.violations().len(), 0);
    let log = log.lock().unwrap();
    assert_eq!(log.len(), 3 * 42);
    for job in 0..3 {
        let of_job: Vec<_> = log.iter().filter(|entry| entry.0 == job).collect();
        assert_eq!(*of_job[0], (job, 0));
        assert_eq!(*of_job[41], (job, 41));
    }
}

#[test]
fn several_sources_sinks_and_parts_are_a_choice() {
    let machine = VirtualTime::new().cores(2);
    // 3 -> 1 backwards, a transitive edge, and subtask 4 apart.
    let edges = [(0, 2), (3, 1), (1, 2), (3, 2)];
    let (dag, _, log) = graph(&[1; 5], &edges, 2);
    let error = finish_create_dags(std::slice::from_ref(&dag)).unwrap_err();
    let codes: Vec<_> = error.faults().iter().map(fass::Fault::code).collect();
    assert!(codes.contains(&"several_sources"), "{codes:?}");
    finish_create_dags_with(&[dag], ConstructionPolicy::any_graph()).unwrap();
    let report = machine.run();
    assert_eq!(report.violations().len(), 0);
    assert_eq!(log.lock().unwrap().len(), 10);
}

#[test]
fn a_cycle_is_refused() {
    let _machine = VirtualTime::new();
    let (dag, ..) = graph(&[1; 3], &[(0, 1), (1, 2), (2, 1)], 1);
    let error = finish_create_dags(&[dag]).unwrap_err();
    assert!(error.faults().iter().any(|fault| fault.code() == "cycle"));
}

#[test]
#[should_panic(expected = "Untyped(1) is a subtask of another DAG")]
fn edges_stay_inside_a_dag() {
    let (dag, subtasks, _) = graph(&[1; 2], &[], 1);
    let (_, others, _) = graph(&[1; 2], &[], 1);
    dag.precede(&subtasks[0], &others[1]);
}
