//! One commit for each fault that an app can make with `fass`.
//!
//! A *case* builds DAGs that a commit must refuse for one reason, its fault.
//! [`provoke`] commits them one after the other and hands over what the commit
//! said; `docs/commit-faults.md` shows the same texts to people. A fault that
//! `fass` rules out by its types (such as 17 inputs) has no case.

mod shared;

use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, Unique, create_dag, finish_create_dags};

/// A fault's name and what builds the DAGs with that fault.
type Case = (&'static str, fn() -> Vec<Dag>);

/// The cases, for a platform with static priorities. The last one needs a commit that succeeds, so it comes last.
pub const CASES: &[Case] = &[
    ("no_dags", Vec::new),
    ("no_subtasks", || vec![named("lidar")]),
    ("given_twice", || {
        let dag = sound("lidar", "points");
        vec![dag.clone(), dag]
    }),
    ("input_arity", input_arity),
    ("output_arity", output_arity),
    ("duration_too_long", || chain(Duration::MAX, PERIOD)),
    ("periods_differ", periods_differ),
    ("deadlines_differ", deadlines_differ),
    ("duplicate_subtask", duplicate_subtask),
    ("cycle", cycle),
    ("self_edge", self_edge),
    ("not_connected", not_connected),
    ("no_source", no_source),
    ("several_sources", several_sources),
    ("no_sink", no_sink),
    ("several_sinks", several_sinks),
    ("unread_topic", unread_topic),
    ("unwritten_topic", unwritten_topic),
    ("type_mismatch", type_mismatch),
    ("several_writers", several_writers),
    ("several_readers", several_readers),
    ("topic_in_several_dags", || {
        vec![sound("lidar", "points"), sound("radar", "points")]
    }),
    ("duplicate_topic", duplicate_topic),
    ("missing_period", no_source),
    ("zero_period", || chain(Duration::ZERO, PERIOD)),
    ("missing_deadline", no_sink),
    ("zero_deadline", || chain(PERIOD, Duration::ZERO)),
    ("wcet_exceeds_deadline", wcet_exceeds_deadline),
    ("priorities_partly_given", || chain_with_priority(7)),
    ("priorities_exhausted", priorities_exhausted),
    ("zero_jobs", || {
        let dag = sound("lidar", "points");
        dag.jobs(0);
        vec![dag]
    }),
    ("zero_in_flight", || {
        let dag = sound("lidar", "points");
        dag.in_flight(0);
        vec![dag]
    }),
    ("too_many_instances", || {
        let dag = sound("lidar", "points");
        dag.in_flight(u32::MAX);
        vec![dag]
    }),
    ("time_overflow", || {
        let dag = sound("lidar", "points");
        dag.offset(Duration::from_nanos(u64::MAX));
        vec![dag]
    }),
    ("activations_differ", shared::activations_differ),
    ("duplicate_state", shared::duplicate_state),
    ("unused_state", shared::unused_state),
    ("state_never_updated", shared::state_never_updated),
    ("state_used_twice", shared::state_used_twice),
    ("state_over_jobs", shared::state_over_jobs),
    ("latest_unwritten", || shared::latest("pose", true)),
    ("latest_unread", || shared::latest("points", false)),
    ("latest_type_mismatch", shared::latest_type_mismatch),
    ("latest_of_moved", shared::latest_of_moved),
    ("latest_not_committed", shared::latest_not_committed),
    ("signal_not_committed", shared::signal_not_committed),
    ("not_proven", not_proven),
    ("already_committed", already_committed),
];

/// Commits every case and hands over the case's name, the fault's name, and
/// its text; once with empty texts if the commit did not find the fault.
pub fn provoke(mut report: impl FnMut(&str, &str, &str)) {
    for (name, build) in CASES {
        let dags = build();
        let faults = match finish_create_dags(&dags) {
            Ok(_) => Vec::new(),
            Err(error) => error.faults().to_vec(),
        };
        match faults.iter().find(|fault| fault.code() == *name) {
            Some(fault) => report(name, fault.code(), &fault.to_string()),
            None => report(name, "", ""),
        }
    }
}

const PERIOD: Duration = Duration::from_millis(10);

fn named(name: &str) -> Dag {
    let dag = create_dag();
    dag.name(name);
    dag
}

/// Registers a source that writes `topic`.
fn source(dag: &Dag, name: &str, topic: &str) {
    let attributes = SubtaskAttributes::named(name);
    dag.register_periodic_subtask(|| (1_u32,), vec![topic], PERIOD, attributes);
}

/// Registers a subtask that reads one topic and writes another.
fn relay(dag: &Dag, name: &str, input: &str, output: &str) {
    let attributes = SubtaskAttributes::named(name);
    dag.register_subtask(|(x,): (u32,)| (x,), vec![input], vec![output], attributes);
}

/// Registers a subtask that reads two topics and writes another.
fn join(dag: &Dag, name: &str, inputs: [&str; 2], output: &str) {
    let attributes = SubtaskAttributes::named(name);
    let sum = |(x, y): (u32, u32)| (x.wrapping_add(y),);
    dag.register_subtask(sum, inputs.to_vec(), vec![output], attributes);
}

/// Registers a sink that reads `topic`.
fn sink(dag: &Dag, name: &str, topic: &str) {
    let attributes = SubtaskAttributes::named(name);
    dag.register_sink_subtask(|(_,): (u32,)| (), vec![topic], PERIOD, attributes);
}

/// Registers a sink that reads two topics.
fn joining_sink(dag: &Dag, name: &str, inputs: [&str; 2]) {
    let attributes = SubtaskAttributes::named(name);
    dag.register_sink_subtask(|(_, _): (u32, u32)| (), inputs.to_vec(), PERIOD, attributes);
}

/// A DAG without fault: a source, a topic, a sink.
fn sound(name: &str, topic: &str) -> Dag {
    let dag = named(name);
    source(&dag, "read", topic);
    sink(&dag, "store", topic);
    dag
}

fn chain(period: Duration, deadline: Duration) -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], period, read);
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], deadline, store);
    vec![dag]
}

