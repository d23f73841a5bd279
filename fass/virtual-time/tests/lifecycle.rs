//! The rules L1 to L6: what functions change of a run, in virtual time.

mod support;

use std::panic::{AssertUnwindSafe, catch_unwind};

use fass::{Dag, Shutdown, Switch, create_dag, finish_create_dags, shutting_down};
use support::lifecycle::{asking, events, ticking};
use support::run;
use support::sharing::{every, ms, named, work};
use virtual_time::{VirtualTime, What};

#[test]
fn l1_a_request_takes_effect_at_the_completion_before_the_releases_of_that_instant() {
    let machine = VirtualTime::new().cores(2);
    let ticks = ticking("ticks", 4);
    // Asked for at 0, complete at 10 ms: at the very release of job 1.
    let asks = asking(&ticks, 10, 1, |mut switch, _| switch.pause());
    let report = run(&machine, &[ticks, asks]);
    assert_eq!(
        events(&report, &["released", "skipped", "off", "on"]),
        [
            "0 released ticks[0]",
            "0 released asks[0]",
            "10 off ticks",
            "10 skipped ticks[1]",
            "20 skipped ticks[2]",
            "30 skipped ticks[3]"
        ]
    );
}

#[test]
fn l1_an_instance_that_fails_has_asked_for_nothing() {
    let machine = VirtualTime::new().cores(2).contain_panics();
    let ticks = ticking("ticks", 3);
    let asks = asking(&ticks, 1, 1, |mut switch, _| {
        switch.pause();
        panic!("after it has asked");
    });
    let report = run(&machine, &[ticks, asks]);
    assert_eq!(report.panics.len(), 1);
    assert_eq!(report.dag("ticks").statistics().completed, 3);
}

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
fn l2_of_one_switch_the_last_word_counts() {
    let machine = VirtualTime::new().cores(2);
    let ticks = ticking("ticks", 3);
    let asks = asking(&ticks, 5, 1, |mut switch, _| {
        switch.pause();
        switch.resume();
    });
    let report = run(&machine, &[ticks, asks]);
    assert_eq!(report.dag("ticks").statistics().skips, 0);
    assert_eq!(events(&report, &["off", "on"]), [""; 0]);
}

#[test]
fn l3_a_dag_pauses_another_and_resumes_it_on_the_old_grid() {
    let machine = VirtualTime::new().cores(1);
    let ticks = ticking("ticks", 7);
    let asks = asking(&ticks, 4, 3, |mut switch, job| match job % 2 {
        0 => switch.pause(),
        _ => switch.resume(),
    });
    // Of one core: `ticks` goes first at 0, so the requests are complete at 5, 24 and 45.
    let report = run(&machine, &[ticks, asks]);
    assert_eq!(
        events(&report, &["off", "on", "released", "skipped"]),
        [
            "0 released ticks[0]",
            "0 released asks[0]",
            "5 off ticks",
            "10 skipped ticks[1]",
            "20 skipped ticks[2]",
            "20 released asks[1]",
            "24 on ticks",
            "30 released ticks[3]",
            "40 released ticks[4]",
            "40 released asks[2]",
            "45 off ticks",
            "50 skipped ticks[5]",
            "60 skipped ticks[6]"
        ]
    );
}

#[test]
fn l3_what_is_in_flight_goes_on_and_a_dag_may_pause_itself() {
    let machine = VirtualTime::new().cores(1);
    let dag = every(10, "once");
    dag.jobs(3);
    let pause = |mut switch: Switch<'_>, _job| switch.pause();
    let first = dag
        .using(dag.switching())
        .register_untyped_subtask(pause, named("pause"));
    let last = dag.register_untyped_subtask(|_job| work(3), named("work"));
    dag.precede(&first, &last);
    let report = run(&machine, &[dag]);
    let statistics = report.dag("once").statistics();
    assert_eq!((statistics.completed, statistics.skips), (1, 2));
    assert_eq!(report.jobs[0].ended_ns, Some(3_000_000));
}

#[test]
fn l3_a_signal_to_a_paused_dag_is_skipped() {
    let machine = VirtualTime::new().cores(2);
    let answers = create_dag();
    answers.name("answers").relative_deadline(ms(5));
    let signal = answers.sporadic(ms(10));
    answers.source(|| ()).register(named("answer"));
    let asks = asking(&answers, 1, 2, |mut switch, job| match job {
        0 => switch.pause(),
        _ => switch.resume(),
    });
    finish_create_dags(&[answers, asks]).unwrap();
    machine.raise_at(&signal, ms(7));
    machine.raise_at(&signal, ms(25));
    let report = machine.run();
    assert_eq!(report.violations(), []);
    let statistics = report.dag("answers").statistics();
    assert_eq!((statistics.skips, statistics.completed), (1, 1));
}

