//! Cores that are divided: each cluster keeps the rules by itself, and hears of the others.
//!
//! Orders and counts are asserted, never durations.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use fass::{
    Dag, Occupation, Policy, Raiser, Sample, SubtaskAttributes, create_dag, execute_for,
    finish_create_dags,
};
use linux::{Linux, Mechanism, Run};
use sched_dag::DagId;
use sched_dag::journal::What;
use support::{ALL, Alone, alone_on, breaches, ms};

/// The divisions that all is tried in.
const DIVISIONS: [&[u32]; 4] = [&[1, 1], &[2, 1], &[1, 2], &[2, 1, 1]];

/// Calls a test with a machine of each division, under each mechanism and policy, and how many
/// clusters it has. Cores may share a processor, so what runs there holds and does not compute.
fn in_all_divisions(test: impl Fn(Alone, u32)) {
    for sizes in DIVISIONS {
        for mechanism in ALL {
            for policy in [Policy::StaticPriority, Policy::Edf] {
                let cores = sizes.iter().sum();
                let share = || Linux::sharing(cores, mechanism).expect("there is a processor");
                let alone = alone_on(|| share().policy(policy).clusters(sizes));
                test(alone, u32::try_from(sizes.len()).expect("few"));
            }
        }
    }
}

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

/// A fork and a join in a cluster, each part of which holds its core for a while.
fn fork_join(cluster: u32, jobs: u64) -> Dag {
    let dag = create_dag();
    dag.name(&format!("fork-join {cluster}"));
    dag.cluster(cluster).jobs(jobs);
    let topic = |name: &str| format!("{name} {cluster}");
    let [own, left, right] = ["job", "left", "right"].map(topic);
    let mut job = 0_u64;
    let source = move || {
        job += 1;
        (job,)
    };
    dag.register_periodic_subtask(source, vec![&own], ms(4), named("source"));
    for branch in [&left, &right] {
        let work = |(job,): (u64,)| {
            execute_for(Duration::from_micros(500), Occupation::Hold);
            (job,)
        };
        dag.register_subtask(work, vec![&own], vec![branch], named(branch));
    }
    let join = |(left, right): (u64, u64)| assert_eq!(left, right, "two jobs were mixed");
    dag.register_sink_subtask(join, vec![&left, &right], ms(4), named("sink"));
    dag
}

#[test]
fn each_cluster_keeps_the_rules_on_its_own_cores() {
    in_all_divisions(|alone, clusters| {
        let dags: Vec<Dag> = (0..clusters)
            .map(|cluster| fork_join(cluster, 15))
            .collect();
        finish_create_dags(&dags).unwrap();
        let run = alone.machine.run().unwrap();
        assert_lawful(&run);
        for dag in (0..clusters).map(DagId) {
            assert_eq!(run.statistics(dag).completed, 15);
        }
    });
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
    assert_eq!(run.statistics(DagId(1)).completed, 20);
    let events: Vec<_> = run.journal().events().collect();
    let last = |dag| events.iter().rposition(|event| event.dag == DagId(dag));
    assert!(last(0) > last(1), "it has waited for that");
}

