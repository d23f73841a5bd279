//! Answers of the commit about deadlines and clusters, and that runs keep to them.

use std::time::Duration;

use crate::support::{every, ms, taking, ticking, work};
use fass::commit::{
    Commit, ConstructionPolicy, DagAnswer, Fault, OverheadSource, Overheads,
    finish_create_dags_with,
};
use fass::shared::Modes;
use fass::{Dag, Policy, Preemption, create_dag, finish_create_dags};
use virtual_time::{Report, VirtualTime};

/// A chain of two subtasks that execute for their WCETs, of one priority; all in milliseconds.
fn chain(name: &str, priority: u32, [period, deadline]: [u64; 2], wcets: [u64; 2]) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(50);
    dag.period(ms(period)).relative_deadline(ms(deadline));
    let [source, sink] = ["source", "sink"].map(|of| taking(of, 0).priority(priority));
    let [first, second] = wcets;
    let source = dag.register_untyped_subtask(move |_job| work(first), source.wcet(ms(first)));
    let sink = dag.register_untyped_subtask(move |_job| work(second), sink.wcet(ms(second)));
    dag.precede(&source, &sink);
    dag
}

/// Commits DAGs and runs them; no job takes longer than its DAG's bound. Of each answer the
/// beginning is compared, and a part of the rest.
#[track_caller]
fn answered(machine: &VirtualTime, dags: &[Dag], expected: &[[&str; 2]]) -> (Commit, Report) {
    let commit = finish_create_dags(dags).expect("nothing is wrong");
    assert_eq!(commit.answers().len(), expected.len());
    for (answer, [start, part]) in commit.answers().iter().zip(expected) {
        let text = answer.to_string();
        assert!(text.starts_with(start) && text.contains(part), "{text}");
    }
    let report = machine.run();
    assert_eq!(report.violations(), []);
    for job in &report.jobs {
        let taken = Duration::from_nanos(job.response_time_ns().expect("it has ended"));
        let bound = commit.answer(job.dag).verdict.bound();
        assert!(bound.is_none_or(|bound| taken <= bound));
    }
    (commit, report)
}

fn codes(dags: &[Dag]) -> Vec<&'static str> {
    let error = finish_create_dags(dags).expect_err("it is refused");
    error.faults().iter().map(Fault::code).collect()
}

fn late_and_busy() -> [Dag; 2] {
    let late = chain("late", 0, [10, 4], [2, 1]);
    let busy = chain("busy", 0, [10, 7], [3, 3]);
    busy.offset(ms(4)); // of which the bound knows nothing
    [late, busy]
}

#[test]
fn the_answer_is_for_the_policy_the_preemption_and_the_cores_of_the_platform() {
    let two = || {
        let urgent = chain("urgent", 0, [10, 10], [2, 2]);
        [urgent, chain("long", 1, [100, 100], [8, 1])]
    };
    let (preempts, keeps) = (Preemption::Enabled, Preemption::Disabled);
    let (ranked, edf) = (Policy::StaticPriority, Policy::Edf);
    let unproven = "dag `urgent` is not proven";
    for (policy, preemption, cores, said) in [
        (ranked, preempts, 1, "dag `urgent` takes at most 4ms"),
        // A started subtask of `long` keeps the only core for 8 ms: 12 > 10.
        (ranked, keeps, 1, unproven),
        // Four cores are rarely all kept.
        (ranked, keeps, 4, "dag `urgent` takes at most"),
        (edf, preempts, 1, "dag `urgent` takes at most"),
    ] {
        let machine = VirtualTime::new().policy(policy).preemption(preemption);
        let expected = [[said, ""], ["dag `long`", ""]];
        answered(&machine.cores(cores), &two(), &expected);
    }
}

#[test]
fn not_proven_is_accepted_and_says_why() {
    let machine = VirtualTime::new().policy(Policy::Edf);
    let expected = [
        ["dag `late` is not proven", ""],
        ["dag `busy` is not proven", "`late`"],
    ];
    let (commit, report) = answered(&machine, &late_and_busy(), &expected);
    let first = commit.first_unproven().expect("one fails first");
    assert_eq!(first.dag.name, "late");
    assert!(commit.warnings().is_empty(), "nothing is certain");
    // It does meet them: not proven is not infeasible.
    assert!(report.dags().all(|dag| dag.statistics().misses == 0));
}

#[test]
fn a_demanded_proof_that_is_missing_refuses_the_commit() {
    // Where cores are divided, no table is made for a proof.
    let _machine = VirtualTime::new().policy(Policy::Edf).clusters(&[1]);
    let [late, busy] = late_and_busy();
    late.cluster(0);
    busy.cluster(0).demand_proof();
    let both = [late.clone(), busy];
    // Of `late` nothing is demanded.
    assert_eq!(codes(&both), ["not_proven"]);
    late.demand_proof();
    assert_eq!(codes(&both), ["not_proven"; 2]);
    // Other faults come before that question.
    let none = chain("none", 0, [10, 4], [3, 3]);
    none.demand_proof().cluster(0).jobs(0);
    assert_eq!(codes(&[none]), ["zero_jobs"]);
    // The handles are as they were: alone it is proven.
    let commit = finish_create_dags(&[late]).expect("nothing delays it");
    assert_eq!(commit.answer("late").verdict.bound(), Some(ms(3)));
}

/// A DAG of three cores in a row and one of the rest, as in `lent.dag`; each demands a proof.
fn lending(number: usize) -> [Dag; 2] {
    let vision = every(100, &format!("vision {number}"));
    let subtask = |name, ms| vision.register_untyped_subtask(|_| (), taking(name, ms));
    let (first, last) = (subtask("first", 1), subtask("last", 1));
    for (name, ms) in [("left", 39), ("right", 39), ("stereo", 29)] {
        let middle = subtask(name, ms);
        vision.precede(&first, &middle).precede(&middle, &last);
    }
    let control = chain(&format!("control {number}"), 0, [120, 95], [20, 39]);
    [vision.clone(), control].map(|dag| dag.jobs(3).demand_proof().clone())
}

