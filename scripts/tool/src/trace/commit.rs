//! What a log says of a run's commit besides its model: lines of kind `graph`, by which
//! samplings are known, and the response times that are proven.
//!
//! `./scripts/run --trace FILE` asks for both kinds. The commit of a run is the last one before
//! its trace, if its DAGs have the same names; a log without such lines has no chains.

use sched_dag::chains::Sampling;
use sched_dag::{DagId, SubtaskId, TaskSet};

use super::line::Line;
use crate::json::Value;
use replay::lines::Malformed;

/// What a run's commit has said.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Committed {
    /// Which subtasks sample which topics.
    pub samplings: Vec<Sampling>,
    /// For each DAG, the response time that is proven.
    pub bounds_ns: Vec<Option<u64>>,
}

/// A commit of which not all lines may be read.
#[derive(Clone, Debug, Default)]
pub(super) struct Open {
    number: u64,
    dags: Vec<Graph>,
}

/// A line of kind `graph`.
#[derive(Clone, Debug)]
struct Graph {
    name: String,
    bound_ns: Option<u64>,
    /// The writers of its topics.
    writers: Vec<u64>,
    /// By sampling: the subtask, the DAG that writes, and the topic's place there.
    samples: Vec<[u64; 3]>,
}

impl Open {
    /// Takes a line of kind `graph`, the first one of a commit or another one.
    pub(super) fn add(&mut self, line: &Line<'_>) -> Result<(), Malformed> {
        let number = line.number("commit")?;
        if number != self.number || line.number("dag")? == 0 {
            *self = Open::default();
            self.number = number;
        }
        let numbers = |name: &str, of: fn(&[Value]) -> Option<Vec<u64>>| {
            let all = line.elements(name)?.iter();
            let all: Option<Vec<Vec<u64>>> = all.map(|value| of(value.elements())).collect();
            all.ok_or_else(|| line.malformed(format!("`{name}` is not as it should be")))
        };
        let writers = numbers("topics", |topic| Some(vec![topic.get(2)?.as_u64()?]))?;
        let samples = numbers("samples", |sample| {
            sample.get(..3)?.iter().map(Value::as_u64).collect()
        })?;
        let samples = samples
            .iter()
            .map(|sample| [sample[0], sample[1], sample[2]]);
        self.dags.push(Graph {
            name: line.text("name")?.into(),
            bound_ns: line.elements("bound_ns")?.first().and_then(Value::as_u64),
            writers: writers.concat(),
            samples: samples.collect(),
        });
        Ok(())
    }

    /// Returns what was said of these DAGs, if they are the ones that were committed.
    pub(super) fn of(&self, task_set: &TaskSet) -> Committed {
        let names = self.dags.iter().map(|dag| dag.name.as_str());
        if !names.eq(task_set.dags().iter().map(sched_dag::Dag::name)) {
            return Committed::default();
        }
        let dags = (0_u64..).zip(&self.dags);
        let samples = dags.flat_map(|(dag, graph)| graph.samples.iter().map(move |it| (dag, it)));
        let sampling = |(dag, &[reader, writer, topic]): (u64, &[u64; 3])| {
            let graph = self.dags.get(usize::try_from(writer).ok()?)?;
            let of_topic = graph.writers.get(usize::try_from(topic).ok()?)?;
            Some(Sampling {
                writer: place(task_set, writer, *of_topic)?,
                reader: place(task_set, dag, reader)?,
            })
        };
        Committed {
            samplings: samples.filter_map(sampling).collect(),
            bounds_ns: self.dags.iter().map(|dag| dag.bound_ns).collect(),
        }
    }
}

/// Returns a subtask that is there.
fn place(task_set: &TaskSet, dag: u64, subtask: u64) -> Option<(DagId, SubtaskId)> {
    let model = task_set.dags().get(usize::try_from(dag).ok()?)?;
    let subtask = u32::try_from(subtask).ok().map(SubtaskId);
    let subtask = subtask.filter(|subtask| subtask.index() < model.subtasks().len())?;
    Some((DagId(u32::try_from(dag).ok()?), subtask))
}
