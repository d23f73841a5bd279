//! The machine itself: panics, limits, misuse, threads.

mod support;

use std::panic::catch_unwind;
use std::thread;
use std::time::Duration;

use fass::{Fault, create_dag, finish_create_dags};
use support::{commit, execute, ms, named, pair, run};
use virtual_time::{RunError, VirtualTime};

const MS: u64 = 1_000_000;

#[test]
fn a_panic_names_dag_subtask_and_job_and_ends_the_run() {
    let machine = VirtualTime::new();
    let dag = create_dag();
    dag.name("vision").jobs(10);
    dag.register_periodic_subtask(|| (1,), vec!["frame"], ms(10), named("camera"));
    let mut frames = 0;
    let sink = move |_: (i32,)| {
        execute(ms(2));
        frames += 1;
        assert!(frames < 4, "frame {frames} is broken");
    };
    dag.register_sink_subtask(sink, vec!["frame"], ms(10), named("detect"));
    commit(&[dag]);
    let error = machine.try_run().expect_err("the fourth frame is broken");
    assert_eq!(
        error.to_string(),
        "subtask `detect` of dag `vision` panicked in job 3: frame 4 is broken"
    );
    let RunError::Panicked { job, report, .. } = error else {
        panic!("it is a panic");
    };
    assert_eq!(job, 3);
    let last = report.event_lines().pop();
    assert_eq!(last.as_deref(), Some("30000000 start detect[3] core 0"));
    let again = machine.try_run().expect_err("the run is over");
    assert!(matches!(again, RunError::NothingToRun));
}

/// What is to come costs nothing: neither where a panic ends the run, nor where it ends
/// its DAG.
#[test]
fn a_panic_ends_at_once_however_many_jobs_are_to_come() {
    for is_contained in [false, true] {
        let machine = VirtualTime::new().cores(2);
        let machine = if is_contained {
            machine.contain_panics()
        } else {
            machine
        };
        let dag = pair("endless", ms(10), ms(10), [ms(1), ms(1)]);
        dag.jobs(1 << 40);
        let broken = create_dag();
        broken.name("broken").jobs(1 << 40);
        let mut jobs = 0;
        let panics = move || {
            jobs += 1;
            assert!(jobs < 4, "a panic on purpose");
        };
        broken.relative_deadline(ms(10));
        broken.register_periodic_subtask(panics, vec![], ms(10), named("panics"));
        let dags = if is_contained {
            vec![broken]
        } else {
            vec![broken, dag]
        };
        commit(&dags);
        let (dags, report) = match machine.try_run() {
            Ok(report) => (1, report),
            Err(RunError::Panicked { report, .. }) => (2, *report),
            Err(error) => panic!("{error}"),
        };
        // Job 3 is the fourth.
        let released = report.dags().map(|dag| dag.statistics().released);
        assert_eq!(released.collect::<Vec<_>>(), vec![4; dags]);
        assert!(report.events.len() < 80);
    }
}

#[test]
fn running_in_steps_is_running_at_once() {
    let make = || {
        let machine = VirtualTime::new();
        let dag = pair("steps", ms(10), ms(10), [ms(3), ms(4)]);
        dag.jobs(3);
        commit(&[dag]);
        machine
    };
    let at_once = make().run();
    let machine = make();
    let first = machine.run_for(ms(8));
    assert_eq!(first.jobs.len(), 1);
    assert_eq!(fass::now_ns(), 8 * MS);
    let second = machine.run_for(ms(2));
    assert_eq!(second.jobs.len(), 2, "events at the very end happen");
    let last = machine.run();
    assert_eq!(last.events, at_once.events);
    assert_eq!(fass::now_ns(), 27 * MS);
}

#[test]
fn an_endless_dag_runs_for_a_while_only() {
    let machine = VirtualTime::new();
    commit(&[pair("endless", ms(10), ms(10), [ms(1), ms(1)])]);
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
    let dag = pair("long", ms(10), ms(10), [ms(1), Duration::MAX]);
    dag.jobs(1);
    commit(&[dag]);
    let error = machine.try_run().expect_err("time ends");
    assert_eq!(
        error.to_string(),
        "subtask `sink` of dag `long` would finish job 0 after 18446744073709551615 ns, the last \
         time there is; execute for less"
    );
}

