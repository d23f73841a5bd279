//! Reading the files of RD-Gen: a graph in networkx's node-link form, as YAML.
//!
//! A node has an `id`, an `execution_time` and, if a timer drives it, a `period`
//! and perhaps an `offset`; an `end_to_end_deadline` counts from the release of
//! its chain. A link has `source` and `target`. Times are numbers without unit.
//! [`rates`](super::rates) explains how timers become DAGs.
//!
//! Messages take no time here, so a link's `communication_time` is added to the execution time of
//! its target, which reads the message.

use fass_dag_file::{DagFile, Set, is_name, no_name, time};

use text::{Malformed, quoted, repeated};

use super::rates::{RateGraph, Subtask, split};
use super::yaml::{Node, YamlValue, parse};

/// Reads a file into one set, whose DAGs are named after `name`.
///
/// # Errors
///
/// Every deviation from the form above, with its line.
pub fn read(text: &str, name: &str, unit_ns: u64) -> Result<DagFile, Vec<Malformed>> {
    let graph = read_graph(text, unit_ns).map_err(|malformed| vec![malformed])?;
    let set = Set {
        dags: split(&graph, name)?,
        ..Set::default()
    };
    Ok(DagFile { sets: vec![set] })
}

fn malformed(line: usize, reason: impl Into<String>) -> Malformed {
    let reason = reason.into();
    Malformed { line, reason }
}

fn read_graph(text: &str, unit_ns: u64) -> Result<RateGraph, Malformed> {
    let document = parse(text)?;
    let mut nodes: &[Node] = &[];
    let mut links: &[Node] = &[];
    let mut listed: Option<&str> = None;
    for (key, node) in members(&document, "the document")? {
        match key.as_str() {
            "nodes" => nodes = items(node, key)?,
            "links" | "edges" => {
                // Versions of networkx differ in the key; both at once would be two lists.
                if let Some(other) = listed.replace(key) {
                    let reason = format!("`{other}` and `{key}` both list the edges; keep one");
                    return Err(malformed(node.line, reason));
                }
                links = items(node, key)?;
            }
            "directed" => expect(node, key, "true", "an edge needs a direction")?,
            "multigraph" => expect(
                node,
                key,
                "false",
                "two edges between two nodes say no more",
            )?,
            "graph" => {}
            other => {
                let known = "directed, graph, links, multigraph, nodes";
                return Err(unknown(node, other, "a node-link document", known));
            }
        }
    }
    if nodes.is_empty() {
        let reason = "the file has no nodes; a node-link document lists them under `nodes`";
        return Err(malformed(document.line, reason));
    }
    let mut graph = RateGraph::default();
    for node in nodes {
        let subtask = read_node(node, unit_ns)?;
        if let Some(first) = graph.position(&subtask.name) {
            let (id, line) = (quoted(&subtask.name), graph.subtasks[first].line);
            let reason = format!("node {id} stands here twice, first on line {line}; drop one");
            return Err(malformed(node.line, reason));
        }
        graph.add(subtask);
    }
    for link in links {
        read_link(link, &mut graph, unit_ns)?;
    }
    // Only with all links: an offset is refused on nodes that have predecessors.
    check_whole(&graph)?;
    Ok(graph)
}

/// Refuses faults that show only when all links are known.
fn check_whole(graph: &RateGraph) -> Result<(), Malformed> {
    let edges = &graph.edges;
    let name = |subtask: usize| quoted(&graph.subtasks[subtask].name);
    if let Some((first, second)) = repeated(edges.iter().map(|&(from, to, _)| (from, to))) {
        let (source, target, line) = edges[second];
        let (source, target, first) = (name(source), name(target), edges[first].2);
        let reason = format!(
            "the link from {source} to {target} stands here twice, first on line {first}; drop one"
        );
        return Err(malformed(line, reason));
    }
    for &(_, target, _) in edges {
        let subtask = &graph.subtasks[target];
        // With a period it is a timer, and starts by the clock with an offset.
        if subtask.offset_ns > 0 && subtask.period_ns.is_none() {
            let reason = format!(
                "node {} has an `offset` and no `period`, and starts after those before it; give \
                 it a period, or drop the offset",
                name(target)
            );
            return Err(malformed(subtask.line, reason));
        }
    }
    Ok(())
}

