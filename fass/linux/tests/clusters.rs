//! Cores that are divided: each cluster keeps the rules by itself, and hears of the others.
//!
//! Orders and counts are asserted, never durations.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use fass::{
    Entrance, Modes, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags,
};
use linux::{Linux, Mechanism, Run};
use sched_dag::journal::What;
use support::{alone_on, breaches, ms};

fn assert_lawful(run: &Run) {
    let found = breaches(run);
    assert!(found.is_empty(), "{found:?}");
    // Nothing of a DAG was ever on a core of another cluster.
    let task_set = run.task_set();
    for event in run.journal().events() {
        let own = task_set.cores_of(task_set.dag(event.dag).cluster(), run.options().cores);
        assert!(own.contains(&event.core.0), "{event:?} is not on {own:?}");
    }
}

fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

#[test]
fn a_cluster_that_never_ends_a_job_keeps_no_other_from_its_own() {
    let share = || Linux::sharing(2, Mechanism::Fifo).expect("there is a processor");
    let alone = alone_on(|| share().clusters(&[1, 1]));
    let done = Arc::new(AtomicU64::new(0));
    let (count, seen) = (Arc::clone(&done), Arc::clone(&done));
    let waits = create_dag();
    waits.name("waits").cluster(0).jobs(1);
    waits.period(ms(1)).relative_deadline(ms(1));
    // It keeps its cluster's only core until the other cluster has done all that it has to do.
    let wait = move |_job| {
        while seen.load(Relaxed) < 20 {
            execute_for(ms(1), Occupation::Hold);
        }
    };
    waits.register_untyped_subtask(wait, named("wait").non_preemptive());
    let works = create_dag();
    works.name("works").cluster(1).jobs(20);
    works.period(ms(1)).relative_deadline(ms(1));
    works.register_untyped_subtask(move |_job| _ = count.fetch_add(1, Relaxed), named("work"));
    finish_create_dags(&[waits, works]).unwrap();
    let run = alone.machine.run().unwrap();
    assert_lawful(&run);
    assert_eq!(run.statistics("works").completed, 20);
    let events: Vec<_> = run.journal().events().collect();
    let last = |dag| {
        let dag = run.task_set().find(dag);
        events.iter().rposition(|event| event.dag == dag)
    };
    assert!(last("waits") > last("works"), "it has waited for that");
}

#[test]
fn a_cluster_is_paused_and_stopped_from_outside_like_any() {
    let share = || Linux::sharing(2, Mechanism::Normal).expect("there is a processor");
    let alone = alone_on(|| share().clusters(&[1, 1]));
    let dags = [("first", 0), ("second", 1)].map(|(name, cluster)| {
        let dag = create_dag();
        dag.name(name)
            .cluster(cluster)
            .period(ms(1))
            .relative_deadline(ms(1));
        dag.register_untyped_subtask(|_job| (), named("tick"));
        dag
    });
    finish_create_dags(&dags).unwrap();
    let control = alone.machine.control().expect("it is committed");
    let meddler = std::thread::spawn(move || {
        std::thread::sleep(ms(10));
        control.pause("second");
        std::thread::sleep(ms(10));
        control.stop("first");
        control.stop("second");
    });
    let run = alone.machine.run().unwrap();
    meddler.join().expect("it does not panic");
    assert_eq!(run.violations().count(), 0);
    let stopped = run
        .journal()
        .events()
        .filter(|event| event.what == What::Stopped);
    assert_eq!(stopped.count(), 2);
}

#[test]
fn dags_of_modes_are_in_one_cluster() {
    let alone = alone_on(|| {
        Linux::sharing(2, Mechanism::Normal)
            .expect("a machine")
            .clusters(&[1, 1])
    });
    let dags = [0, 1].map(|cluster| {
        let dag = create_dag();
        dag.name(&format!("dag {cluster}")).cluster(cluster);
        dag.jobs(1).period(ms(1)).relative_deadline(ms(1));
        dag
    });
    let modes = Modes::new();
    let first = modes.mode("first", &[&dags[0]]);
    modes.mode("second", &[&dags[1]]);
    let ask = |mut first: Entrance<'_>, _job| first.at_once();
    dags[0]
        .using(first.entering())
        .register_untyped_subtask(ask, SubtaskAttributes::named("ask"));
    dags[1].register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    let error = finish_create_dags(&dags).expect_err("they are in two");
    drop(alone);
    let text = error.to_string();
    let expected =
        "DAGs of several clusters are in modes; put all DAGs that are in a mode into one";
    assert!(text.contains(expected), "{text}");
}
