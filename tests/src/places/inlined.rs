//! Which line of an app an address comes from, although its function is inlined.
//!
//! A subtask's function is compiled into the kernel's call of it, so the symbol
//! there is the caller's. The image's debugging information (DWARF 4) has the
//! calls that were inlined, each with the line of the call: from these and the
//! line of the instruction itself the innermost is chosen that is the app's.
//!
//! Only as much of DWARF is read as this compiler writes with
//! `debug = "line-tables-only"`. Of anything else nothing is said.

use std::collections::BTreeMap;

use super::cursor::Cursor;
use super::lines::{Line, Lines};
use crate::elf;

const TAG_INLINED: u64 = 0x1d;
const TAG_UNIT: u64 = 0x11;
const TAG_FUNCTION: u64 = 0x2e;

const AT_STMT_LIST: u64 = 0x10;
const AT_LOW_PC: u64 = 0x11;
const AT_HIGH_PC: u64 = 0x12;
const AT_RANGES: u64 = 0x55;
const AT_CALL_FILE: u64 = 0x58;
const AT_CALL_LINE: u64 = 0x59;

const FORM_ADDR: u64 = 0x01;

/// Folders of the workspace that are not the app's, and that of Rust's own library,
/// whose paths are relative where it is compiled by itself.
const OF_OTHERS: [&str; 5] = ["boot/", "fass/", "kernel/", "library/", "sched-dag/"];

/// Returns the app's innermost line at an address of an image, as `file:line`.
pub(super) fn line_of_app(image: &[u8], address: u64) -> Option<String> {
    let section = |name| elf::named_section(image, name).ok();
    let sections = Sections {
        info: section(".debug_info")?,
        abbreviations: section(".debug_abbrev")?,
        lines: section(".debug_line")?,
        ranges: section(".debug_ranges")?,
    };
    let mut units = Cursor::at(sections.info, 0)?;
    while !units.is_at_end() {
        let length = units.number(4)?;
        let Some(unit) = sections.read_unit(units.take(length)?, address) else {
            continue;
        };
        if unit.has_function {
            let lines = Lines::read(sections.lines, unit.stmt_list?)?;
            let innermost = lines.line(address).into_iter();
            let places = innermost.chain(unit.calls.into_iter().rev());
            return app_line(&lines, places);
        }
    }
    None
}

fn app_line(lines: &Lines<'_>, mut places: impl Iterator<Item = Line>) -> Option<String> {
    places.find_map(|(file, line)| {
        let path = lines.path(file)?;
        let is_app = !path.starts_with('/') && !OF_OTHERS.iter().any(|of| path.starts_with(of));
        // Line 0 is of instructions that come from no line in particular.
        (is_app && line > 0).then(|| format!("{path}:{line}"))
    })
}

struct Sections<'f> {
    info: &'f [u8],
    abbreviations: &'f [u8],
    lines: &'f [u8],
    ranges: &'f [u8],
}

/// What a compilation unit says of an address.
#[derive(Default)]
struct Unit {
    stmt_list: Option<u64>,
    has_function: bool,
    /// Where inlined functions that contain the address are called, the outermost
    /// first.
    calls: Vec<Line>,
}

/// A kind of entry: its tag, and its attributes with their forms.
type Abbreviation = (u64, Vec<(u64, u64)>);

impl<'f> Sections<'f> {
    fn read_unit(&self, mut unit: Cursor<'f>, address: u64) -> Option<Unit> {
        if unit.number(2)? != 4 {
            return None;
        }
        let abbreviations = self.read_abbreviations(unit.number(4)?)?;
        unit.number(1)?; // the size of an address
        let mut found = Unit::default();
        while !unit.is_at_end() {
            let number = unit.uleb()?;
            if number == 0 {
                continue; // the end of a list of entries
            }
            let (tag, attributes) = abbreviations.get(&number)?;
            let mut values = BTreeMap::new();
            for &(attribute, form) in attributes {
                values.insert(attribute, (read_value(&mut unit, form)?, form));
            }
            let value = |attribute| values.get(&attribute).map(|(value, _)| *value);
            match *tag {
                TAG_UNIT => found.stmt_list = value(AT_STMT_LIST),
                TAG_FUNCTION => found.has_function |= self.contains(&values, address),
                TAG_INLINED if self.contains(&values, address) => {
                    let call = value(AT_CALL_FILE).zip(value(AT_CALL_LINE));
                    found.calls.extend(call);
                }
                _ => {}
            }
        }
        Some(found)
    }

    fn read_abbreviations(&self, offset: u64) -> Option<BTreeMap<u64, Abbreviation>> {
        let mut table = Cursor::at(self.abbreviations, offset)?;
        let mut abbreviations = BTreeMap::new();
        loop {
            let number = table.uleb()?;
            if number == 0 {
                return Some(abbreviations);
            }
            let tag = table.uleb()?;
            table.number(1)?; // whether it has entries of its own
            let pairs = std::iter::from_fn(|| {
                let pair = (table.uleb()?, table.uleb()?);
                (pair != (0, 0)).then_some(pair)
            });
            let attributes = pairs.collect();
            abbreviations.insert(number, (tag, attributes));
        }
    }

    /// Reports whether an entry's code contains an address.
    fn contains(&self, values: &BTreeMap<u64, (u64, u64)>, address: u64) -> bool {
        if let Some((offset, _)) = values.get(&AT_RANGES) {
            return self.ranges_contain(*offset, address).unwrap_or(false);
        }
        let ends = values.get(&AT_LOW_PC).zip(values.get(&AT_HIGH_PC));
        ends.is_some_and(|((low, _), (high, form))| match *form {
            FORM_ADDR => (*low..*high).contains(&address),
            _ => (*low..low.saturating_add(*high)).contains(&address),
        })
    }

    fn ranges_contain(&self, offset: u64, address: u64) -> Option<bool> {
        let mut list = Cursor::at(self.ranges, offset)?;
        let mut base = 0_u64;
        loop {
            match (list.number(8)?, list.number(8)?) {
                (0, 0) => return Some(false),
                (u64::MAX, new_base) => base = new_base,
                (from, to) => {
                    let (from, to) = (base.wrapping_add(from), base.wrapping_add(to));
                    if (from..to).contains(&address) {
                        return Some(true);
                    }
                }
            }
        }
    }
}

/// Reads a value of a form (DWARF 4, section 7.5.4); of texts and blocks only as far
/// as to pass them.
fn read_value(entry: &mut Cursor<'_>, form: u64) -> Option<u64> {
    match form {
        FORM_ADDR | 0x07 => entry.number(8),
        0x05 => entry.number(2),
        0x06 | 0x0e | 0x10 | 0x13 | 0x17 => entry.number(4),
        0x0b | 0x0c => entry.number(1),
        0x0d => entry.sleb().map(i64::cast_unsigned),
        0x0f => entry.uleb(),
        0x08 => entry.text().map(|_| 0),
        0x18 => {
            let length = entry.uleb()?;
            entry.take(length).map(|_| 0)
        }
        0x19 => Some(1),
        _ => None,
    }
}
