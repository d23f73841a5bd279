//! From a graph with timers to DAGs of one rate each.
//!
//! In a multi-rate graph a *timer* (a subtask with a period of its own) starts by the clock,
//! regardless of its predecessors; every other subtask starts when its predecessors have finished.
//! A DAG of ours has one period. So the graph is split:
//!
//! - A subtask without a timer belongs to the *slowest* rate among its predecessors: a join of two
//!   rates has all its inputs renewed no more often than that.
//! - An edge into a timer, or from another rate, is no precedence: its reader takes the latest
//!   value. It is left out, and reported in a remark.
//! - Each connected part that remains is a DAG.
//!
//! So no subtask starts more or less often than its graph says, and the edges that
//! remain are the precedences of the graph. A graph of one rate becomes one DAG
//! with all its edges. (`docs/decisions/` has the alternatives.)
//!
//! Missing times: a source without a timer gets the longest period of the graph, else its shortest
//! end-to-end deadline, else the sum of all execution times. A DAG without a deadline gets the
//! smallest multiple of its period that is longer than its longest path, as no schedule can be
//! faster than that. A sink has its own deadline, or the longest of its DAG's; the deadline of a
//! subtask with successors is one of its whole DAG.

use std::collections::{BTreeMap, BTreeSet};

use fass_dag_file::{FileDag, FileSubtask, Length, Set, check, is_name, no_name};

use sched_dag::analysis::Task;
use sched_dag::{CommitOptions, DagSpec, Policy, SubtaskSpec};
use text::{Malformed, quoted};

/// A graph in which each subtask may have a timer.
#[derive(Clone, Debug, Default)]
pub struct RateGraph {
    /// The subtasks.
    pub subtasks: Vec<Subtask>,
    /// The edges, with their lines.
    pub edges: Vec<(usize, usize, usize)>,
    positions: BTreeMap<String, usize>,
}

/// A subtask of such a graph.
#[derive(Clone, Debug, Default)]
pub struct Subtask {
    /// Its name.
    pub name: String,
    /// Its line in the file.
    pub line: usize,
    /// Its worst-case execution time.
    pub wcet_ns: u64,
    /// Its timer's period, if it has one.
    pub period_ns: Option<u64>,
    /// Its timer's first release.
    pub offset_ns: u64,
    /// Its deadline, from the release of its DAG.
    pub deadline_ns: Option<u64>,
}

/// A period and an offset; the larger one is the slower rate.
type Rate = (u64, u64);

impl RateGraph {
    /// Adds a subtask whose name is new.
    pub fn add(&mut self, subtask: Subtask) {
        let position = self.subtasks.len();
        self.positions.insert(subtask.name.clone(), position);
        self.subtasks.push(subtask);
    }

    /// Returns the position of the subtask of that name.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.positions.get(name).copied()
    }

    fn pairs(&self) -> Vec<(usize, usize)> {
        self.edges.iter().map(|edge| (edge.0, edge.1)).collect()
    }
}

