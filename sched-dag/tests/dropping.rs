//! The rules D1 to D7: faults that cost a job, as whole sequences of events.

mod support;

use sched_dag::journal::What;
use sched_dag::law::{self, Terms};
use sched_dag::virtual_time::{End, VirtualTime};
use sched_dag::{DagId, DagSpec, FaultLimit, Instance, OnFault, OverrunPolicy};
use support::written::Written;
use support::{
    Log, PREEMPTIVE, TWO_CORES, Timeline, commit, dag, instance, overrunning, run, run_failing,
    scheduler,
};

/// Lets a DAG survive `faults` within `window` jobs, `in_all` in all.
fn surviving(faults: u32, window: u64, in_all: u32, dag: DagSpec) -> DagSpec {
    DagSpec {
        on_fault: OnFault::DropJob(FaultLimit {
            faults,
            window,
            in_all,
        }),
        ..dag
    }
}

/// Returns how many jobs of a DAG of one subtask were released when those with these
/// numbers fail.
fn released(faults: u32, window: u64, in_all: u32, failing: &[u64]) -> u64 {
    let spec = surviving(faults, window, in_all, dag(10, 10, 20, &[0], &[]));
    let failing: Vec<_> = failing.iter().map(|&job| instance(0, job, 0)).collect();
    run_failing(&[spec], PREEMPTIVE, &failing, |_| 1).1[0].released
}

#[test]
fn d1_a_dag_survives_so_many_faults_in_a_window_and_in_all() {
    assert_eq!(released(1, 5, 9, &[4, 9, 14]), 20);
    assert_eq!(
        released(1, 5, 9, &[4, 8]),
        9,
        "the window is of jobs 4 to 8"
    );
    assert_eq!(released(2, 5, 9, &[4, 8]), 20);
    assert_eq!(released(2, 5, 9, &[4, 7, 8]), 9);
    assert_eq!(released(2, 5, 9, &[4, 7, 9, 12, 14]), 20);
    assert_eq!(released(1, 1, 9, &[4, 5, 6, 7]), 20);
    assert_eq!(released(1, 1, 3, &[4, 5, 6, 7]), 8, "there are 4 in all");
    assert_eq!(released(u32::MAX, u64::MAX, 2, &[1, 3, 5]), 6);
}

#[test]
fn d1_a_fault_that_cannot_be_replaced_ends_the_dag() {
    let spec = surviving(9, 1, 9, dag(10, 10, 5, &[0], &[]));
    let mut log = Log::new(|_| 1);
    log.failing = vec![instance(0, 1, 0)];
    log.is_replaceable = false;
    let mut run = VirtualTime::new(scheduler(&[spec], PREEMPTIVE));
    assert_eq!(run.run(&mut log), End::Finished);
    assert!(run.scheduler_of(DagId(0)).is_ended(DagId(0)));
    assert_eq!(run.scheduler_of(DagId(0)).statistics(DagId(0)).restarts, 0);
}

#[test]
fn d2_the_next_instance_may_start_at_the_instant_of_the_fault() {
    let spec = surviving(1, 1, 9, dag(10, 30, 3, &[0], &[]));
    let (events, _) = run_failing(&[spec], PREEMPTIVE, &[instance(0, 0, 0)], |_| 12);
    events.must_be(
        "0 ready 0.0.0, start 0.0.0 on 0
         12 fail 0.0.0, restarted 0.0.0, ready 0.1.0, start 0.1.0 on 0
         24 ready 0.2.0, start 0.2.0 on 0",
    );
}

#[test]
fn d3_what_is_ready_is_cancelled_and_what_has_started_ends() {
    // 0 -> (1, 2, 3) -> 4: at 4 subtask 1 fails, 2 runs until 8, and 3 waits for a core.
    let edges = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];
    let spec = surviving(1, 1, 9, dag(20, 20, 2, &[0, 1, 2, 3, 4], &edges));
    let failing = [instance(0, 0, 1)];
    let (events, statistics) = run_failing(&[spec], TWO_CORES, &failing, |instance| {
        [1, 3, 7, 1, 1][instance.subtask.index()]
    });
    events.must_be(
        "0 ready 0.0.0
         1 ready 0.0.1, ready 0.0.2, ready 0.0.3
         4 fail 0.0.1, restarted 0.0.1, cancelled 0.0.3
         8 cancelled 0.0.4, ended 0.0 Failed
         20 ready 0.1.0
         21 ready 0.1.1, ready 0.1.2, ready 0.1.3
         28 ready 0.1.4
         29 ended 0.1 Met",
    );
    let counted = statistics[0];
    assert_eq!(
        (counted.faults, counted.restarts, counted.failed),
        (1, 1, 1)
    );
    assert_eq!((counted.completed, counted.cut_short), (1, 0));
}

#[test]
fn d3_an_aborted_job_stays_aborted() {
    let spec = overrunning(dag(10, 10, 3, &[0], &[]), 1, OverrunPolicy::Abort);
    let spec = surviving(1, 1, 9, spec);
    let (events, statistics) = run_failing(&[spec], PREEMPTIVE, &[instance(0, 0, 0)], |it| {
        [15, 2, 2][usize::try_from(it.job).expect("few jobs")]
    });
    events.must_be(
        "10 aborted 0.0
         15 fail 0.0.0, restarted 0.0.0, ended 0.0 Aborted
         17 ended 0.1 Met
         22 ended 0.2 Met",
    );
    let counted = statistics[0];
    assert_eq!(
        (counted.aborts, counted.failed, counted.restarts),
        (1, 0, 1)
    );
}

