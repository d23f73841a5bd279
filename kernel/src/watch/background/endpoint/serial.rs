//! The second serial port.
//!
//! Core 0's heartbeat polls the port every [`PERIOD_NS`](super::PERIOD_NS): at 115200 baud its FIFO
//! of 16 bytes is full after 1.4 ms. So bytes arrive whatever the core runs, and cost no additional
//! interrupt. The background sends bytes when the core is idle; any rest is sent at the end of the
//! run.

use alloc::boxed::Box;
use alloc::format;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::shared::{DeviceEnd, Wire};

use super::{CONNECTED, Endpoint, EndpointWords, Opened, arrive, end_of};
use crate::options::UsageError;
use executive::machine::serial::SECOND;
use executive::machine::this_core::{self, Core};
use executive::machine::timer::{self, Alarm};
use front::report;

/// The capacity of the port's FIFO, in bytes.
pub(super) const FIFO_BYTES: usize = 16;

struct SerialEndpoint {
    end: DeviceEnd,
    /// Whether a run goes on: bytes between runs belong to none.
    is_run: AtomicBool,
}

/// Opens the port.
pub(super) fn open(wire: &Wire, _words: &EndpointWords<'_>) -> Opened {
    take_port(wire)?;
    let (end, is_run) = (end_of(wire)?, AtomicBool::new(false));
    CONNECTED.add(Box::new(SerialEndpoint { end, is_run }));
    Ok(true)
}

/// Takes the port for a wire, once.
pub(super) fn take_port(wire: &Wire) -> Result<(), UsageError> {
    static IS_TAKEN: AtomicBool = AtomicBool::new(false);
    let name = wire.name();
    if !SECOND.is_there() {
        return Err(UsageError::new(format!(
            "wire `{name}` has no device, as there is no second serial port; give --input FILE \
             or --output FILE, or a network by --net and `wire.{name}=udp://:PORT`"
        )));
    }
    match IS_TAKEN.swap(true, Ordering::Relaxed) {
        false => Ok(()),
        true => Err(UsageError::new(format!(
            "wire `{name}` finds the serial port taken by another wire; connect this one \
             elsewhere, such as by `wire.{name}=udp://:5000`"
        ))),
    }
}

/// Sends some of a wire's bytes, and reports whether there were any.
pub(super) fn step(end: &DeviceEnd) -> bool {
    if !end.has_bytes_to_go() {
        return false;
    }
    if SECOND.is_ready() {
        // A port that is ready has an empty FIFO, so these bytes fit without further questions.
        let bytes = core::iter::from_fn(|| end.depart()).take(FIFO_BYTES);
        bytes.for_each(|byte| SECOND.write(byte));
    }
    true
}

/// Sends all remaining bytes of a wire.
pub(super) fn send_rest(end: &DeviceEnd) {
    core::iter::from_fn(|| end.depart()).for_each(|byte| SECOND.send(byte));
    SECOND.drain();
}

impl Endpoint for SerialEndpoint {
    fn begin_run(&self, now_ns: u64) {
        self.is_run.store(true, Ordering::Relaxed);
        timer::set_no_later(this_core::get(), Alarm::Heartbeat, now_ns);
    }

    fn beat(&self, core: &Core, now_ns: u64) {
        if core.index > 0 || !self.is_run.load(Ordering::Relaxed) {
            return;
        }
        let mut bytes = [0; FIFO_BYTES];
        let mut count = 0;
        while let Some(place) = bytes.get_mut(count)
            && let Some(byte) = SECOND.receive()
        {
            *place = byte;
            count += 1;
        }
        arrive(&self.end, &bytes[..count], now_ns);
    }

    fn step(&self) -> bool {
        step(&self.end)
    }

    fn end_run(&self) {
        self.is_run.store(false, Ordering::Relaxed);
        send_rest(&self.end);
    }

    fn tell(&self) {
        report::tell_wire(self.end.wire());
    }
}
