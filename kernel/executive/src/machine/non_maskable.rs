//! What cores tell each other by the non-maskable interrupt, which no core can put off.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::local_apic;
use super::this_core::{self, Core};

/// Whether non-maskable interrupts are this kernel's own signal to stop.
static STOPPING: AtomicBool = AtomicBool::new(false);

/// The core that has to say why it takes no interrupts: its index, or `NOBODY`.
static ACCUSED: AtomicU32 = AtomicU32::new(NOBODY);
const NOBODY: u32 = u32::MAX;

/// Makes a core say why it takes no interrupts, and end the run; or go on, if it does.
pub fn accuse(core: &Core) {
    ACCUSED.store(core.index, Ordering::Release);
    local_apic::send_non_maskable(core.apic_id());
}

/// Reports whether this core is accused, and withdraws the accusation.
pub(super) fn is_accusation() -> bool {
    let (taken, failed) = (Ordering::AcqRel, Ordering::Relaxed);
    this_core::is_ready()
        && (ACCUSED.compare_exchange(this_core::get().index, NOBODY, taken, failed)).is_ok()
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
