//! Makespans on the machine are those of virtual time, and those that others found
//! for the same order of priorities.

use std::fs;

use dag_file::{Execution, Length, Set, Settings, build};
use fass::{ConstructionPolicy, Occupation, Policy, Preemption, finish_create_dags_with};
use tool::bench::makespan::measure;
use tool::dag_file::stg::{TaskGraph, read_graphs};
use tool::json::{self, Value};
use tool::system::workspace;
use virtual_time::VirtualTime;

/// A length of a unit that leaves no rest.
const UNIT_NS: u64 = 1000;

fn text() -> String {
    fs::read_to_string(workspace().join("apps/dag-file/examples/stg50.json"))
        .expect("it is in the tree")
}

/// Returns the makespan in virtual time, in units.
fn in_virtual_time(graph: &TaskGraph, cores: u64) -> u64 {
    let machine = VirtualTime::new()
        .cores(u32::try_from(cores).expect("a few"))
        .policy(Policy::StaticPriority)
        .preemption(Preemption::Disabled);
    let set = Set {
        name: graph.name.clone(),
        dags: vec![graph.dag(UNIT_NS).expect("it fits")],
    };
    let settings = Settings {
        execution: Execution::Wcet,
        seed: 1,
        occupation: Occupation::Hold,
        length: Length::Jobs(1),
        grid: None,
    };
    let dags = build(&set, &settings, &replay::Epoch::default());
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("it is a DAG");
    let report = machine.run();
    assert_eq!(report.violations(), []);
    report.jobs[0].response_time_ns().expect("it is complete") / UNIT_NS
}

/// Returns what the file states for the longest path first, without preemption.
fn published(file: &Value, number: usize, cores: u64) -> u64 {
    let graph = &file.get("graphs").expect("graphs").elements()[number];
    let path = ["check", &cores.to_string(), "hlf_nonpreemptive"];
    graph.at(&path).and_then(Value::as_u64).expect("a number")
}

#[test]
fn virtual_time_finds_the_published_makespans() {
    let file = json::parse(&text()).expect("it is JSON");
    for (number, graph) in read_graphs(&text())
        .expect("it is well formed")
        .iter()
        .enumerate()
    {
        for cores in [2, 4, 8, 16] {
            let found = in_virtual_time(graph, cores);
            assert_eq!(
                found,
                published(&file, number, cores),
                "{} on {cores}",
                graph.name
            );
            assert!(found >= graph.optimal[&cores], "{} on {cores}", graph.name);
        }
    }
}

#[test]
fn the_kernel_takes_as_long_as_virtual_time() {
    let graphs = read_graphs(&text()).expect("it is well formed");
    // Among them are the graphs that are farthest from their optimum.
    let some: Vec<TaskGraph> = graphs.into_iter().step_by(2).collect();
    for cores in [2, 8] {
        for (graph, makespan) in some.iter().zip(measure(&some, cores).expect("it boots")) {
            assert_eq!(
                makespan.units,
                in_virtual_time(graph, cores),
                "{} on {cores}",
                graph.name
            );
            assert_eq!(makespan.complaint(), None);
        }
    }
}
