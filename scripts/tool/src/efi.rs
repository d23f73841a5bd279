//! The application of UEFI that boots an image: one file for a FAT stick.
//!
//! It is a PE file of the application `boot-efi`, which the firmware starts, and of
//! what that looks for: the image as far as it is loaded, the words, a file to be left in memory
//! if there is one. The layout is that of Microsoft's PE format, for a PE32+ file.
//!
//! The application runs wherever the firmware puts it. So each absolute address in it is in
//! the list by which the firmware corrects them; one that cannot be is refused.

use std::iter;

use boot_efi::file::{self, IMAGE, MODULE, SUM, WORDS};

use crate::elf::{self, Correction};
use crate::files;
use crate::image::{self, Contents};

/// Where a firmware looks for it on a stick.
pub const PLACE: &str = "EFI/BOOT/BOOTX64.EFI";

/// In memory a section begins at a multiple of this, in the file of that.
const PAGE: u64 = 4096;
const BLOCK: u64 = 512;

/// What is done with a section, as its header says.
const CODE: u32 = 0x6000_0020;
const CONSTANT: u32 = 0x4000_0040;
const DISCARDABLE: u32 = 0x4200_0040;

/// A section of a PE file.
struct Section {
    name: &'static str,
    rights: u32,
    start: u64,
    bytes: Vec<u8>,
}

impl Section {
    fn bytes_in_file(&self) -> u64 {
        bytes_of(&self.bytes).next_multiple_of(BLOCK)
    }

    /// Returns where the next one may begin in memory. One without bytes has a page all the same.
    fn end_in_memory(&self) -> u64 {
        (self.start + bytes_of(&self.bytes).max(1)).next_multiple_of(PAGE)
    }
}

/// Makes the application that boots what `contents` have. The part that the firmware starts is
/// built first.
///
/// # Errors
///
/// In words: the build failed, or its result is none of ours.
pub fn application(contents: &Contents<'_>) -> Result<Vec<u8>, String> {
    let own = image::build("boot-efi")?.path;
    let made = assemble(&files::read_at(&own)?, parts(contents));
    made.map_err(|why| format!("`{}`: {why}", files::place(&own)))
}

/// Returns the sections that the application looks for.
fn parts(contents: &Contents<'_>) -> Vec<(&'static str, Vec<u8>)> {
    let Contents {
        image,
        words,
        module,
    } = contents;
    let content = module.as_deref().unwrap_or_default();
    let sum = file::sum([image, words.as_bytes(), content]);
    let always = [
        (IMAGE, image.clone()),
        (WORDS, (*words).into()),
        (SUM, sum.to_le_bytes().into()),
    ];
    let module = module.clone().map(|module| (MODULE, module));
    always.into_iter().chain(module).collect()
}

