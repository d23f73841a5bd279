//! Two clusters of cores, of which one has more to do than it can.
//!
//! Each job of `writer`, in cluster 0, shows a latest value and raises the signal of `answers`
//! in cluster 1, which raises the one of `echoes` back in cluster 0. `reader`, in cluster 1,
//! samples the value. `overload` has what is left of cluster 1, which is far from enough.
//! [`auto`] leaves clusters to the commit.

use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{
    ConstructionPolicy, Dag, OverrunPolicy, Raiser, Sample, Signal, SubtaskAttributes, create_dag,
    finish_create_dags, finish_create_dags_with,
};
use kernel::{Ending, Machine, Run, json};
use sched_dag::DagId;

use crate::times::hold;

const JOBS: u64 = 40;

const PERIOD: Duration = Duration::from_millis(5);

/// For how long an instance may be owed a core.
const BOUND_NS: u64 = 1_000_000;

/// A value that cannot be half written without showing it.
#[derive(Clone)]
struct Whole([u64; 16]);

/// Runs the two clusters.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let (echoes, echo) = sporadic("echoes", 0, None);
    let (answers, answer) = sporadic("answers", 1, Some(&echo));
    let writer = create_dag();
    writer
        .name("writer")
        .cluster(0)
        .jobs(JOBS)
        .relative_deadline(PERIOD);
    let mut written = 0;
    let write = move |mut answer: Raiser<'_>| {
        hold(500);
        answer.raise();
        written += 1;
        (Whole([written; 16]),)
    };
    let whole = vec!["whole"];
    writer
        .period(PERIOD)
        .using(answer.raising())
        .source(write)
        .writes(&whole)
        .register(priority(1));
    let latest = writer.latest::<Whole>("whole");
    let reader = create_dag();
    let looks = Duration::from_micros(2300);
    reader
        .name("reader")
        .cluster(1)
        .jobs(2 * JOBS)
        .relative_deadline(looks);
    let seen = Arc::new(AtomicU64::new(0));
    let mut last = None;
    let read = {
        let seen = Arc::clone(&seen);
        move |whole: Option<Sample<'_, Whole>>| {
            let Some(whole) = whole else { return };
            assert!(whole.completed_ns <= fass::now_ns(), "complete");
            assert_eq!(whole.value.0, [whole.job + 1; 16], "whole, of its job");
            assert!(last <= Some(whole.job), "never backwards");
            seen.fetch_add(u64::from(last < Some(whole.job)), Ordering::Relaxed);
            last = Some(whole.job);
        }
    };
    reader
        .period(looks)
        .using(latest.sample())
        .source(read)
        .register(priority(1));
    finish_create_dags(&[writer, echoes, answers, reader, overload()])?;
    let run = machine.run()?;
    report(&run, seen.load(Ordering::Relaxed));
    Ok(())
}

fn priority(priority: u32) -> SubtaskAttributes {
    SubtaskAttributes::default().priority(priority)
}

/// A DAG that a signal releases, and that may raise another one.
fn sporadic(name: &str, cluster: u32, raises: Option<&Signal>) -> (Dag, Signal) {
    let least = Duration::from_millis(1);
    let dag = create_dag();
    dag.name(name).cluster(cluster).relative_deadline(PERIOD);
    let signal = dag.sporadic(least);
    match raises {
        None => dag.source(|| hold(100)).register(priority(0)),
        Some(next) => {
            let answer = |mut next: Raiser<'_>| {
                hold(100);
                next.raise();
            };
            let source = dag.using(next.raising()).source(answer);
            source.register(priority(0));
        }
    }
    (dag, signal)
}

/// Four subtasks of 3 ms each 2 ms, for two cores.
fn overload() -> Dag {
    let period = Duration::from_millis(2);
    let dag = create_dag();
    dag.name("overload")
        .cluster(1)
        .jobs(2 * JOBS)
        .relative_deadline(period)
        .overrun(OverrunPolicy::Skip);
    dag.register_periodic_subtask(|| ((),), vec!["tick"], period, priority(9));
    let outputs = ["a", "b", "c", "d"];
    for output in outputs {
        let work = |((),): ((),)| {
            hold(3000);
            ((),)
        };
        dag.register_subtask(work, vec!["tick"], vec![output], priority(9));
    }
    let join = |((), (), (), ()): ((), (), (), ())| ();
    dag.register_sink_subtask(join, outputs.to_vec(), period, priority(9));
    dag
}

fn report(run: &Run, seen: u64) {
    let violations = run.violations().inspect(|it| kernel::println!("{it}"));
    let violations = violations.count() as u64;
    let owed = run.dispatch_violations(BOUND_NS).unwrap_or_default();
    owed.iter().for_each(|it| kernel::println!("{it}"));
    json::emit("clusters", |line| {
        line.number("violations", violations + owed.len() as u64)
            .number("allocations", run.allocations())
            .number("seen", seen);
    });
    for (dag, model) in (0..).map(DagId).zip(run.task_set().dags()) {
        let of = run.statistics(dag);
        json::emit("of_dag", |line| {
            line.text("name", model.name())
                .number("completed", of.completed)
                .number("misses", of.misses)
                .number("skips", of.skips)
                .number("signals", of.signals)
                .number("dropped", of.dropped_signals);
        });
    }
}

/// Commits a DAG that needs two cores and two that share one, none of which states a cluster.
pub(crate) fn auto(machine: &Machine) -> Result<(), Ending> {
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let dags = [("light", 1, 2), ("heavy", 3, 4), ("lighter", 1, 1)];
    let dags = dags.map(|(name, branches, wcet_ms)| {
        let period = Duration::from_millis(10);
        let dag = create_dag();
        dag.name(name)
            .jobs(3)
            .period(period)
            .relative_deadline(period);
        for _ in 0..branches {
            let taking = priority(1).wcet(Duration::from_millis(wcet_ms));
            dag.register_untyped_subtask(|_job| hold(500), taking);
        }
        dag
    });
    let commit = finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
    for answer in commit.answers() {
        kernel::println!("{answer}");
    }
    let run = machine.run()?;
    report(&run, 0);
    Ok(())
}
