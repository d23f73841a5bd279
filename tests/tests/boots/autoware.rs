//! The Autoware reference system on four cores.

use harness::{Guest, Members, Said};
use sched_dag::chains::Chain;
use sched_dag::law::Distribution;
use tool::Outcome;
use views::protocol::MachineLine;

#[test]
fn the_hot_path_keeps_its_bounds_and_the_trace_tells_the_ages_that_its_values_tell() {
    for policy in ["policy=static", "policy=edf"] {
        let guest = Guest::new("autoware").cores(4).word("jobs=40 events=on");
        let outcome = guest.word(policy).succeed();
        let line = outcome.line("autoware");
        line.has([("subtasks", 24), ("allocations", 0)]);
        line.has([("violations", 0), ("deadline_misses", 0)]);
        // Kernel times are not in the bounds, which are not met with so little room.
        for path in ["hot_path", "to_vehicle"] {
            let longest = line.number(&format!("{path}_ns.max"));
            let bound = line.number(&format!("{path}_bound_ns"));
            assert!(0 < longest && longest < bound, "{}", line.text);
        }
        tells_its_ages(&outcome, line);
    }
}

fn tells_its_ages(outcome: &Outcome, line: &MachineLine) {
    let mut runs = tool::trace::read(&outcome.serial).expect("a trace");
    let run = runs.remove(0);
    assert_eq!(run.samplings.len(), 10);
    let place = |name| Chain::find(&run.task_set, name).expect(name);
    let ends = (
        place("lidar/FrontLidarDriver"),
        place("behaviour/VehicleDBWSystem"),
    );
    let chains = Chain::between(&run.task_set, &run.samplings, ends.0, ends.1);
    // By the obstacles, by the pose, and by four topics of `route`, which samples the pose.
    assert_eq!(chains.len(), 6, "{chains:?}");
    let by_obstacles = |chain: &&Chain| {
        let mut names = chain.names(&run.task_set).map(|name| name.to_string());
        names.any(|name| name == "lidar/ObjectCollisionEstimator")
    };
    let chain = chains.iter().find(by_obstacles).expect("the hot path");
    let times = chain.latencies(&run.task_set, run.events.iter().copied());
    let bounds_ns = &run.bounds_ns;
    let bound_ns = chain.output_age_bound_ns(&run.task_set, bounds_ns);
    assert_eq!(bound_ns.ok(), line.number_at("to_vehicle_bound_ns"));
    let reaction_ns = times.reaction_ns.iter().max().copied().expect("some");
    assert!(chain.reaction_bound_ns(&run.task_set, bounds_ns) > Ok(reaction_ns));
    // All jobs of the vehicle but the first, which finds nothing.
    let ages = Distribution::new(times.output_age_ns);
    assert_eq!(ages.count(), 39);
    line.has([
        ("to_vehicle_ns.max", ages.max()),
        ("to_vehicle_ns.median", ages.median()),
    ]);
}
