//! The rules of the task model, through real functions on real topics.

mod support;

use fass::{
    ConstructionPolicy, Policy, Preemption, SubtaskAttributes, create_dag, finish_create_dags_with,
};
use support::{commit, diamond, ms, named, pair, run};
use virtual_time::{Event, JobOutcome, Rule, SubtaskId, VirtualTime, What};

const MS: u64 = 1_000_000;
#[test]
fn r3_successors_of_one_instance_become_ready_at_one_instant() {
    let machine = VirtualTime::new().cores(1);
    let dag = diamond(ms(100), ms(100), [ms(7), ms(5), ms(5), ms(2)]);
    dag.jobs(1);
    let report = run(&machine, &[dag]);
    let lines = report.event_lines();
    assert_eq!(
        lines,
        [
            "0 released diamond[0]",
            "0 ready source[0]",
            "0 start source[0] core 0",
            "7000000 finish source[0] core 0",
            "7000000 ready left[0]",
            "7000000 ready right[0]",
            "7000000 start left[0] core 0",
            "12000000 finish left[0] core 0",
            "12000000 start right[0] core 0",
            "17000000 finish right[0] core 0",
            "17000000 ready join[0]",
            "17000000 start join[0] core 0",
            "19000000 finish join[0] core 0",
            "19000000 completed diamond[0] met",
        ]
    );
}
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
fn r5_static_priority_prefers_the_smaller_number_and_preempts() {
    let run = |preemption| {
        let machine = (VirtualTime::new().policy(Policy::StaticPriority)).preemption(preemption);
        let dags = [("low", 0, 20), ("high", 5, 1)].map(|(name, offset, priority)| {
            let dag = create_dag();
            dag.name(name).offset(ms(offset)).jobs(1);
            let attributes = |name: &str| SubtaskAttributes::named(name).priority(priority);
            dag.register_periodic_subtask(
                || {
                    support::execute(ms(10));
                    (1,)
                },
                vec![name],
                ms(100),
                attributes("source"),
            );
            dag.register_sink_subtask(|_: (i32,)| (), vec![name], ms(100), attributes("sink"));
            dag
        });
        commit(&dags);
        machine.run()
    };
    let report = run(Preemption::Enabled);
    let low = report.subtask("low", "source")[0];
    assert_eq!((low.finish_ns, low.preemptions), (Some(20 * MS), 1));
    assert_eq!(report.subtask("high", "source")[0].finish_ns, Some(15 * MS));

    let report = run(Preemption::Disabled);
    let low = report.subtask("low", "source")[0];
    assert_eq!((low.finish_ns, low.preemptions), (Some(10 * MS), 0));
    assert_eq!(report.subtask("high", "source")[0].start_ns, Some(10 * MS));
}
#[test]
fn overlapping_jobs_keep_their_numbers() {
    // D = 4 T: up to four jobs are in the diamond at once.
    let machine = VirtualTime::new().cores(4);
    let dag = diamond(ms(10), ms(40), [ms(9), ms(2), ms(10), ms(10)]);
    dag.jobs(50);
    let report = run(&machine, &[dag]);
    assert_eq!(report.statistics[0].completed, 50);
    assert_eq!(report.statistics[0].misses, 0);
    let response_times = report.jobs.iter().filter_map(|job| job.response_time_ns());
    assert!(
        response_times
            .max()
            .is_some_and(|longest| longest > 20 * MS),
        "they overlap"
    );
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

#[test]
fn the_same_dags_give_the_same_events() {
    let run = || {
        let machine = VirtualTime::new().cores(3);
        let dag = diamond(ms(10), ms(30), [ms(2), ms(9), ms(12), ms(5)]);
        dag.jobs(30);
        let other = pair("other", ms(7), ms(7), [ms(2), ms(1)]);
        other.jobs(40);
        commit(&[dag, other]);
        machine.run().event_lines()
    };
    assert_eq!(run(), run());
}

/// `trace_of_virtual_time` tells the same check more lies.
#[test]
fn the_check_finds_forged_journals() {
    let forge = |is_forged: fn(&Event) -> bool| {
        let machine = VirtualTime::new().cores(2);
        let dag = diamond(ms(100), ms(100), [ms(1), ms(5), ms(20), ms(2)]);
        dag.jobs(2);
        let mut report = run(&machine, &[dag]);
        for event in &mut report.events {
            event.time_ns += u64::from(is_forged(event));
        }
        let rules = report.violations().into_iter().map(|found| found.rule());
        rules.collect::<Vec<_>>()
    };
    assert!(forge(|event| event.what == What::Released).contains(&Rule::Release));
    let idle = |event: &Event| {
        let of = (event.what, event.job, event.subtask);
        of == (What::Start, 0, Some(SubtaskId(2)))
    };
    assert_eq!(forge(idle), [Rule::Dispatch]);
}
