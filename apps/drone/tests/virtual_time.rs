//! Flights on the host, where each subtask takes its WCET: the proofs' worst case.

use std::time::Duration;

use drone::{FRAME, Workload};
use fass::{Policy, finish_create_dags};
use virtual_time::{Report, VirtualTime};

const WORKLOAD: Workload = Workload {
    seconds: 8,
    seed: 1,
    takes_wcet: true,
    delay: Duration::ZERO,
    fault_at: None,
};

fn fly(workload: Workload, cores: u32, policy: Policy) -> (drone::Flight, Report) {
    let machine = VirtualTime::new().cores(cores).policy(policy);
    let machine = machine.contain_panics();
    let system = workload.build();
    let commit = finish_create_dags(&system.dags).expect("every DAG is proven");
    assert!(
        commit
            .answers()
            .iter()
            .all(|answer| answer.verdict.bound().is_some())
    );
    (system.flight, machine.run())
}

#[test]
fn it_flies_its_waypoints_and_comes_down_without_a_miss() {
    for (cores, policy) in [
        (1, Policy::StaticPriority),
        (2, Policy::Edf),
        (4, Policy::StaticPriority),
    ] {
        let (flight, report) = fly(WORKLOAD, cores, policy);
        println!("{cores} cores, {policy:?}: {flight}");
        assert_eq!(report.violations(), []);
        for dag in &report.statistics {
            assert_eq!((dag.misses, dag.skips), (0, 0), "{dag:?}");
        }
        assert_eq!(report.statistics[0].completed, 8_000);
        assert!(flight.waypoints() >= 3, "{flight}");
        assert!(flight.has_landed(), "{flight}");
        assert!(flight.most_tilt_degrees() < 25.0, "{flight}");
        assert!(flight.most_error_metres() < 0.3, "{flight}");
        let (frames, fixes) = flight.frames();
        assert!(fixes * 10 > frames * 9, "{flight}");
    }
}

#[test]
fn a_camera_that_is_too_slow_skips_frames_and_delays_nothing_else() {
    let workload = Workload {
        delay: FRAME,
        ..WORKLOAD
    };
    let (flight, report) = fly(workload, 2, Policy::StaticPriority);
    let [attitude, camera, ..] = &report.statistics[..] else {
        panic!("five DAGs");
    };
    assert_eq!((attitude.completed, attitude.misses), (8_000, 0));
    assert!(camera.skips > 100, "{camera:?}");
    assert!(flight.most_tilt_degrees() < 30.0, "{flight}");
}

#[test]
fn when_the_camera_fails_the_drone_comes_down_by_its_other_sensors() {
    let workload = Workload {
        seconds: 5,
        fault_at: Some(60),
        ..WORKLOAD
    };
    let (flight, report) = fly(workload, 2, Policy::StaticPriority);
    assert_eq!(report.panics.len(), 1);
    let [attitude, camera, .., safety] = &report.statistics[..] else {
        panic!("six DAGs");
    };
    assert_eq!((attitude.completed, attitude.misses), (5_000, 0));
    assert_eq!((camera.completed, safety.completed), (60, 1));
    assert!(
        flight.has_landed() && flight.most_tilt_degrees() < 25.0,
        "{flight}"
    );
    assert!(flight.height_metres() < 0.8, "{} m", flight.height_metres());
}