#[test]
fn l4_a_dag_that_starts_paused_releases_nothing_before_it_is_resumed() {
    let machine = VirtualTime::new().cores(2);
    let ticks = ticking("ticks", 4);
    ticks.starts_paused();
    let asks = asking(&ticks, 1, 2, |mut switch, job| {
        if job == 1 {
            switch.resume();
        }
    });
    let report = run(&machine, &[ticks, asks]);
    assert_eq!(
        events(&report, &["off", "on", "released", "skipped"]),
        [
            "0 off ticks",
            "0 skipped ticks[0]",
            "0 released asks[0]",
            "10 skipped ticks[1]",
            "20 skipped ticks[2]",
            "20 released asks[1]",
            "21 on ticks",
            "30 released ticks[3]"
        ]
    );
}

/// A DAG that ends the run in job 1.
fn ending() -> Dag {
    let dag = every(20, "ends");
    let end = |mut shutdown: Shutdown<'_>, job| {
        work(2);
        if job == 1 {
            shutdown.request();
        }
    };
    dag.using(shutting_down())
        .register_untyped_subtask(end, named("end"));
    dag
}

#[test]
fn l5_a_shutdown_releases_nothing_more_and_waits_for_what_is_in_flight() {
    for clusters in [&[][..], &[1, 1, 1]] {
        let machine = VirtualTime::new().cores(3).clusters(clusters);
        let ticks = ticking("ticks", 0);
        let slow = every(15, "slow");
        slow.register_untyped_subtask(|_job| work(14), named("work"));
        let dags = [ticks, slow, ending()];
        if !clusters.is_empty() {
            (0..)
                .zip(&dags)
                .for_each(|(cluster, dag)| _ = dag.cluster(cluster));
        }
        let report = run(&machine, &dags);
        assert_eq!(
            events(&report, &["closed", "skipped", "stopped"]),
            ["22 closed ticks", "22 closed slow", "22 closed ends"]
        );
        // `slow` is in its job from 15 ms to 29 ms.
        assert_eq!(report.end_ns, 29_000_000);
        let completed: Vec<u64> = report
            .dags()
            .map(|dag| dag.statistics().completed)
            .collect();
        assert_eq!(completed, [3, 2, 2]);
        assert!(report.dags().all(|dag| dag.statistics().cut_short == 0));
    }
}

#[test]
fn l5_of_what_is_asked_for_after_a_shutdown_nothing_comes() {
    let machine = VirtualTime::new().cores(3);
    let ticks = ticking("ticks", 0);
    ticks.starts_paused();
    // In flight from 20 ms to 30 ms; the shutdown is at 22 ms.
    let asks = asking(&ticks, 10, 5, |mut switch, job| {
        if job == 1 {
            switch.resume();
        }
    });
    let report = run(&machine, &[ticks, asks, ending()]);
    assert_eq!(report.dag("ticks").statistics().released, 0);
    assert_eq!(report.end_ns, 30_000_000);
    assert_eq!(events(&report, &["on"]), [""; 0]);
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

#[test]
fn a_fault_releases_the_dag_that_brings_about_a_safe_state_and_that_ends_the_run() {
    let machine = VirtualTime::new().cores(1).contain_panics();
    let safe = create_dag();
    safe.name("safe").relative_deadline(ms(5));
    let hold = |mut shutdown: Shutdown<'_>| {
        work(2);
        shutdown.request();
    };
    let signal = safe.sporadic(ms(50));
    safe.using(shutting_down())
        .source(hold)
        .register(named("hold"));
    let steering = every(10, "steering");
    steering.on_fault(&signal);
    let steer = |job| assert_ne!(job, 3, "a fault");
    steering.register_untyped_subtask(steer, named("steer"));
    let report = run(&machine, &[ticking("ticks", 0), steering, safe]);
    assert_eq!(report.panics.len(), 1);
    assert_eq!(
        events(&report, &["stopped", "signalled", "closed"]),
        [
            "31 stopped steering",
            "31 signalled safe[0]",
            "33 closed ticks",
            "33 closed safe"
        ]
    );
    assert!(
        report.dag("ticks").statistics().completed == 4
            && report.dag("safe").statistics().completed == 1
    );
    assert_eq!(
        report.task_set().find("safe"),
        report.jobs.last().unwrap().dag
    );
}
