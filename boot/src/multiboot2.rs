//! Information of a Multiboot2 loader: a list of tags, as given by GRUB under BIOS and UEFI.
//!
//! The layout is that of the Multiboot2 specification 2.0, 3.6. The loader's list lies in memory
//! that counts as free, so everything needed is copied here. A tag may hold a copy of the ACPI root
//! pointer: of that copy only the place is kept. Unknown tags are passed over. Of a truncated list,
//! the tags before the cut count.

use crate::physical::PhysicalMemory;
use crate::{BootInfo, Framebuffer};

/// The kinds of tags read.
pub mod tag {
    /// The end of the list.
    pub const END: u32 = 0;
    /// The command line.
    pub const COMMAND_LINE: u32 = 1;
    /// A file left in memory by the loader.
    pub const MODULE: u32 = 3;
    /// The memory map.
    pub const MEMORY_MAP: u32 = 6;
    /// The screen.
    pub const SCREEN: u32 = 8;
    /// A copy of the ACPI root pointer, in the form before ACPI 2.0.
    pub const OLD_RSDP: u32 = 14;
    /// A copy of the ACPI root pointer, in the form since ACPI 2.0.
    pub const NEW_RSDP: u32 = 15;
}

/// Adds the contents of the list of tags at `address` to `info`.
pub fn read(memory: &impl PhysicalMemory, address: u64, info: &mut BootInfo) {
    /// The bytes of a tag's kind and size. The list begins with as many.
    const HEADER: u64 = 8;
    let end = address + u64::from(memory.u32(address).unwrap_or(0));
    let mut at = address + HEADER;
    while at + HEADER <= end {
        let (Some(kind), Some(size)) = (memory.u32(at), memory.u32(at + 4)) else {
            return;
        };
        let size = u64::from(size);
        if kind == tag::END || size < HEADER || at + size > end {
            return;
        }
        read_tag(memory, kind, at + HEADER, at + size, info);
        at += size.next_multiple_of(8);
    }
}

/// The first letters of the name that the tool's ISO gives to a filler: a module whose only purpose
/// is to keep the others from page 0.
const FILLER: u32 = u32::from_le_bytes(*b"fill");

/// Reads a single tag, whose content lies in `start..end`.
fn read_tag(memory: &impl PhysicalMemory, kind: u32, start: u64, end: u64, info: &mut BootInfo) {
    /// The offset of the revision in a root pointer (ACPI 5.2.5.3).
    const REVISION: u64 = 15;
    match kind {
        tag::COMMAND_LINE => info.take_command_line(memory, start),
        tag::MODULE => {
            let place = (memory.u32(start), memory.u32(start + 4));
            if let (Some(from), Some(to)) = place
                && memory.u32(start + 8) != Some(FILLER)
            {
                // Modules beyond the list's room are more than the kernel uses.
                let _ = info.add_module(u64::from(from), u64::from(to));
            }
        }
        tag::SCREEN => info.screen = read_screen(memory, start),
        tag::MEMORY_MAP => read_memory_map(memory, start, end, info),
        // This copy ends before the fields of later revisions.
        tag::OLD_RSDP if memory.u8(start + REVISION) == Some(0) => {
            info.rsdp.get_or_insert(start);
        }
        // The newer form counts, in whichever order the loader gives them.
        tag::NEW_RSDP => info.rsdp = Some(start),
        _ => {}
    }
}

/// Reads the place of the screen, unless the screen has text alone, or colours by numbers.
fn read_screen(memory: &impl PhysicalMemory, at: u64) -> Option<Framebuffer> {
    const DIRECT_COLOUR: u8 = 1;
    let screen = Framebuffer {
        start: memory.u64(at)?,
        pitch: memory.u32(at + 8)?,
        width: memory.u32(at + 12)?,
        height: memory.u32(at + 16)?,
        pixel_bytes: memory.u8(at + 20)?.div_ceil(8),
    };
    let has_colours = memory.u8(at + 21)? == DIRECT_COLOUR;
    let fits = screen.width.checked_mul(screen.pixel_bytes.into())? <= screen.pitch;
    (has_colours && fits && (2..=4).contains(&screen.pixel_bytes)).then_some(screen)
}

