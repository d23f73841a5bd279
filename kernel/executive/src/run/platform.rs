//! The kernel as the platform that `fass` runs on.

use alloc::borrow::Cow;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::edge::Begin;
use fass::{
    Channel, Clock, Clusters, Cutter, LaunchError, Occupation, Overheads, Plan, Platform, Policy,
    Preemption, Recorded,
};
use sched_dag::analysis::{self, Answer, Settings};
use sched_dag::{DagId, SchedulerOptions, TaskSet};

use super::execution::{self, Division, Terms};
use super::{edge, occupation, stacks};
use crate::machine::once::Once;
use crate::machine::{clock, cut, this_core};
use crate::text::graph;

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
    /// What a commit adds to WCETs: context switch, dispatch, interrupt.
    overheads_ns: [AtomicU64; 3],
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
    overheads_ns: [const { AtomicU64::new(0) }; 3],
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
        } = overheads;
        let values = [context_switch_ns, dispatch_ns, interrupt_ns];
        for (place, value) in self.overheads_ns.iter().zip(values) {
            place.store(value, Ordering::Relaxed);
        }
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
    let running = || execution::running(this_core::get());
    edge::tell_time(running, clock_ns, execution::since_epoch(clock_ns))
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

    fn answer(&self, task_set: &TaskSet, settings: &Settings) -> Answer {
        analysis::answer_compact(task_set, settings)
    }

    fn overheads(&self) -> Overheads {
        let [context_switch_ns, dispatch_ns, interrupt_ns] = self
            .overheads_ns
            .each_ref()
            .map(|value| value.load(Ordering::Relaxed));
        Overheads {
            context_switch_ns,
            dispatch_ns,
            interrupt_ns,
        }
    }

    fn wcets(&self) -> Option<Cow<'static, str>> {
        self.wcets.get().copied().map(Cow::Borrowed)
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

    fn cutter(&self) -> Option<Cutter> {
        cut::MAY_CUT.then_some(cut::run as Cutter)
    }

    fn raise(&self, plan: u64, dag: DagId) {
        execution::raise(plan, dag);
    }

    fn crosses(&self) -> bool {
        edge::is_wished()
    }

    fn results_cross(&self) -> bool {
        edge::has_results()
    }

    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        edge::open(dag, graph, channels, begin)
    }

    fn record(&self, value: &Recorded<'_>) {
        edge::record(value, execution::since_epoch(value.completed_ns));
    }

    fn replays(&self) -> bool {
        edge::is_replay()
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        edge::lend(channel, job, take);
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        if edge::launch(&mut plan)? {
            fass::set_clock(&TOLD);
        }
        stacks::watch(&mut plan);
        let options = SchedulerOptions {
            policy: self.policy(),
            preemption: self.preemption(),
            cores: self.cores(),
        };
        let overhead_ns = self.overheads().of_an_instance_ns(options.preemption);
        graph::dump(&plan, options, overhead_ns);
        let terms = Terms {
            coincidence_ns: self.coincidence_ns.load(Ordering::Relaxed),
            budget_factor: self.budget_factor.load(Ordering::Relaxed),
            most_events: self.most_events.load(Ordering::Relaxed),
        };
        execution::prepare(plan, options, terms)
    }
}
