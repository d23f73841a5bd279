//! The machine below a cluster's engine: clock, edge, and waking of cores.
//!
//! A run takes its stacks at the commit: as many as its DAGs can need at once.

use alloc::format;
use alloc::vec::Vec;
use core::ops::{Deref, DerefMut};
use core::sync::atomic::Ordering;

use fass::platform::{LaunchError, SubtaskCode};
use sched_dag::engine::{PlatformPort, SubtaskBody as _};
use sched_dag::journal::EventKind;
use sched_dag::lifecycle::{self, Request};
use sched_dag::{ClusterId, CoreId, DriverNotice, Preemption, SchedulerOptions, TaskSet};

use super::EPOCH_NS;
use super::cluster::{self, ClusterState, CoreSet, FIRST_SEAT, Letters};
use super::loans::RunnerLoan;
use super::status::note_running;
use crate::machine::clock;
use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};
use crate::run::contexts;

/// A step of the engine on this core.
pub(super) struct SmpPort<'a> {
    pub(super) cluster: &'static ClusterState,
    pub(super) id: ClusterId,
    pub(super) letters: &'a Letters,
    /// The other cores due to look at their assigned work.
    pub(super) woken: &'a mut CoreSet,
}

impl PlatformPort<RunnerLoan> for SmpPort<'_> {
    /// The edge hears of these events, if a topic is recorded.
    const HEARS: &'static [EventKind] = fass::edge::HEARS;

    fn now_ns(&self) -> u64 {
        since_epoch(clock::now_ns())
    }

    #[inline]
    fn on_clock(&self, time_ns: u64) -> u64 {
        time_ns.wrapping_add(EPOCH_NS.load(Ordering::Relaxed))
    }

    /// Stamps the start with interrupts disabled, as for the finish, so that no preemption comes
    /// between a stamp and the stamped event.
    #[inline(always)]
    fn start(&mut self, _: CoreId, loan: &mut RunnerLoan, _: u64) -> u64 {
        begin_turn(loan, loan.budget_ns)
    }

    /// Keeps the rest of the budget: waiting time does not count as execution.
    fn wait(&mut self, _: CoreId, loan: &mut RunnerLoan, ended_ns: u64) {
        let ended_ns = self.on_clock(ended_ns);
        loan.budget_left_ns = match this_core::get().context().budget_end_ns() {
            u64::MAX => u64::MAX,
            // 0 if the budget ran out while its alarm was pending: the next turn then ends at once.
            end_ns => end_ns.saturating_sub(ended_ns),
        };
    }

    #[inline]
    fn proceed(&mut self, _: CoreId, loan: &mut RunnerLoan, _: u64) -> u64 {
        begin_turn(loan, loan.budget_left_ns)
    }

    #[inline]
    fn forward(&mut self, request: Request) -> bool {
        cluster::send_to_others(self.letters, self.id, request, self.woken)
    }

    #[inline]
    fn has_letters(&self) -> bool {
        self.cluster.may_have_letters()
    }

    fn take_letters(&mut self) -> Option<&lifecycle::Mailboxes> {
        // Cleared before the letters are read: a letter sent meanwhile sets the flag again, and
        // costs a step at worst. Cleared afterwards, the flag could hide that letter.
        self.cluster.has_letters.swap(false, Ordering::AcqRel);
        self.letters.as_deref()
    }

    #[inline]
    fn retarget(&mut self, core: CoreId) {
        // This core needs no wake-up: it looks for its target once its own step is done.
        if core != here() {
            self.woken.insert(self.cluster.core(core));
        }
    }

    fn hear(&mut self, notice: &DriverNotice) {
        fass::platform::at_edge::happened(notice);
    }
}

/// Begins a turn of a runner's instance on this core, with `budget_ns` nanoseconds of execution
/// left. Returns the start, in nanoseconds on the run's time.
#[inline(always)]
fn begin_turn(loan: &RunnerLoan, budget_ns: u64) -> u64 {
    let core = this_core::get();
    note_running(core, Some(loan.subject()));
    let now_ns = clock::now_ns();
    let budget_end_ns = match budget_ns {
        u64::MAX => u64::MAX,
        budget_ns => {
            let end_ns = now_ns.saturating_add(budget_ns);
            timer::set_no_later(core, Alarm::Budget, end_ns);
            end_ns
        }
    };
    core.context().set_budget_end(budget_end_ns);
    instance_time_ns(now_ns)
}

