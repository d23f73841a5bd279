//! Graphs of one rate and of several.

use super::{RateGraph, Subtask, split};

const MS: u64 = 1_000_000;

/// Makes a graph of subtasks of 1 ms, such as `a:10 b`, of which those with a period in ms are
/// timers, and of edges between them, such as `ab`, on the lines from 10 on.
fn graph(subtasks: &str, edges: &str) -> RateGraph {
    let mut graph = RateGraph::default();
    for subtask in subtasks.split(' ') {
        let period_ms: Option<u64> = subtask.get(2..).map(|ms| ms.parse().unwrap());
        graph.add(Subtask {
            name: subtask[..1].into(),
            wcet_ns: MS,
            period_ns: period_ms.map(|ms| ms * MS),
            ..Subtask::default()
        });
    }
    let end = |edge: &str, at: usize| graph.position(&edge[at..=at]).unwrap();
    let edges = edges.split_whitespace().zip(10..);
    let edges = edges.map(|(edge, line)| (end(edge, 0), end(edge, 1), line));
    graph.edges = edges.collect();
    graph
}

#[test]
fn a_graph_becomes_dags_of_one_rate_each() {
    // For each DAG: name, period in ms, subtasks, and how many edges it has and has not.
    for (subtasks, edges, expected) in [
        // One rate is one DAG with all edges.
        ("a:10 b:10 c", "ac bc", "g 10 abc 2 0"),
        // A join of two rates belongs to the slower one.
        (
            "a:10 b:20 c d e",
            "ac cd bd de",
            "g-a 10 ac 1 0, g-b 20 bde 2 1",
        ),
        // A timer in mid-chain begins a DAG of its own.
        ("a:10 b t:10 u", "ab bt tu", "g-a 10 ab 1 0, g-t 10 tu 1 1"),
        // Without a timer it is the longest period of the graph, or else the sum of all execution
        // times.
        ("a:7 b:9 c", "", "g-a 7 a 0 0, g-b 9 b 0 0, g-c 9 c 0 0"),
        ("a b c", "ab bc", "g 3 abc 2 0"),
    ] {
        let dags = split(&graph(subtasks, edges), "g").unwrap();
        let described = dags.iter().map(|dag| {
            let names = dag.spec.subtasks.iter().map(|one| one.name.as_str());
            let names: String = names.collect();
            let (name, period_ns) = (&dag.spec.name, dag.spec.period_ns.unwrap());
            let edges = dag.spec.edges.len();
            let latest = |remark: &&String| remark.contains("latest");
            let left_out = dag.remarks.iter().filter(latest).count();
            format!("{name} {} {names} {edges} {left_out}", period_ns / MS)
        });
        assert_eq!(described.collect::<Vec<_>>().join(", "), expected);
    }
    let dags = split(&graph("a:10 b:20 c d e", "ac cd bd de"), "g").unwrap();
    assert_eq!(dags[1].edge_lines, [12, 13]);
    assert!(dags[1].remarks.iter().any(|it| it.contains("line 11")));
}

#[test]
fn deadlines_are_those_of_the_graph_or_fit_the_longest_path() {
    // Subtasks, edges, deadlines; the DAG's deadline, those of its sinks: in ms.
    for (subtasks, edges, given, expected) in [
        ("a b c", "ab bc", "", "6"),
        // A longest path of 3 ms, a period of 2 ms.
        ("a:2 b c", "ab bc", "", "4"),
        ("a", "", "a5", "5"),
        // Each sink has its own deadline; that of a subtask with successors holds for all that
        // follows.
        ("a:20 b c d", "ab ac ad", "b5 c9", "9 b5"),
        ("a:20 b c d", "ab ac ad", "b5 c9 a4", "4"),
    ] {
        let mut graph = graph(subtasks, edges);
        for deadline in given.split_whitespace() {
            let subtask = graph.position(&deadline[..1]).unwrap();
            let ms: u64 = deadline[1..].parse().unwrap();
            graph.subtasks[subtask].deadline_ns = Some(ms * MS);
        }
        let spec = split(&graph, "g").unwrap().remove(0).spec;
        let of_sink = |one: &sched_dag::SubtaskSpec| {
            let deadline_ns = one.relative_deadline_ns?;
            Some(format!(" {}{}", one.name, deadline_ns / MS))
        };
        let sinks: String = spec.subtasks.iter().filter_map(of_sink).collect();
        let of_dag = spec.relative_deadline_ns.unwrap() / MS;
        assert_eq!(format!("{of_dag}{sinks}"), expected, "{given}");
    }
}

#[test]
fn a_cycle_is_refused_even_through_a_timer() {
    let faults = split(&graph("a:10 b", "ab ba"), "g").unwrap_err();
    let [fault] = &faults[..] else {
        panic!("{faults:?}");
    };
    assert!(fault.line == 11 && fault.reason.contains("has a cycle"));
}
