//! The rules O1 to O6 of optional parts (`fass/src/api/refining.rs`), in virtual time; O7 is Linux's.
#![allow(
    unsafe_code,
    reason = "refinements may be cut here: they have nothing but numbers"
)]

mod support;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use fass::{Dag, Refinements, SubtaskAttributes, create_dag};
use support::{commit, execute, ms, named, pair};
use virtual_time::{JobOutcome, VirtualTime};

/// What a mandatory part or a refinement noted: who, the job, and the steps before it.
type Seen = Arc<Mutex<Vec<(&'static str, u64, u64)>>>;

fn note(seen: &Seen, who: &'static str, job: u64, steps: u64) {
    seen.lock()
        .expect("nobody panics with it")
        .push((who, job, steps));
}

fn taken(seen: &Seen) -> Vec<(&'static str, u64, u64)> {
    seen.lock().expect("nobody panics with it").clone()
}

/// What a refining subtask does, in ms: its mandatory part, its optional part at most, each
/// refinement, and after how many of these it is done.
#[derive(Clone, Copy)]
struct Work {
    mandatory: u64,
    optional: u64,
    step: u64,
    most_steps: u64,
}

const PERIOD: Duration = ms(20);

/// source -> plan -> sink, which takes 1 ms; all is noted.
fn planning(
    jobs: u64,
    work: Work,
    attributes: SubtaskAttributes,
    seen: &Seen,
) -> (Dag, Refinements) {
    let dag = create_dag();
    dag.name("planning").jobs(jobs);
    let mut next = 0_u64..;
    let source = move || (next.next().expect("it has no end"),);
    dag.register_periodic_subtask(source, vec!["job"], PERIOD, named("source").wcet(ms(1)));
    let log = Arc::clone(seen);
    let plan = move |&(job,): &(u64,)| {
        execute(ms(work.mandatory));
        note(&log, "plan", job, 0);
        (job, 0)
    };
    let log = Arc::clone(seen);
    let refine = move |&(job,): &(u64,), &(of, steps): &(u64, u64)| {
        assert_eq!(of, job);
        note(&log, "refine", job, steps);
        execute(ms(work.step));
        (steps < work.most_steps).then_some((job, steps + 1))
    };
    // SAFETY: what it notes is whole before it executes, and it is unwound.
    let refinements = unsafe { dag.refining(ms(work.optional), plan, refine) }.register_subtask(
        vec!["job"],
        vec!["planned", "steps"],
        attributes,
    );
    let log = Arc::clone(seen);
    let sink = move |(job, steps): (u64, u64)| {
        execute(ms(1));
        note(&log, "sink", job, steps);
    };
    dag.register_sink_subtask(
        sink,
        vec!["planned", "steps"],
        PERIOD,
        named("sink").wcet(ms(1)),
    );
    (dag, refinements)
}

const CUT: Work = Work {
    mandatory: 2,
    optional: 7,
    step: 3,
    most_steps: u64::MAX,
};

#[test]
fn o1_the_mandatory_part_ends_before_the_first_refinement_begins_with_its_result() {
    let (machine, seen) = (VirtualTime::new(), Seen::default());
    let (dag, _) = planning(2, CUT, named("plan"), &seen);
    commit(&[dag]);
    machine.run();
    for job in 0..2 {
        let of_job = taken(&seen).into_iter().filter(|&(_, of, _)| of == job);
        let first_two: Vec<_> = of_job.take(2).collect();
        assert_eq!(first_two, [("plan", job, 0), ("refine", job, 0)]);
    }
}

#[test]
fn o2_each_refinement_gets_the_best_result_and_none_ends_the_optional_part() {
    let (machine, seen) = (VirtualTime::new(), Seen::default());
    let work = Work {
        most_steps: 1,
        ..CUT
    };
    let (dag, refinements) = planning(1, work, named("plan"), &seen);
    commit(&[dag]);
    let report = machine.run();
    let expected = [
        ("plan", 0, 0),
        ("refine", 0, 0),
        ("refine", 0, 1),
        ("sink", 0, 1),
    ];
    assert_eq!(taken(&seen), expected);
    assert_eq!((refinements.complete(), refinements.cut()), (1, 0));
    // 2 ms, and two refinements of 3 ms, of which the second one says that it is done.
    let plan = report.subtask("planning", "plan")[0];
    assert_eq!(plan.execution_ns, 8_000_000);
}

#[test]
fn o3_a_refinement_is_cut_when_the_optional_part_has_executed_for_its_time() {
    let (machine, seen) = (VirtualTime::new(), Seen::default());
    let (dag, refinements) = planning(5, CUT, named("plan"), &seen);
    commit(&[dag]);
    let report = machine.run();
    // Two refinements of 3 ms, and 1 ms of a third one.
    for plan in report.subtask("planning", "plan") {
        assert_eq!(plan.execution_ns, 9_000_000);
    }
    let sent = taken(&seen).into_iter().filter(|&(who, ..)| who == "sink");
    let expected: Vec<_> = (0..5).map(|job| ("sink", job, 2)).collect();
    assert_eq!(sent.collect::<Vec<_>>(), expected);
    assert_eq!((refinements.complete(), refinements.cut()), (10, 5));
    assert_eq!(report.violations(), []);
}

#[test]
fn o3_a_refinement_that_ends_with_the_time_is_complete() {
    let (machine, seen) = (VirtualTime::new(), Seen::default());
    let work = Work { optional: 6, ..CUT };
    let (dag, refinements) = planning(1, work, named("plan"), &seen);
    commit(&[dag]);
    machine.run();
    assert_eq!(taken(&seen).last(), Some(&("sink", 0, 2)));
    // The third one was cut before it had executed.
    assert_eq!((refinements.complete(), refinements.cut()), (2, 1));
}

#[test]
fn o3_time_in_which_it_is_suspended_does_not_count() {
    let machine = VirtualTime::new().policy(fass::Policy::Edf);
    let seen = Seen::default();
    let (dag, refinements) = planning(3, CUT, named("plan"), &seen);
    let urgent = pair("urgent", ms(5), ms(5), [ms(1), ms(1)]);
    urgent.jobs(12);
    commit(&[dag, urgent]);
    let report = machine.run();
    let plans = report.subtask("planning", "plan");
    assert!(plans.iter().all(|plan| plan.preemptions > 0));
    assert!(plans.iter().all(|plan| plan.execution_ns == 9_000_000));
    assert_eq!((refinements.complete(), refinements.cut()), (6, 3));
    assert_eq!(report.violations(), []);
}

#[test]
fn o4_a_cut_ends_no_job_and_no_dag() {
    let machine = VirtualTime::new().contain_panics();
    let seen = Seen::default();
    let (dag, refinements) = planning(1000, CUT, named("plan"), &seen);
    commit(&[dag]);
    let report = machine.run();
    assert_eq!(refinements.cut(), 1000);
    let [of_dag] = report.statistics[..] else {
        panic!("there is one DAG");
    };
    assert_eq!(
        (of_dag.completed, of_dag.faults, of_dag.failed),
        (1000, 0, 0)
    );
    let mut outcomes = report.jobs.iter().map(|job| job.outcome);
    assert!(outcomes.all(|outcome| outcome == Some(JobOutcome::Met)));
    assert!(report.panics.is_empty());
}

#[test]
fn o5_the_commit_charges_the_wcet_and_the_time_of_the_optional_part() {
    let (_machine, seen) = (VirtualTime::new(), Seen::default());
    let (dag, _) = planning(1, CUT, named("plan").wcet(ms(2)).budget(ms(4)), &seen);
    let commit = fass::finish_create_dags(&[dag]).expect("it is sound");
    // 1 ms for the source, 2 and 7 for the plan, 1 for the sink; one core, one DAG.
    let bound = commit.answers()[0].verdict.bound();
    assert_eq!(bound, Some(ms(11)));
}

#[test]
fn o6_a_panic_in_a_refinement_is_a_fault_of_the_instance() {
    let machine = VirtualTime::new().contain_panics();
    let dag = create_dag();
    dag.name("planning").jobs(3);
    dag.register_periodic_subtask(|| (1_u32,), vec!["seed"], PERIOD, named("source"));
    let refine = |_: &(u32,), &(result,): &(u32,)| {
        assert!(result < 2, "too good");
        Some((result + 1,))
    };
    // SAFETY: it has nothing but numbers.
    unsafe { dag.refining(ms(1), |seed: &(u32,)| *seed, refine) }.register_subtask(
        vec!["seed"],
        vec!["best"],
        named("plan"),
    );
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["best"], PERIOD, named("sink"));
    commit(&[dag]);
    let report = machine.run();
    assert_eq!(report.panics.len(), 1);
    assert_eq!(report.panics[0].message, "too good");
    assert_eq!(
        (report.statistics[0].faults, report.statistics[0].completed),
        (1, 0)
    );
}
