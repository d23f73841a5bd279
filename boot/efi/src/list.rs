//! The list of tags by which the application informs the image, as a Multiboot2 loader does.
//!
//! [`boot::multiboot2`] reads it, and says which tags there are. A tag that does not fit is
//! counted and not written, so that it can be refused once, at the end.

use boot::MemoryRegion;
use boot::multiboot2::tag;

/// A list of tags that is being written.
#[derive(Debug)]
pub struct List<'b> {
    bytes: &'b mut [u8],
    length: usize,
}

impl<'b> List<'b> {
    /// Begins a list. Its memory begins at a multiple of 8.
    pub fn new(bytes: &'b mut [u8]) -> Self {
        let mut list = Self { bytes, length: 0 };
        list.put(&[0; 8]);
        list
    }

    /// Adds the command line.
    pub fn command_line(&mut self, words: &[u8]) {
        self.tag(tag::COMMAND_LINE, &[words, &[0]]);
    }

    /// Adds the screen, of pixels of 32 bits.
    pub fn screen(&mut self, start: u64, pitch: u32, width: u32, height: u32) {
        const DEPTH_AND_KIND: [u8; 4] = [32, 1, 0, 0];
        let numbers = [pitch, width, height].map(u32::to_le_bytes);
        let numbers = numbers.as_flattened();
        self.tag(
            tag::SCREEN,
            &[&start.to_le_bytes(), numbers, &DEPTH_AND_KIND],
        );
    }

    /// Adds a file that lies in `start..end`.
    pub fn module(&mut self, start: u32, end: u32) {
        self.tag(
            tag::MODULE,
            &[&start.to_le_bytes(), &end.to_le_bytes(), &[0]],
        );
    }

    /// Adds a copy of the ACPI root pointer.
    pub fn root_pointer(&mut self, copy: &[u8], is_new: bool) {
        let kind = if is_new { tag::NEW_RSDP } else { tag::OLD_RSDP };
        self.tag(kind, &[copy]);
    }

    /// Adds the memory map.
    pub fn memory_map(&mut self, ranges: impl Iterator<Item = MemoryRegion>) {
        const ENTRY_SIZE: u32 = 24;
        const RESERVED: u32 = 2;
        let start = self.length;
        self.tag(
            tag::MEMORY_MAP,
            &[&ENTRY_SIZE.to_le_bytes(), &0_u32.to_le_bytes()],
        );
        for range in ranges {
            let kind: u32 = if range.usable { 1 } else { RESERVED };
            self.put(&range.start.to_le_bytes());
            self.put(&(range.end - range.start).to_le_bytes());
            self.put(&u64::from(kind).to_le_bytes());
        }
        self.put_size(start, 4);
    }

    /// Ends the list, and reports whether all of it is there.
    #[must_use]
    pub fn finish(mut self) -> bool {
        self.tag(tag::END, &[]);
        self.put_size(0, 0);
        self.length <= self.bytes.len()
    }

    fn tag(&mut self, kind: u32, parts: &[&[u8]]) {
        let start = self.length;
        self.put(&kind.to_le_bytes());
        self.put(&[0; 4]);
        parts.iter().for_each(|part| self.put(part));
        self.put_size(start, 4);
        while !self.length.is_multiple_of(8) {
            self.put(&[0]);
        }
    }

    /// Writes how much there is since `start`, `offset` bytes behind that.
    fn put_size(&mut self, start: usize, offset: usize) {
        let size = u32::try_from(self.length.wrapping_sub(start)).unwrap_or(0);
        let places = self.bytes.iter_mut().skip(start + offset);
        places
            .zip(size.to_le_bytes())
            .for_each(|(at, byte)| *at = byte);
    }

    fn put(&mut self, bytes: &[u8]) {
        let places = self.bytes.iter_mut().skip(self.length);
        places.zip(bytes).for_each(|(at, byte)| *at = *byte);
        self.length = self.length.saturating_add(bytes.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use boot::physical::PhysicalMemory;
    use boot::{BootInfo, Module, multiboot2};

    /// A machine of so many bytes.
    struct Machine(Vec<u8>);

    impl PhysicalMemory for Machine {
        fn bytes(&self, address: u64, length: usize) -> Option<&[u8]> {
            let start = usize::try_from(address).ok()?;
            self.0.get(start..start.checked_add(length)?)
        }
    }

    fn write(list: &mut List<'_>) {
        list.command_line(b"jobs=3 k=\xc3\xa4");
        list.module(0x7000, 0x7005);
        list.screen(1 << 33, 4096, 1000, 600);
        let mut copy = [0; 36];
        copy[15] = 2;
        list.root_pointer(&copy, true);
        let pages = (0..40).map(|page| MemoryRegion {
            start: page << 12,
            end: (page + 1) << 12,
            usable: page < 30,
        });
        list.memory_map(pages);
    }

    #[test]
    fn the_image_reads_what_the_application_tells() {
        let mut machine = Machine(vec![0xff; 2048]);
        let mut list = List::new(&mut machine.0);
        write(&mut list);
        assert!(list.finish());
        let mut info = BootInfo::new(0);
        multiboot2::read(&machine, 0, &mut info);
        assert_eq!(info.command_line(), Ok("jobs=3 k=\u{e4}"));
        assert_eq!(
            info.screen.map(|it| (it.start, it.width)),
            Some((1 << 33, 1000))
        );
        let module = Module {
            start: 0x7000,
            end: 0x7005,
        };
        assert_eq!(info.modules.as_slice(), [module]);
        assert_eq!(info.rsdp.and_then(|at| machine.u8(at + 15)), Some(2));
        let region = |start, end, usable| MemoryRegion { start, end, usable };
        let merged = [region(0, 30 << 12, true), region(30 << 12, 40 << 12, false)];
        assert_eq!(info.memory.as_slice(), merged);
    }

    #[test]
    fn a_list_that_does_not_fit_says_so() {
        let fits = |length| {
            let mut bytes = vec![0; length];
            let mut list = List::new(&mut bytes);
            write(&mut list);
            list.finish()
        };
        let least = (0..2048).find(|length| fits(*length)).unwrap();
        assert!(least > 40 * 24 && (least..2048).all(fits), "{least}");
    }
}
