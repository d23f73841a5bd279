//! DAGs that are added to a run and removed: what an app sees of the rules A1 to A6.

mod support;

use std::slice;
use std::sync::Arc;
use std::time::Duration;

use fass::{Commit, Dag, SubtaskAttributes, create_dag, finish_create_dags, shutting_down};
use fass::{LaunchError, Policy, Shutdown};
use support::lifecycle::events;
use support::sharing::{ms, named, work};
use virtual_time::VirtualTime;

/// A DAG of one subtask with a period and a WCET, which its calls take, and as deadline the period.
fn dag(name: &str, period: u64, wcet: u64) -> Dag {
    holding(name, period, wcet, ())
}

/// The same, whose function holds something.
fn holding<T: Send + 'static>(name: &str, period: u64, wcet: u64, held: T) -> Dag {
    let dag = create_dag();
    dag.name(name)
        .period(ms(period))
        .relative_deadline(ms(period));
    let function = move |_job| {
        let _ = &held;
    };
    dag.register_untyped_subtask(function, taking(wcet));
    dag
}

fn taking(wcet: u64) -> SubtaskAttributes {
    named("tick").wcet(ms(wcet))
}

fn machine() -> VirtualTime {
    VirtualTime::new().policy(Policy::Edf)
}

fn commit(dags: &[Dag]) -> Commit {
    finish_create_dags(dags).expect("the DAGs are sound")
}

/// The text of a refusal by what is below.
fn refusal(commit: &mut Commit, dag: &Dag) -> String {
    let error = commit.add(slice::from_ref(dag)).expect_err("it is refused");
    error.to_string()
}

#[test]
fn an_added_dag_runs_from_the_switch_on_and_the_others_go_on() {
    let machine = machine();
    let mut commit = commit(&[dag("first", 10, 4)]);
    machine.run_for(ms(12)); // its job 1 executes
    let later = dag("later", 10, 3);
    later.offset(ms(1)).jobs(2);
    assert_eq!(commit.add(&[later]).expect("there is room"), ms(12));
    assert_eq!(commit.answers()[1].dag.name, "later");
    assert!(commit.first_unproven().is_none());
    let report = machine.run_for(ms(20));
    assert_eq!(report.violations(), []);
    assert_eq!(
        events(&report, &["released", "start", "suspend", "finish"])[3..],
        [
            "10 released first[1]",
            "10 start tick[1] core 0",
            "13 released later[0]",
            "14 finish tick[1] core 0",
            "14 start tick[0] core 0",
            "17 finish tick[0] core 0",
            "20 released first[2]",
            "20 start tick[2] core 0",
            "23 released later[1]",
            "24 finish tick[2] core 0",
            "24 start tick[1] core 0",
            "27 finish tick[1] core 0",
            "30 released first[3]",
            "30 start tick[3] core 0",
        ]
    );
}

#[test]
fn what_is_refused_changes_nothing_and_can_be_added_later() {
    let undisturbed = {
        let machine = machine();
        commit(&[dag("first", 10, 6)]);
        machine.run_for(ms(50)).event_lines()
    };
    let machine = machine();
    let first = dag("first", 10, 6);
    first.demand_proof();
    let mut commit = commit(&[first]);
    machine.run_for(ms(25));
    let (heavy, faulty) = (dag("heavy", 10, 5), create_dag());
    // The DAG that runs demands the proof.
    let error = commit
        .add(slice::from_ref(&heavy))
        .expect_err("11 of 10 ms");
    assert_eq!(error.faults()[0].code(), "not_proven");
    let error = commit.add(&[faulty]).expect_err("it is empty");
    assert_eq!(error.faults()[0].code(), "no_subtasks");
    assert_eq!(commit.answers().len(), 1);
    assert_eq!(machine.run_for(ms(25)).event_lines(), undisturbed);
    heavy.period(ms(50)).relative_deadline(ms(50));
    assert_eq!(commit.add(&[heavy]).expect("as it is now"), ms(50));
}

#[test]
fn a_removed_dag_finishes_and_gives_back_what_it_holds() {
    let machine = machine();
    let held = Arc::new(());
    let (first, later) = (
        dag("first", 10, 4),
        holding("later", 10, 5, Arc::clone(&held)),
    );
    let mut commit = commit(&[first]);
    machine.run_for(ms(5));
    commit.add(slice::from_ref(&later)).expect("there is room");
    machine.run_for(ms(2)); // it executes
    commit.remove(&later).expect("it is there");
    commit.remove(&later).expect("it is on its way");
    assert_eq!(Arc::strong_count(&held), 2);
    let report = machine.run_for(ms(20));
    assert_eq!(Arc::strong_count(&held), 1);
    assert_eq!(report.violations(), []);
    assert_eq!(report.statistics[1].completed, 1);
    assert_eq!(events(&report, &["closed"]), ["7 closed later"]);
    // Its number is not given again, and tells of it still.
    let again = holding("again", 10, 5, Arc::clone(&held));
    commit.add(&[again]).expect("there is room");
    let report = machine.run_for(ms(20));
    assert_eq!(report.task_set().dags().len(), 3);
    assert_eq!(report.statistics[1].completed, 1);
    assert_eq!(report.violations(), []);
}

