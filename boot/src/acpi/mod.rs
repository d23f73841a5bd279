//! The few ACPI tables that name the processors, a known clock, and the registers to end the
//! machine.
//!
//! Root pointer (RSDP) -> RSDT or XSDT -> MADT (processors, I/O APICs) and FADT (power management
//! timer, [`power`]), HPET. Layouts: ACPI specification 6.5, 5.2.5 to 5.2.12. Every table's
//! checksum is verified; a table with a wrong checksum is not used, and named.

use crate::physical::PhysicalMemory;
use crate::power::{self, Power, Register};
use crate::{List, MAX_PROCESSORS};

/// The most I/O APICs noted.
pub const MAX_IO_APICS: usize = 8;

/// The facts told by the tables.
#[derive(Clone, Copy, Debug)]
pub struct Platform {
    /// The local APIC ids of the enabled processors, in the table's order, as far as they fit.
    pub apic_ids: List<u32, MAX_PROCESSORS>,
    /// The number of enabled processors, whether their ids fit or not.
    pub processors: usize,
    /// The physical address of the local APICs' registers.
    pub local_apic: u64,
    /// The power management timer, if the machine has one.
    pub pm_timer: Option<PmTimer>,
    /// The physical address of the registers of the high precision event timer, if the machine has
    /// one.
    pub hpet: Option<u64>,
    /// The physical addresses of the I/O APICs' registers.
    pub io_apics: List<u64, MAX_IO_APICS>,
    /// The physical address of PCI's configuration space, starting at bus 0, if it is in memory.
    pub ecam: Option<u64>,
    /// The way to power off and reset the machine.
    pub power: Power,
    /// The fault of a dispensable table, if there is any.
    pub warning: Option<AcpiError>,
}

impl Platform {
    /// Adds a processor, unless the table has named it already, in the other form of an entry.
    fn add_processor(&mut self, apic_id: u32) {
        if !self.apic_ids.as_slice().contains(&apic_id) {
            self.processors += 1;
            // A processor without room is only counted.
            let _ = self.apic_ids.push(apic_id);
        }
    }
}

/// The 3.579545 MHz counter of ACPI 4.8.2.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PmTimer {
    /// The I/O port to read the counter from.
    pub port: u16,
    /// The number of bits that count: 24 or 32.
    pub bits: u32,
}

/// The reason why the processors, or a table, could not be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AcpiError {
    /// No root pointer at the loader's address, nor in the BIOS area.
    NoRootPointer,
    /// The root pointer leads to no valid table of tables.
    NoRootTable,
    /// No table has this signature.
    Absent(Signature),
    /// The table with this signature has a wrong length or checksum.
    Damaged(Signature),
    /// The table of interrupt controllers (MADT) is malformed, or names no processor.
    NoProcessors,
}

/// The first bytes of a table.
type Signature = [u8; 4];

impl core::fmt::Display for AcpiError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (signature, what) = match self {
            Self::NoRootPointer => {
                return f.write_str("the machine has no ACPI root pointer; boot it with ACPI on");
            }
            Self::NoRootTable => {
                return f.write_str("the ACPI root table is malformed; update the firmware");
            }
            Self::Absent(signature) => (signature, "is missing"),
            Self::Damaged(signature) => (signature, "has a wrong length or checksum"),
            Self::NoProcessors => (b"APIC", "is malformed, or names no processor"),
        };
        let name = signature.escape_ascii();
        write!(f, "the ACPI table `{name}` {what}; update the firmware")
    }
}

const HEADER: u64 = 36;

/// Reads the tables, starting from the root pointer named by the loader. If the loader named none,
/// or none is there, the root pointer in the BIOS area counts (ACPI 5.2.5.1).
///
/// # Errors
///
/// [`AcpiError`] says which link of the chain is missing. Without a MADT the existing processors
/// are unknown, so a missing MADT is an error, not an empty list.
// Not inlined: this code is compiled for size here, and an image has little room.
#[inline(never)]
pub fn read(memory: &dyn PhysicalMemory, rsdp: Option<u64>) -> Result<Platform, AcpiError> {
    let root = rsdp
        .filter(|at| is_root_pointer(memory, *at))
        .or_else(|| {
            (0xe_0000..0x10_0000)
                .step_by(16)
                .find(|at| is_root_pointer(memory, *at))
        })
        .ok_or(AcpiError::NoRootPointer)?;
    let tables = RootTable::at(memory, root).ok_or(AcpiError::NoRootTable)?;
    let madt = tables.find(memory, *b"APIC")?;
    let mut warning = None;
    let mut find = |signature| {
        let found = tables.find(memory, signature);
        warning = warning.or(found
            .err()
            .filter(|why| *why == AcpiError::Damaged(signature)));
        found.ok()
    };
    let fadt = find(*b"FACP");
    let hpet = find(*b"HPET").and_then(|hpet| hpet_registers(memory, hpet));
    // After the header and 8 reserved bytes: the base of the first segment, its number, and its
    // first bus (PCI Firmware Specification 3.2, 4.1.2).
    let ecam = find(*b"MCFG").and_then(|mcfg| {
        let first = memory.u32(mcfg + HEADER + 16)? & 0xff_ffff;
        memory.u64(mcfg + HEADER + 8).filter(|_| first == 0)
    });
    let mut platform = Platform {
        ecam,
        apic_ids: List::new(0),
        processors: 0,
        local_apic: 0,
        pm_timer: fadt.and_then(|fadt| pm_timer(memory, fadt)),
        hpet,
        io_apics: List::new(0),
        power: fadt.map_or(Power::default(), |fadt| power::read(memory, fadt)),
        warning,
    };
    read_madt(memory, madt, &mut platform).ok_or(AcpiError::NoProcessors)?;
    Ok(platform)
}

