//! Reads from ACPI how to power off and reset the machine.
//!
//! The FADT names registers (ACPI specification 6.5, 5.2.9), and the object `_S5_` of the DSDT the
//! values to write to power off (7.4.2). That object is found by its bytes, without an interpreter:
//! it is a package of small constants. Missing or malformed parts count as absent.

use crate::physical::PhysicalMemory;

/// The registers used to end a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Power {
    /// The way to power the machine off.
    pub off: Option<Off>,
    /// The register that resets the machine, and the value to write there.
    pub reset: Option<(Register, u8)>,
}

/// A register of one byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Register {
    /// At an I/O port.
    Port(u16),
    /// At a physical address.
    Memory(u64),
}

/// The way to power a machine off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Off {
    /// By the one or two power management control registers: for each, its port and the type of
    /// sleep (4.8.3.2).
    Control {
        /// The registers; the second one may be missing.
        registers: [Option<(u16, u8)>; 2],
        /// The port and the value that make the firmware hand these registers over, if it has not
        /// done so yet.
        enable: Option<(u16, u8)>,
    },
    /// By the sleep control register of hardware-reduced machines, with this type of sleep
    /// (4.8.3.7).
    Sleep(Register, u8),
}

impl Power {
    /// Returns the physical addresses of registers in memory.
    pub fn addresses(&self) -> impl Iterator<Item = u64> {
        let sleep = self.off.and_then(|off| match off {
            Off::Sleep(register, _) => Some(register),
            Off::Control { .. } => None,
        });
        let reset = self.reset.map(|(register, _)| register);
        let registers = sleep.into_iter().chain(reset);
        registers.filter_map(|register| match register {
            Register::Memory(address) => Some(address),
            Register::Port(_) => None,
        })
    }
}

mod offset {
    pub(super) const DSDT: u64 = 40;
    pub(super) const SMI_PORT: u64 = 48;
    pub(super) const ACPI_ENABLE: u64 = 52;
    pub(super) const CONTROL_A: u64 = 64;
    pub(super) const CONTROL_B: u64 = 68;
    pub(super) const FLAGS: u64 = 112;
    pub(super) const RESET_REGISTER: u64 = 116;
    pub(super) const RESET_VALUE: u64 = 128;
    pub(super) const WIDE_DSDT: u64 = 140;
    pub(super) const SLEEP_CONTROL: u64 = 244;
}

/// Reads the FADT at `fadt`, whose checksum is right.
pub(crate) fn read(memory: &dyn PhysicalMemory, fadt: u64) -> Power {
    const HAS_RESET: u32 = 1 << 10;
    const IS_REDUCED: u32 = 1 << 20;
    let length = memory.u32(fadt + 4).map_or(0, u64::from);
    let flags = memory.u32(fadt + offset::FLAGS).unwrap_or(0);
    let at = |offset: u64| (offset + 12 <= length).then(|| register(memory, fadt + offset))?;
    let reset = at(offset::RESET_REGISTER).filter(|_| flags & HAS_RESET != 0);
    let reset = reset.zip(memory.u8(fadt + offset::RESET_VALUE));
    let off = sleep_types(memory, fadt, length).and_then(|types| {
        if flags & IS_REDUCED != 0 {
            return Some(Off::Sleep(at(offset::SLEEP_CONTROL)?, types[0]));
        }
        let port = |offset| small_port(memory.u32(fadt + offset)?);
        let first = port(offset::CONTROL_A)?;
        let second = port(offset::CONTROL_B);
        Some(Off::Control {
            registers: [Some((first, types[0])), second.map(|port| (port, types[1]))],
            enable: port(offset::SMI_PORT).zip(memory.u8(fadt + offset::ACPI_ENABLE)),
        })
    });
    Power { off, reset }
}

fn small_port(port: u32) -> Option<u16> {
    u16::try_from(port).ok().filter(|port| *port != 0)
}

/// Reads a generic address (5.2.3.2) in memory or at a port.
pub(crate) fn register(memory: &dyn PhysicalMemory, at: u64) -> Option<Register> {
    let address = memory.u64(at + 4).filter(|address| *address != 0)?;
    match memory.u8(at)? {
        0 => Some(Register::Memory(address)),
        1 => small_port(u32::try_from(address).ok()?).map(Register::Port),
        _ => None,
    }
}

/// Returns the two sleep types that mean "off", from the DSDT named by the FADT.
fn sleep_types(memory: &dyn PhysicalMemory, fadt: u64, length: u64) -> Option<[u8; 2]> {
    let has_wide = offset::WIDE_DSDT + 8 <= length;
    let wide = memory.u64(fadt + offset::WIDE_DSDT).filter(|_| has_wide);
    let dsdt = match wide {
        Some(0) | None => u64::from(memory.u32(fadt + offset::DSDT)?),
        Some(wide) => wide,
    };
    let bytes = usize::try_from(memory.u32(dsdt + 4)?).ok()?;
    let code = memory
        .bytes(dsdt, bytes)
        .filter(|code| code.starts_with(b"DSDT"))?;
    // A definition begins with the operator Name (8), with or without the root's `\`; any other
    // occurrence of the bytes is a reference (20.2.5.1).
    let named = |at: &usize| code[..*at].ends_with(b"\x08") || code[..*at].ends_with(b"\x08\\");
    let places = code.windows(4).enumerate();
    let mut places = places.filter(|(_, name)| name == b"_S5_").map(|(at, _)| at);
    let at = places.find(named)?;
    package(code.get(at + 4..)?)
}

