//! Wake-ups: a core makes another core look for work.

use core::sync::atomic::Ordering;

use super::this_core::{self, Core};
use super::{local_apic, time_slice, vector};

impl Core {
    /// Makes this core look for work, by an interrupt unless the core watches `wake` or is the
    /// caller's.
    pub fn wake_up(&self) {
        // In one order with `begin_watch`: either the watching core sees there that it is to wake
        // up, or the caller sees here that the core does not watch yet.
        self.wake.store(true, Ordering::SeqCst);
        if self.index != this_core::get().index && !self.watches.load(Ordering::SeqCst) {
            // No slice may begin before the woken core has had the chance to become fresh.
            time_slice::begin_urgent();
            local_apic::send(self.apic_id(), vector::WAKE);
            time_slice::end_urgent();
        }
    }

    /// Announces this core's watch of `wake` to all other cores.
    pub fn begin_watch(&self) {
        self.watches.store(true, Ordering::SeqCst);
    }

    /// Announces the end of this core's watch of `wake` to all other cores.
    pub fn end_watch(&self) {
        self.watches.store(false, Ordering::SeqCst);
    }
}
