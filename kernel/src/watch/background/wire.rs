//! The wire that the second serial port is, or a file of bytes with their times.
//!
//! The port is looked at in core 0's heartbeat, every [`PERIOD_NS`]: at 115200 baud its FIFO of
//! 16 bytes is full after 1.4 ms. So bytes arrive whatever the core runs, and cost it no
//! interrupt more. Bytes go from the background, when the core is idle, and what is left at the
//! run's end goes then.
//!
//! Where runs have to repeat, input is a *script* in the loader's module: each entry is a time
//! of the run (8 bytes), a length (2 bytes), both with the lowest byte first, and its bytes. They
//! arrive at their times, by the heartbeat's alarm, as if the port had got them. The host has
//! made it, and so what is no entry is its end.

use alloc::boxed::Box;
use alloc::format;

use fass::shared::{DeviceEnd, Wire};

use super::{LINE, Line};
use crate::options::UsageError;
use executive::machine::serial::{SECOND, SerialPort};
use executive::machine::spinlock::SpinLock;
use executive::machine::this_core;
use executive::machine::timer::{self, Alarm};
use executive::run::execution;
use front::app::ending::AppError;
use front::report::tell_wire;

/// The time between two looks at the port.
pub(super) const PERIOD_NS: u64 = 1_000_000;

/// The capacity of the port's FIFO, in bytes.
const FIFO_BYTES: usize = 16;

struct WireConnection {
    wire: DeviceEnd,
    port: &'static SerialPort,
    /// Bytes that arrive in each run, in place of those of the port.
    script: Option<&'static [u8]>,
}

/// The rest of the script, still to arrive in this run; `None` outside runs.
static REST: SpinLock<Option<&'static [u8]>> = SpinLock::new(None);

/// Connects the wire to the port, or its way in to the script.
pub(crate) fn connect(wire: &Wire, script: Option<&'static [u8]>) -> Result<(), AppError> {
    let name = wire.name();
    if !SECOND.is_there() {
        return Err(AppError::Usage(UsageError::new(format!(
            "wire `{name}` has no device, as there is no second serial port; give --input FILE or \
             --output FILE"
        ))));
    }
    let Some(end) = DeviceEnd::of(wire) else {
        return Err(AppError::Failure(format!(
            "wire `{name}` has a device already; connect it once"
        )));
    };
    let connection = Box::leak(Box::new(WireConnection {
        wire: end,
        port: &SECOND,
        script,
    }));
    match LINE.set(connection) {
        true => Ok(()),
        false => Err(AppError::Failure(format!(
            "wire `{name}` finds the second serial port taken; connect one wire"
        ))),
    }
}

/// Returns the first entry of a script, its time before its bytes, and the entries after it.
fn first(script: &[u8]) -> Option<(u64, &[u8], &[u8])> {
    let (at_ns, rest) = script.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let length = usize::from(u16::from_le_bytes(*length));
    let (bytes, rest) = rest.split_at_checked(length)?;
    Some((u64::from_le_bytes(*at_ns), bytes, rest))
}

impl WireConnection {
    fn arrive(&self, bytes: &[u8], now_ns: u64) {
        if let Some((plan, dag)) = self.wire.arrive(bytes, now_ns) {
            execution::raise_in_interrupt(plan, dag);
        }
    }

    /// Takes the bytes that the script has for now. Reports whether there were some; if not, the
    /// heartbeat comes for the next ones.
    fn play(&self, now_ns: u64) -> bool {
        let mut rest = REST.lock();
        let Some((at_ns, bytes, after)) = rest.and_then(first) else {
            return false;
        };
        let waits_ns = at_ns.saturating_sub(execution::since_epoch(now_ns));
        if waits_ns > 0 {
            let due_ns = now_ns.saturating_add(waits_ns);
            timer::set_no_later(this_core::get(), Alarm::Heartbeat, due_ns);
            return false;
        }
        *rest = Some(after);
        drop(rest);
        self.arrive(bytes, now_ns);
        true
    }
}

impl Line for WireConnection {
    fn begin_run(&self, now_ns: u64) {
        *REST.lock() = Some(self.script.unwrap_or_default());
        timer::set_no_later(this_core::get(), Alarm::Heartbeat, now_ns);
    }

    fn beat(&self, now_ns: u64) {
        if self.script.is_some() {
            // As often as the script has entries.
            while self.play(now_ns) {}
            return;
        }
        if REST.lock().is_none() {
            return;
        }
        let mut bytes = [0; FIFO_BYTES];
        let mut count = 0;
        while let Some(place) = bytes.get_mut(count)
            && let Some(byte) = self.port.receive()
        {
            *place = byte;
            count += 1;
        }
        self.arrive(&bytes[..count], now_ns);
    }

    fn step(&self) -> bool {
        if !self.wire.has_bytes_to_go() {
            return false;
        }
        if self.port.is_ready() {
            let bytes = core::iter::from_fn(|| self.wire.depart()).take(FIFO_BYTES);
            bytes.for_each(|byte| self.port.write(byte));
        }
        true
    }

    fn end_run(&self) {
        *REST.lock() = None;
        core::iter::from_fn(|| self.wire.depart()).for_each(|byte| self.port.send(byte));
        self.port.drain();
    }

    fn report(&self) {
        tell_wire(self.wire.wire());
    }
}

#[cfg(test)]
mod tests {
    use super::first;

    #[test]
    fn a_script_is_read_entry_by_entry_to_its_end() {
        let script = b"\x07\0\0\0\0\0\0\0\x02\0ab\x00\x01\0\0\0\0\0\0\x01\0c";
        let (at_ns, bytes, rest) = first(script).unwrap();
        assert_eq!((at_ns, bytes), (7, &b"ab"[..]));
        assert_eq!(first(rest), Some((256, &b"c"[..], &b""[..])));
        for end in 0..11 {
            assert_eq!(first(&rest[..end.min(rest.len() - 1)]), None);
        }
    }
}
