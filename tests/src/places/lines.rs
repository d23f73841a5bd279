//! Which line of source an address comes from: an image's line table (DWARF 4,
//! section 6.2), as `debug = "line-tables-only"` leaves it.

use super::cursor::Cursor;

/// A line of source, by the number of its file.
pub(super) type Line = (u64, u64);

/// The line table of one compilation unit.
#[derive(Debug)]
pub(super) struct Lines<'f> {
    directories: Vec<&'f str>,
    /// Names with the numbers of their directories, from 1.
    files: Vec<(&'f str, u64)>,
    program: Cursor<'f>,
    minimum_instruction: u64,
    line_base: i64,
    line_range: u64,
    opcode_base: u64,
    /// How many operands each standard opcode has.
    operands: Vec<u64>,
}

impl<'f> Lines<'f> {
    /// Reads what stands before the program of a table; `None` if it is of another
    /// version than 4, or damaged.
    pub(super) fn read(section: &'f [u8], offset: u64) -> Option<Lines<'f>> {
        let mut unit = Cursor::at(section, offset)?;
        let length = unit.number(4)?;
        let mut unit = unit.take(length)?;
        if unit.number(2)? != 4 {
            return None;
        }
        let header = unit.number(4)?;
        let mut header = unit.take(header)?;
        let minimum_instruction = header.number(1)?;
        // Operations an instruction, and whether a row is a statement at first.
        header.number(2)?;
        let line_base = i64::from(u8::try_from(header.number(1)?).ok()?.cast_signed());
        let line_range = header.number(1).filter(|range| *range > 0)?;
        let opcode_base = header.number(1)?;
        let operands = (1..opcode_base).map(|_| header.number(1));
        let operands = operands.collect::<Option<_>>()?;
        let directories = std::iter::from_fn(|| header.text().filter(|name| !name.is_empty()));
        let directories = directories.collect();
        let files = std::iter::from_fn(|| {
            let name = header.text().filter(|name| !name.is_empty())?;
            let directory = header.uleb()?;
            // Its time and its size.
            header.uleb().and_then(|_| header.uleb())?;
            Some((name, directory))
        });
        Some(Lines {
            directories,
            files: files.collect(),
            program: unit,
            minimum_instruction,
            line_base,
            line_range,
            opcode_base,
            operands,
        })
    }

    /// Returns the path of a file: relative to the workspace if it is of it.
    pub(super) fn path(&self, file: u64) -> Option<String> {
        let from_1 = |number: u64| usize::try_from(number.checked_sub(1)?).ok();
        let (name, directory) = self.files.get(from_1(file)?)?;
        let directory = from_1(*directory).and_then(|number| self.directories.get(number));
        Some(directory.map_or_else(|| (*name).into(), |directory| format!("{directory}/{name}")))
    }

    /// Returns the line that the instruction at `address` comes from.
    pub(super) fn line(&self, address: u64) -> Option<Line> {
        let mut program = self.program.clone();
        let mut before: Option<(u64, Line)> = None;
        let (mut at, mut file, mut line) = (0_u64, 1, 1_u64);
        while !program.is_at_end() {
            let opcode = program.number(1)?;
            let (mut is_row, mut is_end) = (false, false);
            match opcode {
                special if special >= self.opcode_base => {
                    let adjusted = special - self.opcode_base;
                    at = at.wrapping_add(adjusted / self.line_range * self.minimum_instruction);
                    let lines = (adjusted % self.line_range).cast_signed() + self.line_base;
                    line = line.wrapping_add_signed(lines);
                    is_row = true;
                }
                0 => {
                    let length = program.uleb()?;
                    let mut extended = program.take(length)?;
                    match extended.number(1)? {
                        1 => is_end = true,
                        2 => at = extended.number(8)?,
                        _ => {}
                    }
                }
                1 => is_row = true,
                2 => at = at.wrapping_add(program.uleb()?.wrapping_mul(self.minimum_instruction)),
                3 => line = line.wrapping_add_signed(program.sleb()?),
                4 => file = program.uleb()?,
                8 => {
                    let steps = (255 - self.opcode_base) / self.line_range;
                    at = at.wrapping_add(steps * self.minimum_instruction);
                }
                9 => at = at.wrapping_add(program.number(2)?),
                other => {
                    let operands = self.operands.get(usize::try_from(other - 1).ok()?)?;
                    for _ in 0..*operands {
                        program.uleb()?;
                    }
                }
            }
            if is_row || is_end {
                if let Some((from, found)) = before
                    && (from..at).contains(&address)
                {
                    return Some(found);
                }
                before = is_row.then_some((at, (file, line)));
            }
            if is_end {
                (at, file, line) = (0, 1, 1);
            }
        }
        None
    }
}
