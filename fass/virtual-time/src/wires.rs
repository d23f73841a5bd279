//! Bytes in and out in virtual time: what a test lets arrive, and what functions have sent.
//!
//! Bytes arrive at their times, between the completions and the releases of that instant, as
//! signals do. What an instance sends is gone at its completion: no device is slow here, so only
//! an instance that sends more than its wire has room for loses bytes.

use std::cell::RefCell;
use std::time::Duration;

use fass::Wire;

use crate::VirtualTime;
use crate::arrival::Arrival;

/// The wires of a machine.
#[derive(Debug, Default)]
pub(crate) struct Wires {
    connected: RefCell<Vec<Connected>>,
}

#[derive(Debug)]
struct Connected {
    wire: Wire,
    sent: Vec<u8>,
}

impl Wires {
    /// Takes what has been sent.
    pub(crate) fn collect(&self) {
        for Connected { wire, sent } in self.connected.borrow_mut().iter_mut() {
            sent.extend(std::iter::from_fn(|| wire.depart()));
        }
    }
}

impl VirtualTime {
    /// Connects a wire: what is sent on it can be had by [`sent`](Self::sent).
    ///
    /// See [`Wire`].
    #[must_use = "the machine itself is returned"]
    pub fn connect(self, wire: &Wire) -> Self {
        let (wire, sent) = (wire.clone(), Vec::new());
        let wires = &self.machine.surroundings.wires;
        wires.connected.borrow_mut().push(Connected { wire, sent });
        self
    }

    /// Lets bytes arrive on a wire at a time of the run, counted from the start of scheduling;
    /// at once if that is past.
    ///
    /// See [`Wire`].
    pub fn arrive_at(&self, wire: &Wire, time: Duration, bytes: &[u8]) {
        let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let at_ns = ns.max(self.machine.surroundings.now_ns.get());
        let arrival = Arrival::Bytes(wire.clone(), bytes.to_vec());
        self.machine.surroundings.keep(at_ns, arrival);
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
        let connected = self.machine.surroundings.wires.connected.borrow();
        let mut connected = connected.iter();
        match connected.find(|connected| connected.wire == *wire) {
            Some(connected) => connected.sent.clone(),
            None => panic!(
                "wire `{}` is not connected; call `connect` before the run",
                wire.name()
            ),
        }
    }
}
