//! The kernel as the platform that `fass` runs on.

use alloc::borrow::Cow;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::edge::Begin;
use fass::{
    Channel, Clock, Clusters, LaunchError, Occupation, Overheads, Plan, Platform, Policy,
    Preemption, Recorded,
};
use sched_dag::analysis::OverheadSource;
use sched_dag::{DagId, SchedulerOptions, TaskSet};

use super::execution::{self, Division, Terms};
use super::{edge, occupation, record, stacks};
use crate::machine::once::Once;
use crate::machine::{clock, this_core};

/// The one kernel, as `fass` sees it.
pub struct Kernel {
    /// Whether instances are ordered by deadline rather than by priority.
    edf: AtomicBool,
    /// Whether a started instance may lose its core.
    preemptive: AtomicBool,
    /// How long a decision waits for further events of the same instant.
    coincidence_ns: AtomicU64,
    /// The budget of a subtask that has a WCET only, in WCETs; 0 for none.
    budget_factor: AtomicU64,
    /// The most events that journals from now on have room for.
    most_events: AtomicU64,
    /// The charges of a commit: context switch, dispatch, interrupt, readiness.
    overheads_ns: [AtomicU64; 4],
    /// How many dispatches these are the longest of, 0 if they are stated, and the margin in
    /// hundredths.
    measured: [AtomicU64; 2],
    /// Whether a commit is the kernel's own, to measure overheads with.
    calibrates: AtomicBool,
    /// A file of WCETs that were observed.
    wcets: Once<&'static str>,
}

/// The platform that apps on this machine are built for.
pub static KERNEL: Kernel = Kernel {
    edf: AtomicBool::new(false),
    preemptive: AtomicBool::new(true),
    coincidence_ns: AtomicU64::new(0),
    budget_factor: AtomicU64::new(0),
    most_events: AtomicU64::new(u64::MAX),
    overheads_ns: [const { AtomicU64::new(0) }; 4],
    measured: [const { AtomicU64::new(0) }; 2],
    calibrates: AtomicBool::new(false),
    wcets: Once::new(),
};

impl Kernel {
    /// Chooses the policy of the commits to come.
    pub fn set_policy(&self, policy: Policy) {
        self.edf.store(policy == Policy::Edf, Ordering::Relaxed);
    }

    /// Chooses what the commits to come add to WCETs.
    pub fn set_overheads(&self, overheads: Overheads) {
        let Overheads {
            context_switch_ns,
            dispatch_ns,
            interrupt_ns,
            ready_ns,
        } = overheads;
        let values = [context_switch_ns, dispatch_ns, interrupt_ns, ready_ns];
        for (place, value) in self.overheads_ns.iter().zip(values) {
            place.store(value, Ordering::Relaxed);
        }
    }

    /// Says that these are the longest of so many dispatches, and a margin in hundredths.
    pub fn set_measured(&self, dispatches: u64, margin_percent: u32) {
        let values = [dispatches, u64::from(margin_percent)];
        for (place, value) in self.measured.iter().zip(values) {
            place.store(value, Ordering::Relaxed);
        }
    }

    /// Makes the commits to come the kernel's own, of which nobody is told, or the app's again.
    pub fn set_calibration(&self, calibrates: bool) {
        self.calibrates.store(calibrates, Ordering::Relaxed);
    }

    /// Gives commits a file of WCETs that were observed.
    pub fn set_wcets(&self, file: &'static str) {
        // Only the first one counts.
        let _ = self.wcets.set(file);
    }

    /// Chooses the budget of subtasks that have a WCET only, in WCETs; 0 for none.
    pub fn set_budget_factor(&self, factor: u64) {
        self.budget_factor.store(factor, Ordering::Relaxed);
    }

    /// Lets journals from now on have room for at most so many events; `u64::MAX`: as
    /// many as make sense.
    pub fn set_most_events(&self, most: u64) {
        self.most_events.store(most, Ordering::Relaxed);
    }

