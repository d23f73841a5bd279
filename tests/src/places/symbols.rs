//! The functions of an image, from its symbol table.
//!
//! A function written in Rust has a size in the table. A label in assembly has
//! none; it reaches to the next symbol, or to the end of its section.

use super::demangle::demangle;
use crate::elf::{self, Section};

/// A symbol's type, the low four bits of its `info` (gabi, chapter 4).
const STT_NOTYPE: u64 = 0;
const STT_FUNC: u64 = 2;
const SYMBOL_BYTES: u64 = 24;

/// The functions of an image, by address.
#[derive(Debug)]
pub(super) struct Symbols(Vec<Function>);

#[derive(Debug)]
struct Function {
    start: u64,
    /// The address after its last byte.
    end: u64,
    name: String,
}

impl Symbols {
    /// Reads the symbol table of an ELF file.
    ///
    /// # Errors
    ///
    /// In words: the file is no ELF file, is damaged, or has no symbols.
    pub(super) fn read(file: &[u8]) -> Result<Symbols, String> {
        let sections = elf::sections(file)?;
        let table = sections
            .iter()
            .find(|section| section.kind == elf::SHT_SYMTAB)
            .ok_or("the image has no symbols")?;
        let names = usize::try_from(table.link)
            .ok()
            .and_then(|index| sections.get(index))
            .ok_or("the symbols have no names")?;
        let mut functions = Vec::new();
        for index in 0..table.bytes / SYMBOL_BYTES {
            let at = table.offset.saturating_add(index * SYMBOL_BYTES);
            functions.extend(function(file, at, &sections, names)?);
        }
        functions.sort_by_key(|function| (function.start, function.end));
        Ok(Symbols(functions))
    }

    /// Returns the function that an address lies in, and how far, as
    /// `path::to::function+0x18`.
    pub(super) fn name(&self, address: u64) -> Option<String> {
        let after = self.0.partition_point(|function| function.start <= address);
        // The nearest one below; labels inside a function of assembly are of the
        // same function, and the nearest says most.
        let function = self.0.get(after.checked_sub(1)?)?;
        let offset = address - function.start;
        (address < function.end).then(|| format!("{}+{offset:#x}", demangle(&function.name)))
    }
}

/// Reads the symbol at `at` of the file, if it is one of code.
fn function(
    file: &[u8],
    at: u64,
    sections: &[Section],
    names: &Section,
) -> Result<Option<Function>, String> {
    let kind = elf::number(file, at + 4, 1)? & 0xf;
    let section = elf::number(file, at + 6, 2)?;
    let section = usize::try_from(section)
        .ok()
        .and_then(|index| sections.get(index));
    let Some(section) = section.filter(|section| section.is_code()) else {
        return Ok(None);
    };
    let start = elf::number(file, at + 8, 8)?;
    let bytes = elf::number(file, at + 16, 8)?;
    let end = match (kind, bytes) {
        (STT_FUNC | STT_NOTYPE, 0) => section.address.saturating_add(section.bytes),
        (STT_FUNC, bytes) => start.saturating_add(bytes),
        _ => return Ok(None),
    };
    let name_at = names.offset.saturating_add(elf::number(file, at, 4)?);
    let name = elf::text(file, name_at)?;
    Ok(Some(Function { start, end, name }))
}

#[cfg(test)]
pub(super) mod tests {
    use super::Symbols;

    /// Where the code of [`elf_with_symbols`] is.
    pub(crate) const CODE: u64 = 0x20_0000;

    /// An ELF file of nothing but symbols: 16 bytes of the label `entry`, 16 of a
    /// function, 16 of padding, 16 of another label, a constant.
    pub(crate) fn elf_with_symbols() -> Vec<u8> {
        const NAMES: &[u8] = b"\0entry\0_ZN3app4fuse17h0123456789abcdefE\0last\0CONSTANT\0";
        let name = |text: &[u8]| {
            let at = NAMES.windows(text.len()).position(|part| part == text);
            u32::try_from(at.unwrap()).unwrap()
        };
        // Name, type, section, address, size.
        let symbols = [
            (name(b"entry"), 0, 1, CODE, 0),
            (name(b"last"), 0, 1, CODE + 0x30, 0),
            (name(b"_ZN"), 2, 1, CODE + 0x10, 0x10),
            (name(b"CONSTANT"), 1, 1, CODE + 0x38, 8),
            (name(b"entry"), 0, 0xfff1, CODE + 0x20, 0),
        ];
        let mut table = Vec::new();
        for (name, kind, section, address, bytes) in symbols {
            table.extend(u32::to_le_bytes(name));
            table.extend([kind, 0]);
            table.extend(u16::to_le_bytes(section));
            table.extend(u64::to_le_bytes(address));
            table.extend(u64::to_le_bytes(bytes));
        }
        let names_at = 64 + u64::try_from(table.len()).unwrap();
        let sections_at = names_at + u64::try_from(NAMES.len()).unwrap();

        let mut file = Vec::from(*b"\x7fELF\x02\x01\x01");
        file.resize(40, 0);
        file.extend(sections_at.to_le_bytes());
        file.resize(60, 0);
        file.extend(4_u16.to_le_bytes());
        file.resize(64, 0);
        file.extend(&table);
        file.extend(NAMES);
        let mut section = |kind: u32, flags: u64, address: u64, offset: u64, bytes: u64, link| {
            file.extend(0_u32.to_le_bytes());
            file.extend(kind.to_le_bytes());
            for word in [flags, address, offset, bytes] {
                file.extend(word.to_le_bytes());
            }
            file.extend(u32::to_le_bytes(link));
            file.extend([0; 20]);
        };
        section(0, 0, 0, 0, 0, 0);
        section(1, 2 | 4, CODE, 0, 0x40, 0);
        section(2, 0, 0, 64, names_at - 64, 3);
        section(3, 0, 0, names_at, sections_at - names_at, 0);
        file
    }

    #[test]
    fn an_address_belongs_to_the_function_around_it() {
        let symbols = Symbols::read(&elf_with_symbols()).unwrap();
        let name = |offset| symbols.name(CODE + offset);
        assert_eq!(name(0).unwrap(), "entry+0x0");
        assert_eq!(name(0xf).unwrap(), "entry+0xf");
        assert_eq!(name(0x10).unwrap(), "app::fuse+0x0");
        assert_eq!(name(0x1f).unwrap(), "app::fuse+0xf");
        assert_eq!(name(0x20), None);
        assert_eq!(name(0x3f).unwrap(), "last+0xf");
        assert_eq!(name(0x40), None);
        assert_eq!(symbols.name(CODE - 1), None);
    }

    #[test]
    fn a_file_without_symbols_or_cut_short_is_refused() {
        let file = elf_with_symbols();
        let tiny = crate::tiny::tiny_image("hello", crate::tiny::TinyEnd::Never);
        assert_eq!(
            Symbols::read(&tiny).unwrap_err(),
            "the image has no symbols"
        );
        for length in [10, 100, file.len() - 30] {
            assert!(Symbols::read(&file[..length]).is_err(), "{length}");
        }
    }
}
