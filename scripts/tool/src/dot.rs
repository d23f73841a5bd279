//! Committed DAGs as a picture: text for Graphviz.
//!
//! A guest that is booted with `graph=dump` prints each committed DAG in a line of
//! kind `graph`. Here the lines of a run become one `digraph` in the DOT language: a
//! cluster for each DAG with its period and deadline; a box for each subtask with
//! its WCET and priority; an arrow for each edge, with the topic and the message's
//! type, dotted where a state makes the edge. A topic whose latest value is sampled
//! has a note of its own, with a dashed arrow to each subtask, of any DAG, that
//! samples it.

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::json::Value;
use crate::protocol::{MachineLine, Transcript};

/// Returns the text for all DAGs that a run has committed.
///
/// # Errors
///
/// In words: the run has committed none, or a line is not as
/// `docs/serial-protocol.md` says.
pub fn text(transcript: &Transcript) -> Result<String, String> {
    let lines: Vec<&MachineLine> = transcript.of_kind("graph").collect();
    if lines.is_empty() {
        return Err("the guest has committed no DAG".into());
    }
    let mut text = String::from(
        "digraph committed {\n  rankdir=LR;\n  node [shape=box, style=rounded, \
         fontname=\"sans-serif\"];\n  edge [fontname=\"sans-serif\", fontsize=10];\n  \
         graph [fontname=\"sans-serif\"];\n",
    );
    // An arrow between two clusters stands outside both.
    let mut between = String::new();
    for line in lines {
        let dag = Dag(line);
        let parts = dag.text().zip(dag.samples());
        let (cluster, samples) = parts.ok_or_else(|| {
            format!(
                "serial line {}: a line of kind `graph` is malformed",
                line.number
            )
        })?;
        text += &cluster;
        between += &samples;
    }
    text += &between;
    text += "}\n";
    Ok(text)
}

/// One DAG's line.
struct Dag<'l>(&'l MachineLine);

