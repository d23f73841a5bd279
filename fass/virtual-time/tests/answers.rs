//! What the commit answers about deadlines, and that runs keep to it.

mod support;

use std::time::Duration;

use fass::{
    Answer, Dag, Fault, OverheadSource, Overheads, Policy, Preemption, Reason, SubtaskAttributes,
    Test, Untyped, Verdict, create_dag, finish_create_dags,
};
use support::sharing::every;
use support::{execute, ms, named};
use virtual_time::VirtualTime;

/// A chain of two subtasks that execute for their WCETs.
fn chain(name: &str, period: Duration, deadline: Duration, wcets: [Duration; 2]) -> Dag {
    let attributes = |subtask: &str, wcet| named(subtask).wcet(wcet);
    build(name, period, deadline, wcets, attributes)
}

/// The same with priorities.
fn ranked(name: &str, priority: u32, period: Duration, wcets: [Duration; 2]) -> Dag {
    let attributes = |subtask: &str, wcet| named(subtask).wcet(wcet).priority(priority);
    build(name, period, period, wcets, attributes)
}

fn build(
    name: &str,
    period: Duration,
    deadline: Duration,
    [first, second]: [Duration; 2],
    attributes: impl Fn(&str, Duration) -> SubtaskAttributes,
) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(50);
    let source = move || {
        execute(first);
        (1,)
    };
    dag.register_periodic_subtask(source, vec![name], period, attributes("source", first));
    let sink = move |_: (i32,)| execute(second);
    dag.register_sink_subtask(sink, vec![name], deadline, attributes("sink", second));
    dag
}

fn reason(answer: &Answer) -> Option<Reason> {
    answer.verdict.unproven().map(fass::Unproven::reason)
}

/// Compares what answers say: for each its beginning, and a part of the rest.
#[track_caller]
fn assert_said(answers: &[Answer], expected: &[[&str; 2]]) {
    assert_eq!(answers.len(), expected.len());
    for (answer, [start, part]) in answers.iter().zip(expected) {
        let text = answer.to_string();
        assert!(text.starts_with(start) && text.contains(part), "{text}");
    }
}

#[test]
fn a_proven_dag_has_a_bound_that_runs_keep() {
    let machine = VirtualTime::new().policy(Policy::StaticPriority);
    let dags = [
        ranked("high", 0, ms(10), [ms(1), ms(2)]),
        ranked("low", 1, ms(20), [ms(2), ms(3)]),
    ];
    let commit = finish_create_dags(&dags).expect("nothing is wrong");
    assert!(commit.first_unproven().is_none());
    let report = machine.run();
    let bounds: Vec<Duration> = (commit.answers().iter())
        .map(|answer| answer.verdict.bound().expect("it is proven"))
        .collect();
    for job in &report.jobs {
        let taken = Duration::from_nanos(job.response_time_ns().expect("it has ended"));
        assert!(taken <= bounds[job.dag.index()]);
    }
    assert_eq!(bounds[0], ms(3));
    let tests = commit.answers().iter().map(|answer| match answer.verdict {
        Verdict::Proven { test, .. } => Some(test),
        Verdict::NotProven(_) => None,
    });
    let tests: Vec<_> = tests.flatten().collect();
    assert!(matches!(tests[0], Test::Alone | Test::IntraTask));
    assert_eq!(tests[1], Test::OneCore);
}

#[test]
fn the_answer_is_for_the_preemption_and_the_cores_of_the_platform() {
    let answers = |preemption, cores| {
        let machine = VirtualTime::new().policy(Policy::StaticPriority);
        let _machine = machine.preemption(preemption).cores(cores);
        let urgent = ranked("urgent", 0, ms(10), [ms(2), ms(2)]);
        let long = ranked("long", 1, ms(100), [ms(8), ms(1)]);
        let commit = finish_create_dags(&[urgent, long]).expect("nothing is wrong");
        commit.answers()[0].verdict.clone()
    };
    // A started subtask of `long` keeps the only core for 8 ms: 12 > 10.
    let blocked = answers(Preemption::Disabled, 1);
    assert_eq!(
        blocked.unproven().map(fass::Unproven::reason),
        Some(Reason::NoBound)
    );
    assert_eq!(
        answers(Preemption::Enabled, 1).bound(),
        Some(ms(4)),
        "it is preempted"
    );
    // Four cores are rarely all kept.
    let Verdict::Proven { bound, test } = answers(Preemption::Disabled, 4) else {
        panic!("four cores are enough");
    };
    assert_eq!(test, Test::NonPreemptive);
    assert!(bound <= ms(10));
}

