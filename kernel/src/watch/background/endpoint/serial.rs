//! The second serial port.
//!
//! The port is looked at in core 0's heartbeat, every [`PERIOD_NS`](super::PERIOD_NS): at 115200
//! baud its FIFO of 16 bytes is full after 1.4 ms. So bytes arrive whatever the core runs, and cost
//! it no interrupt more. Bytes go from the background, when the core is idle, and what is left at
//! the run's end goes then.

use alloc::boxed::Box;
use alloc::format;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::shared::{DeviceEnd, Wire};

use super::{Endpoint, EndpointWords, Opened, arrive, end_of};
use crate::options::UsageError;
use executive::machine::serial::SECOND;
use executive::machine::this_core::{self, Core};
use executive::machine::timer::{self, Alarm};
use front::app::ending::AppError;

/// The capacity of the port's FIFO, in bytes.
const FIFO_BYTES: usize = 16;

pub(super) struct SerialEndpoint {
    end: DeviceEnd,
    /// Whether a run goes on: bytes that come between runs are of none.
    is_run: AtomicBool,
}

/// Opens the port.
pub(super) fn open(wire: &Wire, _words: &EndpointWords<'_>) -> Opened {
    Ok(Some(Box::new(SerialEndpoint::new(wire)?)))
}

/// Whether a wire has the port.
static IS_TAKEN: AtomicBool = AtomicBool::new(false);

impl SerialEndpoint {
    pub(super) fn new(wire: &Wire) -> Result<Self, AppError> {
        if !SECOND.is_there() {
            let name = wire.name();
            return Err(AppError::Usage(UsageError::new(format!(
                "wire `{name}` has no device, as there is no second serial port; give --input FILE \
                 or --output FILE"
            ))));
        }
        if IS_TAKEN.swap(true, Ordering::Relaxed) {
            return Err(AppError::Usage(UsageError::new(format!(
                "wire `{0}` finds the serial port taken by another wire; connect this one \
                 elsewhere, such as by `wire.{0}=udp://:5000`",
                wire.name()
            ))));
        }
        let (end, is_run) = (end_of(wire)?, AtomicBool::new(false));
        Ok(Self { end, is_run })
    }
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
        if !self.end.has_bytes_to_go() {
            return false;
        }
        if SECOND.is_ready() {
            let bytes = core::iter::from_fn(|| self.end.depart()).take(FIFO_BYTES);
            bytes.for_each(|byte| SECOND.write(byte));
        }
        true
    }

    fn end_run(&self) {
        self.is_run.store(false, Ordering::Relaxed);
        core::iter::from_fn(|| self.end.depart()).for_each(|byte| SECOND.send(byte));
        SECOND.drain();
    }

    fn end(&self) -> &DeviceEnd {
        &self.end
    }
}