/// Splits a graph into DAGs, called `name` or, if there are several, `name` and
/// their first source.
///
/// # Errors
///
/// The graph has a cycle, or a path that is too long for a deadline.
pub fn split(graph: &RateGraph, name: &str) -> Result<Vec<FileDag>, Vec<Malformed>> {
    refuse_cycles(graph, name)?;
    // Of its order alone; its times cannot overflow.
    let order = Task::new(1, 1, vec![1; graph.subtasks.len()], &graph.pairs());
    let order = order.expect("it has no cycle");
    let rates = rates(graph, &order);
    let kept = |edge: &&(usize, usize, usize)| is_kept(graph, &rates, (edge.0, edge.1));
    let parts = parts(graph, graph.edges.iter().filter(kept));
    let is_one = parts.len() == 1;
    let mut part_of = vec![0; graph.subtasks.len()];
    for (number, part) in parts.iter().enumerate() {
        part.iter().for_each(|&subtask| part_of[subtask] = number);
    }
    let mut has_input = vec![false; graph.subtasks.len()];
    let mut edges = vec![Vec::new(); parts.len()];
    for edge in graph.edges.iter().filter(kept) {
        // A subtask without kept inputs is a source, and can name its DAG.
        has_input[edge.1] = true;
        edges[part_of[edge.1]].push(*edge);
    }
    let ends_ns = earliest_ends_ns(graph, &order, &rates);
    let named = |part: &[usize]| match part.iter().find(|&&subtask| !has_input[subtask]) {
        Some(&source) if !is_one => format!("{name}-{}", graph.subtasks[source].name),
        _ => name.into(),
    };
    let mut dags: Vec<FileDag> = Vec::new();
    for (part, edges) in parts.iter().zip(&edges) {
        let path_ns = part.iter().map(|&subtask| ends_ns[subtask]).max();
        let rate = rates[part[0]];
        let dag = dag(graph, part, edges, rate, named(part), path_ns.unwrap_or(0));
        let dag = dag.map_err(|malformed| vec![malformed])?;
        if !is_name(&dag.spec.name) {
            let reason = format!("{}; rename the file or the node", no_name(&dag.spec.name));
            let line = dag.line;
            return Err(vec![Malformed { line, reason }]);
        }
        dags.push(dag);
    }
    for &(earlier, later, line) in graph.edges.iter().filter(|edge| !kept(edge)) {
        let (from, to) = (&graph.subtasks[earlier].name, &graph.subtasks[later].name);
        let remark = format!("{to} reads the latest value of {from} (line {line}): no precedence");
        dags[part_of[later]].remarks.push(remark);
    }
    Ok(dags)
}

/// Reports whether an edge is a precedence of one DAG.
fn is_kept(graph: &RateGraph, rates: &[Rate], (earlier, later): (usize, usize)) -> bool {
    graph.subtasks[later].period_ns.is_none() && rates[earlier] == rates[later]
}

/// Returns the rate of each subtask.
fn rates(graph: &RateGraph, order: &Task) -> Vec<Rate> {
    let subtasks = || graph.subtasks.iter();
    let volume = || {
        let wcets = subtasks().map(|subtask| subtask.wcet_ns);
        wcets.fold(0, u64::saturating_add).max(1)
    };
    let missing = (subtasks().filter_map(|subtask| subtask.period_ns).max())
        .or_else(|| subtasks().filter_map(|subtask| subtask.deadline_ns).min())
        .unwrap_or_else(volume);
    let of_timer = |subtask: &Subtask| Some((subtask.period_ns?, subtask.offset_ns));
    let mut rates: Vec<Option<Rate>> = subtasks().map(of_timer).collect();
    for subtask in order.topological_order() {
        // Without a rate by now it is a source.
        let rate = *rates[subtask].get_or_insert((missing, graph.subtasks[subtask].offset_ns));
        let later = order.successors(subtask);
        for later in later.filter(|&later| graph.subtasks[later].period_ns.is_none()) {
            rates[later] = rates[later].max(Some(rate));
        }
    }
    rates.into_iter().flatten().collect()
}

/// Returns the connected parts of the kept edges, each in the order of the file, the parts by their
/// first subtask.
fn parts<'g>(
    graph: &RateGraph,
    kept: impl Iterator<Item = &'g (usize, usize, usize)>,
) -> Vec<Vec<usize>> {
    let mut beside = vec![Vec::new(); graph.subtasks.len()];
    for &(earlier, later, _) in kept {
        beside[earlier].push(later);
        beside[later].push(earlier);
    }
    let mut is_taken = vec![false; graph.subtasks.len()];
    let mut parts = Vec::new();
    for first in 0..graph.subtasks.len() {
        let mut part = Vec::new();
        let mut waiting = vec![first];
        while let Some(subtask) = waiting.pop() {
            // A subtask may wait here several times, once for each neighbour.
            if !std::mem::replace(&mut is_taken[subtask], true) {
                part.push(subtask);
                waiting.extend(&beside[subtask]);
            }
        }
        if !part.is_empty() {
            part.sort_unstable();
            parts.push(part);
        }
    }
    parts
}

