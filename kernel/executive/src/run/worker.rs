//! The worker of each core: it runs what the scheduler assigns to it, else it halts.

use core::sync::atomic::{AtomicBool, Ordering};

use super::execution::{self, CoreWork, RunnerLoan};
use super::heartbeat;
use crate::machine::context::Parked;
use crate::machine::this_core::{self, Core};
use crate::machine::{clock, cpu, interrupt_flag, turns};
use crate::text::console;

/// Runs what is assigned to the core that it is on, from one instance to the
/// next, preempted now and then and resumed on any core. Returns the
/// context that the core is to go on with instead, with interrupts disabled.
pub fn work() -> Parked {
    interrupt_flag::disable();
    let mut work = find_work();
    loop {
        work = match work {
            CoreWork::Run(runner) => run(runner),
            CoreWork::Continue(context) => {
                turns::enter_by_interrupt(this_core::get());
                return context;
            }
            CoreWork::Rest => {
                rest(this_core::get());
                find_work()
            }
        };
    }
}

/// Finds what this core, which has computed nothing, is to do. Interrupts are disabled.
fn find_work() -> CoreWork {
    let work = execution::find_work();
    if let CoreWork::Run(_) = &work {
        turns::enter();
    }
    work
}

/// Calls a subtask's function, with interrupts enabled meanwhile.
fn run(mut runner: RunnerLoan) -> CoreWork {
    interrupt_flag::enable();
    runner.run();
    interrupt_flag::disable_enabled();
    let finish_ns = clock::now_ns();
    execution::complete(runner, finish_ns)
}

/// Makes the cores other than the first of each cluster watch for work instead of halting when
/// they have none.
pub fn watch_when_idle() {
    WATCHES.store(true, Ordering::Relaxed);
}

static WATCHES: AtomicBool = AtomicBool::new(false);

/// Sends waiting text and halts in between, until this core is to look for work.
/// Interrupts are disabled before and after.
fn rest(core: &Core) {
    // A core that keeps time has to hear of earlier events and of letters, by an interrupt.
    if WATCHES.load(Ordering::Relaxed) && !execution::keeps_time(core) {
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
    heartbeat::keep_beating(core);
    // It was spared the interrupt that arms it where it is the first of a cluster now.
    if execution::keeps_time(core) {
        execution::arm_next_event();
    }
}

/// Waits until the run has ended, as the background of core 0: whenever there is
/// work for the core, this is suspended. `when_idle` reports whether it has more to
/// do at once.
pub fn wait_in_background(mut when_idle: impl FnMut() -> bool) {
    while !execution::is_finished() {
        turns::begin_background();
        let has_more = when_idle();
        if console::send_pending_byte() || has_more {
            continue;
        }
        turns::end_background();
        interrupt_flag::disable();
        if execution::is_finished() {
            interrupt_flag::enable();
        } else {
            interrupt_flag::enable_and_halt();
        }
    }
    turns::end_background();
}
