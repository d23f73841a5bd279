//! Reading task graphs, as `apps/dag-file/examples/stg50.json` has them: Kasahara's Standard Task
//! Graph Set.
//!
//! A graph has a `name`, the costs `c` of its vertices, and `edges`. Vertices without cost are the
//! format's own entry and exit; they take no time and order nothing that the others do not, so they
//! are left out. In the middle of a graph such a vertex would order others, and is refused. Other
//! members, such as the origin of the graphs and the length of published schedules, are not needed
//! here.
//!
//! A graph becomes a DAG of one job at a time: its period and its deadline are the
//! sum of its costs.

use fass_dag_file::{DagFile, FileDag, FileSubtask, Set, is_name, no_name};

use sched_dag::{DagSpec, SubtaskSpec};
use text::{Malformed, quoted, repeated};

use crate::options::did_you_mean;
use views::json::{Value, parse_with_places};

/// A task graph.
struct TaskGraph {
    name: String,
    /// Its line in the file.
    line: usize,
    /// The cost of each vertex, in units of time.
    costs: Vec<u64>,
    edges: Vec<(usize, usize)>,
}

/// Reads a file into one set for each graph, or only the graph that is named.
///
/// # Errors
///
/// The first deviation from the form above, with its line.
pub fn read(text: &str, graph: Option<&str>, unit_ns: u64) -> Result<DagFile, Malformed> {
    let mut graphs = read_graphs(text)?;
    if let Some(wanted) = graph {
        let names: Vec<String> = graphs.iter().map(|graph| graph.name.clone()).collect();
        graphs.retain(|graph| graph.name == wanted);
        if graphs.is_empty() {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let hint = did_you_mean(wanted, &names);
            let reason = format!(
                "there is no graph {}; name one of the {} there are{hint}",
                quoted(wanted),
                names.len()
            );
            return Err(Malformed { line: 1, reason });
        }
    }
    let sets = graphs.iter().map(|graph| {
        Ok(Set {
            name: graph.name.clone(),
            dags: vec![graph.dag(unit_ns)?],
            ..Set::default()
        })
    });
    let sets = sets.collect::<Result<_, _>>()?;
    Ok(DagFile { sets })
}

/// Reads all graphs of a file. The error is the first deviation from the form above, with its line.
fn read_graphs(text: &str) -> Result<Vec<TaskGraph>, Malformed> {
    let (document, places) = parse_with_places(text, "graphs").map_err(|error| {
        let line = line_at(text, error.column.saturating_sub(1));
        let reason = format!("this is no JSON: {}", error.message);
        Malformed { line, reason }
    })?;
    let graphs = document.get("graphs").map(Value::elements);
    let graphs = graphs.unwrap_or_default();
    if graphs.is_empty() {
        let reason = "the file has no `graphs`; of JSON a task graph set is read, \
                      {\"graphs\":[{\"name\":\"a\",\"c\":[3,4],\"edges\":[[0,1]]}]}; RD-Gen's graphs are \
                      read from .yaml, and others can be written in the format of docs/dag-file.md";
        let reason = reason.into();
        return Err(Malformed { line: 1, reason });
    }
    let (mut line, mut before) = (1, 0);
    let mut read: Vec<TaskGraph> = Vec::new();
    for (graph, place) in graphs.iter().zip(places) {
        // Counted from the graph before: from the start each time it would be quadratic.
        line += line_at(&text[before..place], place - before) - 1;
        before = place;
        read.push(JsonGraph { value: graph, line }.read(read.len())?);
    }
    match repeated(read.iter().map(|graph| &graph.name)) {
        None => Ok(read),
        Some((first, second)) => Err(Malformed {
            line: read[second].line,
            reason: format!(
                "graph {} stands here twice, first on line {}; rename one",
                quoted(&read[second].name),
                read[first].line
            ),
        }),
    }
}

/// Returns the line of a byte, counted from 1.
fn line_at(text: &str, byte: usize) -> usize {
    let before = text.as_bytes().iter().take(byte);
    1 + before.filter(|byte| **byte == b'\n').count()
}

/// A graph as JSON.
struct JsonGraph<'v> {
    value: &'v Value,
    line: usize,
}

