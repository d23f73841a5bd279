//! Modes as functions enter them, in virtual time; `sched-dag/tests/modes/` has the rules.

mod support;

use fass::{Dag, Entrance, Mode, Modes, create_dag};
use support::lifecycle::{events, ticking};
use support::run;
use support::sharing::{every, ms, named, work};
use virtual_time::VirtualTime;

/// What a function does with a mode.
type Ask = fn(Entrance<'_>);

/// A DAG that asks for a mode in its only job, after 12 ms.
fn asking(mode: &Mode, ask: Ask) -> Dag {
    let dag = every(20, "asks");
    dag.jobs(1);
    let function = move |mode: Entrance<'_>, _job| {
        ask(mode);
        work(12);
    };
    dag.using(mode.entering())
        .register_untyped_subtask(function, named("ask"));
    dag
}

/// A DAG of four jobs, one every 10 ms, each of which executes for 5 ms.
fn busy(name: &str) -> Dag {
    let dag = every(10, name);
    dag.jobs(4)
        .register_untyped_subtask(|_job| work(5), named("work"));
    dag
}

#[test]
fn a_mode_is_entered_by_a_completion_at_once_or_when_idle() {
    let at_once = |mut mode: Entrance<'_>| mode.at_once();
    let when_idle = |mut mode: Entrance<'_>| mode.when_idle();
    let cases: [(Ask, &str); 2] = [(at_once, "12"), (when_idle, "15")];
    for (ask, entered_ms) in cases {
        // Where cores are divided, too: a mode is of the whole run.
        for clusters in [&[][..], &[2, 1]] {
            let mut machine = VirtualTime::new().cores(3);
            if !clusters.is_empty() {
                machine = machine.clusters(clusters);
            }
            let (cruise, descend) = (busy("cruise"), busy("descend"));
            let modes = Modes::new();
            modes.mode("flight", &[&cruise]);
            let asks = asking(&modes.mode("landing", &[&descend]), ask);
            let dags = [cruise, descend, asks];
            for (dag, cluster) in dags.iter().zip([0, 1, 0]) {
                if !clusters.is_empty() {
                    dag.cluster(cluster);
                }
            }
            let report = run(&machine, &dags);
            assert_eq!(
                events(&report, &["entered", "off", "on"]),
                [
                    "0 off descend",
                    "0 entered mode 0",
                    "12 off cruise",
                    &format!("{entered_ms} on descend"),
                    &format!("{entered_ms} entered mode 1"),
                ],
                "{clusters:?}"
            );
            let [cruise, descend] = ["cruise", "descend"].map(|dag| report.dag(dag).statistics());
            assert_eq!((cruise.completed, cruise.skips), (2, 2));
            assert_eq!((descend.completed, descend.skips), (2, 2));
        }
    }
}

#[test]
fn what_a_fault_releases_enters_the_mode_of_the_safe_state() {
    let machine = VirtualTime::new().cores(2).contain_panics();
    let (cruise, descend) = (ticking("cruise", 5), ticking("descend", 5));
    let modes = Modes::new();
    modes.mode("flight", &[&cruise]);
    let landing = modes.mode("landing", &[&descend]);
    let camera = every(10, "camera");
    camera.jobs(5).register_untyped_subtask(
        |job| {
            work(2);
            assert!(job < 1, "as was asked for");
        },
        named("look"),
    );
    let alarm = create_dag();
    alarm.name("alarm").relative_deadline(ms(10));
    camera.on_fault(&alarm.sporadic(ms(10)));
    let land = |mut landing: Entrance<'_>, _job| {
        work(1);
        landing.at_once();
    };
    alarm
        .using(landing.entering())
        .register_untyped_subtask(land, named("land"));
    let report = run(&machine, &[cruise, descend, camera, alarm]);
    assert_eq!(report.panics.len(), 1);
    // The fault at 12 ms, and what it releases until 13 ms.
    assert_eq!(
        events(&report, &["entered", "off", "on"]),
        [
            "0 off descend",
            "0 entered mode 0",
            "13 off cruise",
            "13 on descend",
            "13 entered mode 1",
        ]
    );
}
