//! Flights on the host, where each subtask takes its WCET: the proofs' worst case.

use std::time::Duration;

use drone::{FRAME, Workload};
use fass::commit::Overheads;
use fass::shared::Parameter;
use fass::{Policy, finish_create_dags};
use virtual_time::{EventKind, Report, VirtualTime};

const WORKLOAD: Workload = Workload {
    seconds: 8,
    seed: 1,
    takes_wcet: true,
    delay: Duration::ZERO,
    fault_at: None,
    survived: 0,
};

/// The most that a network card takes of a core.
const NETWORK: Overheads = Overheads {
    device_ns: 4_000,
    device_distance_ns: 100_000,
    ..Overheads::NONE
};

fn machine(cores: u32, policy: Policy) -> VirtualTime {
    let machine = VirtualTime::new().cores(cores).policy(policy);
    machine.overheads(NETWORK).contain_panics()
}

/// Commits the DAGs.
fn take_off(workload: Workload) -> (drone::Flight, Parameter<u32>) {
    let system = workload.build();
    let commit = finish_create_dags(&system.dags).expect("every DAG is proven");
    assert!(
        commit
            .answers()
            .iter()
            .all(|answer| answer.verdict.bound().is_some())
    );
    (system.flight, system.reserve)
}

fn fly(workload: Workload, cores: u32, policy: Policy) -> (drone::Flight, Report) {
    let machine = machine(cores, policy);
    let (flight, _) = take_off(workload);
    (flight, machine.run())
}

/// Returns when the landing began, which no frame and no look for a waypoint comes after.
fn landed_ns(report: &Report) -> u64 {
    let is_landing = |what, job| what == EventKind::Entered && job == 1;
    let mut entered = (report.events.iter()).filter(|event| is_landing(event.what, event.job));
    let landed_ns = entered.next().expect("it has landed").time_ns;
    assert!(entered.next().is_none(), "once");
    let [camera, mission, descent] =
        ["camera", "mission", "descent"].map(|dag| report.task_set().find(dag));
    for event in &report.events {
        if event.what == EventKind::Released && event.time_ns != landed_ns {
            let is_late = event.time_ns > landed_ns;
            let is_of_flight = [camera, mission].contains(&event.dag);
            let is_of_landing = event.dag == descent;
            assert!(!(is_late && is_of_flight), "{event:?}");
            assert!(is_late || !is_of_landing, "{event:?}");
        }
    }
    landed_ns
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
        assert!(report.dags().all(|dag| dag.statistics().misses == 0));
        assert_eq!(report.dag("attitude").statistics().skips, 0);
        assert!(landed_ns(&report) > 5_000_000_000);
        assert!(report.dag("descent").statistics().completed >= 10);
        assert_eq!(report.dag("attitude").statistics().completed, 8_000);
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
    let [attitude, camera] = ["attitude", "camera"].map(|dag| report.dag(dag).statistics());
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
    let [attitude, camera, safety] =
        ["attitude", "camera", "safety"].map(|dag| report.dag(dag).statistics());
    assert_eq!((attitude.completed, attitude.misses), (5_000, 0));
    assert_eq!((camera.completed, safety.completed), (60, 1));
    // In frame 60, and right after the fault.
    assert!((1_999_980_000..2_005_000_000).contains(&landed_ns(&report)));
    assert!(
        flight.has_landed() && flight.most_tilt_degrees() < 25.0,
        "{flight}"
    );
    assert!(flight.height_metres() < 0.8, "{} m", flight.height_metres());
}

#[test]
fn a_person_who_wants_more_reserve_has_the_drone_land_earlier() {
    let machine = machine(2, Policy::StaticPriority);
    let (flight, reserve) = take_off(Workload {
        seconds: 4,
        ..WORKLOAD
    });
    let _ = machine.run_for(Duration::from_secs(1));
    assert!(!flight.has_landed(), "{flight}");
    reserve.set(95).expect("it is within the range");
    let report = machine.run();
    assert!(flight.has_landed(), "{flight}");
    // `drain` reads it at 1 s, `decide` follows, and the camera has one frame to finish.
    assert!((1_000_000_000..1_150_000_000).contains(&landed_ns(&report)));
    assert!(flight.height_metres() < 0.8, "{} m", flight.height_metres());
}
