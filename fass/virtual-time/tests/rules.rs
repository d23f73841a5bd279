//! Deadlines of sinks, and what a function keeps, through real functions on real topics.

mod support;

use fass::{ConstructionPolicy, Policy, create_dag, finish_create_dags_with};
use support::{ms, named, run};
use virtual_time::{JobOutcome, VirtualTime};

const MS: u64 = 1_000_000;

/// One source, a quick sink with a short deadline and a slow one; the slow one is
/// registered first, so that nothing but its deadline puts it last.
fn two_ends(name: &str, quick_deadline: u64, jobs: u64) -> fass::Dag {
    let dag = create_dag();
    dag.name(name).jobs(jobs);
    let topics = [format!("{name} record"), format!("{name} angle")];
    let read = || {
        support::execute(ms(1));
        (1, 2)
    };
    let outputs = topics.iter().map(String::as_str).collect();
    dag.register_periodic_subtask(read, outputs, ms(20), named("read"));
    for (topic, end, deadline, takes) in [
        (&topics[0], "log", 20, 8),
        (&topics[1], "act", quick_deadline, 2),
    ] {
        let sink = move |_: (i32,)| support::execute(ms(takes));
        dag.register_sink_subtask(sink, vec![topic], ms(deadline), named(end));
    }
    dag
}

#[test]
fn r4_each_sink_has_its_own_deadline_and_the_job_ends_with_the_last() {
    for (deadline, outcome, misses) in [(3, JobOutcome::Met, 0), (2, JobOutcome::Missed, 2)] {
        let machine = VirtualTime::new().policy(Policy::Edf);
        let dag = two_ends("arm", deadline, 2);
        finish_create_dags_with(&[dag], ConstructionPolicy::any_graph()).unwrap();
        let report = machine.run();
        let job = report.jobs[1];
        assert_eq!(
            (job.outcome, job.missed_ns.is_some()),
            (Some(outcome), misses > 0)
        );
        assert_eq!(
            (job.response_time_ns(), job.deadline_ns),
            (Some(11 * MS), 40 * MS)
        );
        assert_eq!(report.statistics[0].misses, misses);
        assert_eq!(report.sink_misses, [[0, misses]]);
        assert_eq!(report.violations(), []);
    }
}

#[test]
fn r5_edf_puts_what_leads_to_the_more_urgent_sink_first() {
    let machine = VirtualTime::new().policy(Policy::Edf);
    let dags = [two_ends("arm", 4, 1), two_ends("leg", 3, 1)];
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).unwrap();
    let report = machine.run();
    let starts = ["leg", "arm"].map(|dag| {
        ["read", "act", "log"].map(|subtask| report.subtask(dag, subtask)[0].start_ns.unwrap() / MS)
    });
    assert_eq!(starts, [[0, 1, 14], [3, 4, 6]]);
    assert_eq!(report.violations(), []);
}

#[test]
fn a_closure_keeps_its_state_from_job_to_job() {
    let machine = VirtualTime::new();
    let (send, receive) = std::sync::mpsc::channel();
    let dag = create_dag();
    dag.jobs(4);
    let mut fibonacci = (0_u32, 1_u32);
    dag.register_periodic_subtask(
        move || {
            fibonacci = (fibonacci.1, fibonacci.0 + fibonacci.1);
            (fibonacci.0,)
        },
        vec!["number"],
        ms(10),
        named("source"),
    );
    let mut sum = 0;
    let sink = move |(number,): (u32,)| {
        sum += number;
        send.send(sum).expect("the test listens");
    };
    dag.register_sink_subtask(sink, vec!["number"], ms(10), named("sink"));
    run(&machine, &[dag]);
    assert_eq!(receive.try_iter().collect::<Vec<_>>(), [1, 2, 4, 7]);
}
