//! A panic that is contained ends its DAG, and nothing else.

mod support;

use fass::{Dag, FaultLimit, OverrunPolicy, Unique, create_dag, finish_create_dags};
use support::{commit, execute, ms, named, pair, run};
use virtual_time::{JobOutcome, VirtualTime};

const MS: u64 = 1_000_000;

/// A chain of three whose middle panics in job 2, after 2 of its 3 ms.
fn faulty() -> Dag {
    let dag = create_dag();
    dag.name("faulty").jobs(10);
    dag.register_periodic_subtask(|| (1,), vec!["raw"], ms(10), named("source"));
    let mut frames = 0;
    let middle = move |(value,): (i32,)| {
        execute(ms(2));
        frames += 1;
        assert!(frames != 3, "frame 2 is broken");
        execute(ms(1));
        (value,)
    };
    dag.register_subtask(middle, vec!["raw"], vec!["fine"], named("middle"));
    let sink = |_: (i32,)| execute(ms(1));
    dag.register_sink_subtask(sink, vec!["fine"], ms(10), named("sink"));
    dag
}

fn healthy() -> Dag {
    let dag = pair("healthy", ms(5), ms(5), [ms(1), ms(1)]);
    dag.jobs(30);
    dag
}

#[test]
fn a_contained_panic_ends_its_dag_at_the_time_of_the_panic() {
    let machine = VirtualTime::new().contain_panics();
    let report = run(&machine, &[faulty()]);
    let lines = report.event_lines();
    let job_2 = lines
        .iter()
        .position(|line| line == "20000000 released faulty[2]");
    assert_eq!(
        lines[job_2.expect("job 2 is released")..],
        [
            "20000000 released faulty[2]",
            "20000000 ready source[2]",
            "20000000 start source[2] core 0",
            "20000000 finish source[2] core 0",
            "20000000 ready middle[2]",
            "20000000 start middle[2] core 0",
            "22000000 ended middle[2] core 0",
            "22000000 stopped faulty",
            "22000000 cancelled sink[2]",
            "22000000 completed faulty[2] dagended",
        ]
    );
    assert_eq!(report.panics.len(), 1);
    assert_eq!(report.panics[0].message, "frame 2 is broken");
    let failed = (report.instance(report.panics[0].instance)).expect("it was ready");
    assert_eq!((failed.failed_ns, failed.finish_ns), (Some(22 * MS), None));
    assert_eq!(failed.execution_ns, 2 * MS);
    assert_eq!(report.jobs[2].outcome, Some(JobOutcome::DagEnded));
    let counted = report.dag("faulty").statistics();
    assert_eq!((counted.released, counted.completed), (3, 2));
    assert_eq!((counted.faults, counted.cut_short), (1, 1));
}

/// A value that the sink of an aborted job leaves behind, and that cannot be dropped.
struct Sharp(bool);

impl Drop for Sharp {
    fn drop(&mut self) {
        assert!(!self.0, "it cannot be dropped");
    }
}

#[test]
fn a_value_that_cannot_be_dropped_is_the_fault_of_the_subtask_that_replaces_it() {
    let machine = VirtualTime::new().cores(2).contain_panics();
    let dag = create_dag();
    dag.name("sharp").jobs(5).in_flight(1);
    dag.overrun(OverrunPolicy::Abort);
    let mut is_sharp = true;
    let source = move || (Unique::new(Sharp(core::mem::take(&mut is_sharp))), ());
    dag.register_periodic_subtask(source, vec!["value", "go"], ms(10), named("source"));
    let slow = |((),): ((),)| {
        execute(ms(12));
        ((),)
    };
    dag.register_subtask(slow, vec!["go"], vec!["went"], named("slow"));
    let sink = |(value, ()): (Unique<Sharp>, ())| std::mem::forget(value);
    dag.register_sink_subtask(sink, vec!["value", "went"], ms(10), named("sink"));
    let report = run(&machine, &[healthy(), dag]);
    let [panic] = &report.panics[..] else {
        panic!("{:?}", report.panics);
    };
    assert_eq!(panic.message, "it cannot be dropped");
    assert_eq!((panic.instance.subtask.0, panic.instance.job), (0, 1));
    let [healthy, sharp] = ["healthy", "sharp"].map(|dag| report.dag(dag).statistics());
    assert_eq!((healthy.completed, healthy.misses), (30, 0));
    assert_eq!((sharp.aborts, sharp.faults), (1, 1));
}

#[test]
fn values_that_wait_for_a_broken_body_do_no_harm() {
    // The source runs ahead: when the sink panics, later jobs' values are in its
    // slots.
    let machine = VirtualTime::new().cores(2).contain_panics();
    let dag = create_dag();
    dag.name("ahead").jobs(8).in_flight(4);
    dag.register_periodic_subtask(|| (1,), vec!["number"], ms(10), named("source"));
    let sink = |_: (i32,)| {
        execute(ms(25));
        panic!("slow and wrong");
    };
    dag.register_sink_subtask(sink, vec!["number"], ms(10), named("sink"));
    commit(&[dag]);
    let first = machine.run_for(ms(12));
    assert_eq!(first.panics.len(), 1, "its function has run");
    assert_eq!(
        first.dag("ahead").statistics().faults,
        0,
        "its time is not over"
    );
    let report = machine.run();
    assert_eq!(report.end_ns, 25 * MS);
    let counted = report.dag("ahead").statistics();
    assert_eq!(
        (counted.released, counted.cut_short, counted.faults),
        (3, 3, 1)
    );
    assert_eq!(report.violations(), []);
}

#[test]
fn a_call_that_is_to_fail_does_so_in_place_of_its_function() {
    let machine = VirtualTime::new().fault("pair", "sink", 1);
    let dag = create_dag();
    dag.name("pair").jobs(4).survive_faults(FaultLimit {
        faults: 1,
        window: 4,
        in_all: 1,
    });
    dag.register_periodic_subtask(|| (1,), vec!["number"], ms(10), named("source"));
    dag.restarting(|| |_: (i32,)| execute(ms(1)))
        .reads(&["number"])
        .due(ms(10))
        .register(named("sink").wcet(ms(2)));
    let report = run(&machine, &[dag]);
    let outcomes: Vec<_> = report.jobs.iter().map(|job| job.outcome).collect();
    let met = Some(JobOutcome::Met);
    assert_eq!(outcomes, [met, Some(JobOutcome::Failed), met, met]);
    assert_eq!(report.panics[0].message, "a fault that was asked for");
    let failed = (report.instance(report.panics[0].instance)).expect("it was ready");
    assert_eq!(failed.execution_ns, 2 * MS);
}

#[test]
fn a_call_that_is_to_fail_must_be_in_the_commit() {
    let _machine = VirtualTime::new().fault("healthy", "drain", 1);
    let said = finish_create_dags(&[healthy()]).expect_err("no such subtask");
    let expected = "subtask `drain` of dag `healthy`, which is to fail, is not in the commit; \
                    name one that is";
    assert!(said.to_string().contains(expected), "{said}");
}
