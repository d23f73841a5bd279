//! The worker of each core: runs the instances assigned by the scheduler, and halts when there are
//! none.
//!
//! # The states of a worker's context
//!
//! ```text
//!             1                 2                     6
//!   stock --------> looking ----------> running ----------> suspended
//!     ^             |  ^  | <----------  |   ^                  |
//!     |      8      |  |  |      3       |   |        7         |
//!     +-------------+  |  | 4            |   +------------------+
//!     |              5 |  v              |
//!     |              resting             |
//!     |                        9         |
//!     +----------------------------------+
//! ```
//!
//! 1. A core begins with its first context, or an interrupt handler exchanges contexts and restarts
//!    a free context ([`contexts::new_worker`](super::contexts::new_worker)); [`work`] looks for an
//!    instance.
//! 2. [`execution::find_work`] or [`execution::complete`] returned [`CoreWork::Run`]: an instance
//!    starts, or proceeds after a wait. A waiting instance has no context. With time slices, the
//!    context may wait for its slice first, with interrupts enabled.
//! 3. The subtask's function returned, and [`execution::complete`] looks for the next work.
//! 4. The scheduler has no work for the core ([`CoreWork::Rest`]); never on core 0 during a run:
//!    the parked background continues instead (8).
//! 5. `Core::wake` is set, by another core's `wake_up` or by the core's own interrupt.
//! 6. An interrupt on the core preempts the instance (`ClusterRun::follow`), unless a section of an
//!    app's lock postpones the preemption.
//! 7. A core of the cluster continues the context: in an interrupt (`follow`), or after the core's
//!    own worker has found [`CoreWork::Continue`] (8).
//! 8. The scheduler has a suspended context or the background for the core
//!    ([`CoreWork::Continue`]). The worker's context becomes the core's spare, and an earlier spare
//!    returns to the stock: in the drawing, spare contexts are part of the stock.
//! 9. A contained fault ends the instance ([`containment`](super::containment)), and the core
//!    continues with another context (1).
//!
//! Impossible: looking to suspended, because a looking core has no instance to suspend; resting to
//! suspended, because an interrupt only wakes a resting worker; and leaving the states by an error:
//! a fault outside any instance ends the run.

use core::sync::atomic::{AtomicBool, Ordering};

use super::execution::{self, CoreWork, RunnerLoan};
use super::heartbeat;
use crate::machine::context::Parked;
use crate::machine::this_core::{self, Core};
use crate::machine::{clock, cpu, interrupt_flag, time_slice};
use crate::text::console;

/// Runs the instances assigned to the current core, one after another. Interrupts may preempt the
/// calling context and another core may resume it. Returns, with interrupts disabled, the context
/// to continue on this core instead.
pub fn work() -> Parked {
    interrupt_flag::disable();
    let mut work = find_work();
    loop {
        work = match work {
            CoreWork::Run(runner) => run(runner),
            CoreWork::Continue(context) => {
                time_slice::enter_by_interrupt(this_core::get());
                return context;
            }
            CoreWork::Rest => {
                rest(this_core::get());
                find_work()
            }
        };
    }
}

/// Finds the next work of this core, which has computed nothing so far. Interrupts are disabled.
fn find_work() -> CoreWork {
    let work = execution::find_work();
    if let CoreWork::Run(_) = &work {
        time_slice::enter();
    }
    work
}

/// Calls a subtask's function, with interrupts enabled during the call.
fn run(mut runner: RunnerLoan) -> CoreWork {
    interrupt_flag::enable();
    runner.run();
    interrupt_flag::disable_enabled();
    // Stamped before the lock is waited for: the finish is the function's return (decision 19).
    let finish_ns = clock::now_ns();
    execution::complete(runner, finish_ns)
}

/// Makes idle cores watch for work instead of halting, except each cluster's first core.
pub fn watch_when_idle() {
    WATCHES.store(true, Ordering::Relaxed);
}

static WATCHES: AtomicBool = AtomicBool::new(false);

/// Sends waiting text, or else halts, until this core is to look for work. Interrupts are disabled
/// before and after.
fn rest(core: &Core) {
    // A time-keeping core must hear of earlier events and of letters by an interrupt: no watching.
    if WATCHES.load(Ordering::Relaxed) && !execution::keeps_time(core) {
        watch(core);
    }
    while !core.wake.swap(false, Ordering::AcqRel) {
        // A byte may take the port 87 us: with interrupts enabled the core follows decisions
        // meanwhile.
        if console::has_pending() {
            interrupt_flag::enable();
            console::send_pending_byte();
        } else {
            // No wake-up is lost: its interrupt is pending since `wake` was looked at, and ends the
            // halt.
            interrupt_flag::enable_and_halt();
        }
        interrupt_flag::disable();
    }
}

/// Watches for another core's wake-up, so the other core need not send an interrupt. Interrupts are
/// disabled before and after, and enabled during the watch.
fn watch(core: &Core) {
    core.begin_watch();
    interrupt_flag::enable();
    while !core.wake.load(Ordering::Acquire) {
        if !console::send_pending_byte() {
            cpu::relax();
        }
    }
    interrupt_flag::disable();
    // Before `rest` looks at `wake` again: a core that still sees the watch sends no interrupt.
    core.end_watch();
    heartbeat::keep_beating(core);
    // A core that became a cluster's first core while watching got no interrupt to arm its timer.
    if execution::keeps_time(core) {
        execution::arm_next_event();
    }
}

/// Waits, as core 0's background, until the run has ended. Core 0 suspends the background whenever
/// there is work for the core. `when_idle` reports whether more remains to be done at once.
pub fn wait_in_background(mut when_idle: impl FnMut() -> bool) {
    while !execution::is_finished() {
        time_slice::begin_background();
        let has_more = when_idle();
        if console::send_pending_byte() || has_more {
            continue;
        }
        time_slice::end_background();
        interrupt_flag::disable();
        // Asked again with interrupts disabled, to lose no wake-up between question and halt.
        if execution::is_finished() {
            interrupt_flag::enable();
        } else {
            interrupt_flag::enable_and_halt();
        }
    }
    time_slice::end_background();
}
