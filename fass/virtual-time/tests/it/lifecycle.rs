//! Changes that functions make to a run besides outputs: switches, signals; and those they may not.

use crate::support::{every, job_numbers, ms, named, run, ticking, work};
use fass::shared::Switch;
use fass::{Dag, create_dag};
use virtual_time::{EventKind, VirtualTime};

/// A DAG of one subtask that asks for something of another DAG in each job, every 20 ms.
fn asking(of: &Dag, mut ask: impl FnMut(Switch<'_>, u64) + Send + 'static) -> Dag {
    let dag = every(20, "asks");
    let function = move |switch: Switch<'_>, job| {
        ask(switch, job);
        work(1);
    };
    let using = dag.using(of.switching());
    using.register_untyped_subtask(function, named("ask"));
    dag
}

#[test]
fn l2_requests_are_served_in_the_order_in_which_the_uses_are_stated() {
    for (resumes_last, skips) in [(false, 2), (true, 0)] {
        let machine = VirtualTime::new().cores(2);
        let (ticks, asks) = (ticking("ticks", 1), every(20, "asks"));
        let function = move |(mut one, mut other): (Switch<'_>, Switch<'_>), _job| {
            if resumes_last {
                one.pause();
                other.resume();
            } else {
                one.resume();
                other.pause();
            }
            work(5);
        };
        let using = asks.using((ticks.switching(), ticks.switching()));
        using.register_untyped_subtask(function, named("ask"));
        let _ = (ticks.jobs(3), asks.jobs(1));
        let report = run(&machine, &[ticks, asks]);
        assert_eq!(report.dag("ticks").statistics().skips, skips);
    }
}

/// A DAG whose sensor is recorded, and one that pauses it from job 1 on.
fn recorded() -> [Dag; 2] {
    let sensor = every(10, "sensor");
    sensor
        .jobs(6)
        .record::<u64>("value")
        .record::<u64>("double");
    let measure = sensor.source(job_numbers(0)).writes(&["value"]);
    measure.register(named("measure"));
    let double = |(value,): (u64,)| (2 * value,);
    sensor.register_subtask(double, vec!["value"], vec!["double"], named("double"));
    sensor.register_subtask(|_: (u64,)| (), vec!["double"], vec![], named("use"));
    let asks = asking(&sensor, |mut switch, job| match job {
        0 => switch.pause(),
        _ => switch.resume(),
    });
    asks.jobs(2);
    [sensor, asks]
}

#[test]
fn l6_a_replay_passes_over_what_was_skipped_whatever_is_asked_for() {
    let machine = VirtualTime::new().cores(2);
    let report = run(&machine, &recorded());
    let counts = report.dag("sensor").statistics();
    assert_eq!((counts.skips, counts.completed), (2, 4));
    let recording = machine.recording();
    for cores in [1, 2] {
        let machine = VirtualTime::new().cores(cores).replay(&recording).unwrap();
        let report = run(&machine, &recorded());
        assert_eq!(report.divergence, None);
        assert_eq!((report.compared, report.uncompared), (4, 0));
        let skips = report.dag("sensor").statistics().skips;
        assert_eq!(skips, 0, "they are passed over");
        let is_switch = |what| [EventKind::Off, EventKind::On].contains(&what);
        assert!(!report.events.iter().any(|event| is_switch(event.what)));
    }
}

#[test]
fn a_release_of_a_dag_that_is_off_is_a_breach() {
    for off in [EventKind::Off, EventKind::Closed] {
        let machine = VirtualTime::new().cores(2);
        let ticks = ticking("ticks", 1);
        let asks = asking(&ticks, |mut switch, _| switch.pause());
        let _ = (ticks.jobs(2), asks.jobs(1));
        let mut report = run(&machine, &[ticks, asks]);
        for event in &mut report.events {
            event.what = match event.what {
                EventKind::Off => off,
                // The pause should have kept it from coming.
                EventKind::Skipped => EventKind::Released,
                what => what,
            };
        }
        let found = report.violations();
        let text = "at 10000000 ns, R1 release: dag 0 job 1 is released although its DAG is paused \
                    or closed";
        assert!(found.iter().any(|it| it.to_string() == text), "{found:?}");
    }
}

#[test]
#[should_panic(expected = "a state of another DAG is used")]
fn a_state_stays_in_its_dag() {
    let state = create_dag().state("state", 0);
    let _ = create_dag().using(state.update());
}

#[test]
fn a_subtask_cannot_raise_a_signal_behind_the_models_back() {
    let machine = VirtualTime::new().contain_panics();
    let answers = create_dag();
    let event = answers.relative_deadline(ms(5)).sporadic(ms(15));
    answers.source(|| ()).register(named("answer"));
    let asks = every(10, "asks");
    let ask = asks.jobs(1).source(move || event.raise());
    ask.register(named("ask"));
    let report = run(&machine, &[answers, asks]);
    let said = &report.panics[0].message;
    assert!(said.contains("dag.using(signal.raising())"), "{said}");
}

#[test]
fn a_certificate_goes_with_nothing_that_changes_what_runs() {
    for is_paused in [false, true] {
        let machine = VirtualTime::new();
        machine.change(|terms| terms.certificate = Some("certificate v1 of 0\n".into()));
        let dag = ticking("ticks", 1);
        if is_paused {
            dag.starts_paused();
        }
        match fass::finish_create_dags(&[dag]) {
            Ok(commit) => {
                let answer = commit.answers()[0].to_string();
                assert!(!is_paused && !answer.contains("certificate"), "{answer}");
            }
            Err(error) => {
                let text = error.to_string();
                assert!(
                    is_paused && text.contains("a certificate fixes the set"),
                    "{text}"
                );
            }
        }
    }
}
