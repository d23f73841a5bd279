//! The system in virtual time: its shape, and what the commit promises of it.

use std::time::Duration;

use autoware::{Latencies, SUBTASKS, Workload};
use fass::commit::{ConstructionPolicy, CountLimit, finish_create_dags_with};
use fass::{Occupation, Policy};
use virtual_time::VirtualTime;

fn workload(jobs: u64, least_percent: u64) -> Workload {
    Workload {
        jobs,
        crunch: Duration::from_millis(4),
        least_percent,
        seed: 1,
        occupation: Occupation::Hold,
    }
}

fn construction() -> ConstructionPolicy {
    ConstructionPolicy {
        sources: CountLimit::Several,
        sinks: CountLimit::Several,
        ..ConstructionPolicy::paper()
    }
}

#[test]
fn it_has_the_24_subtasks_and_29_edges_of_the_original() {
    let machine = VirtualTime::new().cores(4);
    let system = workload(2, 50).build();
    let commit = finish_create_dags_with(&system.dags, construction()).expect("a sound system");
    let report = machine.run();
    let dags = report.task_set().dags();
    let subtasks: usize = dags.iter().map(|dag| dag.subtasks().len()).sum();
    let edges = dags.iter().flat_map(|dag| {
        let ids = (0..dag.subtasks().len()).map(|id| u32::try_from(id).expect("few"));
        ids.map(|id| dag.successors(sched_dag::SubtaskId(id)).len())
    });
    assert_eq!(subtasks, SUBTASKS);
    assert_eq!((edges.sum::<usize>(), commit.staleness().len()), (19, 10));
}

#[test]
fn latencies_stay_below_what_the_commit_promises() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for least_percent in [0, 50, 99] {
            let machine = VirtualTime::new().cores(4).policy(policy);
            let system = workload(60, least_percent).build();
            let commit = finish_create_dags_with(&system.dags, construction()).expect("sound");
            let report = machine.run();
            assert_eq!(report.violations(), []);
            let latencies = Latencies::of(report.task_set(), report.record(), &system.acted_on);
            assert_eq!(latencies.hot_path_ns.len(), 60);
            assert!(latencies.to_vehicle_ns.len() >= 58, "{latencies:?}");

            let bound = |dag: usize| commit.answers()[dag].verdict.bound().expect("proven");
            let below = |latencies: &[u64], bound: Duration| {
                let longest = latencies.iter().max().copied().unwrap_or(0);
                assert!(
                    u128::from(longest) <= bound.as_nanos(),
                    "{policy:?} {longest}"
                );
            };
            below(&latencies.hot_path_ns, bound(0));
            let hop = commit.staleness().iter().find(|sample| {
                sample.reader.name == "BehaviorPlanner"
                    && sample.topic == "ObjectCollisionEstimator"
            });
            let hop = hop.and_then(|hop| hop.bound).expect("a bound");
            below(&latencies.to_vehicle_ns, hop + bound(5));

            // What the events tell of the chain is what the values have told, and so its bound.
            let from = "lidar/FrontLidarDriver";
            let ways = commit.chains_between(from, "behaviour/VehicleDBWSystem");
            let by = |way: &&fass::commit::EndToEnd| {
                let names = way.to_string();
                names.contains("ObjectCollisionEstimator") && !names.contains("route/")
            };
            let way = ways.iter().find(by).expect("the hot path");
            assert_eq!(way.output_age, Some(hop + bound(5)));
            let told = &latencies.to_vehicle_ns;
            let found = report.latencies(&way.chain);
            // The last ones come after the lidars have ended.
            let count = found.output_age_ns.len();
            assert!(count >= told.len() - 1, "{count} of {}", told.len());
            assert_eq!(found.output_age_ns, told[..count]);
            below(&found.reaction_ns, way.reaction.expect("a bound"));
        }
    }
}