#[test]
fn not_proven_is_accepted_and_says_why() {
    let machine = VirtualTime::new().policy(Policy::Edf);
    let late = chain("late", ms(10), ms(4), [ms(2), ms(1)]);
    let busy = chain("busy", ms(10), ms(7), [ms(3), ms(3)]);
    busy.offset(ms(4)); // of which the bound knows nothing
    let commit = finish_create_dags(&[late, busy]).expect("a proof is not demanded");
    let expected = [
        ["dag `late` is not proven", ""],
        ["dag `busy` is not proven", "`late`"],
    ];
    assert_said(commit.answers(), &expected);
    assert_eq!(reason(&commit.answers()[0]), Some(Reason::NoBound));
    let first = commit.first_unproven().expect("one fails first");
    assert_eq!(first.dag.name, "late");
    assert!(commit.warnings().is_empty(), "nothing is certain");
    // It does meet them: not proven is not infeasible.
    let report = machine.run();
    assert!(report.dags().all(|dag| dag.statistics().misses == 0));
}

#[test]
fn a_demanded_proof_that_is_missing_refuses_the_commit() {
    let machine = VirtualTime::new().policy(Policy::Edf);
    let late = chain("late", ms(10), ms(4), [ms(2), ms(1)]);
    let busy = chain("busy", ms(10), ms(7), [ms(3), ms(3)]);
    busy.offset(ms(4));
    busy.demand_proof();
    let error = finish_create_dags(&[late.clone(), busy.clone()]).expect_err("it is demanded");
    let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
    assert_eq!(codes, ["not_proven"], "of `late` nothing is demanded");
    let text = error.to_string();
    assert!(
        text.starts_with("dag `busy` ") && text.contains("dag `late`"),
        "{text}"
    );
    late.demand_proof();
    let error = finish_create_dags(&[late.clone(), busy]).expect_err("both demand it");
    assert_eq!(error.faults().len(), 2);
    // The handles are as they were: alone it is proven, and runs.
    let commit = finish_create_dags(&[late]).expect("nothing delays it");
    assert_eq!(commit.answers()[0].verdict.bound(), Some(ms(3)));
    assert_eq!(machine.run().dag("late").statistics().completed, 50);
}

#[test]
fn other_faults_come_before_the_question_of_a_proof() {
    let _machine = VirtualTime::new();
    let dag = chain("none", ms(10), ms(4), [ms(3), ms(3)]);
    dag.demand_proof().jobs(0);
    let error = finish_create_dags(&[dag]).expect_err("no jobs");
    let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
    assert_eq!(codes, ["zero_jobs"]);
}

#[test]
fn dags_without_all_wcets_say_so() {
    let _machine = VirtualTime::new().policy(Policy::StaticPriority);
    let unknown = create_dag();
    unknown.name("unknown");
    let known = named("source").wcet(ms(1)).priority(1);
    unknown.register_periodic_subtask(|| (1,), vec!["unknown"], ms(10), known);
    let sink = named("sink").priority(1);
    unknown.register_sink_subtask(|_: (i32,)| (), vec!["unknown"], ms(10), sink);
    let urgent = ranked("urgent", 0, ms(10), [ms(1), ms(1)]);
    let lax = ranked("lax", 2, ms(10), [ms(1), ms(1)]);
    let commit = finish_create_dags(&[unknown, urgent, lax]).expect("WCETs are optional");
    let expected = [
        [
            "dag `unknown` is not proven",
            "no WCET above 0 is given for subtask `sink`",
        ],
        ["dag `urgent` takes at most 2ms", ""],
        ["dag `lax` is not proven", "dag `unknown`"],
    ];
    assert_said(commit.answers(), &expected);
    assert_eq!(
        commit
            .first_unproven()
            .map(|answer| answer.dag.name.as_str()),
        Some("unknown")
    );
}

#[test]
fn an_answer_says_which_wcets_are_observed_ones() {
    let said_and_hash = |machine: VirtualTime| {
        let dag = chain("seen", ms(10), ms(9), [ms(3), ms(3)]);
        let commit = finish_create_dags(&[dag]).expect("the DAG is right");
        let hash = machine.run().task_set().dags()[0].graph_hash();
        (commit.answers()[0].to_string(), hash)
    };
    let (stated, hash) = said_and_hash(VirtualTime::new());
    assert_eq!(stated, "dag `seen` takes at most 6ms, by multiple paths");
    let file = format!("margin 20\ndag {hash} seen\nwcet 1200000 1 sink\nend\n");
    let (observed, _) = said_and_hash(VirtualTime::new().wcets(&file));
    assert_eq!(
        observed,
        "dag `seen` takes at most 4.2ms, by multiple paths; 1 of 2 WCETs are observed ones and 20 %"
    );
}

#[test]
fn an_answer_says_that_overheads_are_measured_ones() {
    let _machine = VirtualTime::new();
    let dag = chain("two", ms(10), ms(9), [ms(3), ms(3)]);
    let commit = finish_create_dags(&[dag]).expect("the DAG is right");
    let mut answer = commit.answers()[0].clone();
    assert_eq!(answer.overheads, OverheadSource::Stated);
    answer.overheads = OverheadSource::Measured {
        dispatches: 500,
        margin_percent: 20,
    };
    assert_eq!(
        answer.to_string(),
        "dag `two` takes at most 6ms, by multiple paths; overheads are the longest of 500 measured \
         and 20 %"
    );
}

