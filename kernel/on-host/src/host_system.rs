//! Virtual time as the platform below an app's machine.

use std::cell::{Cell, RefCell};
use std::fs;
use std::net::SocketAddrV4;
use std::sync::Arc;
use std::time::Duration;

use fass::edge::Sink as _;
use fass::platform::{Protocol, RunConfig};
use fass::shared::{Signal, Wire};
use front::app::ending::AppError;
use front::app::machine::System;
use front::json;
use front::options::{CommandLine, UsageError};
use front::report::{HeapUsage, Ns, RecordLines};
use front::shell::LiveRun;
use sched_dag::analysis;
use sched_dag::engine::Run;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, SchedulerQuery, TaskSet};
use virtual_time::VirtualTime;

/// The machine, lent to the app's function for the time of the run.
pub type Machine = front::app::machine::Machine<HostSystem>;

/// Virtual time, as seen by an app's machine.
#[derive(Debug)]
pub struct HostSystem {
    /// The machine of the next run: each run has its own.
    pub(crate) machine: RefCell<VirtualTime>,
    /// The file for the record of the run; `on` is for lines of the output.
    pub(crate) record_to: Cell<Option<&'static str>>,
    /// Whether each test is asked for its own bounds.
    pub(crate) tells_tests: bool,
    /// Whether the app wants all events of a window taken together, not only those of an instant.
    pub(crate) has_window: Cell<bool>,
}

/// The most DAGs whose bounds are printed test by test.
const MOST_TOLD: usize = 32;

impl HostSystem {
    /// Prints the bound of each DAG by each test.
    fn tell_tests(&self, run: &Run) {
        let task_set = run.task_set();
        // With very many DAGs the tests would take minutes.
        if task_set.dags().len() > MOST_TOLD {
            return;
        }
        let found = analysis::bounds_by_test(task_set, &self.terms().settings());
        for (model, bounds) in task_set.dags().iter().zip(found) {
            let dag = model.name();
            for bound in bounds {
                crate::println!("dag `{dag}` by {}: {}", bound.test, Ns(bound.bound_ns));
                json::emit("test_bound", |line| {
                    line.text("dag", dag)
                        .text("test", bound.test)
                        .number("bound_ns", bound.bound_ns);
                });
            }
        }
    }
}

/// Makes a machine with the given terms.
pub(crate) fn with_terms(terms: RunConfig) -> VirtualTime {
    let machine = VirtualTime::new().contain_panics();
    machine.change(|own| *own = terms);
    machine
}

/// Refuses a request that needs a machine.
fn refused<T>(what: &str) -> Result<T, AppError> {
    let line = format!("{what} is for the machine; there is none in virtual time, leave it out");
    Err(UsageError::new(line).into())
}

impl System for HostSystem {
    type Run = NoRun;

    fn terms(&self) -> RunConfig {
        self.machine.borrow().terms()
    }

    fn change(&self, change: impl FnOnce(&mut RunConfig)) {
        self.machine.borrow().change(change);
    }

    fn set_coincidence(&self, window: Duration) {
        self.has_window.set(window > Duration::ZERO);
    }

    fn run(&self, epoch_ns: Option<u64>, input: Option<&Signal>) -> Result<Run, AppError> {
        if input.is_some() {
            return refused("a signal of input");
        }
        if epoch_ns.is_some() || self.has_window.get() {
            return refused("a grid or a window of time");
        }
        let failure = AppError::Failure;
        let next = with_terms(self.terms());
        let machine = self.machine.replace(next);
        let report = machine.try_run();
        let report = report.map_err(|error| failure(error.to_string()))?;
        for line in &report.logs {
            crate::println!("{line}");
        }
        let run = Run::clone(&report);
        if self.tells_tests {
            self.tell_tests(&run);
        }
        if let Some(path) = self.record_to.take() {
            let bytes = machine.recording();
            if path == "on" {
                let mut lines = RecordLines::new();
                lines.put(&bytes);
                lines.flush();
            } else {
                fs::write(path, bytes).map_err(|why| failure(format!("`{path}`: {why}")))?;
            }
        }
        // The app's own count of violations leaves out rule R5, which needs a tolerance on the
        // machine.
        let late = run.dispatch_violations(0);
        let late = late.expect("in virtual time no event is lost");
        for violation in &late {
            crate::println!("violation: {violation}");
        }
        AppError::of_violations(late.len() as u64).map(|()| run)
    }

    fn is_shut_down(&self) -> bool {
        false
    }

    fn connect(
        &self,
        wire: &Wire,
        _options: &CommandLine<'static>,
        _module: &Cell<Option<&'static [u8]>>,
    ) -> Result<(), AppError> {
        refused(&format!("wire `{}`", wire.name()))
    }

    fn connect_protocol(
        &self,
        _protocol: Box<dyn Protocol>,
        _peer: SocketAddrV4,
        _options: &CommandLine<'static>,
    ) -> Result<(), AppError> {
        refused("`router`")
    }

    fn seed() -> u128 {
        0
    }

    fn unix_ns() -> Option<u64> {
        None
    }

    fn measure_overheads(_margin_percent: u32) -> Result<(), AppError> {
        refused("`overheads`")
    }

    fn memory() -> HeapUsage {
        HeapUsage::default()
    }
}

/// Stands for the lack of a run that a person could talk to.
#[derive(Debug)]
pub struct NoRun;

impl LiveRun for NoRun {
    fn task_set() -> Option<Arc<TaskSet>> {
        None
    }

    fn control(_dag: DagId, _change: fn(DagId) -> Request) {}

    fn now_ns() -> u64 {
        0
    }

    fn ask(_cluster: usize, _query: SchedulerQuery<'_>) -> Option<u64> {
        None
    }

    fn receive() -> Option<u8> {
        None
    }
}
