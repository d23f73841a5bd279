//! Reading task graphs with published makespans, as `tests/data/stg50.json` has
//! them: Kasahara's Standard Task Graph Set.
//!
//! A graph has a `name`, the costs `c` of its vertices, `edges` and, by number of
//! processors, the `optimal` length of a schedule without preemption. Vertices
//! without cost are the format's own entry and exit; they take no time and order
//! nothing that the others do not, so they are left out. What else is stated, such
//! as where the graphs come from, is not needed here.
//!
//! A graph becomes a DAG of one job at a time: its period and its deadline are the
//! sum of its costs.

use std::collections::BTreeMap;

use dag_file::{DagFile, FileDag, FileSubtask, Malformed, Set, is_name, quoted};
use sched_dag::{DagSpec, SubtaskSpec};

use crate::json::{self, Value};
use crate::options::nearest;

/// A task graph.
#[derive(Clone, Debug)]
pub struct TaskGraph {
    /// Its name.
    pub name: String,
    /// The line on which it stands.
    pub line: usize,
    /// The cost of each vertex, in units of time.
    pub costs: Vec<u64>,
    /// The edges between vertices.
    pub edges: Vec<(usize, usize)>,
    /// The shortest makespan known to be possible, by the number of processors.
    pub optimal: BTreeMap<u64, u64>,
}

/// Reads a file into one set a graph, or the one that is named.
///
/// # Errors
///
/// Everything that is not as described, with its line.
pub fn read(text: &str, graph: Option<&str>, unit_ns: u64) -> Result<DagFile, Malformed> {
    let mut graphs = read_graphs(text)?;
    if let Some(wanted) = graph {
        let names: Vec<String> = graphs.iter().map(|graph| graph.name.clone()).collect();
        graphs.retain(|graph| graph.name == wanted);
        if graphs.is_empty() {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let near = nearest(wanted, &names).or(names.first().copied());
            let hint = near.map_or(String::new(), |near| format!(", such as `{near}`"));
            let reason = format!(
                "there is no graph {}; name one of the {} there are{hint}",
                quoted(wanted),
                names.len()
            );
            return Err(Malformed { line: 1, reason });
        }
    }
    let sets = graphs.iter().map(|graph| {
        let dags = vec![graph.dag(unit_ns)?];
        let name = graph.name.clone();
        Ok(Set { name, dags })
    });
    let sets = sets.collect::<Result<_, _>>()?;
    Ok(DagFile { sets })
}

/// Reads all graphs of a file.
///
/// # Errors
///
/// The first thing that is not as described, with its line.
pub fn read_graphs(text: &str) -> Result<Vec<TaskGraph>, Malformed> {
    let document = json::parse(text).map_err(|error| {
        let before = text.as_bytes().iter().take(error.column.saturating_sub(1));
        let line = 1 + before.filter(|byte| **byte == b'\n').count();
        let reason = format!("this is no JSON: {}", error.message);
        Malformed { line, reason }
    })?;
    let graphs = document
        .get("graphs")
        .map(Value::elements)
        .unwrap_or_default();
    if graphs.is_empty() {
        let reason = "the file has no `graphs`; only a task graph set is read from JSON".into();
        return Err(Malformed { line: 1, reason });
    }
    graphs.iter().map(|graph| read_graph(graph, text)).collect()
}

fn read_graph(graph: &Value, text: &str) -> Result<TaskGraph, Malformed> {
    let name = graph
        .get("name")
        .and_then(Value::as_text)
        .unwrap_or_default();
    // Values do not know their lines; the name stands but once.
    let at = text.find(&format!("\"{name}\"")).unwrap_or(0);
    let line = 1 + text[..at].matches('\n').count();
    let malformed = |reason: String| Malformed { line, reason };
    if !is_name(name) {
        return Err(malformed(format!(
            "{} is no name of a graph; give a word",
            quoted(name)
        )));
    }
    if let Value::Object(members) = graph {
        for (key, _) in members {
            if !["name", "c", "edges", "optimal", "check"].contains(&key.as_str()) {
                let known = "name, c, edges, optimal";
                return Err(malformed(format!(
                    "unknown key {}; a graph has {known}",
                    quoted(key)
                )));
            }
        }
    }
    let costs = graph.get("c").map(Value::elements).unwrap_or_default();
    let number = |value: &Value| {
        value.as_u64().ok_or_else(|| {
            malformed(format!(
                "graph `{name}`: a cost is no whole number from 0 on; give one"
            ))
        })
    };
    let costs: Vec<u64> = costs.iter().map(number).collect::<Result<_, _>>()?;
    if costs.iter().all(|cost| *cost == 0) {
        return Err(malformed(format!(
            "graph `{name}` has no cost above 0; give `c`"
        )));
    }
    let end = |value: Option<&Value>| {
        let end = value
            .and_then(Value::as_u64)
            .and_then(|end| usize::try_from(end).ok());
        end.filter(|end| *end < costs.len()).ok_or_else(|| {
            let last = costs.len() - 1;
            malformed(format!(
                "graph `{name}`: an edge must be two vertices from 0 to {last}"
            ))
        })
    };
    let edges = graph.get("edges").map(Value::elements).unwrap_or_default();
    let edges = edges.iter().map(|edge| match edge.elements() {
        [earlier, later] => Ok((end(Some(earlier))?, end(Some(later))?)),
        _ => end(None).map(|end| (end, end)),
    });
    let edges = edges.collect::<Result<_, _>>()?;
    let mut optimal = BTreeMap::new();
    if let Some(Value::Object(members)) = graph.get("optimal") {
        for (cores, length) in members {
            let pair = cores.parse().ok().zip(length.as_u64());
            let (cores, length) = pair.ok_or_else(|| {
                malformed(format!(
                    "graph `{name}`: `optimal` maps processors to lengths"
                ))
            })?;
            optimal.insert(cores, length);
        }
    }
    Ok(TaskGraph {
        name: name.into(),
        line,
        costs,
        edges,
        optimal,
    })
}