fn is_root_pointer(memory: &dyn PhysicalMemory, address: u64) -> bool {
    memory
        // The part common to all revisions, which has a checksum of its own (5.2.5.3).
        .bytes(address, 20)
        .is_some_and(|bytes| bytes.starts_with(b"RSD PTR ") && sums_to_0(bytes))
}

fn sums_to_0(bytes: &[u8]) -> bool {
    bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)) == 0
}

/// Returns the table's length if the table is whole and starts with `signature`.
fn table_length(memory: &dyn PhysicalMemory, table: u64, signature: Signature) -> Option<u64> {
    let length = memory.u32(table + 4)?;
    let bytes = memory.bytes(table, usize::try_from(length).ok()?)?;
    (bytes.starts_with(&signature) && sums_to_0(bytes)).then_some(u64::from(length))
}

/// The table of tables: 32-bit entries (RSDT) or 64-bit ones (XSDT).
struct RootTable {
    address: u64,
    length: u64,
    entry_size: usize,
}

impl RootTable {
    fn at(memory: &dyn PhysicalMemory, rsdp: u64) -> Option<Self> {
        let revision = memory.u8(rsdp + 15)?;
        let xsdt = if revision >= 2 {
            memory.u64(rsdp + 24)?
        } else {
            0
        };
        let (address, signature, entry_size) = if xsdt == 0 {
            (u64::from(memory.u32(rsdp + 16)?), *b"RSDT", 4)
        } else {
            (xsdt, *b"XSDT", 8)
        };
        let length = table_length(memory, address, signature)?;
        Some(Self {
            address,
            length,
            entry_size,
        })
    }

    /// Finds the first whole table with a signature.
    fn find(&self, memory: &dyn PhysicalMemory, signature: Signature) -> Result<u64, AcpiError> {
        let mut why = AcpiError::Absent(signature);
        for offset in (HEADER..self.length).step_by(self.entry_size) {
            let entry = self.address + offset;
            let table = match self.entry_size {
                4 => memory.u32(entry).map(u64::from),
                _ => memory.u64(entry),
            };
            let is_named = |at: &u64| memory.bytes(*at, 4) == Some(&signature);
            if let Some(table) = table.filter(is_named) {
                if table_length(memory, table, signature).is_some() {
                    return Ok(table);
                }
                why = AcpiError::Damaged(signature);
            }
        }
        Err(why)
    }
}

/// Reads the processors and the local APIC's address (ACPI 5.2.12).
fn read_madt(memory: &dyn PhysicalMemory, madt: u64, platform: &mut Platform) -> Option<()> {
    const LOCAL_APIC: u8 = 0;
    const IO_APIC: u8 = 1;
    const LOCAL_APIC_ADDRESS_OVERRIDE: u8 = 5;
    const LOCAL_X2APIC: u8 = 9;
    const ENABLED: u32 = 1;
    let length = u64::from(memory.u32(madt + 4)?);
    platform.local_apic = u64::from(memory.u32(madt + HEADER)?);
    let mut offset = HEADER + 8;
    while offset + 2 <= length {
        let entry = madt + offset;
        // A shorter entry would keep the loop from advancing.
        let size = memory.u8(entry + 1).filter(|size| *size >= 2)?;
        match memory.u8(entry)? {
            LOCAL_APIC if memory.u32(entry + 4)? & ENABLED != 0 => {
                platform.add_processor(u32::from(memory.u8(entry + 3)?));
            }
            LOCAL_X2APIC if memory.u32(entry + 8)? & ENABLED != 0 => {
                platform.add_processor(memory.u32(entry + 4)?);
            }
            IO_APIC => {
                // An I/O APIC without room stays as the firmware left it.
                let _ = platform.io_apics.push(u64::from(memory.u32(entry + 4)?));
            }
            LOCAL_APIC_ADDRESS_OVERRIDE => platform.local_apic = memory.u64(entry + 4)?,
            _ => {}
        }
        offset += u64::from(size);
    }
    (!platform.apic_ids.as_slice().is_empty()).then_some(())
}

/// Reads the address of the event timer's registers (IA-PC HPET specification 1.0a, 3.2.4).
fn hpet_registers(memory: &dyn PhysicalMemory, hpet: u64) -> Option<u64> {
    const BASE_ADDRESS: u64 = 40;
    match power::register(memory, hpet + BASE_ADDRESS)? {
        Register::Memory(address) => Some(address),
        Register::Port(_) => None,
    }
}

/// Reads the port of the power management timer (ACPI 5.2.9).
fn pm_timer(memory: &dyn PhysicalMemory, fadt: u64) -> Option<PmTimer> {
    const PM_TIMER_BLOCK: u64 = 76;
    const FLAGS: u64 = 112;
    const TIMER_IS_32_BITS: u32 = 1 << 8;
    let port = u16::try_from(memory.u32(fadt + PM_TIMER_BLOCK)?)
        .ok()
        .filter(|port| *port != 0)?;
    let wide = memory.u32(fadt + FLAGS)? & TIMER_IS_32_BITS != 0;
    Some(PmTimer {
        port,
        bits: if wide { 32 } else { 24 },
    })
}

#[cfg(test)]
mod tests;
