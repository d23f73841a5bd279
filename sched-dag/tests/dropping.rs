//! The rules D1 to D7: faults that cost a job, as whole sequences of events.

mod support;

use sched_dag::journal::What;
use sched_dag::law::{self, Terms};
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{DagId, DagSpec, Instance, OverrunPolicy};
use support::{PREEMPTIVE, Run, Script, Spec, TWO_CORES, commit, dag, run, run_failing, scheduler};

#[test]
fn d1_a_dag_survives_so_many_faults_in_a_window_and_in_all() {
    for ((faults, window, in_all), failing, released) in [
        ((1, 5, 9), &[4, 9, 14][..], 20),
        ((1, 5, 9), &[4, 8], 9), // The window is of jobs 4 to 8.
        ((2, 5, 9), &[4, 8], 20),
        ((2, 5, 9), &[4, 7, 8], 9),
        ((2, 5, 9), &[4, 7, 9, 12, 14], 20),
        ((1, 1, 9), &[4, 5, 6, 7], 20),
        ((1, 1, 3), &[4, 5, 6, 7], 8), // There are 4 in all.
        ((u32::MAX, u64::MAX, 2), &[1, 3, 5], 6),
    ] {
        let spec = dag(10, 10, 20, &[0], &[]).surviving(faults, window, in_all);
        let failing: Vec<String> = failing.iter().map(|job| format!("0.{job}.0")).collect();
        let failing: Vec<&str> = failing.iter().map(String::as_str).collect();
        run_failing(&[spec], PREEMPTIVE, &failing, 1).must_be(&format!("released={released}"));
    }
}

#[test]
fn d1_a_fault_that_cannot_be_replaced_ends_the_dag() {
    let spec = dag(10, 10, 5, &[0], &[]).surviving(9, 1, 9);
    let script = Script::new(1)
        .failing(|it| it.job == 1)
        .replacing(|_| false);
    let run = script.run(VirtualTime::new(scheduler(&[spec], PREEMPTIVE)));
    run.must_be("ended=true, restarts=0");
}

#[test]
fn d2_the_next_instance_may_start_at_the_instant_of_the_fault() {
    let spec = dag(10, 30, 3, &[0], &[]).surviving(1, 1, 9);
    run_failing(&[spec], PREEMPTIVE, &["0.0.0"], 12).must_be(
        "0 ready 0.0.0, start 0.0.0 on 0
         12 ended 0.0.0, restarted 0.0.0, ready 0.1.0, start 0.1.0 on 0
         24 ready 0.2.0, start 0.2.0 on 0",
    );
}

#[test]
fn d3_what_is_ready_is_cancelled_and_what_has_started_ends() {
    // 0 -> (1, 2, 3) -> 4: at 4 subtask 1 fails, 2 runs until 8, and 3 waits for a core.
    let edges = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];
    let spec = dag(20, 20, 2, &[0, 1, 2, 3, 4], &edges).surviving(1, 1, 9);
    run_failing(&[spec], TWO_CORES, &["0.0.1"], [1, 3, 7, 1, 1]).must_be(
        "0 ready 0.0.0
         1 ready 0.0.1, ready 0.0.2, ready 0.0.3
         4 ended 0.0.1, restarted 0.0.1, cancelled 0.0.3
         8 cancelled 0.0.4, completed 0.0 Failed
         20 ready 0.1.0
         21 ready 0.1.1, ready 0.1.2, ready 0.1.3
         28 ready 0.1.4
         29 completed 0.1 Met
         faults=1, restarts=1, failed=1, completed=1, cut_short=0",
    );
}

/// Jobs of 10 ns, one in flight, of which the oldest is aborted by the next one.
fn aborting(priorities: &[u32]) -> DagSpec {
    let spec = dag(10, 10, 3, priorities, &[]).surviving(1, 1, 9);
    spec.overrunning(1, OverrunPolicy::Abort)
}

/// Job 0's subtasks take so long, the others 2 ns.
fn at_first(first_ns: [u64; 2]) -> impl FnMut(Instance) -> u64 {
    move |instance| match instance.job {
        0 => first_ns[instance.subtask.index()],
        _ => 2,
    }
}

#[test]
fn d3_an_aborted_job_stays_aborted() {
    run_failing(&[aborting(&[0])], PREEMPTIVE, &["0.0.0"], at_first([15; 2])).must_be(
        "10 aborted 0.0
         15 ended 0.0.0, restarted 0.0.0, completed 0.0 Aborted
         17 completed 0.1 Met
         22 completed 0.2 Met
         aborts=1, failed=0, restarts=1",
    );
}

