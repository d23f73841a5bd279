//! Runs on real cores obey the rules, whatever else the computer does meanwhile.
//!
//! Orders and counts are asserted, never durations.

mod support;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use fass::{
    Dag, Occupation, OverrunPolicy, Policy, SubtaskAttributes, create_dag, execute_for,
    finish_create_dags,
};
use linux::{Linux, Mechanism, Run};
use sched_dag::DagId;
use support::{ALL, alone, alone_on, breaches, ms, spin, ticking};

/// One source, two branches of `us` each, and a sink that checks what it joins.
fn fork_join(jobs: u64, us: u64) -> (Dag, Arc<AtomicU64>) {
    let dag = create_dag();
    dag.name("fork-join").jobs(jobs);
    let mut job = 0_u64;
    let source = move || {
        job += 1;
        (job,)
    };
    let named = SubtaskAttributes::named;
    dag.register_periodic_subtask(source, vec!["job"], ms(5), named("source"));
    for branch in ["left", "right"] {
        let work = move |(job,): (u64,)| {
            spin(us);
            (job,)
        };
        dag.register_subtask(work, vec!["job"], vec![branch], named(branch));
    }
    let joined = Arc::new(AtomicU64::new(0));
    let count = Arc::clone(&joined);
    let sink = move |(left, right): (u64, u64)| {
        assert_eq!(left, right, "two jobs were mixed");
        count.fetch_add(1, Relaxed);
    };
    dag.register_sink_subtask(sink, vec!["left", "right"], ms(5), named("sink"));
    (dag, joined)
}

fn assert_lawful(run: &Run) {
    let found = breaches(run);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn r2_every_job_is_joined_under_both_mechanisms_and_policies() {
    for mechanism in ALL {
        for policy in [Policy::StaticPriority, Policy::Edf] {
            let alone = alone(2, mechanism).with(|machine| machine.policy(policy));
            let (dag, joined) = fork_join(30, 300);
            finish_create_dags(&[dag]).unwrap();
            let run = alone.machine.run().unwrap();
            assert_lawful(&run);
            let statistics = run.statistics(DagId(0));
            assert_eq!(statistics.completed, joined.load(Relaxed));
            assert_eq!(statistics.completed, 30, "a late release waits");
        }
    }
}

#[test]
fn cores_that_share_a_processor_keep_the_rules_while_they_hold() {
    let share = || Linux::sharing(5, Mechanism::Fifo).expect("there is a processor");
    let alone = alone_on(share);
    assert_eq!(alone.machine.cores(), 5);
    let dags: Vec<Dag> = (0..6)
        .map(|number| {
            let dag = create_dag();
            dag.name(&format!("dag {number}")).jobs(20);
            dag.period(ms(4)).relative_deadline(ms(4));
            let attributes = SubtaskAttributes::named("holds").priority(number);
            dag.register_untyped_subtask(|_| execute_for(ms(2), Occupation::Hold), attributes);
            dag
        })
        .collect();
    finish_create_dags(&dags).unwrap();
    let run = alone.machine.run().unwrap();
    assert_lawful(&run);
    let cores: BTreeSet<u32> = run.journal().events().map(|event| event.core.0).collect();
    assert_eq!(cores.len(), 5, "all have had something to do");
}

#[test]
fn r5_the_urgent_one_takes_the_core_in_mid_function() {
    let alone = alone(1, Mechanism::Fifo);
    if !alone.machine.is_preemptive() {
        eprintln!("skipped: {}", alone.machine.warnings().join("\n"));
        return;
    }
    let urgent = ticking("urgent", 40, ms(3), 0, 200);
    let long = ticking("long", 4, ms(30), 9, 12_000);
    finish_create_dags(&[urgent, long]).unwrap();
    let run = alone.machine.run().unwrap();
    assert_lawful(&run);
    assert_eq!(run.statistics(DagId(1)).completed, 4);
    assert!(run.counts().preemptions > 0, "{:?}", run.counts());
}

#[test]
fn r5_without_preemption_a_function_keeps_its_core() {
    let alone = alone(1, Mechanism::Normal);
    let urgent = ticking("urgent", 20, ms(3), 0, 200);
    let long = ticking("long", 3, ms(20), 9, 8_000);
    finish_create_dags(&[urgent, long]).unwrap();
    let run = alone.machine.run().unwrap();
    assert_lawful(&run);
    assert_eq!(run.counts().preemptions, 0);
}

#[test]
fn a_chain_on_one_core_wakes_nobody() {
    const LENGTH: u64 = 12;
    const JOBS: u64 = 40;
    for mechanism in ALL {
        let alone = alone(1, mechanism);
        let dag = create_dag();
        dag.name("chain")
            .jobs(JOBS)
            .period(ms(2))
            .relative_deadline(ms(2));
        let named = |link| SubtaskAttributes::named(&format!("link {link}"));
        let links: Vec<_> = (0..LENGTH)
            .map(|link| dag.register_untyped_subtask(|_job| spin(10), named(link)))
            .collect();
        for pair in links.windows(2) {
            dag.precede(&pair[0], &pair[1]);
        }
        finish_create_dags(&[dag]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_lawful(&run);
        let completed = run.statistics(DagId(0)).completed;
        let counts = run.counts();
        assert!(
            counts.calls <= completed,
            "one for each release: {counts:?}"
        );
        assert!(counts.hand_offs > 0, "{counts:?}");
    }
}

#[test]
fn overload_goes_as_each_policy_says() {
    for overrun in [
        OverrunPolicy::Queue,
        OverrunPolicy::Skip,
        OverrunPolicy::Abort,
    ] {
        let alone = alone(2, Mechanism::Fifo);
        let dag = create_dag();
        dag.name("late").jobs(30).in_flight(2).overrun(overrun);
        dag.period(ms(1)).relative_deadline(ms(1));
        let first = dag.register_untyped_subtask(|_| spin(1_500), SubtaskAttributes::named("a"));
        let second = dag.register_untyped_subtask(|_| spin(1_500), SubtaskAttributes::named("b"));
        dag.precede(&first, &second);
        let other = ticking("other", 20, ms(2), 1, 100);
        finish_create_dags(&[dag, other]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_lawful(&run);
        let statistics = run.statistics(DagId(0));
        match overrun {
            OverrunPolicy::Queue => assert_eq!(statistics.completed, 30),
            OverrunPolicy::Skip => assert!(statistics.skips > 0),
            OverrunPolicy::Abort => assert!(statistics.completed < 30),
        }
    }
}
