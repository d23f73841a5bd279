//! The cases of what is wrong with the graph: its subtasks, edges, topics and types.

use alloc::vec;
use alloc::vec::Vec;

use fass::{Dag, SubtaskAttributes, Unique, finish_create_dags};

use super::{PERIOD, join, joining_sink, named, relay, sink, sound, source};

pub(super) fn no_dags() -> Vec<Dag> {
    Vec::new()
}

pub(super) fn no_subtasks() -> Vec<Dag> {
    vec![named("lidar")]
}

pub(super) fn given_twice() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    vec![dag.clone(), dag]
}

pub(super) fn already_committed() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.jobs(1);
    // What it returns shows at the next commit, which is the case.
    let _ = finish_create_dags(core::slice::from_ref(&dag));
    vec![dag]
}

pub(super) fn input_arity() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_, _): (u32, u32)| (), vec!["points"], PERIOD, store);
    vec![dag]
}

pub(super) fn output_arity() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32, 2_u32), vec!["points"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

pub(super) fn duplicate_subtask() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    relay(&dag, "filter", "points", "near points");
    relay(&dag, "filter", "near points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

pub(super) fn cycle() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    join(&dag, "filter", ["points", "objects"], "near points");
    relay(&dag, "detect", "near points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

pub(super) fn self_edge() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    join(&dag, "track", ["points", "tracks"], "tracks");
    sink(&dag, "store", "tracks");
    vec![dag]
}

pub(super) fn not_connected() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    source(&dag, "measure", "heat");
    sink(&dag, "cool", "heat");
    vec![dag]
}

pub(super) fn no_source() -> Vec<Dag> {
    let dag = named("lidar");
    relay(&dag, "filter", "objects", "near points");
    relay(&dag, "detect", "near points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

pub(super) fn several_sources() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "left", "left points");
    source(&dag, "right", "right points");
    joining_sink(&dag, "store", ["left points", "right points"]);
    vec![dag]
}

pub(super) fn no_sink() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    join(&dag, "filter", ["points", "objects"], "near points");
    relay(&dag, "detect", "near points", "objects");
    vec![dag]
}

pub(super) fn several_sinks() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    sink(&dag, "show", "points");
    vec![dag]
}

pub(super) fn unread_topic() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32, 2_u32), vec!["points", "heat"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

pub(super) fn unwritten_topic() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    relay(&dag, "filter", "points", "ground");
    joining_sink(&dag, "store", ["ground", "point"]);
    vec![dag]
}

pub(super) fn type_mismatch() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (f64,)| (), vec!["points"], PERIOD, store);
    vec![dag]
}

pub(super) fn several_writers() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    relay(&dag, "near", "points", "objects");
    relay(&dag, "far", "points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

pub(super) fn several_readers() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (Unique::new(1_u32),), vec!["points"], PERIOD, read);
    for (name, output) in [("near", "near points"), ("far", "far points")] {
        let attributes = SubtaskAttributes::named(name);
        let take = |(points,): (Unique<u32>,)| (points.into_inner(),);
        dag.register_subtask(take, vec!["points"], vec![output], attributes);
    }
    joining_sink(&dag, "store", ["near points", "far points"]);
    vec![dag]
}

pub(super) fn topic_in_several_dags() -> Vec<Dag> {
    vec![sound("lidar", "points"), sound("radar", "points")]
}

pub(super) fn duplicate_topic() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    joining_sink(&dag, "store", ["points", "points"]);
    vec![dag]
}
