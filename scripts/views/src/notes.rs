//! Notes on committed DAGs and their subtasks, besides the picture of the graph.
//!
//! Of a DAG: its jobs, its cores, its topics with the types of messages and the subtasks of any DAG
//! sampling them, and its states. Of a subtask: its waits, its priority, its core, its own
//! deadline.

use recording::{CommittedDag, CommittedTopic};
use sched_dag::{DagId, Policy, SubtaskId};

use crate::record::CommittedDags;
use crate::units::briefly;

/// Returns the notes on a DAG of a commit; none for a DAG outside the commit.
pub fn of_dag(commit: &CommittedDags, dag: DagId) -> Vec<String> {
    let Some(told) = commit.told.dags.get(dag.index()) else {
        return Vec::new();
    };
    let overrun = ["queue", "skip", "abort"][usize::from(told.overrun.min(2))];
    let jobs = told
        .jobs
        .map_or("without end".into(), |jobs| format!("{jobs} jobs"));
    let in_flight = told.in_flight;
    let mut notes = vec![format!("{jobs}, {in_flight} in flight, overrun: {overrun}")];
    if told.offset_ns > 0 {
        notes.push(format!("released from {} on", briefly(told.offset_ns)));
    }
    let cores = commit.told.affinities.iter().filter(|of| of.0 == dag.0);
    let cores: Vec<String> = cores.map(|of| of.1.to_string()).collect();
    if !cores.is_empty() {
        notes.push(format!("affinity: cores {}", cores.join(", ")));
    }
    let topics = (0..).zip(&told.topics);
    notes.extend(topics.map(|(number, topic)| of_topic(commit, (dag, told), number, topic)));
    let state = |(state, earlier, later): &(String, u32, u32)| {
        let [earlier, later] = [earlier, later].map(|subtask| name(told, *subtask));
        format!("state `{state}`: {earlier} before {later}")
    };
    notes.extend(told.states.iter().map(state));
    notes
}

/// Returns the note on a topic: the type, the writer and the readers.
fn of_topic(
    commit: &CommittedDags,
    (dag, told): (DagId, &CommittedDag),
    number: u32,
    topic: &CommittedTopic,
) -> String {
    let type_name = without_paths(&topic.type_name);
    let writer = name(told, topic.writer);
    let mut note = format!("topic `{}`: {type_name} of {writer}", topic.name);
    let readers = topic.readers.iter().map(|reader| name(told, *reader));
    let readers: Vec<String> = readers.collect();
    if !readers.is_empty() {
        note += &format!(", read by {}", readers.join(", "));
    }
    let mut is_taken = false;
    for reader in &commit.told.dags {
        for &(subtask, of, topic, staleness_ns) in &reader.samples {
            if (of, topic) == (dag.0, number) {
                is_taken = true;
                note += &format!(", sampled by {}/{}", reader.name, name(reader, subtask));
                note += &staleness_ns.map_or(String::new(), |ns| {
                    format!(" (less than {} old while jobs come)", briefly(ns))
                });
            }
        }
    }
    // The model has one mark for both: values that leave the DAG.
    note += if topic.is_sampled && !is_taken {
        ", recorded"
    } else {
        ""
    };
    note
}

