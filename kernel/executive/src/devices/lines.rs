//! Lines: the messages of devices, each tied to one driver and sent to one core.

use core::sync::atomic::Ordering;

use fass::platform::SetOnce;

use super::pci::{Function, Message};
use super::registers::{RangeError, Registers};
use crate::machine::interrupt::{self, Interrupted};
use crate::machine::{clock, this_core, vector};
use crate::run::execution;

/// A driver's answer to its device's message.
pub trait DeviceLine: Sync {
    /// Takes what the device has, and releases DAGs or answers waits by
    /// [`execution::raise_in_interrupt`] and [`execution::answer`]. In an interrupt: it returns
    /// soon, and calls no function of an app's.
    fn interrupt(&self, now_ns: u64);
}

static LINES: [SetOnce<&'static dyn DeviceLine>; vector::DEVICES as usize] =
    [const { SetOnce::new() }; vector::DEVICES as usize];

/// Why a message cannot be tied to a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// The function has no such message.
    Range(RangeError),
    /// All lines are taken.
    NoLine,
    /// Messages do not reach a core with so large a local APIC id.
    Unreachable(u32),
}

impl core::fmt::Display for LineError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Range(error) => error.fmt(f),
            Self::NoLine => write!(
                f,
                "finds all {} lines of devices taken; use fewer devices",
                vector::DEVICES
            ),
            Self::Unreachable(id) => write!(
                f,
                "cannot reach the core with APIC id {id}; tie it to one with an id below 255"
            ),
        }
    }
}

/// Ties a message of a function to a driver, on this core, and has the function send it.
///
/// # Errors
///
/// [`LineError`].
pub fn tie(
    function: &Function<'_>,
    number: u16,
    line: &'static dyn DeviceLine,
) -> Result<(), LineError> {
    let id = this_core::get().apic_id();
    let reached = u8::try_from(id).ok().filter(|id| *id < u8::MAX);
    let reached = reached.ok_or(LineError::Unreachable(id))?;
    interrupt::install_devices(device_interrupt);
    let free = (vector::DEVICE..)
        .zip(&LINES)
        .find(|(_, place)| place.set(line));
    let (vector, _) = free.ok_or(LineError::NoLine)?;
    let message = Message {
        address: 0xfee0_0000 | u32::from(reached) << 12,
        data: vector.into(),
    };
    let function_error = |error| LineError::Range(RangeError::Function(error));
    let entry = function.send(number, message).map_err(function_error)?;
    if let Some(entry) = entry {
        let table = Registers::of(function, entry.bar).map_err(LineError::Range)?;
        table.write32(entry.offset, message.address);
        table.write32(entry.offset + 4, 0);
        table.write32(entry.offset + 8, message.data.into());
        // No longer masked.
        table.write32(entry.offset + 12, 0);
    }
    Ok(())
}

/// Handles the message of a line.
fn device_interrupt(line: u8, interrupted: &mut Interrupted) {
    let core = this_core::get();
    let now_ns = clock::now_ns();
    core.interrupted_ns.store(now_ns, Ordering::Relaxed);
    if let Some(driver) = LINES.get(usize::from(line)).and_then(SetOnce::get) {
        driver.interrupt(now_ns);
    }
    execution::interrupt(interrupted, now_ns, false);
}
