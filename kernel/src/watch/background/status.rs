//! Status lines: how a run does, now and then.
//!
//! The load of each core is computed from the journal, so that counting it costs
//! nothing between two lines. Where the journal holds less than that time, or more than
//! 2,048 events of it, the load is of the latest; where events are not recorded there is
//! none.

use sched_dag::DagId;

use super::live_run::KernelRun;
use super::load;
use super::patience::Patience;
use executive::machine::clock;
use executive::run::execution;
use front::json;
use front::shell::snapshot;

/// How many events are read where time is short.
const FEW_EVENTS: u64 = 128;

/// How many are read otherwise: some tens of microseconds, in which core 0 takes no interrupt.
const MOST_EVENTS: u64 = 2048;

/// When and what to print.
#[derive(Debug)]
pub(super) struct Status {
    period_ns: u64,
    total: u64,
    /// When the last line was printed.
    last_ns: u64,
    patience: Patience,
}

impl Status {
    /// Begins with the first line due after `period_ns`.
    pub(super) fn begin(period_ns: u64, total: u64) -> Self {
        Self {
            period_ns,
            total,
            last_ns: clock::now_ns(),
            patience: Patience::new(),
        }
    }

    /// Prints a line if one is due and need not wait.
    pub(super) fn print_when_due(&mut self, is_starved: bool) {
        let now_ns = clock::now_ns();
        let is_due = now_ns >= self.last_ns.saturating_add(self.period_ns);
        if !is_due || !(is_starved || self.patience.is_over()) {
            return;
        }
        let [from_ns, to_ns] = [self.last_ns, now_ns].map(execution::since_epoch);
        self.last_ns = now_ns;
        let Some(task_set) = execution::task_set() else {
            return;
        };
        let misses = (0..)
            .map(DagId)
            .take(task_set.dags().len())
            .filter_map(|dag| snapshot::<KernelRun>(&task_set, dag))
            .map(|dag| dag.statistics.misses)
            .sum::<u64>();
        // In an interrupt's handler there is no time to read many events.
        let most = if is_starved { FEW_EVENTS } else { MOST_EVENTS };
        let loads = || load::loads_permille(from_ns, to_ns, most);
        json::emit("status", |line| {
            line.number("time_ns", to_ns)
                .number("done", execution::jobs_ended())
                .number("total", self.total)
                .number("misses", misses)
                .list("load_permille", loads());
            if let Some(end_ns) = execution::nominal_end_ns() {
                line.number("left_ns", end_ns.saturating_sub(to_ns));
            }
        });
    }
}