#[test]
fn signals_and_latest_values_go_to_and_fro() {
    const ROUNDS: u64 = 25;
    in_all_divisions(|alone, clusters| {
        let [ping, pong] = [("ping", 0), ("pong", clusters - 1)].map(|(name, cluster)| {
            let dag = create_dag();
            dag.name(name).cluster(cluster).jobs(ROUNDS);
            dag.relative_deadline(ms(5));
            dag
        });
        let beat = Duration::from_micros(100);
        let to_pong = pong.sporadic(beat);
        let mut count = 0_u64;
        let tell = move |mut there: Raiser<'_>| {
            there.raise();
            count += 1;
            (count - 1,)
        };
        let to_ping = ping.using(to_pong.raising()).register_sporadic_subtask(
            tell,
            vec!["count"],
            beat,
            named("tell"),
        );
        ping.register_sink_subtask(|_: (u64,)| (), vec!["count"], ms(5), named("end"));
        let hear = |(sample, mut back): (Option<Sample<'_, u64>>, Raiser<'_>), job| {
            // The signal was raised by the very job whose value is there.
            let sample = sample.expect("it shows before the signal counts");
            assert_eq!((*sample.value, sample.job), (job, job));
            back.raise();
        };
        pong.using((ping.latest("count").sample(), to_ping.raising()))
            .register_untyped_subtask(hear, named("hear"));
        let begin = create_dag();
        begin.name("begin").cluster(clusters - 1).jobs(1);
        begin.period(ms(1)).relative_deadline(ms(1));
        let raise = |mut signal: Raiser<'_>, _job| signal.raise();
        begin
            .using(to_ping.raising())
            .register_untyped_subtask(raise, named("begin"));
        finish_create_dags(&[ping, pong, begin]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_lawful(&run);
        let completed = [0, 1, 2].map(|dag| run.statistics(DagId(dag)).completed);
        assert_eq!(completed, [ROUNDS, ROUNDS, 1]);
    });
}

#[test]
fn each_signal_to_another_cluster_is_counted() {
    let share = || Linux::sharing(2, Mechanism::Fifo).expect("there is a processor");
    let alone = alone_on(|| share().clusters(&[1, 1]));
    let hears = create_dag();
    hears.name("hears").cluster(1);
    hears.relative_deadline(ms(1));
    let signal = hears.register_sporadic_subtask(|| (), vec![], ms(1), named("hear"));
    let tells = create_dag();
    tells.name("tells").cluster(0).jobs(40);
    tells
        .period(Duration::from_micros(200))
        .relative_deadline(ms(1));
    let raise = |mut signal: Raiser<'_>, _job| signal.raise();
    tells
        .using(signal.raising())
        .register_untyped_subtask(raise, named("tell"));
    finish_create_dags(&[hears, tells]).unwrap();
    let run = alone.machine.run().unwrap();
    assert_lawful(&run);
    let hears = run.statistics(DagId(0));
    assert_eq!(hears.signals, 40);
    assert_eq!(hears.completed + hears.dropped_signals, 40);
    assert!(hears.completed > 0);
}

#[test]
fn a_fault_is_handled_in_another_cluster() {
    let share = || Linux::sharing(2, Mechanism::Fifo).expect("there is a processor");
    let alone = alone_on(|| share().clusters(&[1, 1]));
    let handles = create_dag();
    handles
        .name("handles")
        .cluster(1)
        .jobs(1)
        .relative_deadline(ms(1));
    let signal = handles.register_sporadic_subtask(|| (), vec![], ms(1), named("handle"));
    let fails = create_dag();
    fails.name("fails").cluster(0).jobs(10).on_fault(&signal);
    fails.period(ms(1)).relative_deadline(ms(1));
    fails.register_untyped_subtask(|job| assert!(job < 3, "meant"), named("fail"));
    finish_create_dags(&[handles, fails]).unwrap();
    let run = alone.machine.run().unwrap();
    assert_lawful(&run);
    assert_eq!(run.faults().len(), 1);
    assert_eq!(run.statistics(DagId(0)).completed, 1);
    assert_eq!(run.statistics(DagId(1)).completed, 3);
}

#[test]
fn a_cluster_is_paused_and_stopped_from_outside_like_any() {
    let share = || Linux::sharing(2, Mechanism::Normal).expect("there is a processor");
    let alone = alone_on(|| share().clusters(&[1, 1]));
    let dags = [0, 1].map(|cluster| {
        let dag = create_dag();
        dag.name("endless")
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
        control.pause(DagId(1));
        std::thread::sleep(ms(10));
        control.stop(DagId(0));
        control.stop(DagId(1));
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
