//! What each core does: run what the scheduler assigns to it, else halt.

use core::sync::atomic::{AtomicBool, Ordering};

use alloc::boxed::Box;

use crate::background::{self, watchdog};
use crate::execution::{self, Runner, Work};
use crate::machine::context::{Context, Parked};
use crate::machine::interrupt::{self, Interrupted};
use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, cpu, interrupt_flag, section, turns};
use crate::{console, containment, contexts};

/// The time between two signs of life of core 0. Without any alarm anywhere a
/// virtual machine whose time is virtual would stand still forever.
pub(crate) const HEARTBEAT_NS: u64 = 1_000_000_000;

/// Makes a context that works, in place of one that is suspended or lost.
/// Interrupts are disabled.
pub(crate) fn new_context() -> Parked {
    let mut context = this_core::take_spare_context().unwrap_or_else(contexts::take);
    context.restart(interrupt::work);
    context
}

/// Runs what is assigned to the core that it is on, from one instance to the
/// next, preempted now and then, on whatever core that may be. Returns the
/// context that the core is to go on with instead, with interrupts disabled.
pub(crate) fn work() -> Parked {
    interrupt_flag::disable();
    let mut work = find_work();
    loop {
        work = match work {
            Work::Run(runner) => run(runner),
            Work::Continue(context) => {
                turns::enter_by_interrupt(this_core::get());
                return context;
            }
            Work::Rest => {
                rest(this_core::get());
                find_work()
            }
        };
    }
}

/// Finds what this core, which has computed nothing, is to do. Interrupts are disabled.
fn find_work() -> Work {
    let work = execution::find_work();
    if let Work::Run(_) = &work {
        turns::enter();
    }
    work
}

/// Calls a subtask's function, with interrupts enabled meanwhile.
fn run(mut runner: Box<Runner>) -> Work {
    interrupt_flag::enable();
    runner.run();
    interrupt_flag::disable_enabled();
    let finish_ns = clock::now_ns();
    execution::complete(runner, finish_ns)
}

/// Makes the cores other than core 0 watch for work instead of halting when they
/// have none.
pub(crate) fn watch_when_idle() {
    WATCHES.store(true, Ordering::Relaxed);
}

static WATCHES: AtomicBool = AtomicBool::new(false);

/// Sends waiting text and halts in between, until this core is to look for work.
/// Interrupts are disabled before and after.
fn rest(core: &Core) {
    if WATCHES.load(Ordering::Relaxed) {
        watch(core);
    }
    while !core.wake.swap(false, Ordering::AcqRel) {
        if console::has_pending() {
            interrupt_flag::enable();
            console::send_pending_byte();
        } else {
            interrupt_flag::enable_and_halt();
        }
        interrupt_flag::disable();
    }
}

/// Watches for another core's word that there is work, which then needs no
/// interrupt. Interrupts are disabled before and after, and enabled meanwhile.
fn watch(core: &Core) {
    core.begin_watch();
    interrupt_flag::enable();
    while !core.wake.load(Ordering::Acquire) {
        if !console::send_pending_byte() {
            cpu::relax();
        }
    }
    interrupt_flag::disable();
    core.end_watch();
    keep_beating(core);
}

/// Waits until the run has ended, as the background of core 0: whenever there is
/// work for the core, this is suspended. `when_idle` reports whether it has more to
/// do at once.
pub(crate) fn wait_in_background(mut when_idle: impl FnMut() -> bool) {
    while !execution::is_finished() {
        let has_more = when_idle();
        if console::send_pending_byte() || has_more {
            continue;
        }
        interrupt_flag::disable();
        if execution::is_finished() {
            interrupt_flag::enable();
        } else {
            interrupt_flag::enable_and_halt();
        }
    }
}

/// Handles this core's timer interrupt.
pub(crate) fn timer_interrupt(interrupted: &mut Interrupted) {
    let core = this_core::get();
    core.timer_interrupts.fetch_add(1, Ordering::Relaxed);
    let now_ns = clock::now_ns();
    core.interrupted_ns.store(now_ns, Ordering::Relaxed);
    // The instance that holds the core watches the clock: waking it is enough.
    timer::take_due(Alarm::Hold, now_ns);
    if timer::take_due(Alarm::Heartbeat, now_ns) {
        beat(core, now_ns);
        watchdog::look(core, now_ns);
        if core.index == 0 {
            background::beat(now_ns);
        }
    }
    if timer::take_due(Alarm::Schedule, now_ns) {
        execution::interrupt(interrupted, now_ns, true);
    }
    if timer::take_due(Alarm::Budget, now_ns) {
        containment::end_overrun(interrupted, now_ns);
    }
    if section::has_put_off(core) {
        execution::interrupt(interrupted, now_ns, false);
    }
    timer::arm_earliest();
}

