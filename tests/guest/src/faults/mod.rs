//! One commit for each fault that an app can make with `fass`.
//!
//! A *case* builds DAGs that a commit must refuse for one reason, its fault.
//! [`provoke`] commits them one after the other and hands over what the commit
//! said, which `docs/errors.md` tells people word for word. Each function is named as its
//! fault. A fault that `fass` rules out by its types (such as 17
//! inputs) has no case.

mod graph;
mod modes;
mod shared;
mod values;

use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use fass::{Dag, FaultLimit, SubtaskAttributes, Uses, create_dag, finish_create_dags};

/// A fault's name and what builds the DAGs with that fault.
type Case = (&'static str, fn() -> Vec<Dag>);

/// The cases, for a platform with static priorities. The last one needs a commit
/// that succeeds, so it comes last.
pub const CASES: &[Case] = &[
    ("no_dags", graph::no_dags),
    ("no_subtasks", graph::no_subtasks),
    ("given_twice", graph::given_twice),
    ("input_arity", graph::input_arity),
    ("output_arity", graph::output_arity),
    ("duplicate_subtask", graph::duplicate_subtask),
    ("cycle", graph::cycle),
    ("self_edge", graph::self_edge),
    ("not_connected", graph::not_connected),
    ("no_source", graph::no_source),
    ("several_sources", graph::several_sources),
    ("no_sink", graph::no_sink),
    ("several_sinks", graph::several_sinks),
    ("unread_topic", graph::unread_topic),
    ("unwritten_topic", graph::unwritten_topic),
    ("type_mismatch", graph::type_mismatch),
    ("several_writers", graph::several_writers),
    ("several_readers", graph::several_readers),
    ("topic_in_several_dags", graph::topic_in_several_dags),
    ("duplicate_topic", graph::duplicate_topic),
    ("missing_period", values::missing_period),
    ("zero_period", values::zero_period),
    ("periods_differ", values::periods_differ),
    ("missing_deadline", values::missing_deadline),
    ("zero_deadline", values::zero_deadline),
    ("zero_sink_deadline", values::zero_sink_deadline),
    ("sink_deadline_beyond_dag", values::sink_deadline_beyond_dag),
    ("deadline_of_no_sink", values::deadline_of_no_sink),
    ("duration_too_long", values::duration_too_long),
    ("wcet_exceeds_deadline", values::wcet_exceeds_deadline),
    ("priorities_partly_given", values::priorities_partly_given),
    ("priorities_exhausted", values::priorities_exhausted),
    ("stack_out_of_range", values::stack_out_of_range),
    ("zero_jobs", values::zero_jobs),
    ("zero_in_flight", values::zero_in_flight),
    ("zero_faults", values::zero_faults),
    ("zero_window", values::zero_window),
    ("too_many_instances", values::too_many_instances),
    ("time_overflow", values::time_overflow),
    ("unknown_cluster", values::unknown_cluster),
    ("activations_differ", shared::activations_differ),
    ("duplicate_state", shared::duplicate_state),
    ("unused_state", shared::unused_state),
    ("state_never_updated", shared::state_never_updated),
    ("state_used_twice", shared::state_used_twice),
    ("state_without_reset", shared::state_without_reset),
    ("replaced_in_vain", shared::replaced_in_vain),
    ("nothing_replaceable", shared::nothing_replaceable),
    ("state_over_jobs", shared::state_over_jobs),
    ("latest_unwritten", shared::latest_unwritten),
    ("latest_unread", shared::latest_unread),
    ("latest_type_mismatch", shared::latest_type_mismatch),
    ("latest_of_moved", shared::latest_of_moved),
    ("latest_not_committed", shared::latest_not_committed),
    ("signal_not_committed", shared::signal_not_committed),
    ("switched_not_committed", shared::switched_not_committed),
    ("taken_by_no_source", shared::taken_by_no_source),
    ("taken_twice", shared::taken_twice),
    ("source_partly_recorded", shared::source_partly_recorded),
    ("sample_not_recorded", shared::sample_not_recorded),
    ("duplicate_mode", modes::duplicate_mode),
    ("several_sets_of_modes", modes::several_sets_of_modes),
    ("mode_not_committed", modes::mode_not_committed),
    ("mode_starts_paused", modes::mode_starts_paused),
    ("mode_without_handler", modes::mode_without_handler),
    ("not_proven", values::not_proven),
    ("already_committed", graph::already_committed),
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

/// One fault within 100 jobs, and 8 in all.
const FAULT_LIMIT: FaultLimit = FaultLimit {
    faults: 1,
    window: 100,
    in_all: 8,
};

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

/// Registers the source `plan`, which uses something.
fn planning<U: Uses + 'static>(
    dag: &Dag,
    uses: U,
    mut plan: impl for<'a> FnMut(U::Borrowed<'a>) + Send + 'static,
) {
    dag.period(PERIOD).relative_deadline(PERIOD);
    let source = move |used: U::Borrowed<'_>| plan(used);
    let source = dag.using(uses).source(source);
    source.register(SubtaskAttributes::named("plan"));
}

/// Registers the sink `store`, which reads the topic `points` and uses something.
fn storing<U: Uses + 'static>(
    dag: &Dag,
    uses: U,
    mut store: impl for<'a> FnMut(U::Borrowed<'a>) + Send + 'static,
) {
    let sink = move |used: U::Borrowed<'_>, (_,): (u32,)| store(used);
    let sink = dag.using(uses).subtask(sink).reads(&["points"]).due(PERIOD);
    sink.register(SubtaskAttributes::named("store"));
}

/// A DAG without fault: a source, a topic, a sink.
fn sound(name: &str, topic: &str) -> Dag {
    let dag = named(name);
    source(&dag, "read", topic);
    sink(&dag, "store", topic);
    dag
}