/// Returns the notes on a subtask of a commit; none for a subtask outside the commit.
pub fn of_subtask(commit: &CommittedDags, dag: DagId, subtask: SubtaskId) -> Vec<String> {
    let told = commit.told.dags.get(dag.index());
    let Some((told, of)) = told.and_then(|of| Some((of, of.subtasks.get(subtask.index())?))) else {
        return Vec::new();
    };
    let mut notes = Vec::new();
    for &(of_dag, of, limit_ns, segment_ns) in &commit.told.waits {
        if (of_dag, of) == (dag.0, subtask.0) {
            let then = segment_ns.map_or(String::new(), |ns| format!(", then {}", briefly(ns)));
            notes.push(format!("waits up to {}{then}", briefly(limit_ns)));
        }
    }
    // Under other policies it has no effect.
    if commit.options().policy == Policy::StaticPriority {
        notes.push(format!("priority {}", of.priority));
    }
    let tables = commit.task_set.tables().iter();
    for (table, list) in tables.flat_map(|table| table.lists.iter().map(move |list| (table, list)))
    {
        let mut entries = list.entries.iter();
        if entries.any(|entry| (entry.dag, entry.subtask) == (dag, subtask)) {
            let core = commit.task_set.cores_of(table.cluster, 0).start + list.core;
            notes.push(format!("listed on core {core}"));
        }
    }
    for &(sink, deadline_ns) in &told.sinks {
        if sink == subtask.0 && deadline_ns != told.relative_deadline_ns {
            notes.push(format!("deadline {}", briefly(deadline_ns)));
        }
    }
    notes.extend(of.is_non_preemptive.then(|| "non-preemptive".into()));
    notes
}

/// Returns the name of a subtask, or the number of a nameless subtask.
fn name(dag: &CommittedDag, subtask: u32) -> String {
    let of = dag.subtasks.get(SubtaskId(subtask).index());
    let of = of.filter(|of| !of.name.is_empty());
    of.map_or(format!("subtask {subtask}"), |of| of.name.clone())
}

/// Returns a type's name without the paths of the name's parts.
fn without_paths(name: &str) -> String {
    let mut short = String::new();
    for part in name.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
        short += part.rsplit("::").next().unwrap_or(part);
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::commit;
    use recording::Commit;

    const EYE: &str = "static 2
eye T=25000000 D=100000000 O=500 flight=5: camera/1/1000000 b/2 fuse/3; 0>1 0>2 1>2
beat T=25000000 D=25000000: tick/4/1000000";

    fn committed(policy: Policy) -> CommittedDags {
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
            lists: vec!["core 1: 1.0".into()],
            affinities: vec![(0, 0)],
            ..told
        };
        let mut committed = CommittedDags::new(0, told).expect("it is right");
        // A commit refuses it, but notes can tell of it.
        committed.told.dags[0].subtasks[1].name.clear();
        committed
    }

    /// `tests/tests/boots/seeing.rs` has samples of other DAGs.
    #[test]
    fn all_that_was_committed_is_told_of_a_dag_and_of_its_subtasks() {
        let eye = committed(Policy::StaticPriority);
        let of_dag = [
            "20 jobs, 5 in flight, overrun: queue",
            "released from 500 ns on",
            "affinity: cores 0",
            "topic `frame`: Arc<[Frame]> of camera, read by subtask 1, sampled by eye/camera (less \
             than 12 ms old while jobs come), sampled by eye/fuse",
            "topic `log`: u8 of camera, recorded",
            "state `map`: subtask 1 before fuse",
        ];
        assert_eq!(super::of_dag(&eye, DagId(0)), of_dag);
        let of = |subtask| of_subtask(&eye, DagId(0), SubtaskId(subtask)).join("; ");
        assert_eq!(of(0), "waits up to 3 ms, then 400 us; priority 1");
        assert_eq!(of(1), "priority 2; non-preemptive");
        assert_eq!(of(2), "waits up to 0 ns; priority 3; deadline 90 ms");
        let expected = (String::new(), 0);
        assert_eq!((of(3), super::of_dag(&eye, DagId(2)).len()), expected);
        let tick = of_subtask(&eye, DagId(1), SubtaskId(0));
        assert_eq!(tick, ["priority 4", "listed on core 1"]);
        // Under EDF no priority is shown.
        let eye = committed(Policy::Edf);
        let expected = ["non-preemptive"];
        assert_eq!(of_subtask(&eye, DagId(0), SubtaskId(1)), expected);
    }

    #[test]
    fn types_are_short() {
        let long = "(core::option::Option<a::b::C>, &[x::Y_z; 3])";
        assert_eq!(without_paths(long), "(Option<C>, &[Y_z; 3])");
    }
}
