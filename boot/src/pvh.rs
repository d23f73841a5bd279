//! Information of a PVH loader: Xen's `hvm_start_info`, version 0 or 1.
//!
//! The layout is that of Xen's public header `arch-x86/hvm/start_info.h`.

use crate::BootInfo;
use crate::physical::PhysicalMemory;

/// "xEn3" with the top bit of the first letter set.
const MAGIC: u32 = 0x336e_c578;

mod offset {
    pub(super) const VERSION: u64 = 4;
    pub(super) const MODULE_COUNT: u64 = 12;
    pub(super) const MODULES: u64 = 16;
    pub(super) const COMMAND_LINE: u64 = 24;
    pub(super) const RSDP: u64 = 32;
    pub(super) const MEMORY_MAP: u64 = 40;
    pub(super) const MEMORY_MAP_LENGTH: u64 = 48;
}

/// Adds the contents of the start info at `address` to `info`, and reports whether there is a start
/// info.
pub fn read(memory: &impl PhysicalMemory, address: u64, info: &mut BootInfo) -> bool {
    if memory.u32(address) != Some(MAGIC) {
        return false;
    }
    let pointer = |offset| memory.u64(address + offset).filter(|to| *to != 0);
    info.rsdp = pointer(offset::RSDP);
    if let Some(start) = pointer(offset::COMMAND_LINE) {
        info.take_command_line(memory, start);
    }
    read_modules(memory, address, info);
    // Version 0 ends before the fields of a memory map.
    if memory
        .u32(address + offset::VERSION)
        .is_some_and(|version| version >= 1)
    {
        read_memory_map(memory, address, info);
    }
    true
}

/// Notes the places of modules; nothing is read of the modules themselves.
fn read_modules(memory: &impl PhysicalMemory, address: u64, info: &mut BootInfo) {
    const ENTRY_SIZE: u64 = 32;
    let (Some(count), Some(list)) = (
        memory.u32(address + offset::MODULE_COUNT),
        memory.u64(address + offset::MODULES),
    ) else {
        return;
    };
    for index in 0..u64::from(count) {
        let entry = list.checked_add(index * ENTRY_SIZE);
        let read = |offset| memory.u64(entry?.checked_add(offset)?);
        let (Some(start), Some(size)) = (read(0), read(8)) else {
            return;
        };
        // A module beyond the last address does not count.
        let end = start.checked_add(size).unwrap_or(0);
        if info.add_module(start, end).is_err() {
            return;
        }
    }
}

fn read_memory_map(memory: &impl PhysicalMemory, address: u64, info: &mut BootInfo) {
    const ENTRY_SIZE: u64 = 24;
    let (Some(map), Some(length)) = (
        memory.u64(address + offset::MEMORY_MAP),
        memory.u32(address + offset::MEMORY_MAP_LENGTH),
    ) else {
        return;
    };
    for index in 0..u64::from(length) {
        if info.take_region(memory, map + index * ENTRY_SIZE).is_none() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MemoryRegion;

    fn boot_info(memory: &Vec<u8>, entry_tsc: u64) -> BootInfo {
        let mut info = BootInfo::new(entry_tsc);
        read(memory, 0, &mut info);
        info
    }

    fn start_info(magic: u32) -> Vec<u8> {
        let mut bytes = vec![0; 256];
        bytes[0..4].copy_from_slice(&magic.to_le_bytes());
        bytes[4] = 1;
        bytes[24] = 64; // command line
        bytes[32] = 0x99; // root pointer
        bytes[40] = 96; // memory map
        bytes[48] = 1;
        bytes[64..73].copy_from_slice(b"jobs=200 ");
        bytes[97] = 0x10; // start 0x1000
        bytes[105] = 0x20; // size 0x2000
        bytes[112] = 1;
        bytes
    }

    #[test]
    fn reads_command_line_memory_and_root_pointer() {
        let info = boot_info(&start_info(MAGIC), 5);
        assert_eq!(info.command_line(), Ok("jobs=200"));
        assert_eq!(info.rsdp, Some(0x99));
        assert_eq!(info.entry_tsc, 5);
        let region = MemoryRegion {
            start: 0x1000,
            end: 0x3000,
            usable: true,
        };
        assert_eq!(info.memory.as_slice(), &[region]);
    }

    /// A start info that names `count` modules in a list at 160, where `entries`
    /// (start and size of each) stand.
    fn with_modules(count: u8, entries: &[(u64, u64)]) -> Vec<u8> {
        let mut bytes = start_info(MAGIC);
        bytes[12] = count;
        bytes[16] = 160;
        bytes.truncate(160);
        for (start, size) in entries {
            bytes.extend(start.to_le_bytes());
            bytes.extend(size.to_le_bytes());
            bytes.extend([0; 16]); // no command line of its own
        }
        bytes
    }

    #[test]
    fn keeps_what_modules_there_can_be() {
        let mut cut = with_modules(2, &[(0x7000, 1), (0x8000, 1)]);
        cut.truncate(160 + 32 + 15);
        let mut beyond_all_memory = with_modules(1, &[(0x7000, 1)]);
        beyond_all_memory[16..24].fill(0xff);
        let no_modules = [(0x7000, 0), (u64::MAX - 1, 2), (u64::MAX, 1), (9, 1)];
        for (bytes, expected) in [
            (
                with_modules(2, &[(0x7000, 0x123), (0x5000, 1)]),
                vec![(0x7000, 0x7123), (0x5000, 0x5001)],
            ),
            (with_modules(0, &[(0x7000, 1)]), vec![]),
            (with_modules(4, &no_modules), vec![(9, 10)]),
            (cut, vec![(0x7000, 0x7001)]),
            (with_modules(255, &[(0x7000, 1)]), vec![(0x7000, 0x7001)]),
            (
                with_modules(5, &[(1, 1); 5]),
                vec![(1, 2); crate::MAX_MODULES],
            ),
            (beyond_all_memory, vec![]),
        ] {
            let info = boot_info(&bytes, 0);
            let modules = info.modules.as_slice().iter();
            let modules = modules.map(|module| (module.start, module.end));
            assert_eq!(modules.collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn believes_nothing_without_the_magic_number() {
        let mut info = BootInfo::new(0);
        assert!(!read(&start_info(1), 0, &mut info));
        assert_eq!(info.command_line(), Ok(""));
        assert_eq!(info.rsdp, None);
        assert!(info.memory.as_slice().is_empty());
    }

    #[test]
    fn keeps_what_a_truncated_table_still_tells() {
        let mut bytes = start_info(MAGIC);
        bytes.truncate(100);
        let info = boot_info(&bytes, 0);
        assert_eq!(info.command_line(), Ok("jobs=200"));
        assert!(info.memory.as_slice().is_empty());
    }
}
