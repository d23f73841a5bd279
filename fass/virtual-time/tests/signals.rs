//! Signals that release sporadic DAGs, in virtual time.

mod support;

use support::run;

use fass::{Dag, Raiser, create_dag, finish_create_dags};
use support::sharing::{ms, named, work};
use virtual_time::VirtualTime;

#[test]
fn a_signal_takes_effect_at_the_completion_that_raises_it() {
    let machine = VirtualTime::new().cores(2);
    let answers = create_dag();
    answers.name("answers").relative_deadline(ms(5));
    let event = answers.sporadic(ms(15));
    answers.source(|| work(1)).register(named("answer"));
    let asks = create_dag();
    asks.name("asks").jobs(4).relative_deadline(ms(10));
    asks.period(ms(10))
        .using(event.raising())
        .source(|mut event: Raiser<'_>| {
            event.raise();
            work(3);
        })
        .register(named("ask"));
    let report = run(&machine, &[answers, asks]);
    let answers = report.dag("answers");
    let releases = answers.jobs();
    let releases: Vec<u64> = releases.map(|job| job.release_ns / 1_000_000).collect();
    // Raised at 3, 13, 23 and 33 ms; 13 waits for 18, and 23 for 33, which drops 33.
    assert_eq!(releases, [3, 18, 33]);
    assert_eq!(report.dag("answers").statistics().dropped_signals, 1);
    let lines = report.event_lines();
    assert!(lines.contains(&"13000000 signalled answers[1]".to_owned()));
}

#[test]
fn a_chain_of_signals_runs_on_at_the_minimum_distance() {
    let machine = VirtualTime::new();
    let dags: Vec<Dag> = (0..3).map(|_| create_dag()).collect();
    let signals = dags.iter().enumerate().map(|(index, dag)| {
        dag.name(&format!("stage {index}")).jobs(3);
        dag.sporadic(ms(10))
    });
    let signals: Vec<_> = signals.collect();
    for (index, dag) in dags.iter().enumerate() {
        dag.relative_deadline(ms(10));
        if let Some(next) = signals.get(index + 1) {
            dag.using(next.raising()).register_untyped_subtask(
                |mut next: Raiser<'_>, _job| {
                    work(1);
                    next.raise();
                },
                named("stage"),
            );
        } else {
            let _ = dag.register_untyped_subtask(|_job| work(1), named("stage"));
        }
    }
    finish_create_dags(&dags).unwrap();
    for at_ms in [0, 1, 30] {
        machine.raise_at(&signals[0], ms(at_ms));
    }
    let report = machine.run();
    assert_eq!(report.violations(), []);
    for (stage, expected) in [[0, 10, 30], [1, 11, 31], [2, 12, 32]].iter().enumerate() {
        let jobs = report.jobs.iter().filter(|job| job.dag.index() == stage);
        let releases: Vec<u64> = jobs.map(|job| job.release_ns / 1_000_000).collect();
        assert_eq!(releases, expected);
    }
}

#[test]
fn a_subtask_cannot_raise_a_signal_behind_the_models_back() {
    let machine = VirtualTime::new().contain_panics();
    let answers = create_dag();
    answers.relative_deadline(ms(5));
    let event = answers.sporadic(ms(15));
    answers.source(|| ()).register(named("answer"));
    let asks = create_dag();
    asks.jobs(1).relative_deadline(ms(10));
    asks.register_periodic_subtask(move || event.raise(), vec![], ms(10), named("ask"));
    let report = run(&machine, &[answers, asks]);
    assert!(
        report.panics[0]
            .message
            .contains("dag.using(signal.raising())")
    );
}