fn read_memory_map(memory: &impl PhysicalMemory, start: u64, end: u64, info: &mut BootInfo) {
    /// The bytes read of an entry; later versions may have more.
    const KNOWN: u64 = 20;
    let entry_size = memory.u32(start).map_or(0, u64::from);
    if entry_size < KNOWN {
        return;
    }
    let mut entry = start + 8;
    while entry + KNOWN <= end {
        if info.take_region(memory, entry).is_none() {
            return;
        }
        entry += entry_size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MOST_COMMAND_LINE_BYTES, MemoryRegion, Module};

    /// Where the list lies.
    const LIST: u64 = 16;

    /// A machine with a list of these tags.
    fn list(tags: &[(u32, Vec<u8>)]) -> Vec<u8> {
        let mut bytes = vec![0; 24];
        for (kind, content) in tags {
            let size = u32::try_from(8 + content.len()).unwrap();
            bytes.extend([*kind, size].map(u32::to_le_bytes).concat());
            bytes.extend(content);
            bytes.resize(bytes.len().next_multiple_of(8), 0);
        }
        bytes.extend([0, 8].map(u32::to_le_bytes).concat());
        let size = u32::try_from(bytes.len() - 16).unwrap();
        bytes[16..20].copy_from_slice(&size.to_le_bytes());
        bytes
    }

    fn info(memory: &Vec<u8>) -> BootInfo {
        let mut info = BootInfo::new(7);
        read(memory, LIST, &mut info);
        info
    }

    fn map(entry_size: u32, entries: &[(u64, u64, u32)]) -> (u32, Vec<u8>) {
        let mut bytes = [entry_size, 0].map(u32::to_le_bytes).concat();
        for (start, size, kind) in entries {
            let from = bytes.len();
            bytes.extend([*start, *size].map(u64::to_le_bytes).concat());
            bytes.extend(kind.to_le_bytes());
            bytes.resize(from + entry_size as usize, 0);
        }
        (tag::MEMORY_MAP, bytes)
    }

    fn module(start: u32, end: u32, name: &str) -> (u32, Vec<u8>) {
        let place = [start, end].map(u32::to_le_bytes).concat();
        (tag::MODULE, [&place, name.as_bytes(), b"\0"].concat())
    }

    fn rsdp(kind: u32, revision: u8) -> (u32, Vec<u8>) {
        let mut copy = vec![0; if kind == tag::NEW_RSDP { 36 } else { 20 }];
        copy[15] = revision;
        (kind, copy)
    }

    #[test]
    fn reads_words_modules_and_memory_among_unknown_tags() {
        let memory = list(&[
            (2, b"GRUB 2.06\0".to_vec()),
            (tag::COMMAND_LINE, b"jobs=20 seed=3\0".to_vec()),
            module(0, 0x1b0, "filler"),
            module(0x14000, 0x2c6a0, "dags"),
            map(
                24,
                &[
                    (0, 0x9_fc00, 1),
                    (0x9_fc00, 0x400, 2),
                    (1 << 20, 1 << 20, 1),
                ],
            ),
            module(0x30000, 0x30000, "empty"),
        ]);
        let info = info(&memory);
        assert_eq!(info.command_line(), Ok("jobs=20 seed=3"));
        assert_eq!(info.entry_tsc, 7);
        let only = Module {
            start: 0x14000,
            end: 0x2c6a0,
        };
        assert_eq!(info.modules.as_slice(), &[only]);
        let region = |start, end, usable| MemoryRegion { start, end, usable };
        let regions = [
            region(0, 0x9_fc00, true),
            region(0x9_fc00, 0xa_0000, false),
            region(1 << 20, 2 << 20, true),
        ];
        assert_eq!(info.memory.as_slice(), &regions);
    }

    #[test]
    fn the_newer_copy_of_the_root_pointer_wins() {
        let at = |tags: &[(u32, Vec<u8>)]| info(&list(tags)).rsdp;
        let (old, new) = (rsdp(tag::OLD_RSDP, 0), rsdp(tag::NEW_RSDP, 2));
        assert_eq!(at(core::slice::from_ref(&old)), Some(32));
        assert_eq!(at(&[new.clone(), old.clone()]), Some(32));
        assert_eq!(at(&[old, new]), Some(64));
        assert_eq!(at(&[rsdp(tag::OLD_RSDP, 2)]), None, "cut off");
    }

    #[test]
    fn a_screen_is_one_of_coloured_pixels() {
        let screen = |pitch: u32, depth: u8, kind: u8| {
            let mut bytes = 0xc000_0000_u64.to_le_bytes().to_vec();
            bytes.extend([pitch, 800, 600].map(u32::to_le_bytes).concat());
            bytes.extend([depth, kind, 0, 0]);
            info(&list(&[(tag::SCREEN, bytes)])).screen
        };
        let wanted = Framebuffer {
            start: 0xc000_0000,
            pitch: 3328,
            width: 800,
            height: 600,
            pixel_bytes: 4,
        };
        assert_eq!(screen(3328, 32, 1), Some(wanted));
        assert_eq!(screen(3328, 24, 1).map(|it| it.pixel_bytes), Some(3));
        assert_eq!(screen(3199, 32, 1), None, "rows that overlap");
        assert_eq!(screen(3328, 8, 0), None, "colours by numbers");
        assert_eq!(screen(160, 16, 2), None, "text");
    }

    #[test]
    fn entries_of_another_size_are_read_or_left() {
        let entries = [(0, 4096, 1), (8192, 4096, 1)];
        for (entry_size, regions) in [(24, 2), (20, 2), (40, 2), (16, 0), (0, 0)] {
            let (kind, mut bytes) = map(24.max(entry_size), &entries);
            if entry_size == 20 {
                bytes = map(20, &entries).1;
            }
            bytes[..4].copy_from_slice(&entry_size.to_le_bytes());
            let info = info(&list(&[(kind, bytes)]));
            assert_eq!(info.memory.as_slice().len(), regions, "{entry_size}");
        }
    }

    #[test]
    fn a_list_that_is_cut_or_spoilt_tells_what_it_tells() {
        let line = (tag::COMMAND_LINE, b"jobs=2\0".to_vec());
        let whole = list(&[line.clone(), module(1, 2, "m"), map(24, &[(0, 4096, 1)])]);
        for length in 0..whole.len() {
            info(&whole[..length].to_vec());
        }
        for byte in 0..whole.len() {
            for value in [0, 1, 7, 0x7f, 0xff] {
                let mut spoilt = whole.clone();
                spoilt[byte] = value;
                info(&spoilt);
            }
        }
        let cut = info(&whole[..48].to_vec());
        assert_eq!(cut.command_line(), Ok("jobs=2"));
        assert!(cut.modules.as_slice().is_empty());
        let mut zero = whole;
        zero[28..32].fill(0); // the first tag's size
        assert_eq!(info(&zero).command_line(), Ok(""));
    }

    #[test]
    fn tells_that_a_command_line_was_cut() {
        for (bytes, is_cut) in [(MOST_COMMAND_LINE_BYTES, false), (2049, true)] {
            let mut words = vec![b'x'; bytes];
            words.push(0);
            let info = info(&list(&[(tag::COMMAND_LINE, words)]));
            assert_eq!(info.command_line().map(str::len), Ok(2048));
            assert_eq!(info.is_command_line_cut, is_cut, "{bytes} bytes");
        }
    }
}