impl Dag<'_> {
    fn text(&self) -> Option<String> {
        let line = self.0;
        let id = self.id(line.number_at("dag")?)?;
        let mut text = format!(
            "  subgraph cluster_{id} {{\n    label={};\n",
            quoted(&self.label()?)
        );
        // Writing into a `String` cannot fail.
        for (number, subtask) in line.value.get("subtasks")?.elements().iter().enumerate() {
            let label = self.subtask_label(number, subtask)?;
            let _ = writeln!(text, "    {id}_s{number} [label={}];", quoted(&label));
        }
        self.add_edges(&id, &mut text)?;
        text += "  }\n";
        Some(text)
    }

    /// What the names of a DAG of this commit begin with.
    fn id(&self, dag: u64) -> Option<String> {
        Some(format!("c{}_d{dag}", self.0.number_at("commit")?))
    }

    /// The arrows to this DAG's subtasks from the topics that they sample.
    fn samples(&self) -> Option<String> {
        let line = self.0;
        let id = self.id(line.number_at("dag")?)?;
        let mut text = String::new();
        for sample in line.value.get("samples")?.elements() {
            let [reader, writer, topic, staleness_ns] = sample.elements() else {
                return None;
            };
            let (reader, topic) = (reader.as_u64()?, topic.as_u64()?);
            let writer = self.id(writer.as_u64()?)?;
            let label = staleness_ns.as_u64().map_or(String::new(), |ns| {
                format!(", label=\"less than {} old\"", time(ns))
            });
            // Writing into a `String` cannot fail.
            let _ = writeln!(
                text,
                "  {writer}_t{topic} -> {id}_s{reader} [style=dashed{label}];"
            );
        }
        Some(text)
    }

    fn label(&self) -> Option<String> {
        let line = self.0;
        let name = match line.text_at("name")? {
            "" => format!("dag {}", line.number_at("dag")?),
            name => name.to_string(),
        };
        let period = match line.value.get("sporadic")?.as_bool()? {
            true => "sporadic, at least T",
            false => "T",
        };
        let jobs = line.value.get("jobs")?.elements().first();
        let jobs = jobs.and_then(Value::as_u64);
        let jobs = jobs.map_or("without end".into(), |jobs| format!("{jobs} jobs"));
        let mut label = format!(
            "{name}\n{period} = {}, D = {}",
            time(line.number_at("period_ns")?),
            time(line.number_at("relative_deadline_ns")?)
        );
        if let Some(offset_ns) = line.number_at("offset_ns").filter(|&ns| ns > 0) {
            label += &format!(", O = {}", time(offset_ns));
        }
        label += &format!(
            "\n{jobs}, {} in flight, overrun: {}",
            line.number_at("in_flight")?,
            line.text_at("overrun")?
        );
        Some(label)
    }

    fn subtask_label(&self, number: usize, subtask: &Value) -> Option<String> {
        let [name, priority, non_preemptive, wcet_ns] = subtask.elements() else {
            return None;
        };
        let mut label = match name.as_text()? {
            "" => format!("subtask {number}"),
            name => name.to_string(),
        };
        if let Some(wcet_ns) = wcet_ns.as_u64() {
            label += &format!("\nWCET {}", time(wcet_ns));
        }
        // Under EDF the priority is of no effect.
        if self.0.text_at("policy")? == "static" {
            label += &format!("\npriority {}", priority.as_u64()?);
        }
        if non_preemptive.as_u64()? == 1 {
            label += "\nnon-preemptive";
        }
        Some(label)
    }

    fn add_edges(&self, id: &str, text: &mut String) -> Option<()> {
        let line = self.0;
        let mut explained = BTreeSet::new();
        // Writing into a `String` cannot fail.
        for (number, topic) in line.value.get("topics")?.elements().iter().enumerate() {
            let [name, kind, writer, readers, is_sampled] = topic.elements() else {
                return None;
            };
            let label = format!("{}: {}", name.as_text()?, without_paths(kind.as_text()?));
            let (label, writer) = (quoted(&label), writer.as_u64()?);
            for reader in readers.elements() {
                let reader = reader.as_u64()?;
                explained.insert((writer, reader));
                let _ = writeln!(
                    text,
                    "    {id}_s{writer} -> {id}_s{reader} [label={label}];"
                );
            }
            if is_sampled.as_u64()? == 1 {
                let note = format!("{id}_t{number}");
                let _ = writeln!(text, "    {note} [shape=note, label={label}];");
                let _ = writeln!(text, "    {id}_s{writer} -> {note} [style=dashed];");
            }
        }
        for state in line.value.get("states")?.elements() {
            let [name, earlier, later] = state.elements() else {
                return None;
            };
            let (label, earlier, later) =
                (quoted(name.as_text()?), earlier.as_u64()?, later.as_u64()?);
            explained.insert((earlier, later));
            let edge = format!("{id}_s{earlier} -> {id}_s{later}");
            let _ = writeln!(text, "    {edge} [style=dotted, label={label}];");
        }
        for edge in line.value.get("edges")?.elements() {
            let [from, to] = edge.elements() else {
                return None;
            };
            let (from, to) = (from.as_u64()?, to.as_u64()?);
            if !explained.contains(&(from, to)) {
                let _ = writeln!(text, "    {id}_s{from} -> {id}_s{to};");
            }
        }
        Some(())
    }
}

/// A type's name without the paths of what it is made of.
fn without_paths(name: &str) -> String {
    let mut short = String::new();
    for part in name.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
        short += part.rsplit("::").next().unwrap_or(part);
    }
    short
}

/// A time in the largest unit in which it is a number with few digits.
fn time(ns: u64) -> String {
    let units = [(1_000_000_000, "s"), (1_000_000, "ms"), (1000, "us")];
    let of = |unit: u64| {
        let text = format!("{}.{:03}", ns / unit, ns % unit * 1000 / unit);
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    };
    let unit = units.into_iter().find(|&(unit, _)| ns >= unit);
    unit.map_or(format!("{ns} ns"), |(unit, name)| {
        format!("{} {name}", of(unit))
    })
}