/// Reads the first two constants of a package (20.2.5.4).
fn package(code: &[u8]) -> Option<[u8; 2]> {
    const PACKAGE: u8 = 0x12;
    const BYTE: u8 = 0x0a;
    let (&kind, rest) = code.split_first()?;
    // The first two bits of the length state how many more of its bytes follow; then comes the
    // number of elements.
    let lead = *rest.first().filter(|_| kind == PACKAGE)?;
    let mut elements = rest.get(2 + usize::from(lead >> 6)..)?.iter();
    let mut constant = || match *elements.next()? {
        BYTE => elements.next().copied(),
        small @ (0 | 1) => Some(small),
        _ => None,
    };
    let types = [constant()?, constant()?];
    types.iter().all(|kind| *kind < 8).then_some(types)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FADT: usize = 0x100;
    const DSDT: usize = 0x400;

    /// A machine with an old FADT and this after the header of its DSDT.
    fn machine(length: u8, flags: u32, code: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0; 0x800];
        bytes[FADT + 4] = length;
        bytes[FADT + 5] = u8::from(length == 12); // 268 is the length of a later one
        bytes[FADT + 40..FADT + 44].copy_from_slice(&0x400_u32.to_le_bytes());
        bytes[FADT + 48] = 0xb2;
        bytes[FADT + 52] = 0xf1;
        bytes[FADT + 64..FADT + 66].copy_from_slice(&0x604_u16.to_le_bytes());
        bytes[FADT + 112..FADT + 116].copy_from_slice(&flags.to_le_bytes());
        bytes[FADT + 116] = 1; // the reset register is at a port
        bytes[FADT + 120..FADT + 122].copy_from_slice(&0xcf9_u16.to_le_bytes());
        bytes[FADT + 128] = 15;
        bytes[FADT + 248..FADT + 252].copy_from_slice(&0xfea0_0200_u32.to_le_bytes());
        bytes[DSDT..DSDT + 4].copy_from_slice(b"DSDT");
        let length = u32::try_from(36 + code.len()).unwrap();
        bytes[DSDT + 4..DSDT + 8].copy_from_slice(&length.to_le_bytes());
        bytes[DSDT + 36..DSDT + 36 + code.len()].copy_from_slice(code);
        bytes
    }

    fn off(code: &[u8]) -> Option<Off> {
        read(&machine(12, 0, code), FADT as u64).off
    }

    #[test]
    fn finds_the_control_register_and_what_to_write() {
        let control = |kind| {
            Some(Off::Control {
                registers: [Some((0x604, kind)), None],
                enable: Some((0xb2, 0xf1)),
            })
        };
        // Constants, as QEMU has them, and bytes, as many boards do.
        assert_eq!(off(b"xx\x08_S5_\x12\x06\x04\x00\x00\x00\x00"), control(0));
        assert_eq!(
            off(b"\x08\\_S5_\x12\x08\x04\x0a\x07\x0a\x07\x00"),
            control(7)
        );
        assert_eq!(off(b"\x08_S5_\x12\x40\x08\x04\x0a\x05\x0a\x05"), control(5));
    }

    #[test]
    fn believes_no_name_that_is_not_defined_there() {
        assert_eq!(off(b"\x70_S5_\x12\x06\x04\x00\x00\x00\x00"), None);
        assert_eq!(off(b"\x08_S5_\x11\x06\x04\x00\x00"), None, "no package");
        assert_eq!(off(b"\x08_S5_\x12\x06\x04\x0a\x09\x00"), None, "no type");
        assert_eq!(off(b"\x08_S5_\x12\x06\x04"), None, "cut off");
        assert_eq!(off(b""), None);
    }

    #[test]
    fn a_reduced_machine_has_its_registers_in_memory() {
        let flags = 1 << 20 | 1 << 10;
        let power = read(
            &machine(12, flags, b"\x08_S5_\x12\x06\x04\x0a\x05\x00"),
            FADT as u64,
        );
        let sleep = Register::Memory(0xfea0_0200);
        assert_eq!(power.off, Some(Off::Sleep(sleep, 5)));
        assert_eq!(power.reset, Some((Register::Port(0xcf9), 15)));
        assert_eq!(power.addresses().collect::<Vec<_>>(), [0xfea0_0200]);
    }

    #[test]
    fn an_old_table_has_no_later_fields() {
        let power = read(&machine(116, 1 << 10, b""), FADT as u64);
        assert_eq!(power, Power::default());
    }
}
