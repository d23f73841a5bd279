//! What instances share besides their edges, on threads: signals, latest values, states.
//!
//! Signals and latest values take effect when the instance is complete, neither earlier
//! nor later: so a sporadic DAG that a signal releases finds the value of the very job
//! that raised it. A state is never claimed by two, also where jobs are aborted.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use fass::{
    Dag, Latest, OverrunPolicy, Policy, Raiser, Sample, Signal, SubtaskAttributes, create_dag,
    finish_create_dags,
};
use native::{Native, Report};

const JOBS: u64 = 500;
const PERIOD: Duration = Duration::from_micros(10);
const SHORTER: Duration = Duration::from_micros(3);

fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

/// Runs what `commit` commits in all settings, at full speed and written down.
fn in_all_settings(commit: impl Fn() -> Box<dyn Fn(&Report)>) {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for workers in 1..=3 {
            let machine = Native::new().workers(workers).policy(policy);
            let judge = commit();
            judge(&machine.run());
            let machine = Native::new().workers(workers).policy(policy);
            let judge = commit();
            let recorded = machine.run_recorded();
            assert_eq!(recorded.violations, [], "{policy:?}, {workers} workers");
            judge(&recorded.report);
        }
    }
}

/// A sporadic DAG of two subtasks that counts its runs and samples what has raised it.
fn answering(name: &str, latest: &Latest<u64>, runs: &Arc<AtomicU64>) -> (Dag, Signal) {
    let dag = create_dag();
    dag.name(name).jobs(JOBS).relative_deadline(SHORTER);
    let signal = dag.register_sporadic_subtask(|| (7u64,), vec![name], SHORTER, named("wake"));
    let runs = Arc::clone(runs);
    dag.using(latest.sample()).register_sink_subtask(
        move |sample: Option<Sample<'_, u64>>, (own,): (u64,)| {
            let job = runs.fetch_add(1, Relaxed);
            let sample = sample.expect("it shows at the completion that raised the signal");
            assert_eq!((*sample.value, sample.job, own), (job, job, 7));
            assert!(sample.completed_ns <= fass::now_ns());
        },
        vec![name],
        SHORTER,
        named("answer"),
    );
    (dag, signal)
}

#[test]
fn signals_and_latest_values_take_effect_at_the_same_completion() {
    in_all_settings(|| {
        let asks = create_dag();
        asks.name("asks").jobs(JOBS);
        let latest = asks.latest("count");
        let runs: [Arc<AtomicU64>; 2] = Default::default();
        let (one, to_one) = answering("one", &latest, &runs[0]);
        let (other, to_other) = answering("other", &latest, &runs[1]);
        asks.register_periodic_subtask(|| (1u64,), vec!["tick"], PERIOD, named("clock"));
        let mut count = 0u64;
        asks.using((to_one.raising(), to_other.raising()))
            .register_subtask(
                move |(mut one, mut other): (Raiser<'_>, Raiser<'_>), (tick,): (u64,)| {
                    one.raise();
                    other.raise();
                    count += tick;
                    (count - 1,)
                },
                vec!["tick"],
                vec!["count"],
                named("ask"),
            );
        asks.register_sink_subtask(|_: (u64,)| (), vec!["count"], PERIOD, named("end"));
        finish_create_dags(&[one, other, asks]).expect("the DAGs are right");
        Box::new(move |report| {
            for of_dag in &report.statistics {
                assert_eq!((of_dag.completed, of_dag.misses), (JOBS, 0));
            }
            assert!(report.statistics[..2].iter().all(|of| of.signals == JOBS));
            assert!(runs.iter().all(|runs| runs.load(Relaxed) == JOBS));
        })
    });
}

#[test]
fn a_signal_too_soon_is_dropped_and_an_instance_that_raises_none_has_none() {
    in_all_settings(|| {
        let answers = create_dag();
        answers.name("answers").jobs(JOBS).relative_deadline(PERIOD);
        let signal = answers.register_sporadic_subtask(|| (), vec![], 2 * PERIOD, named("answer"));
        let asks = create_dag();
        asks.name("asks").jobs(JOBS).relative_deadline(PERIOD);
        let mut job = 0;
        asks.using(signal.raising()).register_periodic_subtask(
            move |mut signal: Raiser<'_>| {
                if job % 10 < 4 {
                    signal.raise();
                }
                job += 1;
            },
            vec![],
            PERIOD,
            named("ask"),
        );
        finish_create_dags(&[answers, asks]).expect("the DAGs are right");
        Box::new(|report| {
            let answers = &report.statistics[0];
            // Of four in a row, one finds another that is still kept.
            assert_eq!(answers.signals, JOBS / 10 * 4);
            assert_eq!(answers.dropped_signals, JOBS / 10);
            assert_eq!(answers.completed, JOBS / 10 * 3);
            assert_eq!(report.statistics[1].completed, JOBS);
        })
    });
}

