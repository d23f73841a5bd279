//! Schedules of subtasks that wait: their blocks are read over up to their `end`.

use replay::lines::{Line, Lines, Malformed};

/// One schedule, of which nothing is compared.
#[derive(Debug)]
pub struct ScheduleCase {
    /// The case's name.
    pub name: String,
}

/// Reads a block from its header on.
///
/// # Errors
///
/// [`Malformed`] if it has no name or no end.
pub fn parse(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<ScheduleCase, Malformed> {
    let name = header.words.first();
    let name = name.ok_or_else(|| header.malformed("a case has a name; give it one"))?;
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
        if line.kind == "end" {
            let name = (*name).to_owned();
            return Ok(ScheduleCase { name });
        }
    }
}
