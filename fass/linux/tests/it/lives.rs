//! Lives of runs: what can happen to one from within and from outside, and what goes on regardless.
//! (Random runs are paused, resumed and ended from outside, too; a console shows topics in `gait`.)

use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::thread;

use crate::support::{alone, alone_on, breaches, chain, mechanisms, ms};
use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use linux::{Linux, Mechanism};
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, DagPhase, SchedulerQuery};

#[test]
fn a_chain_on_one_core_wakes_nobody() {
    for mechanism in mechanisms() {
        let alone = alone(1, mechanism);
        finish_create_dags(&[chain("chain", 12, 40, ms(2), 10)]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!(breaches(&run), []);
        let (releases, counts) = (run.statistics("chain").completed, run.counts());
        assert!(
            counts.calls <= releases && counts.hand_offs > 0,
            "{counts:?}"
        );
    }
}

#[test]
fn the_runs_time_skips_what_is_idle() {
    for sizes in [&[1][..], &[2], &[1, 1]] {
        let share = || Linux::sharing(sizes.iter().sum(), Mechanism::Poll).unwrap();
        let alone = alone_on(|| {
            share()
                .with(|terms| terms.divide(sizes))
                .skipping_idle_time()
        });
        let clusters = (0..).take(sizes.len());
        let dags: Vec<_> = clusters
            .map(|cluster| {
                let dag = chain(&format!("dag {cluster}"), 3, 500, ms(3_600_000), 0);
                dag.in_flight(1).cluster(cluster).clone()
            })
            .collect();
        finish_create_dags(&dags).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!(breaches(&run), []);
        for dag in &dags {
            let of = run.statistics(dag);
            assert_eq!((of.completed, of.misses, of.faults), (500, 0, 0));
        }
    }
}

#[test]
fn s1_signals_come_from_other_threads_and_from_files() {
    let alone = alone(1, Mechanism::Fifo);
    let (mut near, far) = UnixStream::pair().unwrap();
    let heard = Arc::new(AtomicU64::new(0));
    let dag = create_dag();
    dag.name("answer").jobs(2).relative_deadline(ms(5));
    let (count, mut source) = (Arc::clone(&heard), far.try_clone().unwrap());
    let function = move || {
        let mut byte = [0];
        if count.fetch_add(1, Relaxed) == 0 {
            source.read_exact(&mut byte).unwrap();
        }
    };
    let named = SubtaskAttributes::named("answer");
    let signal = dag.sporadic(ms(1));
    dag.source(function).register(named);
    finish_create_dags(&[dag]).unwrap();
    alone.machine.raise_on_input(&signal, &far).unwrap();
    let (first, of_thread) = (Arc::clone(&heard), signal.clone());
    thread::spawn(move || {
        near.write_all(b"x").unwrap();
        while first.load(Relaxed) == 0 {
            thread::yield_now();
        }
        of_thread.raise();
    });
    let run = alone.machine.run().unwrap();
    assert_eq!(run.violations().count(), 0);
    assert_eq!(run.statistics("answer").completed, 2);
    assert_eq!(heard.load(Relaxed), 2);
}

#[test]
fn what_was_asked_for_is_there_once_its_letter_is_taken() {
    let alone = alone(1, Mechanism::Normal);
    let endless = chain("endless", 1, 1_000_000, ms(1), 10);
    finish_create_dags(&[endless]).unwrap();
    let control = alone.machine.control().unwrap();
    let person = thread::spawn(move || {
        let dag = DagId(0);
        let is_there = |request: fn(DagId) -> Request, phase| {
            control.change(dag, request);
            control.wait_for_letters(dag);
            let mut found = None;
            control.ask(0, SchedulerQuery::Dag(dag, &mut found));
            found.is_some_and(|dag| dag.phase == phase)
        };
        // In a step, or in the answer, either would be refused under the scheduler's lock.
        let nobody = SchedulerQuery::Dag(DagId(1), &mut None);
        assert_eq!(control.ask(0, nobody), None);
        assert!((control.ask(0, SchedulerQuery::Events(u64::MAX, &mut [None]))).is_some());
        let asks = AssertUnwindSafe(|| control.change(dag, Request::Signal));
        assert!(catch_unwind(asks).is_err());
        let late = (0..100).filter(|_| {
            let is_paused = is_there(Request::Pause, DagPhase::Paused);
            !(is_there(Request::Resume, DagPhase::Running) && is_paused)
        });
        let late = late.count();
        control.end(dag);
        late
    });
    alone.machine.run().unwrap();
    assert_eq!(person.join().unwrap(), 0, "changes were not there yet");
}

#[test]
fn nobody_pauses_a_set_with_a_certificate() {
    let alone = alone(1, Mechanism::Normal);
    (alone.machine).change(|terms| terms.certificate = Some("certificate v1 of 0\n".into()));
    finish_create_dags(&[chain("tick", 1, 3, ms(1), 10)]).unwrap();
    let control = alone.machine.control().unwrap();
    let asks = AssertUnwindSafe(|| control.change(DagId(0), Request::Pause));
    assert!(catch_unwind(asks).is_err());
    let run = alone.machine.run().unwrap();
    assert_eq!(run.statistics("tick").completed, 3);
}

#[test]
fn after_a_run_there_can_be_another() {
    for _ in 0..3 {
        let alone = alone(1, Mechanism::Normal);
        finish_create_dags(&[chain("tick", 1, 3, ms(1), 10)]).unwrap();
        assert_eq!(alone.machine.run().unwrap().statistics("tick").completed, 3);
        let error = alone.machine.run().unwrap_err();
        assert!(error.to_string().starts_with("nothing is committed"));
        finish_create_dags(&[chain("tick", 1, 2, ms(1), 10)]).unwrap();
        assert_eq!(alone.machine.run().unwrap().statistics("tick").completed, 2);
    }
}