#[test]
fn cores_are_divided_for_a_proof_unless_that_parts_the_dags_of_modes() {
    let _machine = VirtualTime::new().policy(Policy::StaticPriority).cores(4);
    let dags = || [lending(0), lending(1)].concat();
    let commit = finish_create_dags(&dags()).expect("divided, all are proven");
    assert!(commit.first_unproven().is_none());

    let _machine = VirtualTime::new().policy(Policy::StaticPriority).cores(4);
    let (dags, modes) = (dags(), Modes::new());
    modes.mode("all", &dags.iter().collect::<Vec<_>>());
    modes.mode("few", &[&dags[0]]);
    assert!(codes(&dags).contains(&"not_proven"), "{:?}", codes(&dags));
}

#[test]
fn what_is_certain_to_miss_is_accepted_with_a_warning() {
    let machine = VirtualTime::new().policy(Policy::Edf);
    let long = chain("long", 0, [10, 9], [5, 5]);
    let expected = ["dag `long` is not proven", "its longest path alone"];
    let (commit, report) = answered(&machine, &[long], &[expected]);
    let codes: Vec<_> = commit.warnings().iter().map(|w| w.code()).collect();
    assert_eq!(codes, ["certain_miss"]);
    assert_eq!(
        commit.warnings()[0].to_string(),
        "dag `long` cannot keep its deadlines at its WCETs: its longest path alone takes 10ms, \
         which is more than its relative deadline; shorten the path or relax the deadline"
    );
    assert_eq!(report.dag("long").statistics().misses, 50);
}

#[test]
fn overheads_are_added_to_every_wcet() {
    let overheads = Overheads {
        context_switch_ns: 100,
        dispatch_ns: 300,
        interrupt_ns: 1_000,
        ..Overheads::NONE
    };
    for (preemption, said) in [
        (Preemption::Enabled, "dag `two` takes at most 5.003ms"),
        (Preemption::Disabled, "dag `two` takes at most 5.001ms"),
    ] {
        let machine = VirtualTime::new().preemption(preemption);
        let machine = machine.overheads(overheads);
        let two = chain("two", 0, [10, 10], [2, 3]);
        let (commit, report) = answered(&machine, &[two], &[[said, ""]]);
        // They are no part of the run in virtual time.
        let mut jobs = report.dag("two").jobs();
        assert!(jobs.all(|job| job.response_time_ns() == Some(5_000_000)));
        let mut answer: DagAnswer = commit.answer("two").clone();
        assert_eq!(answer.overheads, OverheadSource::Stated);
        answer.overheads = OverheadSource::Measured {
            dispatches: 500,
            margin_percent: 20,
        };
        let said = "; overheads are the longest of 500 measured and 20 %";
        assert!(answer.to_string().ends_with(said), "{answer}");
    }
    // What they make too long is not proven any more.
    let _machine = VirtualTime::new().overheads(overheads);
    let tight = chain("tight", 0, [10, 5], [2, 3]);
    tight.demand_proof();
    assert_eq!(codes(&[tight]), ["not_proven"]);
}

#[test]
fn the_commit_divides_the_cores_and_says_why() {
    let machine = VirtualTime::new().cores(4).assign_clusters();
    let heavy = every(10, "heavy");
    for name in ["left", "middle", "right"] {
        heavy.register_untyped_subtask(|_job| work(4), taking(name, 4));
    }
    let [a, b, c] = [("a", 7), ("b", 5), ("c", 4)].map(|(name, time)| ticking(name, time));
    let dags = [a, heavy, b, c];
    dags.iter().for_each(|dag| _ = dag.jobs(5));
    let commit = finish_create_dags_with(&dags, ConstructionPolicy::any_graph());
    let commit = commit.expect("nothing is wrong");
    let place = |answer: &DagAnswer| answer.cluster.as_ref().map(ToString::to_string);
    let places: Vec<String> = commit.answers().iter().filter_map(place).collect();
    assert_eq!(
        places,
        [
            "in cluster 1, on 1 core from core 2 on: the first with room for it, with 30 % of them \
             left (attempt 1, by density)",
            "in cluster 0, on 2 cores from core 0 on: its own by a table, as a job is 12ms of \
             work within 10ms, with 15 % of them left (attempt 1, by density)",
            "in cluster 0, on 1 core from core 1 on: the first with room for it, with 10 % of them \
             left (attempt 1, by density)",
            "in cluster 2, on 1 core from core 3 on: the first with room for it, with 60 % of them \
             left (attempt 1, by density)",
        ]
    );
    assert!(commit.first_unproven().is_none());
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert!(report.dags().all(|dag| dag.statistics().misses == 0));
}

#[test]
fn cores_are_divided_by_the_app_or_by_the_commit_and_the_last_word_counts() {
    let calm = || {
        let dag = ticking("calm", 6);
        dag.cluster(0).jobs(1);
        [dag]
    };
    let machine = VirtualTime::new().clusters(&[1]).assign_clusters();
    let error = finish_create_dags(&calm()).expect_err("the commit divides them");
    assert_eq!(
        error.to_string(),
        "dag `calm` gets no cores: it states a cluster, and the commit is to make them; leave its \
         cluster out"
    );
    drop(machine);
    let _machine = VirtualTime::new().assign_clusters().clusters(&[1]);
    let commit = finish_create_dags(&calm()).expect("the app divides them");
    let place = commit.answer("calm").cluster.as_ref();
    assert_eq!(place.map(|place| &place.why), Some(&None));
}
