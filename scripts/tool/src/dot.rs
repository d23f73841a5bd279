//! Committed DAGs as a picture: text for Graphviz.
//!
//! The commits of a record become one `digraph` in the DOT language: a
//! cluster for each DAG with its period and deadline; a box for each subtask with
//! its WCET, waits and priority; an arrow for each edge, with the topic and the message's
//! type, dotted where a state makes the edge. A topic whose latest value is sampled
//! has a note of its own, with a dashed arrow to each subtask, of any DAG, that
//! samples it; the note of a topic that only leaves the DAG says that it is recorded.

use std::collections::BTreeSet;
use std::fmt::Write;

use recording::{CommittedDag, CommittedSubtask};
use sched_dag::Policy;

use crate::output::briefly;
use crate::record::Committed;
use crate::record::Record;

/// Returns the committed DAGs of a record as a graph.
///
/// # Errors
///
/// In words: nothing was committed.
pub fn text(record: &Record) -> Result<String, String> {
    if record.commits.is_empty() {
        return Err("the guest has committed no DAG".into());
    }
    let mut text = String::from(
        "digraph committed {\n  rankdir=LR;\n  node [shape=box, style=rounded, \
         fontname=\"sans-serif\"];\n  edge [fontname=\"sans-serif\", fontsize=10];\n  \
         graph [fontname=\"sans-serif\"];\n",
    );
    // A node belongs to every cluster that mentions it, so arrows between clusters stand outside.
    let mut between = String::new();
    for commit in &record.commits {
        for (number, dag) in (0..).zip(&commit.told.dags) {
            let dag = Dag {
                commit,
                number,
                dag,
            };
            text += &dag.text();
            between += &dag.samples();
        }
    }
    text += &between;
    text += "}\n";
    Ok(text)
}

/// A DAG of a commit.
struct Dag<'r> {
    commit: &'r Committed,
    number: u32,
    dag: &'r CommittedDag,
}

