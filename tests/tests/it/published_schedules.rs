//! Schedules in virtual time have the published lengths for the same graphs and the same order of
//! priorities: Kasahara's task graphs, the longest path first, without preemption.

use std::fs;

use dag_file::{RunSettings, commit};
use fass::{Occupation, Policy, Preemption};
use fass_dag_file::{Execution, Length, Set};
use tool::dag_file::{ImportSettings, load};
use tool::system::workspace;
use views::json::{self, Value};
use virtual_time::VirtualTime;

/// The length of a unit, in ns, which leaves no rest.
const UNIT_NS: u64 = 1000;

/// Returns the length of a graph's only job in virtual time, in units.
fn in_virtual_time(graph: &Set, cores: u32) -> u64 {
    let machine = VirtualTime::new()
        .cores(cores)
        .policy(Policy::StaticPriority)
        .preemption(Preemption::Disabled);
    let settings = RunSettings {
        execution: Execution::Wcet,
        seed: 1,
        occupation: Occupation::Hold,
        length: Length::Jobs(1),
        grid_ns: 0,
    };
    commit(graph, &settings).expect("it is a DAG");
    let report = machine.run();
    assert_eq!(report.violations(), []);
    report.jobs[0].response_time_ns().expect("it is complete") / UNIT_NS
}

#[test]
fn virtual_time_finds_the_published_makespans() {
    let path = workspace().join("apps/dag-file/examples/stg50.json");
    let text = fs::read_to_string(&path).expect("it is in the tree");
    let published = json::parse(&text).expect("it is JSON");
    let published = published.get("graphs").expect("graphs").elements();
    let import = ImportSettings {
        unit_ns: Some(UNIT_NS),
        graph: None,
        cores: 16,
        clusters: sched_dag::CoreDivision::Undivided,
        length: Length::Jobs(1),
        limit_s: 600,
    };
    let file = load(&path, &import).expect("it is well formed");
    assert_eq!((file.sets.len(), published.len()), (45, 45));
    for (graph, published) in file.sets.iter().zip(published) {
        for cores in [2, 4, 8, 16] {
            let found = in_virtual_time(graph, cores);
            let path = ["check", &cores.to_string(), "hlf_nonpreemptive"];
            let expected = published.at(&path).and_then(Value::as_u64);
            assert_eq!(Some(found), expected, "{} on {cores}", graph.name);
        }
    }
}