/// Makes a DAG of one part, whose longest path takes `path_ns`.
fn dag(
    graph: &RateGraph,
    part: &[usize],
    edges: &[(usize, usize, usize)],
    (period_ns, offset_ns): Rate,
    name: String,
    path_ns: u64,
) -> Result<FileDag, Malformed> {
    // The part is sorted, see `parts`.
    let position = |subtask: usize| part.binary_search(&subtask).ok();
    let subtasks = part.iter().map(|&subtask| &graph.subtasks[subtask]);
    let deadline_ns = |subtask: &usize| graph.subtasks[*subtask].deadline_ns;
    let followed: BTreeSet<usize> = edges.iter().map(|edge| edge.0).collect();
    let (inner, sinks): (Vec<usize>, Vec<usize>) =
        part.iter().partition(|subtask| followed.contains(subtask));
    let longest_ns = sinks.iter().filter_map(deadline_ns).max();
    let of_dag_ns = inner.iter().filter_map(deadline_ns).chain(longest_ns).min();
    let mut spec = DagSpec {
        name,
        period_ns: Some(period_ns),
        relative_deadline_ns: of_dag_ns,
        offset_ns,
        ..DagSpec::default()
    };
    let mut dag = FileDag {
        line: graph.subtasks[part[0]].line,
        ..FileDag::default()
    };
    for (number, subtask) in part.iter().zip(subtasks) {
        // Only a sink has a deadline of its own, and only one shorter than the DAG's says more.
        let is_shorter = |own_ns: &u64| !followed.contains(number) && Some(*own_ns) < of_dag_ns;
        spec.subtasks.push(SubtaskSpec {
            name: subtask.name.clone(),
            wcet_ns: Some(subtask.wcet_ns),
            relative_deadline_ns: subtask.deadline_ns.filter(is_shorter),
            ..SubtaskSpec::default()
        });
        dag.subtasks.push(FileSubtask {
            line: subtask.line,
            ..FileSubtask::default()
        });
    }
    for &(earlier, later, line) in edges {
        if let (Some(earlier), Some(later)) = (position(earlier), position(later)) {
            spec.edges.push((earlier, later));
            dag.edge_lines.push(line);
        }
    }
    if spec.relative_deadline_ns.is_none() {
        // One period more than the path fills, so that the deadline is longer than the path.
        let periods = (path_ns / period_ns.max(1)).checked_add(1);
        let deadline_ns = periods.and_then(|periods| period_ns.checked_mul(periods));
        spec.relative_deadline_ns = Some(deadline_ns.ok_or_else(|| Malformed {
            line: dag.line,
            reason: format!(
                "the longest path of dag {} is more than 64 bits of nanoseconds hold, and so is \
                 its deadline; choose a shorter unit",
                quoted(&spec.name)
            ),
        })?);
        let remark = "no deadline is given: a multiple of the period that fits the longest path";
        dag.remarks.push(remark.into());
    }
    dag.spec = spec;
    Ok(dag)
}

/// Returns for each subtask the length of the longest path that ends with it, over the kept edges.
fn earliest_ends_ns(graph: &RateGraph, order: &Task, rates: &[Rate]) -> Vec<u64> {
    let mut ends_ns = vec![0_u64; graph.subtasks.len()];
    for subtask in order.topological_order() {
        ends_ns[subtask] = ends_ns[subtask].saturating_add(graph.subtasks[subtask].wcet_ns);
        for later in order
            .successors(subtask)
            .filter(|&later| is_kept(graph, rates, (subtask, later)))
        {
            ends_ns[later] = ends_ns[later].max(ends_ns[subtask]);
        }
    }
    ends_ns
}

/// Refuses cycles in the whole graph, including its timers.
fn refuse_cycles(graph: &RateGraph, name: &str) -> Result<(), Vec<Malformed>> {
    let untimed = |subtask: &Subtask| SubtaskSpec {
        name: subtask.name.clone(),
        ..SubtaskSpec::default()
    };
    let whole = FileDag {
        spec: DagSpec {
            name: name.into(),
            // Times that no check can refuse: only the cycles are wanted here.
            period_ns: Some(1),
            relative_deadline_ns: Some(1),
            subtasks: graph.subtasks.iter().map(untimed).collect(),
            edges: graph.pairs(),
            ..DagSpec::default()
        },
        edge_lines: graph.edges.iter().map(|edge| edge.2).collect(),
        ..FileDag::default()
    };
    let dags = vec![whole];
    let set = Set {
        dags,
        ..Set::default()
    };
    check(&set, &CommitOptions::new(Policy::Edf, 1), Length::Jobs(1))
}

#[cfg(test)]
mod tests;
