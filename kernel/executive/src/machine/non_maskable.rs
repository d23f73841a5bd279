//! Messages between cores by the non-maskable interrupt, which no core can put off.

use core::sync::atomic::{AtomicBool, Ordering};

use super::local_apic;
use super::this_core::{self, Core};

/// Whether non-maskable interrupts are this kernel's own signal to stop.
static STOPPING: AtomicBool = AtomicBool::new(false);

/// Makes a core answer even if its interrupts are disabled. If they are disabled at several answers
/// in a row, the core ends the run.
pub fn accuse(core: &Core) {
    if core.accusation.open() {
        local_apic::send_non_maskable(core.apic_id());
    }
}

/// Answers if this core is accused: returns the number of answers given without an interrupt in
/// between.
pub(super) fn answer() -> u32 {
    if !this_core::is_ready() {
        return 0;
    }
    let core = this_core::get();
    let interrupted_ns = core.interrupted_ns.load(Ordering::Relaxed);
    core.accusation.answer(interrupted_ns)
}

/// Stops all other cores, for good.
pub fn stop_others() {
    STOPPING.store(true, Ordering::Release);
    local_apic::send_stop_to_others();
}

/// Reports whether all cores but one have been told to stop.
pub(super) fn is_stopping() -> bool {
    STOPPING.load(Ordering::Acquire)
}