fn read_node(node: &Node, unit_ns: u64) -> Result<Subtask, Malformed> {
    let mut subtask = Subtask {
        line: node.line,
        ..Subtask::default()
    };
    let mut wcet_ns = None;
    for (key, value) in members(node, "a node")? {
        match key.as_str() {
            "id" => {
                let id = text(value, key)?;
                if !is_name(id) {
                    return Err(malformed(value.line, format!("id: {}", no_name(id))));
                }
                subtask.name = id.into();
            }
            "execution_time" => wcet_ns = Some(positive_ns(value, key, unit_ns)?),
            "period" => subtask.period_ns = Some(positive_ns(value, key, unit_ns)?),
            "offset" => subtask.offset_ns = time_ns(value, key, unit_ns)?,
            "end_to_end_deadline" => {
                subtask.deadline_ns = Some(positive_ns(value, key, unit_ns)?);
            }
            other => {
                let known = "id, execution_time, period, offset, end_to_end_deadline";
                return Err(unknown(value, other, "a node", known));
            }
        }
    }
    if subtask.name.is_empty() {
        return Err(malformed(node.line, "this node has no `id`; give it one"));
    }
    subtask.wcet_ns = wcet_ns.ok_or_else(|| {
        let id = quoted(&subtask.name);
        malformed(
            node.line,
            format!("node {id} has no `execution_time`; give it one"),
        )
    })?;
    Ok(subtask)
}

fn read_link(link: &Node, graph: &mut RateGraph, unit_ns: u64) -> Result<(), Malformed> {
    let (mut source, mut target, mut communication_ns) = (None, None, 0);
    for (key, value) in members(link, "a link")? {
        match key.as_str() {
            "source" => source = Some(node_index(value, key, graph)?),
            "target" => target = Some(node_index(value, key, graph)?),
            "communication_time" => communication_ns = time_ns(value, key, unit_ns)?,
            "firing_prob" => {
                let reason = "`firing_prob`: here every subtask runs in every job; generate \
                              without probabilistic branches";
                return Err(malformed(value.line, reason));
            }
            other => {
                let known = "source, target, communication_time";
                return Err(unknown(value, other, "a link", known));
            }
        }
    }
    let (Some(source), Some(target)) = (source, target) else {
        let reason = "this link lacks its `source` or its `target`; give both";
        return Err(malformed(link.line, reason));
    };
    // Checked: both times come from the file and may be of any size.
    let wcet_ns = graph.subtasks[target].wcet_ns.checked_add(communication_ns);
    graph.subtasks[target].wcet_ns = wcet_ns.ok_or_else(|| {
        let reason = "execution and communication together are more than 64 bits of nanoseconds";
        malformed(link.line, reason)
    })?;
    graph.edges.push((source, target, link.line));
    Ok(())
}

fn node_index(value: &Node, key: &str, graph: &RateGraph) -> Result<usize, Malformed> {
    let id = text(value, key)?;
    graph.position(id).ok_or_else(|| {
        let remedy = "add it, or drop the link";
        let reason = format!("{key}: there is no node {}; {remedy}", quoted(id));
        malformed(value.line, reason)
    })
}

fn members<'n>(node: &'n Node, what: &str) -> Result<&'n [(String, Node)], Malformed> {
    match &node.value {
        YamlValue::Mapping(members) => Ok(members),
        _ => Err(malformed(
            node.line,
            format!("{what} must be a mapping of keys"),
        )),
    }
}

fn items<'n>(node: &'n Node, key: &str) -> Result<&'n [Node], Malformed> {
    match &node.value {
        YamlValue::Sequence(items) => Ok(items),
        _ => Err(malformed(node.line, format!("`{key}` must be a sequence"))),
    }
}

fn text<'n>(node: &'n Node, key: &str) -> Result<&'n str, Malformed> {
    match &node.value {
        YamlValue::Scalar(text) if !text.is_empty() => Ok(text),
        _ => Err(malformed(
            node.line,
            format!("`{key}` must be a value on its line; give one"),
        )),
    }
}

fn time_ns(node: &Node, key: &str, unit_ns: u64) -> Result<u64, Malformed> {
    let has_time = ["period", "end_to_end_deadline"].contains(&key);
    time::scale_ns(text(node, key)?, unit_ns, !has_time)
        .map_err(|message| malformed(node.line, format!("{key}: {message}")))
}

fn positive_ns(node: &Node, key: &str, unit_ns: u64) -> Result<u64, Malformed> {
    match time_ns(node, key, unit_ns)? {
        0 => Err(malformed(node.line, format!("{key}: it is 0; give more"))),
        ns => Ok(ns),
    }
}

fn expect(node: &Node, key: &str, wanted: &str, why: &str) -> Result<(), Malformed> {
    let found = text(node, key)?;
    if found.eq_ignore_ascii_case(wanted) {
        return Ok(());
    }
    let reason = format!("`{key}` must be {wanted}, found {}: {why}", quoted(found));
    Err(malformed(node.line, reason))
}

fn unknown(node: &Node, key: &str, what: &str, known: &str) -> Malformed {
    let reason = format!("unknown key {}; {what} has {known}", quoted(key));
    malformed(node.line, reason)
}

#[cfg(test)]
mod tests;
