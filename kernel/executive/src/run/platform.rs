//! The kernel as a platform for `fass`.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::Occupation;
use fass::edge::Edge;
use fass::log::LogLine;
use fass::platform::{Clock, LaunchError, LockWords, Plan, Platform, RunConfig, at_edge};
use sched_dag::lifecycle::WaitId;
use sched_dag::{DagId, Instance};

use super::{edge, execution, occupation, record, stacks};
use crate::machine::spinlock::SpinLock;
use crate::machine::{clock, interrupt_flag, section, this_core};

/// The one kernel, as `fass` sees it.
pub struct Kernel {
    /// The terms of future commits; their cores are the cores brought up.
    terms: SpinLock<RunConfig>,
    /// How long a decision waits for further events of the same instant, in nanoseconds.
    coincidence_ns: AtomicU64,
    /// Whether a commit belongs to the kernel itself, for measuring overheads.
    calibrates: AtomicBool,
    /// The number of the latest plan.
    plan: AtomicU64,
}

/// The platform for all apps on this machine.
pub static KERNEL: Kernel = Kernel {
    terms: SpinLock::new(RunConfig::of_cores(1)),
    coincidence_ns: AtomicU64::new(0),
    calibrates: AtomicBool::new(false),
    plan: AtomicU64::new(0),
};

impl Kernel {
    /// Changes the terms of future commits.
    pub fn change(&self, change: impl FnOnce(&mut RunConfig)) {
        change(&mut self.terms.lock());
    }

    /// Marks future commits as the kernel's own, left out of records and measurements, or as the
    /// app's again.
    pub fn set_calibration(&self, calibrates: bool) {
        self.calibrates.store(calibrates, Ordering::Relaxed);
    }

    /// Chooses how long decisions of future runs wait for further events of the same instant.
    pub fn set_coincidence_ns(&self, coincidence_ns: u64) {
        self.coincidence_ns.store(coincidence_ns, Ordering::Relaxed);
    }
}

static CLOCK: Clock = clock::now_ns;

impl Platform for Kernel {
    fn terms(&self) -> RunConfig {
        let mut terms = self.terms.lock().clone();
        terms.scheduler.cores = u32::try_from(this_core::all().len()).unwrap_or(u32::MAX);
        if self.calibrates.load(Ordering::Relaxed) {
            // WCETs and limits on the command line are stated for the app's DAGs.
            (terms.wcets, terms.most_events) = (None, u64::MAX);
        }
        terms
    }

    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn clock(&self) -> &'static Clock {
        &CLOCK
    }

    fn may_call_app(&self) -> bool {
        interrupt_flag::are_enabled()
    }

    fn execute_for(&self, duration: Duration, how: Occupation) {
        let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        match how {
            Occupation::Spin => occupation::spin(ns),
            Occupation::Hold => occupation::hold(ns),
        }
    }

    fn raise(&self, plan: u64, dag: DagId) {
        execution::raise(plan, dag);
    }

    fn answer(&self, plan: u64, wait: WaitId) {
        execution::answer(plan, wait);
    }

    fn running(&self) -> Option<(u64, Instance)> {
        let were_enabled = interrupt_flag::disable();
        let running = execution::running(this_core::get());
        interrupt_flag::restore(were_enabled);
        running.map(|instance| (self.plan.load(Ordering::Relaxed), instance))
    }

    fn section(&self, lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
        section::with(lock, section)
    }

    fn at_edge(&self, work: &mut dyn FnMut(&mut Edge)) {
        work(&mut edge::get());
    }

    fn log(&self, mut line: LogLine) {
        line.instance = self.running().map(|(_, instance)| instance);
        line.at_ns = execution::since_epoch(clock::now_ns());
        line.keep();
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        execution::refuse_another()?;
        let terms = self.terms();
        let coincidence_ns = self.coincidence_ns.load(Ordering::Relaxed);
        if !self.calibrates.load(Ordering::Relaxed) {
            record::with(|record| at_edge::launch(self, &mut plan, record))?;
            stacks::watch(&mut plan);
        }
        let number = plan.number;
        execution::prepare(plan, &terms, coincidence_ns)?;
        // Last: a refused plan never runs, and the plan before keeps its number.
        self.plan.store(number, Ordering::Relaxed);
        Ok(())
    }
}