/// Gives every core a heartbeat each `period_ns`; if 0, core 0 its ordinary one
/// and the others none.
pub(crate) fn set_heartbeats(period_ns: u64) {
    for core in this_core::all() {
        let ordinary_ns = match core.index {
            0 => HEARTBEAT_NS,
            1 => watchdog::LOOK_NS,
            _ => 0,
        };
        let own_ns = if period_ns == 0 {
            ordinary_ns
        } else {
            period_ns
        };
        core.heartbeat_ns.store(own_ns, Ordering::Relaxed);
        core.wake_up();
    }
    beat(this_core::get(), clock::now_ns());
}

/// Returns the time between two heartbeats of core 0, which executes this.
pub(crate) fn own_heartbeat_ns() -> u64 {
    this_core::get().heartbeat_ns.load(Ordering::Relaxed)
}

/// Gives core 0, which executes this outside any instance, a heartbeat each
/// `period_ns`.
pub(crate) fn set_own_heartbeat(period_ns: u64) {
    let core = this_core::get();
    core.heartbeat_ns.store(period_ns, Ordering::Relaxed);
    beat(core, clock::now_ns());
}

/// Returns the timer interrupts that all cores have taken since boot.
pub(crate) fn timer_interrupts() -> u64 {
    let counts = this_core::all().iter().map(|core| &core.timer_interrupts);
    counts.map(|count| count.load(Ordering::Relaxed)).sum()
}

/// Begins the core's heartbeat if it has one now and had none before.
fn keep_beating(core: &Core) {
    if !timer::is_set(Alarm::Heartbeat) {
        beat(core, clock::now_ns());
    }
}

fn beat(core: &Core, now_ns: u64) {
    let next_ns = match core.heartbeat_ns.load(Ordering::Relaxed) {
        0 => u64::MAX,
        period_ns => now_ns.saturating_add(period_ns),
    };
    timer::set(Alarm::Heartbeat, next_ns);
}

/// Handles another core's wake-up: there is work, an earlier event to wait for,
/// or another heartbeat.
pub(crate) fn wake_interrupt(interrupted: &mut Interrupted) {
    let core = this_core::get();
    let now_ns = clock::now_ns();
    core.interrupted_ns.store(now_ns, Ordering::Relaxed);
    if core.index == 0 {
        execution::arm_next_event();
    }
    keep_beating(core);
    execution::interrupt(interrupted, now_ns, false);
}

/// Occupies the calling instance's core for `ns` of execution, halted in between.
pub(crate) fn hold(ns: u64) {
    let executed = Executed::from_now();
    loop {
        interrupt_flag::disable();
        let left_ns = ns.saturating_sub(executed.ns());
        let core = this_core::get();
        if left_ns == 0 {
            timer::set(Alarm::Hold, u64::MAX);
            turns::enter();
            interrupt_flag::enable();
            return;
        }
        turns::leave(core);
        timer::set(Alarm::Hold, clock::now_ns().saturating_add(left_ns));
        // If this is preempted it is here: it then goes round again, on whatever
        // core it continues, and sets that core's alarm.
        interrupt_flag::enable_and_halt();
    }
}

/// Occupies the calling instance's core for `ns` of execution, computing.
pub(crate) fn spin(ns: u64) {
    let executed = Executed::from_now();
    while executed.ns() < ns {
        turns::stand_back();
        cpu::relax();
    }
    turns::come_back();
}

/// A stopwatch that stands still while its context is suspended.
struct Executed {
    context: &'static Context,
    start_ns: u64,
    suspended_before_ns: u64,
}

impl Executed {
    fn from_now() -> Self {
        let were_enabled = interrupt_flag::disable();
        let context = this_core::get().context();
        let start_ns = clock::now_ns();
        if were_enabled {
            interrupt_flag::enable();
        }
        Self {
            context,
            start_ns,
            suspended_before_ns: context.suspended_ns(),
        }
    }

    fn ns(&self) -> u64 {
        // The clock first: a suspension in between then counts too much in the next
        // line, which the next look sets right, and not too little, as execution.
        let elapsed_ns = clock::now_ns().saturating_sub(self.start_ns);
        let suspended_ns = self.context.suspended_ns() - self.suspended_before_ns;
        elapsed_ns.saturating_sub(suspended_ns)
    }
}