/// A subtask's [runner](fass::platform::SubtaskRunner), with the data for running an instance on
/// this machine.
///
/// Each subtask has one, because a subtask has at most one started instance at a time (R2). A
/// [`RunnerLoan`] moves between the runner's place and the core running the instance.
pub struct CoreRunner {
    pub(super) inner: fass::platform::SubtaskRunner,
    cluster: &'static ClusterState,
    /// The execution budget of an instance in nanoseconds, `u64::MAX` if unlimited.
    pub(super) budget_ns: u64,
    /// The budget left when the instance began to wait, in nanoseconds.
    budget_left_ns: u64,
}

impl CoreRunner {
    /// Returns the cluster running this subtask.
    #[inline]
    pub(super) const fn cluster(&self) -> &'static ClusterState {
        self.cluster
    }
}

impl Deref for CoreRunner {
    type Target = fass::platform::SubtaskRunner;

    #[inline]
    fn deref(&self) -> &fass::platform::SubtaskRunner {
        &self.inner
    }
}

impl DerefMut for CoreRunner {
    #[inline]
    fn deref_mut(&mut self) -> &mut fass::platform::SubtaskRunner {
        &mut self.inner
    }
}

/// Makes a runner for each body, by vertex.
pub(super) fn runners(
    task_set: &TaskSet,
    bodies: Vec<Vec<SubtaskCode>>,
    budget_factor: u64,
) -> impl Iterator<Item = CoreRunner> {
    fass::platform::SubtaskRunner::all(task_set, bodies).map(move |inner| {
        let dag = task_set.dag(inner.instance.dag);
        let subtask = dag.subtask(inner.instance.subtask);
        CoreRunner {
            cluster: cluster::nth(dag.cluster().index()),
            budget_ns: subtask.most_execution_ns(budget_factor),
            budget_left_ns: 0,
            inner,
        }
    })
}

/// Provides the stacks needed by a task set.
pub(super) fn provide(task_set: &TaskSet, options: SchedulerOptions) -> Result<(), LaunchError> {
    let subtasks = task_set.vertices();
    let cores = usize::try_from(options.cores).unwrap_or(usize::MAX);
    let suspended = match options.preemption {
        Preemption::Enabled => task_set.most_suspended(),
        Preemption::Disabled => 0,
    };
    let total = cores.saturating_mul(2).saturating_add(suspended);
    let needed = contexts::stack_bytes(task_set);
    let kib = needed / 1024;
    // The size first: the contexts made next have it for good.
    let settled = contexts::settle(needed).and_then(|settled| {
        contexts::provide(total)?;
        Ok(settled)
    });
    let settled = settled.map_err(|_| {
        LaunchError::new(format!(
            "{subtasks} subtasks and {cores} cores need {total} stacks of {kib} KiB, more than \
             there is memory for; register fewer subtasks, or give the machine more memory"
        ))
    })?;
    if settled < needed {
        return Err(LaunchError::new(format!(
            "a subtask states a stack of {kib} KiB, and the first commit has settled {} KiB; \
             state as much there",
            settled / 1024
        )));
    }
    Ok(())
}

/// Converts a time on the clock to the run's time, in nanoseconds; times before time 0 become 0.
pub fn since_epoch(time_ns: u64) -> u64 {
    time_ns.saturating_sub(EPOCH_NS.load(Ordering::Relaxed))
}

/// Converts the time of an instance's event likewise, without a check, as no instance runs before
/// time 0.
#[inline]
pub(super) fn instance_time_ns(time_ns: u64) -> u64 {
    time_ns.wrapping_sub(EPOCH_NS.load(Ordering::Relaxed))
}

/// Returns the seat of the calling core. Interrupts are disabled.
pub(super) fn here() -> CoreId {
    seat(this_core::get())
}

/// Returns a core's seat.
#[inline]
pub(super) fn seat(core: &Core) -> CoreId {
    CoreId(core.place.load(Ordering::Relaxed))
}

/// Reports whether a core keeps its cluster's time.
pub fn keeps_time(core: &Core) -> bool {
    seat(core) == FIRST_SEAT
}

/// Sets this core's alarm for the next event; this core is its cluster's first. Interrupts are
/// disabled, or nothing else runs here.
pub fn arm_next_event() {
    let cluster = cluster::cluster_of(this_core::get());
    timer::set(Alarm::Schedule, cluster.next_event_ns());
}

/// Sets the alarms of all clusters. Called on core 0, before a run.
pub fn arm_all() {
    arm_next_event();
    // Only the core itself can write its timer: the first cores arm theirs once they wake up.
    for cluster in cluster::all().skip(1) {
        this_core::all()[cluster.core(FIRST_SEAT) as usize].wake_up();
    }
}
