//! Runs that their own functions change, on Linux: orders and counts.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use fass::{Entrance, Modes, Shutdown, SubtaskAttributes, Switch};
use fass::{create_dag, finish_create_dags, shutting_down};
use linux::{Linux, Mechanism};
use sched_dag::DagId;
use sched_dag::journal::What;
use support::{Alone, alone_on, ms};

/// On one core, on two, and on two that are divided: there what asks is in cluster 0, and all that
/// it asks for in the other one.
const SETTINGS: [(Mechanism, &[u32]); 5] = [
    (Mechanism::Normal, &[1]),
    (Mechanism::Fifo, &[2]),
    (Mechanism::Normal, &[1, 1]),
    (Mechanism::Fifo, &[1, 1]),
    (Mechanism::Poll, &[1, 1]),
];

fn machine(mechanism: Mechanism, sizes: &[u32]) -> Alone {
    let share = || Linux::sharing(sizes.iter().sum(), mechanism);
    alone_on(|| share().expect("there is a processor").clusters(sizes))
}

/// Returns the last cluster.
fn last(sizes: &[u32]) -> u32 {
    u32::try_from(sizes.len() - 1).expect("few")
}

#[test]
fn functions_pause_and_resume_a_dag_and_shut_the_run_down() {
    for (mechanism, sizes) in SETTINGS {
        let alone = machine(mechanism, sizes);
        let named = SubtaskAttributes::named;
        let ticks = create_dag();
        ticks
            .name("ticks")
            .period(ms(1))
            .relative_deadline(ms(1))
            .starts_paused()
            .cluster(last(sizes));
        let ticked = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&ticked);
        let tick = move |_job| _ = count.fetch_add(1, Relaxed);
        ticks.register_untyped_subtask(tick, named("tick").priority(1));
        let asks = create_dag();
        asks.name("asks").period(ms(10)).relative_deadline(ms(10));
        asks.cluster(0);
        let mut step = 0;
        let ask = move |(mut ticks, mut shutdown): (Switch<'_>, Shutdown<'_>), _job| {
            match step {
                0 => ticks.resume(),
                // However slow this computer is.
                1 if ticked.load(Relaxed) < 3 => return,
                1 => ticks.pause(),
                _ => shutdown.request(),
            }
            step += 1;
        };
        asks.using((ticks.switching(), shutting_down()))
            .register_untyped_subtask(ask, named("ask").priority(0));
        finish_create_dags(&[ticks, asks]).unwrap();

        let run = alone.machine.run().unwrap();
        assert_eq!(run.violations().count(), 0);
        let [ticks, asks] = [0, 1].map(|dag| *run.statistics(DagId(dag)));
        assert!(ticks.released >= 3 && ticks.skips > 0, "{ticks:?}");
        assert_eq!(ticks.released, ticks.completed);
        assert!(asks.completed >= 3, "{asks:?}");
        let of_life = |what: &What| matches!(what, What::Off | What::On | What::Closed);
        let whats = run.journal().events().map(|event| event.what);
        let changes: Vec<What> = whats.filter(of_life).collect();
        let expected = [What::Off, What::On, What::Off, What::Closed, What::Closed];
        assert_eq!(changes, expected);
    }
}

#[test]
fn functions_enter_modes_when_idle_and_at_once() {
    for (mechanism, sizes) in SETTINGS {
        let alone = machine(mechanism, sizes);
        let named = SubtaskAttributes::named;
        let ticking = |name| {
            let ticked = Arc::new(AtomicU64::new(0));
            let count = Arc::clone(&ticked);
            let dag = create_dag();
            dag.name(name).period(ms(1)).relative_deadline(ms(1));
            dag.cluster(last(sizes));
            let tick = move |_job| _ = count.fetch_add(1, Relaxed);
            dag.register_untyped_subtask(tick, named("tick").priority(1));
            (dag, ticked)
        };
        let (cruise, _) = ticking("cruise");
        let (descend, descended) = ticking("descend");
        let modes = Modes::new();
        let flight = modes.mode("flight", &[&cruise]);
        let landing = modes.mode("landing", &[&descend]);
        let asks = create_dag();
        asks.name("asks").period(ms(10)).relative_deadline(ms(10));
        asks.cluster(0);
        type Uses<'a> = (Entrance<'a>, Entrance<'a>, Shutdown<'a>);
        let mut step = 0;
        let ask = move |(mut flight, mut landing, mut shutdown): Uses<'_>, _job| {
            match step {
                0 => landing.when_idle(),
                // However slow this computer is.
                1 if descended.load(Relaxed) == 0 => return,
                1 => flight.at_once(),
                _ => shutdown.request(),
            }
            step += 1;
        };
        asks.using((flight.entering(), landing.entering(), shutting_down()))
            .register_untyped_subtask(ask, named("ask").priority(0));
        finish_create_dags(&[cruise, descend, asks]).unwrap();

        let run = alone.machine.run().unwrap();
        assert_eq!(run.violations().count(), 0);
        let events = run.journal().events();
        let entered = events.filter(|event| event.what == What::Entered);
        let entered: Vec<u64> = entered.map(|event| event.job).collect();
        assert_eq!(entered, [0, 1, 0]);
    }
}

#[test]
fn dags_of_modes_are_in_one_cluster() {
    let alone = machine(Mechanism::Normal, &[1, 1]);
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
