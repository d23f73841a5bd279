//! Lines: the messages of devices, each tied to one driver and sent to one core.

use core::sync::atomic::Ordering;

use fass::platform::SetOnce;

use super::ecam;
use super::pci::{Function, Message, PciError, Place};
use super::registers::Registers;
use crate::machine::interrupt::{self, Interrupted};
use crate::machine::this_core::Core;
use crate::machine::{clock, local_apic, this_core, vector};
use crate::run::execution;

/// A driver's answer to its device's message.
pub trait DeviceLine: Sync {
    /// Takes the device's data, and releases DAGs or answers waits, by
    /// [`Signal::raise`](fass::shared::Signal::raise) and
    /// [`DeviceDriver::answer`](fass::shared::DeviceDriver::answer). Called in an interrupt:
    /// returns soon, allocates nothing, and must not panic.
    fn interrupt(&self, now_ns: u64);
}

static LINES: [SetOnce<&'static dyn DeviceLine>; vector::DEVICES as usize] =
    [const { SetOnce::new() }; vector::DEVICES as usize];

/// Why a message cannot be tied to a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// The function has no such message.
    Function(PciError),
    /// All lines are taken.
    NoLine,
    /// There is no core with this number.
    NoCore(u32),
    /// Messages do not reach a core with so large a local APIC id.
    Unreachable(u32),
}

impl core::fmt::Display for LineError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Function(error) => error.fmt(f),
            Self::NoLine => write!(
                f,
                "finds all {} lines of devices taken; use fewer devices",
                vector::DEVICES
            ),
            Self::NoCore(core) => write!(
                f,
                "finds no core {core}; tie it to one of 0 to {}",
                this_core::all().len().saturating_sub(1)
            ),
            Self::Unreachable(id) => write!(
                f,
                "cannot reach the core with APIC id {id}; tie it to one with an id below 255"
            ),
        }
    }
}

/// A message tied to a driver.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    place: Place,
    number: u16,
    vector: u8,
    /// The message's entry in a table in memory, if the function has one.
    entry: Option<(Registers, u64)>,
}

/// Ties a message of a function to a driver, and makes the function send the message to a core,
/// given by its number. The function sends once it [may reach memory](Function::enable_reach).
///
/// # Errors
///
/// [`LineError`].
///
/// ```no_run
/// use kernel::devices::{DeviceLine, Function, LineError, Registers, tie};
///
/// /// A driver that has nothing to do but to acknowledge.
/// struct Quiet(Registers);
///
/// impl DeviceLine for Quiet {
///     fn interrupt(&self, _now_ns: u64) {
///         self.0.write32(0x64, self.0.read32(0x24));
///     }
/// }
///
/// fn silence(function: &Function<'_>, registers: Registers) -> Result<(), LineError> {
///     let driver = Box::leak(Box::new(Quiet(registers)));
///     tie(function, 0, driver, 0).map(drop)
/// }
/// ```
pub fn tie(
    function: &Function<'_>,
    number: u16,
    driver: &'static dyn DeviceLine,
    core: u32,
) -> Result<Line, LineError> {
    // Before a line is taken: lines are never given back.
    reached(core)?;
    let vector = take(driver)?;
    let mut line = Line {
        place: function.place,
        number,
        vector,
        entry: None,
    };
    let entry = function.send(number, line.message(core)?);
    if let Some(entry) = entry.map_err(LineError::Function)? {
        let table = Registers::in_bar(function, entry.bar).map_err(LineError::Function)?;
        line.entry = Some((table, entry.offset));
        line.route(core)?;
    }
    Ok(line)
}

/// Takes a line for a driver, and returns its vector.
fn take(driver: &'static dyn DeviceLine) -> Result<u8, LineError> {
    interrupt::install_devices(device_interrupt);
    let free = (vector::DEVICE..)
        .zip(&LINES)
        // Each place is set once, so two cores cannot take the same line.
        .find(|(_, place)| place.set(driver));
    free.map(|(vector, _)| vector).ok_or(LineError::NoLine)
}

/// A line for messages sent by a core, to itself or another core.
#[derive(Clone, Copy, Debug)]
pub struct Bell(u8);

impl Bell {
    /// Ties the line to a driver.
    ///
    /// # Errors
    ///
    /// [`LineError`].
    pub fn new(driver: &'static dyn DeviceLine) -> Result<Self, LineError> {
        take(driver).map(Self)
    }

    /// Makes a core call the driver, as soon as interrupts are enabled there.
    pub fn ring(self, core: &Core) {
        local_apic::send(core.apic_id(), self.0);
    }
}

/// Returns the local APIC's id of a core, if messages can reach the core.
fn reached(core: u32) -> Result<u8, LineError> {
    let core = (this_core::all().get(core as usize)).ok_or(LineError::NoCore(core))?;
    let id = u8::try_from(core.apic_id()).ok();
    // 255 would address all cores.
    let id = id.filter(|id| *id < u8::MAX);
    id.ok_or(LineError::Unreachable(core.apic_id()))
}

impl Line {
    fn message(&self, core: u32) -> Result<Message, LineError> {
        Ok(Message {
            address: 0xfee0_0000 | u32::from(reached(core)?) << 12,
            data: self.vector.into(),
        })
    }

    /// Makes the function send the message to another core from now on. To be called between runs,
    /// while the device has nothing to say: a message on its way may be lost.
    ///
    /// # Errors
    ///
    /// [`LineError`].
    pub fn route(&self, core: u32) -> Result<(), LineError> {
        let message = self.message(core)?;
        let Some((table, offset)) = self.entry else {
            let function = ecam::configuration().ok();
            let function = function.and_then(|space| Function::at(space, self.place));
            let sent = function.ok_or(PciError::NoMessages);
            let sent = sent.and_then(|function| function.send(self.number, message));
            return sent.map(drop).map_err(LineError::Function);
        };
        // Masked meanwhile: between the writes, address and data belong to different messages.
        table.write32(offset + 12, 1);
        table.write32(offset, message.address);
        table.write32(offset + 4, 0);
        table.write32(offset + 8, message.data.into());
        table.write32(offset + 12, 0);
        Ok(())
    }
}

/// Handles the message of a line.
fn device_interrupt(line: u8, interrupted: &mut Interrupted) {
    let now_ns = clock::now_ns();
    let core = this_core::get();
    core.interrupted_ns.store(now_ns, Ordering::Relaxed);
    execution::device_interrupt(interrupted, now_ns, || {
        if let Some(driver) = LINES.get(usize::from(line)).and_then(SetOnce::get) {
            driver.interrupt(now_ns);
        }
    });
}