#[test]
fn misuse_is_told_in_words() {
    let machine = VirtualTime::new();
    let error = machine.try_run().expect_err("nothing is committed");
    assert!(
        error
            .to_string()
            .starts_with("there is nothing to run; commit DAGs")
    );

    let first = pair("first", ms(10), ms(10), [ms(1), ms(1)]);
    let second = pair("second", ms(10), ms(10), [ms(1), ms(1)]);
    commit(&[first]);
    let error = finish_create_dags(&[second]).expect_err("one plan a machine");
    let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
    assert_eq!(codes, ["not_launched"]);
    assert!(error.to_string().contains("commit all DAGs in one call"));

    let payload = catch_unwind(|| execute(ms(1))).expect_err("outside a subtask");
    let message = payload.downcast_ref::<&str>().copied().unwrap_or_default();
    assert!(
        message.starts_with("`execute_for` is called outside a subtask"),
        "{message}"
    );

    drop(machine);
    let error = finish_create_dags(&[pair("third", ms(10), ms(10), [ms(1), ms(1)])]);
    let error = error.expect_err("the thread has no machine");
    assert!(
        error
            .to_string()
            .contains("this thread has no `VirtualTime`"),
        "{error}"
    );
}

#[test]
fn an_older_machine_of_the_thread_keeps_its_own_time() {
    let older = VirtualTime::new();
    let dag = pair("older", ms(10), ms(10), [ms(3), ms(4)]);
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
    let dag = create_dag();
    dag.jobs(2);
    dag.register_periodic_subtask(
        || {
            let inner = pair("inner", ms(10), ms(10), [ms(1), ms(1)]);
            (finish_create_dags(&[inner]).is_err(),)
        },
        vec!["refused"],
        ms(10),
        named("source"),
    );
    let sink = |(refused,): (bool,)| assert!(refused);
    dag.register_sink_subtask(sink, vec!["refused"], ms(10), named("sink"));
    commit(std::slice::from_ref(&dag));
    assert_eq!(machine.run().dag(&dag).statistics().completed, 2);
}

#[test]
fn threads_have_machines_of_their_own() {
    let threads: Vec<_> = (1..=4_u64)
        .map(|number| {
            thread::spawn(move || {
                let machine = VirtualTime::new();
                let dag = pair("own", ms(100), ms(100), [ms(number), ms(number)]);
                dag.jobs(200);
                commit(&[dag]);
                machine.run()
            })
        })
        .collect();
    for (number, thread) in (1..).zip(threads) {
        let report = thread.join().expect("the thread ends");
        let expected = Some(2 * number * MS);
        assert!(
            report
                .jobs
                .iter()
                .all(|job| job.response_time_ns() == expected)
        );
    }
}

#[test]
fn a_chain_of_many_subtasks_runs() {
    const SUBTASKS: usize = 5_000;
    let machine = VirtualTime::new().cores(2);
    let dag = create_dag();
    dag.name("chain").jobs(2);
    let topics: Vec<String> = (0..SUBTASKS)
        .map(|number| format!("topic {number}"))
        .collect();
    let period = ms(10_000);
    dag.register_periodic_subtask(|| (0_usize,), vec![&topics[0]], period, named("source"));
    for (number, ends) in (1..).zip(topics.windows(2)) {
        let step = move |(hops,): (usize,)| {
            execute(ms(1));
            assert_eq!(hops + 1, number);
            (number,)
        };
        let attributes = named(&format!("step {number}"));
        dag.register_subtask(step, vec![&ends[0]], vec![&ends[1]], attributes);
    }
    let sink = |(hops,): (usize,)| assert_eq!(hops, SUBTASKS - 1);
    dag.register_sink_subtask(sink, vec![&topics[SUBTASKS - 1]], period, named("sink"));
    let report = run(&machine, &[dag]);
    assert_eq!(report.jobs[1].response_time_ns(), Some(4_999 * MS));
}

#[test]
fn what_still_runs_at_the_end_of_a_report_breaks_no_rule() {
    let machine = VirtualTime::new().cores(2);
    let first = pair("first", ms(20), ms(20), [ms(9), ms(1)]);
    let second = pair("second", ms(20), ms(20), [ms(4), ms(9)]);
    first.jobs(1);
    second.jobs(1);
    commit(&[first, second]);
    assert_eq!(machine.run_for(ms(6)).violations(), []);
    assert_eq!(machine.run().violations(), []);
}
