//! The rules L1 to L6: what functions change of a run, in virtual time.

mod support;

use std::panic::{AssertUnwindSafe, catch_unwind};

use fass::{Dag, Switch, create_dag, finish_create_dags};
use support::lifecycle::{asking, events, ticking};
use support::run;
use support::sharing::{every, ms, named, work};
use virtual_time::{VirtualTime, What};

#[test]
fn l2_requests_are_served_in_the_order_in_which_the_uses_are_stated() {
    for resumes_last in [false, true] {
        let machine = VirtualTime::new().cores(2);
        let ticks = ticking("ticks", 3);
        let asks = every(20, "asks");
        asks.jobs(1);
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
        asks.using((ticks.switching(), ticks.switching()))
            .register_untyped_subtask(function, named("ask"));
        let report = run(&machine, &[ticks, asks]);
        let expected = if resumes_last { 0 } else { 2 };
        assert_eq!(report.dag("ticks").statistics().skips, expected);
    }
}

#[test]
fn l5_a_run_without_end_is_refused_unless_a_function_may_end_it() {
    let machine = VirtualTime::new();
    finish_create_dags(&[ticking("ticks", 0)]).unwrap();
    let refused = machine.try_run().unwrap_err().to_string();
    assert!(refused.contains("`ticks`"), "{refused}");
}

/// A DAG whose sensor is recorded, and one that pauses it from job 1 on.
fn recorded() -> [Dag; 2] {
    let sensor = create_dag();
    sensor
        .name("sensor")
        .jobs(6)
        .record::<u64>("value")
        .record::<u64>("double");
    let mut value = 0_u64;
    let measure = move || {
        value += 1;
        (value,)
    };
    sensor.register_periodic_subtask(measure, vec!["value"], ms(10), named("measure"));
    let double = |(value,): (u64,)| (2 * value,);
    sensor.register_subtask(double, vec!["value"], vec!["double"], named("double"));
    sensor.register_sink_subtask(|_: (u64,)| (), vec!["double"], ms(10), named("use"));
    let asks = asking(&sensor, 1, 2, |mut switch, job| match job {
        0 => switch.pause(),
        _ => switch.resume(),
    });
    [sensor, asks]
}

#[test]
fn l6_a_replay_passes_over_what_was_skipped_whatever_is_asked_for() {
    let machine = VirtualTime::new().cores(2);
    let report = run(&machine, &recorded());
    assert_eq!(
        (
            report.dag("sensor").statistics().skips,
            report.dag("sensor").statistics().completed
        ),
        (2, 4)
    );
    let recording = machine.recording();

    for cores in [1, 2] {
        let machine = VirtualTime::new().cores(cores).replay(&recording).unwrap();
        let report = run(&machine, &recorded());
        assert_eq!(report.divergence, None);
        assert_eq!((report.compared, report.uncompared), (4, 0));
        assert_eq!(
            report.dag("sensor").statistics().skips,
            0,
            "they are passed over"
        );
        assert_eq!(events(&report, &["off", "on"]), [""; 0]);
    }
}

#[test]
fn a_release_of_a_dag_that_is_off_is_a_breach() {
    for (off, on) in [(What::Off, What::On), (What::Closed, What::Closed)] {
        let machine = VirtualTime::new().cores(2);
        let ticks = ticking("ticks", 4);
        let asks = asking(&ticks, 1, 1, |mut switch, _| switch.pause());
        let mut report = run(&machine, &[ticks, asks]);
        let mut releases = 0;
        for event in &mut report.events {
            match event.what {
                What::Off => event.what = off,
                What::Skipped => {
                    // One that the pause should have kept from coming.
                    event.what = if releases == 0 { What::Released } else { on };
                    releases += 1;
                }
                _ => {}
            }
        }
        let texts: Vec<String> = report
            .violations()
            .iter()
            .map(|it| it.to_string())
            .collect();
        let text = "at 10000000 ns, R1 release: dag 0 job 1 is released although its DAG is paused \
                    or closed";
        assert!(texts.contains(&text.to_owned()), "{texts:?}");
    }
}
#[test]
fn what_is_committed_is_not_paused_at_the_start_any_more() {
    let machine = VirtualTime::new();
    let dag = ticking("ticks", 1);
    finish_create_dags(std::slice::from_ref(&dag)).unwrap();
    let late = catch_unwind(AssertUnwindSafe(|| _ = dag.starts_paused()));
    assert!(late.is_err());
    assert_eq!(machine.run().dag("ticks").statistics().completed, 1);
}
