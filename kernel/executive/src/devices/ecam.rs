//! The configuration space of PCI, in memory (ECAM; PCI Express Base Specification 3.0, 7.2.2).

use core::sync::atomic::{AtomicU64, Ordering};

use fass::platform::SetOnce;

use super::pci::{BUSES, Configuration, Place};
use super::registers::Registers;

/// The bytes of a function's configuration space, and of a bus.
const FUNCTION: u64 = 4096;
const BUS: u64 = 256 * FUNCTION;

/// The start of the space according to the firmware's tables; 0 if there is none.
static PLACE: AtomicU64 = AtomicU64::new(0);

static ECAM: SetOnce<Ecam> = SetOnce::new();

/// Notes the start of the machine's configuration space. The space is mapped when a driver asks.
pub fn note_place(start: Option<u64>) {
    PLACE.store(start.unwrap_or(0), Ordering::Relaxed);
}

/// Why there are no functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EcamError {
    /// The firmware's tables name no such memory.
    Absent,
    /// The place belongs to something else.
    Taken(u64),
}

impl core::fmt::Display for EcamError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Absent => f.write_str(
                "the machine has no PCI configuration space in memory; boot a PC with PCI \
                 Express, in QEMU by `--machine q35`, with a network by `--net user`",
            ),
            Self::Taken(start) => write!(
                f,
                "the PCI configuration space at {start:#x} is where something else is; update the \
                 firmware"
            ),
        }
    }
}

/// Returns the machine's configuration space, mapped at the first call: an app without drivers pays
/// nothing.
///
/// # Errors
///
/// [`EcamError`].
pub fn configuration() -> Result<&'static Ecam, EcamError> {
    if let Some(ecam) = ECAM.get() {
        return Ok(ecam);
    }
    let start = PLACE.load(Ordering::Relaxed);
    if start == 0 {
        return Err(EcamError::Absent);
    }
    ECAM.set(Ecam::new(start).ok_or(EcamError::Taken(start))?);
    ECAM.get().ok_or(EcamError::Absent)
}

/// The configuration space of the first buses.
pub struct Ecam(Registers);

impl Ecam {
    /// Maps the space whose bus 0 starts at an address; `None` if the place belongs to something
    /// else.
    pub fn new(start: u64) -> Option<Self> {
        let end = start.checked_add(BUSES as u64 * BUS)?;
        Registers::map(start..end).map(Self)
    }

    /// Returns the registers of a function, if its bus is among the first.
    fn of(&self, place: Place) -> Option<Registers> {
        self.0.part(u64::from(place.0) * FUNCTION, FUNCTION)
    }
}

impl Configuration for Ecam {
    fn read(&self, place: Place, offset: u16) -> u32 {
        self.of(place)
            .map_or(u32::MAX, |space| space.read32(offset.into()))
    }

    fn write(&self, place: Place, offset: u16, value: u32) {
        if let Some(space) = self.of(place) {
            space.write32(offset.into(), value);
        }
    }
}