#[test]
fn d3_a_job_that_is_cut_is_not_aborted() {
    // At 10 job 0 is cut, but subtask 1 goes on, so job 1 finds no room: no other job
    // is left to be aborted.
    run_failing(
        &[aborting(&[0, 1])],
        TWO_CORES,
        &["0.0.0"],
        at_first([5, 15]),
    )
    .must_be(
        "5 restarted 0.0.0
         10 skipped 0.1
         15 completed 0.0 Failed
         22 completed 0.2 Met
         aborts=0",
    );
}

#[test]
fn d4_other_jobs_in_flight_go_on() {
    // The source runs ahead of the sink, which fails in job 0 at 26.
    let spec = dag(10, 60, 3, &[0, 1], &[(0, 1)]).surviving(1, 1, 9);
    run_failing(&[spec], TWO_CORES, &["0.0.1"], [1, 25]).must_be(
        "0 released 0.0
         10 released 0.1
         20 released 0.2
         26 restarted 0.0.1, completed 0.0 Failed
         51 completed 0.1 Met
         76 completed 0.2 Met
         released=3, completed=2",
    );
}

#[test]
fn d5_only_deadlines_before_the_fault_are_missed() {
    let spec = dag(10, 4, 3, &[0, 1], &[]).surviving(2, 3, 9);
    let takes = |it: Instance| match it.job {
        0 => [3, 6][it.subtask.index()],
        1 => [5, 9][it.subtask.index()],
        _ => 1,
    };
    run_failing(&[spec], TWO_CORES, &["0.0.0", "0.1.0"], takes).must_be(
        "3 restarted 0.0.0
         6 completed 0.0 Failed
         15 missed 0.1, restarted 0.1.0
         19 completed 0.1 Failed
         21 completed 0.2 Met
         misses=1, failed=2, most_consecutive_misses=1",
    );
}

#[test]
fn d6_the_first_fault_that_is_not_survived_ends_the_dag() {
    let spec = dag(10, 10, 3, &[0, 0], &[]).surviving(1, 1, 9);
    run_failing(&[spec], TWO_CORES, &["0.0.0", "0.0.1"], 5).must_be(
        "5 ended 0.0.0, restarted 0.0.0, ended 0.0.1, stopped 0, completed 0.0 Failed
         faults=2, restarts=1",
    );
}

#[test]
fn d7_other_dags_do_not_notice() {
    let faulty = dag(10, 10, 6, &[0, 0], &[(0, 1)]).surviving(1, 1, 9);
    let specs = [faulty, dag(7, 7, 9, &[1, 1], &[(0, 1)])];
    let of_other = |run: &Run| {
        // On a core each.
        let others = run.events.iter().filter(|event| event.dag.0 == 1);
        let without_core = others.map(|event| (event.time_ns, event.what, event.instance()));
        without_core.collect::<Vec<_>>()
    };
    let failing = run_failing(&specs, TWO_CORES, &["0.1.0", "0.3.0", "0.4.0"], 2);
    assert_eq!(of_other(&failing), of_other(&run(&specs, TWO_CORES, 2)));
    failing.must_be("failed=3, completed=3");
}

#[test]
fn the_law_accepts_what_is_survived_and_nothing_else() {
    let chain = || dag(10, 10, 9, &[0, 0, 0], &[(0, 1), (1, 2)]);
    let breaches = |spec, events: &mut dyn Iterator<Item = _>| {
        let events: Vec<_> = events.collect();
        law::violations(&commit(&[spec], PREEMPTIVE), Terms::EXACT, events)
    };
    let right = chain().surviving(1, 3, 3);
    let run = Script::new(3)
        .failing(|instance| instance.job % 3 == 2 && instance.subtask.0 == 1)
        .run(VirtualTime::new(scheduler(
            std::slice::from_ref(&right),
            PREEMPTIVE,
        )));
    let events = || run.events.iter().copied();
    assert_eq!(breaches(right.clone(), &mut events()), []);
    let record = law::Record::of_events(&run.task_set, true, events()).expect("it is short");
    let failed = record.jobs(DagId(0)).iter().filter(|job| job.has_failed);
    assert_eq!(failed.count(), 3);
    // Held against models that survive less.
    let less = [
        (chain().surviving(1, 4, 3), 2),
        (chain().surviving(1, 3, 2), 1),
        (chain(), 3),
    ];
    for (spec, count) in less {
        let found = breaches(spec, &mut events());
        assert_eq!(found.len(), count, "{found:?}");
        let words = found[0].to_string();
        assert!(
            words.contains("although its DAG does not survive that fault"),
            "{words}"
        );
    }
    // A subtask goes on without having failed.
    let lie = breaches(
        right,
        &mut events().filter(|event| event.what != What::Ended),
    );
    assert!(!lie.is_empty());
}