impl JsonGraph<'_> {
    /// Reads the graph; `number` is its position in the list.
    fn read(&self, number: usize) -> Result<TaskGraph, Malformed> {
        let Value::Object(members) = self.value else {
            return Err(self.malformed(format!("graph {number} of the list is no object")));
        };
        let Some(Value::Text(name)) = self.value.get("name") else {
            let reason = format!("graph {number} of the list has no `name`; give it a word");
            return Err(self.malformed(reason));
        };
        if !is_name(name) {
            return Err(self.malformed(no_name(name)));
        }
        for (key, _) in members {
            // `optimal` and `check` are known, and not needed.
            if !["name", "c", "edges", "optimal", "check"].contains(&key.as_str()) {
                let key = quoted(key);
                let reason = format!("unknown key {key}; a graph has name, c, edges");
                return Err(self.malformed(reason));
            }
        }
        let costs = self.costs(name)?;
        let edges = self.edges(name, costs.len())?;
        let graph = TaskGraph {
            name: name.into(),
            line: self.line,
            costs,
            edges,
        };
        graph.check().map_err(|reason| self.malformed(reason))?;
        Ok(graph)
    }

    fn malformed(&self, reason: String) -> Malformed {
        let line = self.line;
        Malformed { line, reason }
    }

    /// Returns a member that must be a list; empty if it is missing.
    fn list(&self, name: &str, member: &str) -> Result<&[Value], Malformed> {
        match self.value.get(member) {
            None => Ok(&[]),
            Some(Value::Array(elements)) => Ok(elements),
            Some(_) => Err(self.malformed(format!("graph `{name}`: `{member}` is no list"))),
        }
    }

    fn costs(&self, name: &str) -> Result<Vec<u64>, Malformed> {
        let costs = self.list(name, "c")?;
        let number = |value: &Value| {
            value.as_u64().ok_or_else(|| {
                self.malformed(format!(
                    "graph `{name}`: a cost is no whole number from 0 on; give one"
                ))
            })
        };
        let costs: Vec<u64> = costs.iter().map(number).collect::<Result<_, _>>()?;
        match costs.iter().all(|cost| *cost == 0) {
            true => Err(self.malformed(format!("graph `{name}` has no cost above 0; give `c`"))),
            false => Ok(costs),
        }
    }

    fn edges(&self, name: &str, vertices: usize) -> Result<Vec<(usize, usize)>, Malformed> {
        let end = |value: &Value| {
            let end = usize::try_from(value.as_u64()?).ok();
            end.filter(|end| *end < vertices)
        };
        let edge = |edge: &Value| {
            let [earlier, later] = edge.elements() else {
                return None;
            };
            Some((end(earlier)?, end(later)?))
        };
        let edges = self.list(name, "edges")?;
        let edges: Option<Vec<(usize, usize)>> = edges.iter().map(edge).collect();
        let edges = edges.ok_or_else(|| {
            let last = vertices - 1;
            self.malformed(format!(
                "graph `{name}`: an edge must be two vertices from 0 to {last}"
            ))
        })?;
        match repeated(&edges) {
            None => Ok(edges),
            Some((_, second)) => {
                let (earlier, later) = edges[second];
                let reason =
                    format!("graph `{name}`: edge [{earlier},{later}] stands twice; drop one");
                Err(self.malformed(reason))
            }
        }
    }
}

impl TaskGraph {
    /// Makes sure that every vertex without cost is an entry or an exit.
    fn check(&self) -> Result<(), String> {
        let mut has = vec![(false, false); self.costs.len()];
        for &(earlier, later) in &self.edges {
            has[later].0 = true;
            has[earlier].1 = true;
        }
        let is_amid = |vertex: &usize| self.costs[*vertex] == 0 && has[*vertex] == (true, true);
        match (0..self.costs.len()).find(is_amid) {
            None => Ok(()),
            Some(vertex) => Err(format!(
                "graph `{}`: vertex {vertex} has cost 0 and stands between others, which only \
                 an entry or an exit may; give it a cost of at least 1, or join its edges",
                self.name
            )),
        }
    }

    /// Makes a DAG of it, with units of `unit_ns`; refused if its times exceed 64 bits.
    fn dag(&self, unit_ns: u64) -> Result<FileDag, Malformed> {
        // In 128 bits, so that even the sum cannot overflow.
        let total: u128 = self.costs.iter().map(|cost| u128::from(*cost)).sum();
        let volume_ns = total.checked_mul(u128::from(unit_ns));
        let volume_ns = volume_ns.and_then(|ns| u64::try_from(ns).ok());
        let volume_ns = volume_ns.ok_or_else(|| Malformed {
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
            // An entry or an exit, see `check`.
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
mod tests;
