//! Drives on the host, where each subtask takes its WCET: the proofs' worst case.

use fass::{Policy, finish_create_dags};
use virtual_time::VirtualTime;
use vision::Workload;

#[test]
fn it_stops_before_the_obstacle_without_a_miss() {
    for (cores, policy) in [
        (1, Policy::StaticPriority),
        (2, Policy::Edf),
        (4, Policy::StaticPriority),
    ] {
        let machine = VirtualTime::new().cores(cores).policy(policy);
        let workload = Workload {
            seconds: 5,
            seed: 1,
            takes_wcet: true,
        };
        let system = workload.build();
        let commit = finish_create_dags(&system.dags).expect("both DAGs are proven");
        for answer in commit.answers() {
            assert!(answer.verdict.bound().is_some(), "{answer}");
        }
        let report = machine.run();
        let drive = system.drive;
        println!("{cores} cores, {policy:?}: {drive}");
        assert_eq!(report.violations(), []);
        for dag in &report.statistics {
            assert_eq!((dag.misses, dag.skips), (0, 0), "{dag:?}");
        }
        let (frames, seen) = drive.frames();
        assert_eq!(frames, 125);
        assert!(seen > 120, "{drive}");
        assert!(drive.most_error() < 0.1, "{drive}");
        let (gap, speed) = drive.end();
        assert!(gap > 2.5 && gap < 3.6 && speed < 0.2, "{drive}");
    }
}
