//! The machine itself: panics, limits, misuse, threads.

use std::panic::catch_unwind;
use std::thread;
use std::time::Duration;

use crate::support::{MS, commit, every, ms, named, pair, ticking, work};
use fass::{Dag, Occupation, execute_for, finish_create_dags};
use virtual_time::{RunError, VirtualTime};

/// A DAG whose function panics in job 3.
fn broken() -> Dag {
    let dag = every(10, "vision");
    let detect = |job| {
        work(2);
        assert!(job != 3, "frame {job} is broken");
    };
    dag.register_untyped_subtask(detect, named("detect"));
    dag
}

#[test]
fn a_panic_names_dag_subtask_and_job_and_ends_the_run() {
    let machine = VirtualTime::new();
    let dag = broken();
    // What is to come costs nothing.
    dag.jobs(1 << 40);
    commit(&[dag]);
    let error = machine.try_run().expect_err("the fourth frame is broken");
    let said = "subtask `detect` of dag `vision` panicked in job 3: frame 3 is broken";
    assert_eq!(error.to_string(), said);
    let RunError::Panicked { job, report, .. } = error else {
        panic!("it is a panic");
    };
    assert_eq!(job, 3);
    let last = report.event_lines().pop();
    assert_eq!(last.as_deref(), Some("30000000 start detect[3] core 0"));
    let again = machine.try_run().expect_err("the run is over");
    assert!(matches!(again, RunError::NothingToRun));
}

#[test]
fn running_in_steps_is_running_at_once() {
    let make = || {
        let machine = VirtualTime::new();
        let dag = pair("steps", [3, 4]);
        dag.jobs(3);
        commit(&[dag]);
        machine
    };
    let at_once = make().run();
    let machine = make();
    let first = machine.run_for(ms(5));
    assert_eq!((first.jobs.len(), fass::now_ns()), (1, 5 * MS));
    assert_eq!(first.violations(), [], "the sink still runs");
    let second = machine.run_for(ms(5));
    assert_eq!(second.jobs.len(), 2, "events at the very end happen");
    let last = machine.run();
    assert_eq!(last.events, at_once.events);
    assert_eq!(fass::now_ns(), 27 * MS);
}

#[test]
fn an_endless_dag_runs_for_a_while_only() {
    let machine = VirtualTime::new();
    commit(&[ticking("endless", 1)]);
    let error = machine.try_run().expect_err("it has no end");
    assert_eq!(
        error.to_string(),
        "dag `endless` has no limit of jobs, so its run has no end; set `jobs` or use `run_for`"
    );
    // The attempt has cost nothing.
    let report = machine.run_for(Duration::from_secs(60));
    assert_eq!(report.dag("endless").statistics().completed, 6_000);
}

#[test]
fn an_execution_beyond_the_end_of_time_is_an_error() {
    let machine = VirtualTime::new();
    let dag = every(10, "long");
    let forever = |_job| execute_for(Duration::MAX, Occupation::Hold);
    dag.jobs(1).offset(ms(1));
    dag.register_untyped_subtask(forever, named("wait"));
    commit(&[dag]);
    let error = machine.try_run().expect_err("time ends");
    assert_eq!(
        error.to_string(),
        "subtask `wait` of dag `long` would finish job 0 after 18446744073709551615 ns, the last \
         time there is; execute for less"
    );
}

#[test]
fn misuse_is_told_in_words() {
    let machine = VirtualTime::new();
    let error = machine.try_run().expect_err("nothing is committed");
    let said = error.to_string();
    assert!(said.starts_with("there is nothing to run; commit DAGs"));
    let payload = catch_unwind(|| work(1)).expect_err("outside a subtask");
    let said = payload.downcast_ref::<&str>().copied().unwrap_or_default();
    assert!(said.starts_with("`execute_for` is called outside a subtask"));
    drop(machine);
    let error = finish_create_dags(&[ticking("late", 1)]).expect_err("there is no machine");
    let said = error.to_string();
    assert!(said.contains("this thread has no `VirtualTime`"), "{said}");
}

#[test]
fn an_older_machine_of_the_thread_keeps_its_own_time() {
    let older = VirtualTime::new();
    let dag = ticking("older", 7);
    dag.jobs(1);
    commit(&[dag]);
    let newer = VirtualTime::new();
    assert_eq!(older.run().end_ns, 7 * MS);
    assert_eq!(fass::now_ns(), 0, "the newer machine has not run");
    drop(newer);
}

#[test]
fn a_commit_from_inside_a_subtask_is_refused_and_harmless() {
    let machine = VirtualTime::new();
    let dag = every(10, "outer");
    let nest = |_job| assert!(finish_create_dags(&[ticking("inner", 1)]).is_err());
    dag.jobs(2).register_untyped_subtask(nest, named("nest"));
    commit(&[dag]);
    assert_eq!(machine.run().dag("outer").statistics().completed, 2);
}

#[test]
fn threads_have_machines_of_their_own() {
    let in_thread = |number| {
        thread::spawn(move || {
            let machine = VirtualTime::new();
            let dag = ticking("own", number);
            dag.jobs(200);
            commit(&[dag]);
            machine.run()
        })
    };
    for (number, thread) in (1..).zip([1, 2, 3, 4].map(in_thread)) {
        let report = thread.join().expect("the thread ends");
        let responses = report.jobs.iter().map(|job| job.response_time_ns());
        assert_eq!(
            (responses.min(), report.jobs.len()),
            (Some(Some(number * MS)), 200)
        );
    }
}
