//! The Autoware reference system on four cores.

use harness::Guest;
use sched_dag::chains::Chain;
use tool::trace::figures::Distribution;

#[test]
fn the_hot_path_keeps_its_bounds() {
    for policy in ["static", "edf"] {
        let policy = format!("policy={policy}");
        let guest = Guest::new("autoware")
            .cores(4)
            .word("jobs=40")
            .word(&policy);
        let outcome = guest.succeed();
        let mut lines = outcome.transcript.of_kind("autoware");
        let line = lines.next().expect("the app's line");
        let number = |name: &str| line.number_at(name).expect(name);
        assert_eq!(number("subtasks"), 24);
        assert_eq!((number("violations"), number("deadline_misses")), (0, 0));
        assert_eq!(number("allocations"), 0);
        // Kernel times are not in the bounds, which are not met with so little room.
        for path in ["hot_path", "to_vehicle"] {
            let longest = number(&format!("{path}_ns.max"));
            let bound = number(&format!("{path}_bound_ns"));
            assert!(0 < longest && longest < bound, "{}", line.text);
        }
    }
}

#[test]
fn its_trace_tells_the_ages_that_its_values_tell() {
    let guest = Guest::new("autoware").cores(4).word("jobs=40");
    let outcome = guest.word("trace=dump").word("graph=dump").succeed();
    let lines: Vec<_> = outcome.transcript.of_kind("autoware").collect();
    let told = |name: &str| lines[0].number_at(&format!("to_vehicle_ns.{name}"));

    let mut runs = tool::trace::read(&outcome.serial).expect("a trace");
    let run = runs.remove(0);
    let place = |name| Chain::place(&run.task_set, name).expect(name);
    let ends = (
        place("lidar/FrontLidarDriver"),
        place("behaviour/VehicleDBWSystem"),
    );
    let chains = Chain::between(&run.task_set, &run.committed.samplings, ends.0, ends.1);
    // By the obstacles, by the pose, and by four topics of `route`, which samples the pose.
    assert_eq!(chains.len(), 6, "{chains:?}");
    let by_obstacles = |chain: &&Chain| {
        let mut names = chain.names(&run.task_set).map(|name| name.to_string());
        names.any(|name| name == "lidar/ObjectCollisionEstimator")
    };
    let chain = chains.iter().find(by_obstacles).expect("the hot path");
    let times = chain.latencies(&run.task_set, run.events.iter().copied());
    let bounds_ns = &run.committed.bounds_ns;
    let bound_ns = chain.output_age_bound_ns(&run.task_set, bounds_ns);
    assert_eq!(bound_ns.ok(), lines[0].number_at("to_vehicle_bound_ns"));
    let reaction_ns = times.reaction_ns.iter().max().copied().expect("some");
    assert!(chain.reaction_bound_ns(&run.task_set, bounds_ns) > Ok(reaction_ns));
    // All jobs of the vehicle but the first, which finds nothing.
    let ages = Distribution::of(times.output_age_ns);
    assert_eq!(ages.count, 39);
    assert_eq!(Some(ages.max_ns), told("max"));
    assert_eq!(Some(ages.median_ns), told("median"));
}