    /// Chooses how long decisions of the runs to come wait for further events of
    /// the same instant.
    pub fn set_coincidence_ns(&self, coincidence_ns: u64) {
        self.coincidence_ns.store(coincidence_ns, Ordering::Relaxed);
    }

    /// Chooses whether the runs to come are preemptive.
    pub fn set_preemption(&self, preemption: Preemption) {
        self.preemptive
            .store(preemption == Preemption::Enabled, Ordering::Relaxed);
    }
}

/// Tells functions the time where that is recorded or replayed.
static TOLD: Clock = || {
    let clock_ns = clock::now_ns();
    let mut edge = edge::get();
    // Interrupts are off, so it stays here.
    let running = execution::running(this_core::get());
    edge.tell_time(running, clock_ns, execution::since_epoch(clock_ns))
};

impl Platform for Kernel {
    fn policy(&self) -> Policy {
        if self.edf.load(Ordering::Relaxed) {
            Policy::Edf
        } else {
            Policy::StaticPriority
        }
    }

    fn preemption(&self) -> Preemption {
        if self.preemptive.load(Ordering::Relaxed) {
            Preemption::Enabled
        } else {
            Preemption::Disabled
        }
    }

    fn cores(&self) -> u32 {
        u32::try_from(this_core::all().len()).unwrap_or(u32::MAX)
    }

    fn clusters(&self) -> Clusters {
        match execution::division() {
            Division::Into(clusters) => clusters,
            Division::ByCommit => Clusters::Undivided,
        }
    }

    fn assign(&self, task_set: &mut TaskSet) -> Result<(), LaunchError> {
        match execution::division() {
            Division::ByCommit => fass::assign_clusters(self, task_set),
            Division::Into(_) => Ok(()),
        }
    }

    fn overheads(&self) -> Overheads {
        let [context_switch_ns, dispatch_ns, interrupt_ns, ready_ns] = self
            .overheads_ns
            .each_ref()
            .map(|value| value.load(Ordering::Relaxed));
        Overheads {
            context_switch_ns,
            dispatch_ns,
            interrupt_ns,
            ready_ns,
        }
    }

    fn overhead_source(&self) -> OverheadSource {
        let [dispatches, margin_percent] = self
            .measured
            .each_ref()
            .map(|value| value.load(Ordering::Relaxed));
        match dispatches {
            0 => OverheadSource::Stated,
            _ => OverheadSource::Measured {
                dispatches,
                margin_percent: u32::try_from(margin_percent).unwrap_or(u32::MAX),
            },
        }
    }

    fn wcets(&self) -> Option<Cow<'static, str>> {
        let is_apps = !self.calibrates.load(Ordering::Relaxed);
        let file = self.wcets.get().copied().filter(|_| is_apps);
        file.map(Cow::Borrowed)
    }

    fn now_ns(&self) -> u64 {
        clock::now_ns()
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

    fn crosses(&self) -> bool {
        edge::get().is_wished()
    }

    fn results_cross(&self) -> bool {
        edge::get().has_results()
    }

    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        edge::get().open(dag, graph, channels, begin)
    }

    fn record(&self, value: &Recorded<'_>) {
        edge::record(value, execution::since_epoch(value.completed_ns));
    }

    fn replays(&self) -> bool {
        edge::get().is_replay()
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        edge::get().lend(channel, job, take);
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        let options = SchedulerOptions {
            policy: self.policy(),
            preemption: self.preemption(),
            cores: self.cores(),
        };
        let mut terms = Terms {
            coincidence_ns: self.coincidence_ns.load(Ordering::Relaxed),
            budget_factor: self.budget_factor.load(Ordering::Relaxed),
            most_events: self.most_events.load(Ordering::Relaxed),
        };
        if self.calibrates.load(Ordering::Relaxed) {
            terms.most_events = u64::MAX;
            return execution::prepare(plan, options, terms);
        }
        if edge::launch(&mut plan)? {
            fass::set_clock(&TOLD);
        }
        stacks::watch(&mut plan);
        record::commit(&plan, options, self.overheads());
        execution::prepare(plan, options, terms)
    }
}
