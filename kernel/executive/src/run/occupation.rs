//! Occupies a core on behalf of an instance without real work.

use crate::machine::context::Context;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, cpu, interrupt_flag, this_core, time_slice};

/// Occupies the calling instance's core for `ns` nanoseconds of execution, halting in between.
pub(crate) fn hold(ns: u64) {
    let executed = ExecutionTimer::from_now();
    loop {
        interrupt_flag::disable();
        let left_ns = ns.saturating_sub(executed.ns());
        let core = this_core::get();
        if left_ns == 0 {
            // Before `enter`, which sets the same alarm for the end of a slice.
            timer::set(Alarm::Hold, u64::MAX);
            time_slice::enter();
            interrupt_flag::enable();
            return;
        }
        time_slice::leave(core);
        timer::set(Alarm::Hold, clock::now_ns().saturating_add(left_ns));
        // A preemption happens here: the loop then goes round again on the core where the instance
        // continues, and sets that core's alarm.
        interrupt_flag::enable_and_halt();
    }
}

/// Occupies the calling instance's core for `ns` nanoseconds of execution, computing.
pub(crate) fn spin(ns: u64) {
    let executed = ExecutionTimer::from_now();
    while executed.ns() < ns {
        // In each round: a resumption after a preemption has made the core join the slices again.
        time_slice::stand_back();
        cpu::relax();
    }
    time_slice::come_back();
}

/// A stopwatch that stands still while its context is suspended.
struct ExecutionTimer {
    context: &'static Context,
    start_ns: u64,
    suspended_before_ns: u64,
}

impl ExecutionTimer {
    fn from_now() -> Self {
        // A suspension between the two readings would be in neither, and so count as execution.
        let were_enabled = interrupt_flag::disable();
        let context = this_core::get().context();
        let timer = Self {
            context,
            start_ns: clock::now_ns(),
            suspended_before_ns: context.suspended_ns(),
        };
        interrupt_flag::restore(were_enabled);
        timer
    }

    fn ns(&self) -> u64 {
        // The clock first: a suspension between the readings then makes this result too small,
        // until the next reading. In the other order it would count as execution.
        let elapsed_ns = clock::now_ns().saturating_sub(self.start_ns);
        let suspended_ns = self.context.suspended_ns() - self.suspended_before_ns;
        elapsed_ns.saturating_sub(suspended_ns)
    }
}