/// A sporadic DAG without a limit, whose jobs are more urgent than what raises them.
fn without_a_limit() -> Native {
    let machine = Native::new().policy(Policy::Edf);
    let answers = create_dag();
    answers.name("answers").relative_deadline(SHORTER);
    let signal = answers.register_sporadic_subtask(|| (), vec![], SHORTER, named("answer"));
    let asks = create_dag();
    asks.name("asks").jobs(JOBS);
    asks.using(signal.raising()).register_periodic_subtask(
        |mut signal: Raiser<'_>| {
            signal.raise();
            (1u64,)
        },
        vec!["tick"],
        PERIOD,
        named("ask"),
    );
    asks.register_sink_subtask(|_: (u64,)| (), vec!["tick"], PERIOD, named("end"));
    finish_create_dags(&[answers, asks]).expect("the DAGs are right");
    machine
}

#[test]
fn a_sporadic_dag_without_a_limit_keeps_no_run_going() {
    let report = without_a_limit().run();
    assert_eq!(report.statistics[0].completed, JOBS);
}

#[test]
#[should_panic(expected = "dag `answers` has no limit of jobs and cannot be recorded")]
fn a_sporadic_dag_without_a_limit_is_not_recorded() {
    without_a_limit().run_recorded();
}

#[test]
fn nobody_finds_a_state_taken_though_jobs_are_aborted() {
    for workers in 1..=3 {
        let machine = Native::new().workers(workers);
        let dag = create_dag();
        dag.name("sharing").jobs(JOBS).in_flight(1);
        dag.overrun(OverrunPolicy::Abort);
        let period = Duration::from_nanos(2);
        // How often each of the three has changed it. They take turns, and a turn that
        // one loses by an abort the next ones lose, too.
        let turns = dag.state("turns", [0u64; 3]);
        dag.register_periodic_subtask(|| (1u64,), vec!["one"], period, named("source"));
        for (index, name) in ["a", "b", "c"].into_iter().enumerate() {
            dag.using(turns.update()).register_subtask(
                move |turns: &mut [u64; 3], (one,): (u64,)| {
                    turns[index] += one;
                    assert!(turns[0] >= turns[1] && turns[1] >= turns[2]);
                    (one,)
                },
                vec!["one"],
                vec![name],
                named(name),
            );
        }
        dag.using(turns.read()).register_sink_subtask(
            |turns: &[u64; 3], (a, b, c): (u64, u64, u64)| {
                assert_eq!((a, b, c), (1, 1, 1));
                assert!(turns[2] > 0);
            },
            vec!["a", "b", "c"],
            period,
            named("sink"),
        );
        finish_create_dags(&[dag]).expect("the DAG is right");
        let recorded = machine.run_recorded();
        assert_eq!(recorded.violations, [], "{workers} workers");
        assert!(recorded.report.statistics[0].aborts > 0);
    }
}

#[test]
fn a_signal_that_an_instance_uses_twice_is_one() {
    in_all_settings(|| {
        let answers = create_dag();
        answers
            .name("answers")
            .jobs(JOBS)
            .relative_deadline(SHORTER);
        let signal = answers.register_sporadic_subtask(|| (), vec![], SHORTER, named("answer"));
        let asks = create_dag();
        asks.name("asks").jobs(JOBS).relative_deadline(PERIOD);
        asks.using((signal.raising(), signal.raising()))
            .register_periodic_subtask(
                |(mut once, mut again): (Raiser<'_>, Raiser<'_>)| {
                    once.raise();
                    again.raise();
                },
                vec![],
                PERIOD,
                named("ask"),
            );
        finish_create_dags(&[answers, asks]).expect("a correct set");
        Box::new(|report| {
            let of_answers = &report.statistics[0];
            assert_eq!((of_answers.signals, of_answers.dropped_signals), (JOBS, 0));
        })
    });
}

#[test]
fn what_changes_a_run_is_refused_at_the_commit() {
    let machine = Native::new();
    let dag = create_dag();
    dag.jobs(1).period(PERIOD).relative_deadline(PERIOD);
    dag.starts_paused();
    dag.register_untyped_subtask(|_job| (), named("tick"));
    let error = finish_create_dags(&[dag]).expect_err("nothing here would resume it");
    drop(machine);
    let text = error.to_string();
    assert!(text.contains("which `Native` does not do"), "{text}");
}