#[test]
fn d3_a_job_that_is_cut_is_not_aborted() {
    // At 10 job 0 is cut, but subtask 1 goes on, so job 1 finds no room: no other job
    // is left to be aborted.
    let spec = dag(10, 10, 3, &[0, 1], &[]);
    let spec = surviving(1, 1, 9, overrunning(spec, 1, OverrunPolicy::Abort));
    let failing = [instance(0, 0, 0)];
    let (events, _) = run_failing(&[spec], TWO_CORES, &failing, |it| match it.job {
        0 => [5, 15][it.subtask.index()],
        _ => 1,
    });
    events.must_be(
        "5 restarted 0.0.0
         10 skipped 0.1
         15 ended 0.0 Failed
         21 ended 0.2 Met",
    );
}

#[test]
fn d4_other_jobs_in_flight_go_on() {
    // The source runs ahead of the sink, which fails in job 0 at 26.
    let spec = surviving(1, 1, 9, dag(10, 60, 3, &[0, 1], &[(0, 1)]));
    let failing = [instance(0, 0, 1)];
    let (events, statistics) = run_failing(&[spec], TWO_CORES, &failing, |it| {
        [1, 25][it.subtask.index()]
    });
    events.must_be(
        "0 released 0.0 of 0
         10 released 0.1 of 10
         20 released 0.2 of 20
         26 restarted 0.0.1, ended 0.0 Failed
         51 ended 0.1 Met
         76 ended 0.2 Met",
    );
    assert_eq!((statistics[0].released, statistics[0].completed), (3, 2));
}

#[test]
fn d5_only_deadlines_before_the_fault_are_missed() {
    let spec = surviving(2, 3, 9, dag(10, 4, 3, &[0, 1], &[]));
    let failing = [instance(0, 0, 0), instance(0, 1, 0)];
    let (events, statistics) = run_failing(&[spec], TWO_CORES, &failing, |it| {
        [[3, 5, 1], [6, 9, 1]][it.subtask.index()][usize::try_from(it.job).expect("few jobs")]
    });
    events.must_be(
        "3 restarted 0.0.0
         6 ended 0.0 Failed
         15 missed 0.1 of 14, restarted 0.1.0
         19 ended 0.1 Failed
         21 ended 0.2 Met",
    );
    assert_eq!((statistics[0].misses, statistics[0].failed), (1, 2));
    assert_eq!(statistics[0].most_consecutive_misses, 1);
}

#[test]
fn d6_the_first_fault_that_is_not_survived_ends_the_dag() {
    let spec = surviving(1, 1, 9, dag(10, 10, 3, &[0, 0], &[]));
    let failing = [instance(0, 0, 0), instance(0, 0, 1)];
    let (events, statistics) = run_failing(&[spec], TWO_CORES, &failing, |_| 5);
    events.must_be("5 fail 0.0.0, restarted 0.0.0, fail 0.0.1, end 0, ended 0.0 Failed");
    assert_eq!((statistics[0].faults, statistics[0].restarts), (2, 1));
}

#[test]
fn d7_other_dags_do_not_notice() {
    let other = || dag(7, 7, 9, &[1, 1], &[(0, 1)]);
    let faulty = surviving(1, 1, 9, dag(10, 10, 6, &[0, 0], &[(0, 1)]));
    let failing = [1, 3, 4].map(|job| instance(0, job, 0));
    let of_other = |events: Vec<String>| {
        let of_it = |line: &String| {
            line.split(' ')
                .nth(2)
                .is_some_and(|it| it.starts_with("1."))
        };
        events.into_iter().filter(of_it).collect::<Vec<_>>()
    };
    let on_a_core_each = |events| {
        let without_core = |line: String| line.split(" on ").next().map(str::to_owned);
        of_other(events)
            .into_iter()
            .map(without_core)
            .collect::<Vec<_>>()
    };
    let execution = |_: Instance| 2;
    let (failing, statistics) =
        run_failing(&[faulty.clone(), other()], TWO_CORES, &failing, execution);
    let (alone, _) = run(&[faulty, other()], TWO_CORES, execution);
    assert_eq!(on_a_core_each(failing), on_a_core_each(alone));
    assert_eq!((statistics[0].failed, statistics[0].completed), (3, 3));
}

#[test]
fn the_law_accepts_what_is_survived_and_nothing_else() {
    let chain = dag(10, 10, 9, &[0, 0, 0], &[(0, 1), (1, 2)]);
    let task_set = commit(&[surviving(1, 3, 3, chain.clone())], PREEMPTIVE);
    let mut written = Written::new(&task_set, |_| 3);
    written.fails = |instance| instance.job % 3 == 2 && instance.subtask.0 == 1;
    let _ = written.run(PREEMPTIVE);
    let events = || written.journal.events.iter().copied();
    assert_eq!(law::violations(&task_set, Terms::EXACT, events()), []);
    let record = law::Record::of_events(&task_set, true, events()).expect("it is short");
    let failed = |job: &law::JobRecord| job.has_failed;
    assert_eq!(
        record
            .jobs(DagId(0))
            .iter()
            .filter(|job| failed(job))
            .count(),
        3
    );
    // Held against models that survive less.
    for (less, count) in [
        (surviving(1, 4, 3, chain.clone()), 2),
        (surviving(1, 3, 2, chain.clone()), 1),
        (chain, 3),
    ] {
        let task_set = commit(&[less], PREEMPTIVE);
        let found = law::violations(&task_set, Terms::EXACT, events());
        assert_eq!(found.len(), count, "{found:?}");
        let words = found[0].to_string();
        assert!(
            words.contains("although its DAG does not survive that fault"),
            "{words}"
        );
    }
    // A subtask goes on without having failed.
    let lie = events().filter(|event| event.what != What::Ended);
    assert!(!law::violations(&task_set, Terms::EXACT, lie).is_empty());
}