// Writing into a `String` cannot fail.
impl Dag<'_> {
    fn text(&self) -> String {
        let id = self.id(self.number);
        let label = quoted(&self.label());
        let mut text = format!("  subgraph cluster_{id} {{\n    label={label};\n");
        for (number, subtask) in self.dag.subtasks.iter().enumerate() {
            let label = quoted(&self.subtask_label(number, subtask));
            let _ = writeln!(text, "    {id}_s{number} [label={label}];");
        }
        self.add_edges(&id, &mut text);
        text += "  }\n";
        text
    }

    fn id(&self, dag: u32) -> String {
        format!("c{}_d{dag}", self.commit.number)
    }

    fn samples(&self) -> String {
        let id = self.id(self.number);
        let mut text = String::new();
        for &(reader, writer, topic, staleness_ns) in &self.dag.samples {
            let writer = self.id(writer);
            let label = staleness_ns.map_or(String::new(), |ns| {
                format!(", label=\"less than {} old while jobs come\"", briefly(ns))
            });
            let _ = writeln!(
                text,
                "  {writer}_t{topic} -> {id}_s{reader} [style=dashed{label}];"
            );
        }
        text
    }

    fn label(&self) -> String {
        let dag = self.dag;
        let name = match &*dag.name {
            "" => format!("dag {}", self.number),
            name => name.to_string(),
        };
        let period = match dag.is_sporadic {
            true => "sporadic, at least T",
            false => "T",
        };
        let jobs = (dag.jobs).map_or("without end".into(), |jobs| format!("{jobs} jobs"));
        let mut label = format!(
            "{name}\n{period} = {}, D = {}",
            briefly(dag.period_ns),
            briefly(dag.relative_deadline_ns)
        );
        if dag.offset_ns > 0 {
            label += &format!(", O = {}", briefly(dag.offset_ns));
        }
        let overrun = match dag.overrun {
            0 => "queue",
            1 => "skip",
            _ => "abort",
        };
        label += &format!("\n{jobs}, {} in flight, overrun: {overrun}", dag.in_flight);
        let of_dag = (self.commit.told.affinities.iter()).filter(|of| of.0 == self.number);
        let cores: Vec<u32> = of_dag.map(|of| of.1).collect();
        if !cores.is_empty() {
            label += &format!("\naffinity: {cores:?}");
        }
        label
    }

    fn subtask_label(&self, number: usize, subtask: &CommittedSubtask) -> String {
        let mut label = match &*subtask.name {
            "" => format!("subtask {number}"),
            name => name.to_string(),
        };
        if let Some(wcet_ns) = subtask.wcet_ns {
            label += &format!("\nWCET {}", briefly(wcet_ns));
        }
        for &(dag, of, limit_ns, segment_ns) in &self.commit.told.waits {
            if (dag, of as usize) == (self.number, number) {
                label += &format!("\nwaits up to {}", briefly(limit_ns));
                label += &segment_ns.map_or(String::new(), |ns| format!(", then {}", briefly(ns)));
            }
        }
        // Under other policies it has no effect.
        if self.commit.options().policy == Policy::StaticPriority {
            label += &format!("\npriority {}", subtask.priority);
        }
        for &(dag, of, core) in &self.commit.told.pins {
            if (dag, of as usize) == (self.number, number) {
                label += &format!("\ncore {core}");
            }
        }
        for &(sink, deadline_ns) in &self.dag.sinks {
            if sink as usize == number && deadline_ns != self.dag.relative_deadline_ns {
                label += &format!("\nD = {}", briefly(deadline_ns));
            }
        }
        if subtask.is_non_preemptive {
            label += "\nnon-preemptive";
        }
        label
    }

    /// Adds an arrow for each reader of a topic, for each state, and for each other edge.
    fn add_edges(&self, id: &str, text: &mut String) {
        // Edges that a topic or a state makes are drawn by these, with a label.
        let mut explained = BTreeSet::new();
        for (number, topic) in self.dag.topics.iter().enumerate() {
            let name = format!("{}: {}", topic.name, without_paths(&topic.type_name));
            let (label, writer) = (quoted(&name), topic.writer);
            for &reader in &topic.readers {
                explained.insert((writer, reader));
                let edge = format!("{id}_s{writer} -> {id}_s{reader}");
                let _ = writeln!(text, "    {edge} [label={label}];");
            }
            let all = self.commit.told.dags.iter().flat_map(|dag| &dag.samples);
            let mut all = all.map(|&(_, dag, topic, _)| (dag, topic as usize));
            let is_taken = all.any(|of| of == (self.number, number));
            if topic.is_sampled {
                // The model has one mark for both: values that leave the DAG.
                let label = if is_taken { name } else { name + "\nrecorded" };
                let label = quoted(&label);
                let note = format!("{id}_t{number}");
                let _ = writeln!(text, "    {note} [shape=note, label={label}];");
                let _ = writeln!(text, "    {id}_s{writer} -> {note} [style=dashed];");
            }
        }
        for (name, earlier, later) in &self.dag.states {
            explained.insert((*earlier, *later));
            let edge = format!("{id}_s{earlier} -> {id}_s{later}");
            let _ = writeln!(text, "    {edge} [style=dotted, label={}];", quoted(name));
        }
        for (from, to) in &self.dag.edges {
            if !explained.contains(&(*from, *to)) {
                let _ = writeln!(text, "    {id}_s{from} -> {id}_s{to};");
            }
        }
    }
}

/// Returns a type's name without the paths of its parts.
fn without_paths(name: &str) -> String {
    let mut short = String::new();
    for part in name.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
        short += part.rsplit("::").next().unwrap_or(part);
    }
    short
}

