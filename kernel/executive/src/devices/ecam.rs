//! The configuration space of PCI, in memory (ECAM; PCI Express Base Specification 3.0, 7.2.2).

use super::pci::{BUSES, Configuration, Place};
use super::registers::Registers;

/// The bytes of a function's configuration space, and those of a bus.
const FUNCTION: u64 = 4096;
const BUS: u64 = 256 * FUNCTION;

/// The configuration space of the first buses.
#[derive(Debug)]
pub struct Ecam(Registers);

impl Ecam {
    /// Maps the space that begins at an address, that of bus 0; none if there is something else.
    #[must_use]
    pub fn new(start: u64) -> Option<Self> {
        let end = start.checked_add(BUSES as u64 * BUS)?;
        Registers::map(start..end).map(Self)
    }

    /// Returns the registers of a function, if its bus is one of the first.
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
