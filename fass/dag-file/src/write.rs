//! Writes DAG files. [`parse()`](crate::parse()) reads a written file back unchanged.
//!
//! Only values differing from the default are written, so a file converted from another format
//! reads like a file written by a person.

use core::fmt::{Display, Formatter, Result};

use sched_dag::{OverrunPolicy, SubtaskSpec};

use crate::file::{DagFile, FileDag, FileSubtask, sample_len};
use crate::time::Time;

impl Display for DagFile {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        for set in &self.sets {
            if !set.name.is_empty() {
                writeln!(out, "set {}\n", set.name)?;
            }
            for dag in &set.dags {
                write_dag(dag, out)?;
            }
            for (_, list) in &set.lists {
                writeln!(out, "{list}")?;
            }
            out.write_str(&set.certificate)?;
        }
        writeln!(out, "end")
    }
}

fn write_dag(dag: &FileDag, out: &mut Formatter<'_>) -> Result {
    let spec = &dag.spec;
    write!(out, "dag {}", spec.name)?;
    write!(out, " period {}", Time(spec.period_ns.unwrap_or(0)))?;
    if let Some(deadline_ns) = spec.relative_deadline_ns {
        write!(out, " deadline {}", Time(deadline_ns))?;
    }
    if spec.offset_ns > 0 {
        write!(out, " offset {}", Time(spec.offset_ns))?;
    }
    if let Some(cluster) = spec.cluster {
        write!(out, " cluster {}", cluster.0)?;
    }
    for (number, core) in spec.affinity.iter().enumerate() {
        let separator = if number == 0 { " affinity " } else { "," };
        write!(out, "{separator}{core}")?;
    }
    match spec.overrun {
        OverrunPolicy::Queue => {}
        OverrunPolicy::Skip => out.write_str(" overrun skip")?,
        OverrunPolicy::Abort => out.write_str(" overrun abort")?,
    }
    if let Some(jobs) = spec.in_flight {
        write!(out, " in-flight {jobs}")?;
    }
    if let Some(jobs) = spec.jobs {
        write!(out, " jobs {jobs}")?;
    }
    writeln!(out)?;
    for (subtask, more) in spec.subtasks.iter().zip(&dag.subtasks) {
        write_subtask(subtask, more, out)?;
    }
    let name = |index: usize| &spec.subtasks[index].name;
    for &(earlier, later) in &spec.edges {
        writeln!(out, "edge {} -> {}", name(earlier), name(later))?;
    }
    writeln!(out)
}

fn write_subtask(spec: &SubtaskSpec, more: &FileSubtask, out: &mut Formatter<'_>) -> Result {
    // Each part is written in the reader's form: the rest of the WCET belongs to the first segment.
    let later_ns: u64 = spec.waits.iter().filter_map(|wait| wait.segment_ns).sum();
    write!(out, "subtask {}", spec.name)?;
    if let Some(wcet_ns) = spec.wcet_ns {
        write!(out, " wcet {}", Time(wcet_ns.saturating_sub(later_ns)))?;
    }
    for wait in &spec.waits {
        write!(out, " wait {}", Time(wait.limit_ns))?;
        if let Some(segment_ns) = wait.segment_ns {
            write!(out, " wcet {}", Time(segment_ns))?;
        }
    }
    if let Some(priority) = spec.priority {
        write!(out, " priority {}", priority.0)?;
    }
    if spec.non_preemptive {
        out.write_str(" non-preemptive")?;
    }
    if let Some(deadline_ns) = spec.relative_deadline_ns {
        write!(out, " deadline {}", Time(deadline_ns))?;
    }
    for (number, sample_ns) in more.samples_ns.iter().enumerate() {
        let separator = match (number, number % sample_len(spec)) {
            (0, _) => " samples ",
            (_, 0) => ",",
            _ => "+",
        };
        write!(out, "{separator}{}", Time(*sample_ns))?;
    }
    writeln!(out)
}
