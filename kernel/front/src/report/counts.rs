//! How a DAG does, or did in a run: a line for people, and a machine line of kind `dag_status`.

use sched_dag::{Dag, DagId, DagStatistics, Snapshot};

use crate::text::json;

/// The facts that are told of a DAG.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// Its state now, in a word.
    pub state: &'static str,
    /// The fates of its jobs.
    pub statistics: DagStatistics,
    /// Jobs in flight.
    pub in_flight: u64,
    /// Due jobs that wait for an older one to end.
    pub waiting: u64,
}

impl Counts {
    /// Returns what is told of a DAG that does, or has ended, so.
    #[must_use]
    pub const fn of(snapshot: &Snapshot) -> Self {
        Self {
            state: snapshot.word(),
            statistics: snapshot.statistics,
            in_flight: snapshot.in_flight,
            waiting: snapshot.waiting,
        }
    }

    /// Prints the lines of a DAG with its counts.
    pub fn show(&self, dag: DagId, model: &Dag) {
        self.show_by(dag, model, Self::print);
    }

    /// Prints the line of a DAG for people, of which `print` makes the rest, and its machine line.
    pub fn show_by(&self, dag: DagId, model: &Dag, print: fn(&Self, &Dag)) {
        crate::print!("  dag {} ", dag.0);
        print(self, model);
        let of = self.statistics;
        json::emit("dag_status", |line| {
            line.number("dag", dag.0)
                .text("name", model.name())
                .text("state", self.state)
                .number("released", of.released)
                .number("completed", of.completed)
                .number("in_flight", self.in_flight)
                .number("waiting", self.waiting)
                .number("misses", of.misses)
                .number("skips", of.skips)
                .number("aborts", of.aborts)
                .number("faults", of.faults)
                .number("failed", of.failed)
                .number("restarts", of.restarts);
        });
    }

    /// Prints the counts.
    pub fn print(&self, model: &Dag) {
        let of = self.statistics;
        crate::println!(
            "`{}`: {}; {} jobs released, {} completed, {} in flight, {} waiting; {} deadlines \
             missed, {} jobs skipped, {} aborted, {} lost to faults",
            model.name(),
            self.state,
            of.released,
            of.completed,
            self.in_flight,
            self.waiting,
            of.misses,
            of.skips,
            of.aborts,
            of.failed
        );
    }
}
