//! Bytes in and out in virtual time: what a test lets arrive, and what functions have sent.
//!
//! Bytes arrive at their times, between the completions and the releases of that instant, as
//! signals do. What an instance sends is gone at its completion: no device is slow here, so only
//! an instance that sends more than its wire has room for loses bytes.

use std::time::Duration;

use fass::Wire;

use crate::surroundings::Arrival;
use crate::{VirtualTime, nanoseconds};

impl VirtualTime {
    /// Connects a wire: what is sent on it can be had by [`sent`](Self::sent).
    ///
    /// See [`Wire`].
    #[must_use = "the machine itself is returned"]
    pub fn connect(self, wire: &Wire) -> Self {
        let mut connected = self.machine.surroundings.connected.borrow_mut();
        connected.push((wire.clone(), Vec::new()));
        drop(connected);
        self
    }

    /// Lets bytes arrive on a wire at a time of the run, counted from the start of scheduling;
    /// at once if that is past.
    ///
    /// See [`Wire`].
    pub fn arrive_at(&self, wire: &Wire, time: Duration, bytes: &[u8]) {
        let surroundings = &self.machine.surroundings;
        let at_ns = nanoseconds(time).max(surroundings.now_ns.get());
        surroundings.keep(at_ns, Arrival::Bytes(wire.clone(), bytes.to_vec()));
    }

    /// Returns all that complete instances have sent so far on a wire that is connected.
    ///
    /// See [`Wire`].
    ///
    /// # Panics
    ///
    /// If the wire is not connected.
    #[must_use]
    pub fn sent(&self, wire: &Wire) -> Vec<u8> {
        let connected = self.machine.surroundings.connected.borrow();
        match connected.iter().find(|(of, _)| of == wire) {
            Some((_, sent)) => sent.clone(),
            None => panic!(
                "wire `{}` is not connected; call `connect` before the run",
                wire.name()
            ),
        }
    }
}