#[test]
fn a_removed_dag_counts_until_its_cluster_is_idle() {
    let machine = machine();
    let (first, removed) = (dag("first", 20, 8), dag("removed", 20, 9));
    first.demand_proof();
    let mut commit = commit(&[first, removed.clone()]);
    machine.run_for(ms(10)); // the second one executes
    commit.remove(&removed).expect("it is there");
    machine.run_for(ms(11)); // it is over, and job 1 of the first in flight
    let next = dag("next", 20, 9);
    let error = commit
        .add(slice::from_ref(&next))
        .expect_err("it may be delayed by both");
    assert_eq!(error.faults()[0].code(), "not_proven");
    machine.run_for(ms(9)); // nothing is in flight
    assert_eq!(commit.add(&[next]).expect("there is room"), ms(30));
    let report = machine.run_for(ms(70));
    assert_eq!(report.violations(), []);
    assert_eq!(report.statistics[0].misses, 0);
}

#[test]
fn a_shutdown_closes_added_dags_and_none_is_added_behind_it() {
    let machine = machine();
    let ends = create_dag();
    ends.name("ends").period(ms(20)).relative_deadline(ms(20));
    let end = |mut end: Shutdown<'_>, job| {
        work(1);
        if job == 2 {
            end.request();
        }
    };
    ends.using(shutting_down())
        .register_untyped_subtask(end, named("end"));
    let mut commit = commit(&[ends]);
    machine.run_for(ms(5));
    commit.add(&[dag("later", 10, 1)]).expect("there is room");
    let report = machine.run_for(ms(95));
    assert_eq!(report.violations(), []);
    assert_eq!(report.statistics[1].completed, 4); // at 5, 15, 25 and 35 ms
    let late = refusal(&mut commit, &dag("late", 10, 1));
    assert!(late.contains("being shut down"), "{late}");
}

#[test]
fn what_an_added_dag_cannot_do_is_refused() {
    let machine = machine();
    let first = dag("first", 10, 4);
    first.jobs(2);
    let mut commit = commit(slice::from_ref(&first));
    let recorded = create_dag();
    recorded.relative_deadline(ms(10));
    recorded.register_periodic_subtask(|| (1_u32,), vec!["n"], ms(10), taking(1));
    recorded.register_sink_subtask(|_: (u32,)| (), vec!["n"], ms(10), named("sink"));
    recorded.record::<u32>("n");
    assert!(refusal(&mut commit, &recorded).contains("record topics of the first commit only"));
    let paused = dag("paused", 10, 1);
    paused.starts_paused();
    assert!(refusal(&mut commit, &paused).contains("commit it with the first ones"));
    let sampling = create_dag();
    let (latest, writer) = (create_dag(), ms(10));
    latest.relative_deadline(writer);
    latest.register_periodic_subtask(|| (1_i32,), vec!["value"], writer, taking(1));
    sampling.period(ms(10)).relative_deadline(ms(10));
    let sample = |_: Option<fass::Sample<'_, i32>>, _job| ();
    sampling
        .using(latest.latest::<i32>("value").sample())
        .register_untyped_subtask(sample, named("sample"));
    assert!(refusal(&mut commit, &sampling).contains("commit both dags in one call"));
    let stranger = commit.remove(&dag("stranger", 10, 1));
    let stranger = stranger.as_ref().map_err(LaunchError::to_string);
    assert!(stranger.is_err_and(|text| text.contains("not of this commit")));
    machine.run();
    assert!(refusal(&mut commit, &dag("late", 10, 1)).contains("the run is over"));
    drop(machine);
    let gone = commit.remove(&first).expect_err("the run is gone");
    assert!(gone.to_string().contains("newest `VirtualTime`"));
}

#[test]
fn an_added_dag_has_a_cluster_and_delays_no_other() {
    let machine = machine().cores(2).clusters(&[1, 1]);
    let in_cluster = |name, cluster| {
        let dag = dag(name, 10, 6);
        dag.cluster(cluster).demand_proof();
        dag
    };
    let mut commit = commit(&[in_cluster("first", 0)]);
    machine.run_for(ms(5));
    let error = commit
        .add(&[dag("nowhere", 10, 6)])
        .expect_err("it has no cores");
    assert_eq!(error.faults()[0].code(), "no_cluster");
    assert!(commit.add(&[in_cluster("full", 0)]).is_err());
    commit
        .add(&[in_cluster("beside", 1)])
        .expect("a core is free");
    let report = machine.run_for(Duration::from_millis(46));
    assert_eq!(report.violations(), []);
    assert_eq!(report.statistics[0].completed, 5);
    assert_eq!(report.statistics[1].completed, 5);
}

#[test]
fn a_name_that_is_in_the_run_is_not_added_again_before_nothing_is_left_of_it() {
    let machine = machine();
    let photo = dag("photo", 10, 2);
    let mut commit = commit(&[dag("first", 20, 4)]);
    machine.run_for(ms(5));
    commit.add(slice::from_ref(&photo)).expect("there is room");
    let again = |commit: &mut Commit| refusal(commit, &dag("photo", 10, 2));
    assert!(again(&mut commit).contains("dag `photo` is added to a run that has one of this name"));
    machine.run_for(ms(1)); // it executes
    commit.remove(&photo).expect("it is there");
    assert!(again(&mut commit).contains("remove that one first"));
    machine.run_for(ms(10));
    commit.add(&[dag("photo", 10, 2)]).expect("it has gone");
    assert_eq!(machine.run_for(ms(20)).violations(), []);
}