fn input_arity() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_, _): (u32, u32)| (), vec!["points"], PERIOD, store);
    vec![dag]
}

fn output_arity() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32, 2_u32), vec!["points"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

fn periods_differ() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "left", "left points");
    let right = SubtaskAttributes::named("right");
    dag.register_periodic_subtask(|| (1_u32,), vec!["right points"], PERIOD * 2, right);
    joining_sink(&dag, "store", ["left points", "right points"]);
    vec![dag]
}

fn deadlines_differ() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    sink(&dag, "store", "points");
    let show = SubtaskAttributes::named("show");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD * 2, show);
    vec![dag]
}

fn duplicate_subtask() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    relay(&dag, "filter", "points", "near points");
    relay(&dag, "filter", "near points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

fn cycle() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    join(&dag, "filter", ["points", "objects"], "near points");
    relay(&dag, "detect", "near points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

fn self_edge() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    join(&dag, "track", ["points", "tracks"], "tracks");
    sink(&dag, "store", "tracks");
    vec![dag]
}

fn not_connected() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    source(&dag, "measure", "heat");
    sink(&dag, "cool", "heat");
    vec![dag]
}

fn no_source() -> Vec<Dag> {
    let dag = named("lidar");
    relay(&dag, "filter", "objects", "near points");
    relay(&dag, "detect", "near points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

fn several_sources() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "left", "left points");
    source(&dag, "right", "right points");
    joining_sink(&dag, "store", ["left points", "right points"]);
    vec![dag]
}

fn no_sink() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    join(&dag, "filter", ["points", "objects"], "near points");
    relay(&dag, "detect", "near points", "objects");
    vec![dag]
}

fn several_sinks() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    sink(&dag, "show", "points");
    vec![dag]
}

fn unread_topic() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32, 2_u32), vec!["points", "heat"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

fn unwritten_topic() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    joining_sink(&dag, "store", ["points", "pose"]);
    vec![dag]
}

fn type_mismatch() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (f64,)| (), vec!["points"], PERIOD, store);
    vec![dag]
}

fn several_writers() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    relay(&dag, "near", "points", "objects");
    relay(&dag, "far", "points", "objects");
    sink(&dag, "store", "objects");
    vec![dag]
}

fn several_readers() -> Vec<Dag> {
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

fn duplicate_topic() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    joining_sink(&dag, "store", ["points", "points"]);
    vec![dag]
}

fn wcet_exceeds_deadline() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store").wcet(PERIOD * 2);
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD, store);
    vec![dag]
}

fn chain_with_priority(priority: u32) -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read").priority(priority);
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

/// The priorities of one DAG are the last numbers there are; those of the
/// other are to be derived below them.
fn priorities_exhausted() -> Vec<Dag> {
    let given = named("radar");
    let read = SubtaskAttributes::named("read").priority(u32::MAX);
    given.register_periodic_subtask(|| (1_u32,), vec!["echoes"], PERIOD, read);
    let store = SubtaskAttributes::named("store").priority(u32::MAX);
    given.register_sink_subtask(|(_,): (u32,)| (), vec!["echoes"], PERIOD, store);
    vec![given, sound("lidar", "points")]
}

/// No number of cores helps a subtask that takes longer than a period.
fn not_proven() -> Vec<Dag> {
    let dag = named("lidar");
    dag.demand_proof();
    let read = SubtaskAttributes::named("read").wcet(PERIOD / 10);
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], PERIOD, read);
    let store = SubtaskAttributes::named("store").wcet(PERIOD * 2);
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD * 4, store);
    vec![dag]
}

fn already_committed() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.jobs(1);
    // What it returns shows at the next commit, which is the case.
    let _ = finish_create_dags(core::slice::from_ref(&dag));
    vec![dag]
}
