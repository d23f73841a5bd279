//! How a DAG does, or did in a run: a line for people, and a machine line of kind `dag_status`.

use sched_dag::{Dag, DagId, Snapshot};

use crate::text::json;

/// Prints the line of a DAG for people, of which `print` makes the rest, and its machine line.
pub fn show(snapshot: &Snapshot, dag: DagId, model: &Dag, print: fn(&Snapshot, &Dag)) {
    crate::print!("  dag {} ", dag.0);
    print(snapshot, model);
    let of = snapshot.statistics;
    json::emit("dag_status", |line| {
        line.number("dag", dag.0)
            .text("name", model.name())
            .text("state", snapshot.word())
            .number("released", of.released)
            .number("completed", of.completed)
            .number("in_flight", snapshot.in_flight)
            .number("waiting", snapshot.waiting)
            .number("misses", of.misses)
            .number("skips", of.skips)
            .number("aborts", of.aborts)
            .number("faults", of.faults)
            .number("failed", of.failed)
            .number("restarts", of.restarts);
    });
}

/// Prints the counts of a DAG's jobs.
pub fn print(snapshot: &Snapshot, model: &Dag) {
    let of = snapshot.statistics;
    crate::println!(
        "`{}`: {}; {} jobs released, {} completed, {} in flight, {} waiting; {} deadlines \
         missed, {} jobs skipped, {} aborted, {} lost to faults",
        model.name(),
        snapshot.word(),
        of.released,
        of.completed,
        snapshot.in_flight,
        snapshot.waiting,
        of.misses,
        of.skips,
        of.aborts,
        of.failed
    );
}
