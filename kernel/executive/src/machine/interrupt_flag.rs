//! Disables and enables interrupts, and measures the time in between on request.
//!
//! When app code has used up its stack, only this code may fail, not the kernel. A call into the
//! kernel must therefore fail while interrupts are still enabled: [`disable`], the usual way to
//! disable them, first touches as much of the stack as a section without interrupts needs.

use core::panic::Location;

use core::sync::atomic::{AtomicBool, Ordering};

use super::{counted_time, cpu, interrupts_off};

/// Whether cores never halt.
static STAYS_AWAKE: AtomicBool = AtomicBool::new(false);

/// Stops all cores from halting from now on, for processors whose timers might stop in a halt.
pub fn stay_awake() {
    STAYS_AWAKE.store(true, Ordering::Relaxed);
}

/// Reports whether cores never halt.
pub fn stays_awake() -> bool {
    STAYS_AWAKE.load(Ordering::Relaxed)
}

/// Disables interrupts on this processor and reports whether they were enabled.
#[track_caller]
pub fn disable() -> bool {
    let were_enabled = cpu::is_interrupt_flag_set();
    if were_enabled {
        // While interrupts are enabled: an overflow found here is still the app's, and contained.
        cpu::probe_stack();
        cpu::clear_interrupt_flag();
        interrupts_off::note_disabled(Location::caller());
    }
    were_enabled
}

/// Disables interrupts where they are known to be enabled, and no app's function is running.
#[track_caller]
pub fn disable_enabled() {
    cpu::clear_interrupt_flag();
    interrupts_off::note_disabled(Location::caller());
}

/// Reports whether interrupts are enabled on this processor.
pub fn are_enabled() -> bool {
    cpu::is_interrupt_flag_set()
}

/// Enables interrupts on this processor.
pub fn enable() {
    interrupts_off::note_enabled();
    cpu::set_interrupt_flag();
}

/// Enables interrupts if they were enabled before [`disable`].
#[inline(always)]
pub fn restore(were_enabled: bool) {
    if were_enabled {
        enable();
    }
}

/// Enables interrupts and halts until one has been handled; leaves them enabled. If cores stay
/// awake, the function may return at once, as after an interrupt without effect.
///
/// To be called with interrupts disabled: no interrupt already checked for by the caller can then
/// leave the processor halted with work to do.
pub fn enable_and_halt() {
    interrupts_off::note_enabled();
    if stays_awake() {
        cpu::set_interrupt_flag();
        return cpu::relax();
    }
    counted_time::count_before_halt();
    cpu::set_interrupt_flag_and_halt();
}