/// Text inside quotes as DOT has them: a quote and a backslash are escaped, and a
/// line's end is `\n`.
fn quoted(text: &str) -> String {
    let escaped = text.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", escaped.replace('\n', "\\n"))
}

#[cfg(test)]
mod tests {
    use super::{quoted, text, time, without_paths};
    use crate::protocol::Transcript;

    const LINE: &str = concat!(
        r#"{"kind":"graph","commit":0,"policy":"static","preemption":"on","cores":2,"#,
        r#""overhead_ns":[0],"bound_ns":[],"hash":1,"dag":1,"name":"the \"eye\"","#,
        r#""period_ns":25000000,"relative_deadline_ns":100000000,"offset_ns":500,"in_flight":5,"#,
        r#""overrun":"queue","subtasks":[["camera",1,0,1000000],["",2,1,null],["fuse",3,0,null]],"#,
        r#""edges":[[0,1],[0,2],[1,2]],"sporadic":false,"jobs":[20],"#,
        r#""topics":[["frame","alloc::sync::Arc<[vision::Frame]>",0,[1],1]],"#,
        r#""states":[["map",1,2]],"samples":[[0,1,0,12000000],[2,1,0,null]]}"#
    );

    const DRAWN: &str = r#"  subgraph cluster_c0_d1 {
    label="the \"eye\"\nT = 25 ms, D = 100 ms, O = 500 ns\n20 jobs, 5 in flight, overrun: queue";
    c0_d1_s0 [label="camera\nWCET 1 ms\npriority 1"];
    c0_d1_s1 [label="subtask 1\npriority 2\nnon-preemptive"];
    c0_d1_s2 [label="fuse\npriority 3"];
    c0_d1_s0 -> c0_d1_s1 [label="frame: Arc<[Frame]>"];
    c0_d1_t0 [shape=note, label="frame: Arc<[Frame]>"];
    c0_d1_s0 -> c0_d1_t0 [style=dashed];
    c0_d1_s1 -> c0_d1_s2 [style=dotted, label="map"];
    c0_d1_s0 -> c0_d1_s2;
  }
  c0_d1_t0 -> c0_d1_s0 [style=dashed, label="less than 12 ms old"];
  c0_d1_t0 -> c0_d1_s2 [style=dashed];
"#;

    fn drawn(line: &str) -> Result<String, String> {
        text(&Transcript::read(line))
    }

    /// Samples of other DAGs are shown by `tests/tests/boot_seeing.rs`.
    #[test]
    fn a_dag_is_a_cluster_with_all_that_was_committed() {
        let dot = drawn(LINE).expect("a good line");
        let (head, _) = dot.split_once("  subgraph").expect("a cluster");
        assert!(head.starts_with("digraph committed {\n"));
        assert_eq!(&dot[head.len()..], format!("{DRAWN}}}\n"));
        // Under EDF no priority is shown.
        let dot = drawn(&LINE.replace("\"static\"", "\"edf\"")).expect("a good line");
        assert!(!dot.contains("priority"), "{dot}");
    }

    #[test]
    fn a_run_without_dags_or_a_damaged_line_is_told() {
        assert_eq!(drawn("").unwrap_err(), "the guest has committed no DAG");
        for (right, wrong) in [("[1,2]]", "[1,\"x\"]]"), ("[2,1,0,null]", "[2,1,0]")] {
            let error = drawn(&LINE.replace(right, wrong)).unwrap_err();
            assert_eq!(error, "serial line 1: a line of kind `graph` is malformed");
        }
    }

    #[test]
    fn types_and_times_are_short() {
        let long = "(core::option::Option<a::b::C>, &[x::Y_z; 3])";
        assert_eq!(without_paths(long), "(Option<C>, &[Y_z; 3])");
        let times = [999, 1_500, 2_000_000_000, 1_234_567_890].map(time);
        assert_eq!(times, ["999 ns", "1.5 us", "2 s", "1.234 s"]);
        assert_eq!(quoted("a\\b\n\"c\""), r#""a\\b\n\"c\"""#);
    }
}
