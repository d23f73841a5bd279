//! How one core makes another look for work.

use core::sync::atomic::Ordering;

use super::this_core::{self, Core};
use super::{local_apic, turns, vector};

impl Core {
    /// Makes this core look for work, by an interrupt unless it watches for the
    /// word or is the core that executes this.
    pub fn wake_up(&self) {
        // In one order with what `begin_watch` does: either this core sees there
        // that it is to wake up, or this sees here that it does not watch yet.
        self.wake.store(true, Ordering::SeqCst);
        if self.index != this_core::get().index && !self.watches.load(Ordering::SeqCst) {
            turns::begin_urgent();
            local_apic::send(self.apic_id(), vector::WAKE);
            turns::end_urgent();
        }
    }

    /// Tells the others that this core watches `wake` from now on.
    pub fn begin_watch(&self) {
        self.watches.store(true, Ordering::SeqCst);
    }

    /// Tells the others that this core no longer watches `wake`.
    pub fn end_watch(&self) {
        self.watches.store(false, Ordering::SeqCst);
    }
}
