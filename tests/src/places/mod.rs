//! Places in code: which function of an image an address lies in.
//!
//! A guest that reports a fault knows the address of the instruction, and its
//! image has no names in it that it could read. The host has the image's symbol
//! table. So wherever the tool shows a line of kind `panic`, `exception` or
//! `fault` whose `place` is an address, it adds one line that names the function
//! and the offset in it, and the app's line there, if debugging information has one.
//! What the guest printed stays as it is.
//!
//! An image without symbols, or one that cannot be read, adds nothing: whoever
//! looks at a fault must not be told about another one.

mod cursor;
mod demangle;
mod inlined;
mod lines;
mod symbols;
mod v0;

use std::cell::OnceCell;
use std::fs;
use std::path::{Path, PathBuf};

use crate::protocol::{MachineLine, read_line};
use symbols::Symbols;

/// The kinds whose `place` may be an address.
const KINDS: [&str; 3] = ["panic", "exception", "fault"];

/// The names for addresses in one image, which is read when first asked.
#[derive(Debug)]
pub struct Places {
    image: PathBuf,
    symbols: OnceCell<Option<Symbols>>,
}

impl Places {
    /// Begins with an image that need not be there, or be an ELF file.
    #[must_use]
    pub fn new(image: &Path) -> Places {
        Places {
            image: image.to_path_buf(),
            symbols: OnceCell::new(),
        }
    }

    /// Returns what to add to a line of the serial log, if anything, such as
    /// `0x20e0b8 is faults::crimes::sum_down+0x18`.
    #[must_use]
    pub fn explain(&self, line: &str) -> Option<String> {
        let address = address(&read_line(0, line)?.ok()?)?;
        let Some(name) = self.symbols()?.name(address) else {
            return Some(format!("{address:#x} is not in the image's code"));
        };
        let line = fs::read(&self.image).ok();
        let line = line.and_then(|image| inlined::line_of_app(&image, address));
        let line = line.map_or_else(String::new, |line| format!(", of {line}"));
        Some(format!("{address:#x} is {name}{line}"))
    }

    fn symbols(&self) -> Option<&Symbols> {
        let read = || Symbols::read(&fs::read(&self.image).ok()?).ok();
        self.symbols.get_or_init(read).as_ref()
    }
}

/// Returns the address at which a line says that something happened.
fn address(line: &MachineLine) -> Option<u64> {
    let place = line.text_at("place")?;
    let digits = place.strip_prefix("0x")?;
    KINDS
        .contains(&line.kind.as_str())
        .then(|| u64::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::Places;
    use super::symbols::tests::{CODE, elf_with_symbols};

    fn line(kind: &str, place: &str) -> String {
        format!("{{\"kind\":\"{kind}\",\"cpu\":0,\"place\":\"{place}\",\"message\":\"m\"}}")
    }

    #[test]
    fn only_addresses_of_faults_are_explained() {
        let image = crate::system::new_log("places").unwrap();
        std::fs::write(&image, elf_with_symbols()).unwrap();
        let places = Places::new(&image);
        let inside = format!("{:#x}", CODE + 0x14);
        assert_eq!(
            places.explain(&line("exception", &inside)),
            Some(format!("{inside} is app::fuse+0x4"))
        );
        assert_eq!(
            places.explain(&line("panic", "0x10")),
            Some("0x10 is not in the image's code".into())
        );
        assert_eq!(places.explain(&line("panic", "main.rs:3:1")), None);
        assert_eq!(places.explain(&line("own", &inside)), None);
        assert_eq!(places.explain("  at 0x200004"), None);
        std::fs::remove_file(&image).unwrap();
    }

    #[test]
    fn without_an_image_nothing_is_added() {
        let places = Places::new(std::path::Path::new("no such image"));
        assert_eq!(places.explain(&line("fault", "0x200000")), None);
    }
}