/// Returns text as a quoted string of DOT: quotes and backslashes are escaped, and a line's end is
/// `\n`.
fn quoted(text: &str) -> String {
    let escaped = text.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", escaped.replace('\n', "\\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::commit;
    use recording::{Commit, CommittedTopic};

    const EYE: &str = "static 2
eye T=25000000 D=100000000 O=500 flight=5: camera/1/1000000 b/2 fuse/3; 0>1 0>2 1>2";

    fn committed(policy: Policy) -> Record {
        let mut told = commit(EYE);
        let eye = &mut told.dags[0];
        eye.jobs = Some(20);
        eye.subtasks[1].is_non_preemptive = true;
        eye.topics = vec![CommittedTopic {
            name: "frame".into(),
            type_name: "alloc::sync::Arc<[vision::Frame]>".into(),
            writer: 0,
            readers: vec![1],
            is_sampled: true,
        }];
        let topic = eye.topics[0].clone();
        let (name, type_name) = ("log".into(), "u8".into());
        eye.topics.push(CommittedTopic {
            name,
            type_name,
            readers: Vec::new(),
            ..topic
        });
        eye.states = vec![("map".into(), 1, 2)];
        eye.sinks = vec![(2, 90_000_000)];
        eye.samples = vec![(0, 0, 0, Some(12_000_000)), (2, 0, 0, None)];
        let waits = vec![(0, 0, 3_000_000, Some(400_000)), (0, 2, 0, None)];
        let told = Commit {
            policy: policy as u8,
            waits,
            pins: vec![(0, 1, 1)],
            affinities: vec![(0, 0)],
            ..told
        };
        let mut committed = Committed::new(0, told).expect("it is right");
        // A commit refuses both, but a picture can show them.
        committed.told.dags[0].name = "the \"eye\"".into();
        committed.told.dags[0].subtasks[1].name.clear();
        Record {
            commits: vec![committed],
            ..Record::default()
        }
    }

    const DRAWN: &str = r#"  subgraph cluster_c0_d0 {
    label="the \"eye\"\nT = 25 ms, D = 100 ms, O = 500 ns\n20 jobs, 5 in flight, overrun: queue\naffinity: [0]";
    c0_d0_s0 [label="camera\nWCET 1 ms\nwaits up to 3 ms, then 400 us\npriority 1"];
    c0_d0_s1 [label="subtask 1\npriority 2\ncore 1\nnon-preemptive"];
    c0_d0_s2 [label="fuse\nwaits up to 0 ns\npriority 3\nD = 90 ms"];
    c0_d0_s0 -> c0_d0_s1 [label="frame: Arc<[Frame]>"];
    c0_d0_t0 [shape=note, label="frame: Arc<[Frame]>"];
    c0_d0_s0 -> c0_d0_t0 [style=dashed];
    c0_d0_t1 [shape=note, label="log: u8\nrecorded"];
    c0_d0_s0 -> c0_d0_t1 [style=dashed];
    c0_d0_s1 -> c0_d0_s2 [style=dotted, label="map"];
    c0_d0_s0 -> c0_d0_s2;
  }
  c0_d0_t0 -> c0_d0_s0 [style=dashed, label="less than 12 ms old while jobs come"];
  c0_d0_t0 -> c0_d0_s2 [style=dashed];
"#;

    /// `tests/tests/boots/seeing.rs` shows samples of other DAGs.
    #[test]
    fn a_dag_is_a_cluster_with_all_that_was_committed() {
        let dot = text(&committed(Policy::StaticPriority)).expect("a commit");
        let (head, _) = dot.split_once("  subgraph").expect("a cluster");
        assert!(head.starts_with("digraph committed {\n"));
        assert_eq!(&dot[head.len()..], format!("{DRAWN}}}\n"));
        // Under EDF no priority is shown.
        let dot = text(&committed(Policy::Edf)).expect("a commit");
        assert!(!dot.contains("priority"), "{dot}");
        let nothing = text(&Record::default()).unwrap_err();
        assert_eq!(nothing, "the guest has committed no DAG");
    }

    #[test]
    fn types_are_short() {
        let long = "(core::option::Option<a::b::C>, &[x::Y_z; 3])";
        assert_eq!(without_paths(long), "(Option<C>, &[Y_z; 3])");
        assert_eq!(quoted("a\\b\n\"c\""), r#""a\\b\n\"c\"""#);
    }
}