#[test]
fn what_is_certain_to_miss_is_accepted_with_a_warning() {
    let machine = VirtualTime::new();
    let dag = chain("long", ms(10), ms(9), [ms(5), ms(5)]);
    let commit = finish_create_dags(&[dag]).expect("WCETs need not be reached");
    let answer = &commit.answers()[0];
    let length_ns = 10_000_000;
    assert_eq!(
        reason(answer),
        Some(Reason::LengthBeyondDeadline { length_ns })
    );
    let codes: Vec<_> = commit.warnings().iter().map(|w| w.code()).collect();
    assert_eq!(codes, ["certain_miss"]);
    assert_eq!(
        commit.warnings()[0].to_string(),
        "dag `long` cannot keep its deadlines at its WCETs: its longest path alone takes 10ms, \
         which is more than its relative deadline; shorten the path or relax the deadline"
    );
    assert_eq!(machine.run().dag("long").statistics().misses, 50);
}

#[test]
fn measured_overheads_are_added_to_every_wcet() {
    let overheads = Overheads {
        context_switch_ns: 100,
        dispatch_ns: 300,
        interrupt_ns: 1_000,
        ready_ns: 0,
    };
    let bound = |machine: VirtualTime| {
        let dag = chain("two", ms(10), ms(10), [ms(2), ms(3)]);
        let commit = finish_create_dags(&[dag]).expect("nothing is wrong");
        // They are no part of the run in virtual time.
        let report = machine.run();
        assert_eq!(report.jobs[0].response_time_ns(), Some(5_000_000));
        commit.answers()[0].verdict.bound()
    };
    let ns = |ns| Some(ms(5) + Duration::from_nanos(ns));
    assert_eq!(bound(VirtualTime::new()), ns(0));
    assert_eq!(bound(VirtualTime::new().overheads(overheads)), ns(3_000));
    let cooperative = VirtualTime::new().preemption(Preemption::Disabled);
    assert_eq!(bound(cooperative.overheads(overheads)), ns(1_000));

    // What they make too long is not proven any more.
    let _machine = VirtualTime::new().overheads(overheads);
    let tight = chain("tight", ms(10), ms(5), [ms(2), ms(3)]);
    tight.demand_proof();
    let error = finish_create_dags(&[tight]).expect_err("5.003 ms are more than 5 ms");
    assert_eq!(error.faults()[0].code(), "not_proven");
}

/// One core without preemption, a source of 2 ms, seven branches and a sink that takes
/// no time, all in all the period: counting work alone, each job is complete after 13
/// ms. By priorities the next job's source comes before that sink.
#[test]
fn a_wcet_of_zero_proves_nothing() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        let machine = VirtualTime::new()
            .policy(policy)
            .preemption(Preemption::Disabled);
        let commit = finish_create_dags(&[star([2, 2, 2, 1, 1, 1, 2], 0)]).expect("accepted");
        assert_said(
            commit.answers(),
            &[["dag `star` is not proven", "subtask `sink`"]],
        );
        assert_eq!(commit.warnings()[0].code(), "zero_wcet");
        let report = machine.run();
        let responses = report.jobs.iter().filter_map(|job| job.response_time_ns());
        let observed_ns = match policy {
            Policy::StaticPriority => 26_000_000,
            Policy::Edf => 13_000_000,
        };
        assert_eq!(responses.max(), Some(observed_ns));
        drop(machine);
        // With what a subtask takes at least, the bound holds.
        let machine = VirtualTime::new()
            .policy(policy)
            .preemption(Preemption::Disabled);
        let commit = finish_create_dags(&[star([2, 2, 2, 1, 1, 1, 1], 1)]).expect("accepted");
        let bound = commit.answers()[0].verdict.bound();
        assert_eq!(bound, Some(ms(13)));
        assert_eq!(machine.run().dag("star").statistics().misses, 0);
    }
}

fn star(branches: [u64; 7], sink: u64) -> Dag {
    let dag = every(13, "star");
    dag.jobs(20);
    let subtask = |name: &str, priority, time| {
        let time = ms(time);
        let attributes = named(name).wcet(time).priority(priority);
        dag.register_untyped_subtask(move |_job| execute(time), attributes)
    };
    let source = subtask("source", 0, 2);
    let names = ["a", "b", "c", "d", "e", "f", "g"];
    let branches = names.iter().zip(branches);
    let branches: Vec<Untyped> = branches
        .map(|(name, time)| subtask(name, 1, time))
        .collect();
    let sink = subtask("sink", 2, sink);
    for branch in &branches {
        dag.precede(&source, branch).precede(branch, &sink);
    }
    dag
}
