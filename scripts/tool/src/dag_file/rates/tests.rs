//! Graphs of one rate and of several.

use super::{Graph, Subtask, split};

/// Makes a graph of 1 ms subtasks; timers are given with their periods in ms.
fn graph(subtasks: &[(&str, Option<u64>)], edges: &[(usize, usize)]) -> Graph {
    let mut graph = Graph::default();
    for (name, period_ms) in subtasks {
        graph.add(Subtask {
            name: (*name).into(),
            wcet_ns: 1_000_000,
            period_ns: period_ms.map(|ms| ms * 1_000_000),
            ..Subtask::default()
        });
    }
    let lined = edges.iter().zip(10..).map(|(&(a, b), line)| (a, b, line));
    graph.edges = lined.collect();
    graph
}

/// Describes DAGs: name, period in ms, subtasks, number of edges, remarks.
fn described(graph: &Graph) -> Vec<String> {
    let dags = split(graph, "g").unwrap();
    let described = dags.iter().map(|dag| {
        let names = dag.spec.subtasks.iter().map(|one| one.name.as_str());
        format!(
            "{} {} {} {} {}",
            dag.spec.name,
            dag.spec.period_ns.unwrap() / 1_000_000,
            names.collect::<String>(),
            dag.spec.edges.len(),
            dag.remarks
                .iter()
                .filter(|remark| remark.contains("latest"))
                .count()
        )
    });
    described.collect()
}

#[test]
fn one_rate_is_one_dag_with_all_edges() {
    let two_sources = [("a", Some(10)), ("b", Some(10)), ("c", None)];
    let graph = graph(&two_sources, &[(0, 2), (1, 2)]);
    assert_eq!(described(&graph), ["g 10 abc 2 0"]);
}

#[test]
fn a_join_of_two_rates_belongs_to_the_slower_one() {
    let subtasks = [
        ("a", Some(10)),
        ("b", Some(20)),
        ("c", None),
        ("d", None),
        ("e", None),
    ];
    let graph = graph(&subtasks, &[(0, 2), (2, 3), (1, 3), (3, 4)]);
    assert_eq!(described(&graph), ["g-a 10 ac 1 0", "g-b 20 bde 2 1"]);
    let dags = split(&graph, "g").unwrap();
    assert_eq!(dags[1].edge_lines, [12, 13]);
    assert!(dags[1].remarks[0].contains("no deadline") || dags[1].remarks[1].contains("line 11"));
}

#[test]
fn a_timer_in_mid_chain_begins_a_dag_of_its_own() {
    let subtasks = [("a", Some(10)), ("b", None), ("t", Some(10)), ("u", None)];
    let graph = graph(&subtasks, &[(0, 1), (1, 2), (2, 3)]);
    assert_eq!(described(&graph), ["g-a 10 ab 1 0", "g-t 10 tu 1 1"]);
}

#[test]
fn missing_times_have_their_defaults() {
    let untimed = graph(&[("a", None), ("b", None), ("c", None)], &[(0, 1), (1, 2)]);
    let dag = &split(&untimed, "g").unwrap()[0];
    assert_eq!(dag.spec.period_ns, Some(3_000_000));
    assert_eq!(dag.spec.relative_deadline_ns, Some(6_000_000));
    // A longest path of 3 ms, a period of 2 ms.
    let fast = graph(
        &[("a", Some(2)), ("b", None), ("c", None)],
        &[(0, 1), (1, 2)],
    );
    let dag = &split(&fast, "g").unwrap()[0];
    assert_eq!(dag.spec.relative_deadline_ns, Some(4_000_000));
    // The period is the longest there is, or else the deadline.
    let mixed = graph(&[("a", Some(7)), ("b", Some(9)), ("c", None)], &[]);
    assert_eq!(
        described(&mixed),
        ["g-a 7 a 0 0", "g-b 9 b 0 0", "g-c 9 c 0 0"]
    );
    let mut by_deadline = graph(&[("a", None)], &[]);
    by_deadline.subtasks[0].deadline_ns = Some(5_000_000);
    assert_eq!(described(&by_deadline), ["g 5 a 0 0"]);
}

#[test]
fn each_sink_has_its_own_deadline() {
    let mut fork = graph(
        &[("a", Some(20)), ("b", None), ("c", None), ("d", None)],
        &[(0, 1), (0, 2), (0, 3)],
    );
    fork.subtasks[1].deadline_ns = Some(5_000_000);
    fork.subtasks[2].deadline_ns = Some(9_000_000);
    let deadlines = |graph: &Graph| {
        let spec = split(graph, "g").unwrap().remove(0).spec;
        let of_sinks = spec.subtasks.iter().map(|one| one.relative_deadline_ns);
        (spec.relative_deadline_ns, of_sinks.collect::<Vec<_>>())
    };
    let own = vec![None, Some(5_000_000), None, None];
    assert_eq!(deadlines(&fork), (Some(9_000_000), own));
    // That of a subtask with successors is one of all that follows.
    fork.subtasks[0].deadline_ns = Some(4_000_000);
    assert_eq!(deadlines(&fork), (Some(4_000_000), vec![None; 4]));
}

#[test]
fn a_cycle_is_refused_even_through_a_timer() {
    let graph = graph(&[("a", Some(10)), ("b", None)], &[(0, 1), (1, 0)]);
    let faults = split(&graph, "g").unwrap_err();
    assert_eq!((faults.len(), faults[0].line), (1, 11));
    assert!(
        faults[0].reason.contains("has a cycle"),
        "{}",
        faults[0].reason
    );
}