/// Makes a PE file of a position-independent program and of sections behind it.
fn assemble(program: &[u8], parts: Vec<(&'static str, Vec<u8>)>) -> Result<Vec<u8>, String> {
    let corrections = elf::corrections(program)?;
    let entry = file::entry(program).ok_or("it has no entry")?;
    let mut sections = Vec::new();
    let kinds = [(".text", CODE), (".rdata", CONSTANT)];
    for (segment, (name, rights)) in file::segments(program).zip(kinds) {
        let mut bytes = segment.bytes.to_vec();
        if bytes_of(&bytes) != segment.end - segment.start {
            return Err("it has variables".into());
        }
        for Correction { at, address } in &corrections {
            let place = at.checked_sub(segment.start);
            let place = place.and_then(|at| usize::try_from(at).ok());
            if let Some(place) = place.and_then(|at| bytes.get_mut(at..at + 8)) {
                place.copy_from_slice(&address.to_le_bytes());
            }
        }
        sections.push(Section {
            name,
            rights,
            start: segment.start,
            bytes,
        });
    }
    let list = corrections_list(&corrections);
    let parts = parts.into_iter();
    let parts = parts.map(|(name, bytes)| (name, CONSTANT, bytes));
    for (name, rights, bytes) in parts.chain([(".reloc", DISCARDABLE, list)]) {
        let start = sections.last().map_or(PAGE, Section::end_in_memory);
        sections.push(Section {
            name,
            rights,
            start,
            bytes,
        });
    }
    Ok(lay_out(entry, &sections))
}

/// Returns the list by which the firmware corrects addresses: a block for each page that
/// has some, of the page's address, the block's size, and for each address kind and place
/// in the page. There is a block even if there is nothing to correct, as some firmware
/// takes a file without one for one that cannot be moved.
fn corrections_list(corrections: &[Correction]) -> Vec<u8> {
    const ADDRESS_OF_64_BITS: u64 = 10;
    let mut list = Vec::new();
    let mut block = |page: u64, mut entries: Vec<u64>| {
        // A block's size is a multiple of 4; an entry 0 says nothing.
        entries.resize(entries.len().next_multiple_of(2).max(2), 0);
        list.extend(long(page));
        list.extend(long(8 + 2 * entries.len() as u64));
        list.extend(entries.into_iter().flat_map(short));
    };
    let page = |correction: &Correction| correction.at / PAGE;
    for of_page in corrections.chunk_by(|a, b| page(a) == page(b)) {
        let entry = |correction: &Correction| (ADDRESS_OF_64_BITS << 12) | (correction.at % PAGE);
        block(
            page(&of_page[0]) * PAGE,
            of_page.iter().map(entry).collect(),
        );
    }
    if corrections.is_empty() {
        block(0, Vec::new());
    }
    list
}

/// Returns the whole file.
fn lay_out(entry: u32, sections: &[Section]) -> Vec<u8> {
    let count = sections.len() as u64;
    let headers = (0x40 + 24 + 240 + 40 * count).next_multiple_of(BLOCK);
    let in_file = Section::bytes_in_file;
    let (code, list) = (sections.first(), sections.last());

    let mut file = b"MZ".to_vec();
    file.resize(0x3c, 0);
    file.extend(long(0x40)); // where the headers begin
    file.extend(b"PE\0\0");
    file.extend(short(0x8664)); // x86-64
    file.extend(short(count));
    file.extend([0; 12]); // no time, no symbols
    file.extend(short(240)); // what follows up to the sections
    file.extend(short(0x22)); // executable, at any address
    file.extend(short(0x20b)); // PE32+
    file.extend([0; 2]); // the linker's version
    file.extend(long(code.map_or(0, in_file)));
    file.extend(long(sections.iter().skip(1).map(in_file).sum()));
    file.extend(long(0)); // no variables
    file.extend(long(entry.into()));
    file.extend(long(code.map_or(0, |code| code.start)));
    file.extend([0; 8]); // the address that it would like to have: none
    file.extend(long(PAGE));
    file.extend(long(BLOCK));
    file.extend([0; 16]); // versions
    file.extend(long(list.map_or(0, Section::end_in_memory)));
    file.extend(long(headers));
    file.extend(long(0)); // no checksum
    file.extend(short(10)); // an application of UEFI
    file.extend(short(0));
    file.extend([0; 36]); // stack and heap are the firmware's affair
    file.extend(long(16)); // tables, of which the sixth corrects addresses
    file.extend([0; 5 * 8]);
    file.extend(long(list.map_or(0, |list| list.start)));
    file.extend(long(list.map_or(0, |list| bytes_of(&list.bytes))));
    file.extend([0; 10 * 8]);
    let mut at = headers;
    for section in sections {
        file.extend(section.name.bytes().chain(iter::repeat(0)).take(8));
        file.extend(long(bytes_of(&section.bytes)));
        file.extend(long(section.start));
        file.extend(long(in_file(section)));
        file.extend(long(at));
        file.extend([0; 12]);
        file.extend(section.rights.to_le_bytes());
        at += in_file(section);
    }
    let fill = |file: &mut Vec<u8>| {
        let block = usize::try_from(BLOCK).unwrap_or(1);
        file.resize(file.len().next_multiple_of(block), 0);
    };
    fill(&mut file);
    for section in sections {
        file.extend(&section.bytes);
        fill(&mut file);
    }
    file
}

fn bytes_of(bytes: &[u8]) -> u64 {
    bytes.len() as u64
}

/// Returns the four bytes of a number; a file has less than 4 GiB.
fn long(number: u64) -> [u8; 4] {
    u32::try_from(number).unwrap_or(u32::MAX).to_le_bytes()
}

fn short(number: u64) -> [u8; 2] {
    u16::try_from(number).unwrap_or(u16::MAX).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::{Contents, Correction, IMAGE, MODULE, WORDS, assemble, corrections_list, parts};
    use crate::tiny::{TinyEnd, tiny_image};
    use boot_efi::file::{is_whole, section};

    /// Lays a PE file out in memory, as a firmware does.
    fn loaded(file: &[u8]) -> Vec<u8> {
        let number = |at: usize| {
            let bytes = file[at..at + 4].try_into().unwrap();
            u32::from_le_bytes(bytes) as usize
        };
        let mut memory = file[..number(0x40 + 24 + 60)].to_vec();
        memory.resize(number(0x40 + 24 + 56), 0);
        for section in 0..usize::from(file[0x46]) {
            let header = 0x40 + 24 + 240 + 40 * section;
            let [bytes, start, from] = [8, 12, 20].map(|at| number(header + at));
            assert!(start.is_multiple_of(4096) && from.is_multiple_of(512));
            memory[start..start + bytes].copy_from_slice(&file[from..from + bytes]);
        }
        memory
    }

    #[test]
    fn the_application_finds_what_the_file_has() {
        let program = tiny_image("program", TinyEnd::Never);
        for module in [Some(vec![9; 4096]), None] {
            let contents = Contents {
                image: vec![7; 5000],
                words: "jobs=3",
                module: module.clone(),
            };
            let file = assemble(&program, parts(&contents)).unwrap();
            assert!(file.len().is_multiple_of(512));
            let mut memory = loaded(&file);
            for (name, content) in [
                (IMAGE, Some(&[7; 5000][..])),
                (WORDS, Some(b"jobs=3")),
                (MODULE, module.as_deref()),
                ("other", None),
            ] {
                assert_eq!(section(&memory, name), content, "{name}");
            }
            assert!(is_whole(&memory));
            let image = memory.windows(9).position(|bytes| bytes == [7; 9]).unwrap();
            memory[image] = 8;
            assert!(!is_whole(&memory));
        }
    }

    #[test]
    fn addresses_are_corrected_page_by_page() {
        let list = |places: &[u64]| -> Vec<u16> {
            let at = |at: &u64| Correction {
                at: *at,
                address: 0,
            };
            let list = corrections_list(&places.iter().map(at).collect::<Vec<_>>());
            let pairs = list.chunks(2).map(|two| two.try_into().unwrap());
            pairs.map(u16::from_le_bytes).collect()
        };
        let first = [0x1000, 0, 12, 0, 0xa008, 0];
        let second = [0x3000, 0, 16, 0, 0xa010, 0xaff8, 0xa000, 0];
        let words = list(&[0x1008, 0x3010, 0x3ff8, 0x3000]);
        assert_eq!(words, [&first[..], &second[..]].concat());
        assert_eq!(list(&[]).len(), 6, "one that says nothing");
    }
}
