//! The cases of what is wrong with times, priorities and numbers.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use fass::{Dag, FaultLimit, SubtaskAttributes};

use super::{FAULT_LIMIT, PERIOD, joining_sink, named, sink, sound, source};

pub(super) fn missing_period() -> Vec<Dag> {
    let dag = named("lidar");
    let start = SubtaskAttributes::named("start");
    dag.register_untyped_subtask(|_job| (), start);
    dag.relative_deadline(PERIOD);
    vec![dag]
}

pub(super) fn zero_period() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], Duration::ZERO, read);
    sink(&dag, "store", "points");
    vec![dag]
}

pub(super) fn periods_differ() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "left", "left points");
    let right = SubtaskAttributes::named("right");
    dag.register_periodic_subtask(|| (1_u32,), vec!["right points"], PERIOD * 2, right);
    joining_sink(&dag, "store", ["left points", "right points"]);
    vec![dag]
}

pub(super) fn missing_deadline() -> Vec<Dag> {
    let dag = named("lidar");
    let start = SubtaskAttributes::named("start");
    dag.register_untyped_subtask(|_job| (), start);
    dag.period(PERIOD);
    vec![dag]
}

pub(super) fn zero_deadline() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], Duration::ZERO, store);
    vec![dag]
}

pub(super) fn zero_sink_deadline() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    dag.relative_deadline(PERIOD);
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], Duration::ZERO, store);
    vec![dag]
}

pub(super) fn sink_deadline_beyond_dag() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    dag.relative_deadline(PERIOD);
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD * 2, store);
    vec![dag]
}

pub(super) fn deadline_of_no_sink() -> Vec<Dag> {
    let dag = named("lidar");
    dag.period(PERIOD).relative_deadline(PERIOD);
    let read = dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("read"));
    let store = dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("store"));
    dag.precede(&read, &store).sink_deadline(&read, PERIOD / 2);
    vec![dag]
}

pub(super) fn duration_too_long() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], Duration::MAX, read);
    sink(&dag, "store", "points");
    vec![dag]
}

pub(super) fn wcet_exceeds_deadline() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let store = SubtaskAttributes::named("store").wcet(PERIOD * 2);
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD, store);
    vec![dag]
}

pub(super) fn priorities_partly_given() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read").priority(7);
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

/// The priorities of one DAG are the last numbers there are; those of the
/// other are to be derived below them.
pub(super) fn priorities_exhausted() -> Vec<Dag> {
    let given = named("radar");
    let read = SubtaskAttributes::named("read").priority(u32::MAX);
    given.register_periodic_subtask(|| (1_u32,), vec!["echoes"], PERIOD, read);
    let store = SubtaskAttributes::named("store").priority(u32::MAX);
    given.register_sink_subtask(|(_,): (u32,)| (), vec!["echoes"], PERIOD, store);
    vec![given, sound("lidar", "points")]
}

pub(super) fn stack_out_of_range() -> Vec<Dag> {
    let dag = named("lidar");
    let read = SubtaskAttributes::named("read").stack_bytes(4096);
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], PERIOD, read);
    sink(&dag, "store", "points");
    vec![dag]
}

pub(super) fn zero_jobs() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.jobs(0);
    vec![dag]
}

pub(super) fn zero_faults() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    let in_all = 0;
    dag.survive_faults(FaultLimit {
        in_all,
        ..FAULT_LIMIT
    });
    vec![dag]
}

pub(super) fn zero_window() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    let window = 0;
    dag.survive_faults(FaultLimit {
        window,
        ..FAULT_LIMIT
    });
    vec![dag]
}

pub(super) fn zero_in_flight() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.in_flight(0);
    vec![dag]
}

pub(super) fn too_many_instances() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.in_flight(u32::MAX);
    vec![dag]
}

pub(super) fn time_overflow() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.offset(Duration::from_nanos(u64::MAX));
    vec![dag]
}

pub(super) fn unknown_cluster() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.cluster(1);
    vec![dag]
}

/// No number of cores helps a subtask that takes longer than a period.
pub(super) fn not_proven() -> Vec<Dag> {
    let dag = named("lidar");
    dag.demand_proof();
    let read = SubtaskAttributes::named("read").wcet(PERIOD / 10);
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], PERIOD, read);
    let store = SubtaskAttributes::named("store").wcet(PERIOD * 2);
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD * 4, store);
    vec![dag]
}