impl TaskGraph {
    /// Makes a DAG of it, with units of so many nanoseconds.
    ///
    /// # Errors
    ///
    /// Its times do not fit 64 bits.
    pub fn dag(&self, unit_ns: u64) -> Result<FileDag, Malformed> {
        let total: u128 = self.costs.iter().map(|cost| u128::from(*cost)).sum();
        let volume_ns = u64::try_from(total * u128::from(unit_ns)).map_err(|_| Malformed {
            line: self.line,
            reason: format!(
                "graph `{}`: its costs are more than 64 bits of nanoseconds; choose a shorter unit",
                self.name
            ),
        })?;
        let mut positions: Vec<Option<usize>> = Vec::new();
        let mut dag = FileDag {
            spec: DagSpec {
                name: self.name.clone(),
                period_ns: Some(volume_ns),
                relative_deadline_ns: Some(volume_ns),
                ..DagSpec::default()
            },
            line: self.line,
            ..FileDag::default()
        };
        for (vertex, &cost) in self.costs.iter().enumerate() {
            positions.push((cost > 0).then_some(dag.subtasks.len()));
            if cost == 0 {
                continue;
            }
            dag.spec.subtasks.push(SubtaskSpec {
                name: vertex.to_string(),
                wcet_ns: Some(cost * unit_ns),
                ..SubtaskSpec::default()
            });
            dag.subtasks.push(FileSubtask {
                line: self.line,
                ..FileSubtask::default()
            });
        }
        for &(earlier, later) in &self.edges {
            if let (Some(earlier), Some(later)) = (positions[earlier], positions[later]) {
                dag.spec.edges.push((earlier, later));
                dag.edge_lines.push(self.line);
            }
        }
        Ok(dag)
    }
}

#[cfg(test)]
mod tests {
    use super::{read, read_graphs};
    use crate::system::workspace;

    fn set() -> String {
        std::fs::read_to_string(workspace().join("tests/data/stg50.json")).unwrap()
    }

    #[test]
    fn the_published_graphs_are_read() {
        let graphs = read_graphs(&set()).unwrap();
        assert_eq!(graphs.len(), 45);
        assert_eq!(
            (graphs[0].name.as_str(), graphs[0].costs.len()),
            ("50/rand0000", 52)
        );
        assert_eq!(graphs[0].optimal[&4], 66);
        assert!(graphs[1].line > graphs[0].line);
        let all = read(&set(), None, 1000).unwrap();
        assert_eq!((all.sets.len(), all.most_subtasks()), (45, 50));
        let one = read(&set(), Some("50/rand0004"), 1000).unwrap();
        assert_eq!(one.sets[0].dags[0].spec.period_ns, Some(232_000));
    }

    #[test]
    fn a_refusal_names_line_offender_and_remedy() {
        let message = read(&set(), Some("50/rand0001"), 1)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("there is no graph `50/rand0001`; name one of the 45"),
            "{message}"
        );
        let cut = &set()[..5000];
        let message = read(cut, None, 1).unwrap_err().to_string();
        assert!(
            message.contains("this is no JSON") && !message.starts_with("line 1:"),
            "{message}"
        );
        for (text, words) in [
            ("{}", "the file has no `graphs`"),
            ("", "this is no JSON"),
            (
                r#"{"graphs":[{"name":"a","c":[-1]}]}"#,
                "a cost is no whole number from 0 on",
            ),
            (
                r#"{"graphs":[{"name":"a","c":[0]}]}"#,
                "graph `a` has no cost above 0",
            ),
            (
                "{\"graphs\":[\n{\"name\":\"a\",\"c\":[1],\"edges\":[[0,1]]}]}",
                "line 2: graph `a`: an edge must be two vertices from 0 to 0",
            ),
            (
                r#"{"graphs":[{"name":"a","c":[1],"edges":[[0]]}]}"#,
                "an edge must be two vertices",
            ),
            (
                r#"{"graphs":[{"name":"a","cost":[1]}]}"#,
                "unknown key `cost`",
            ),
            (
                r#"{"graphs":[{"name":"a","c":[18446744073709551615,1]}]}"#,
                "choose a shorter unit",
            ),
        ] {
            let message = read(text, None, 1).unwrap_err().to_string();
            assert!(message.contains(words), "{message}\n  not: {words}");
        }
    }
}
