//! Prints without a panic, even after the reader has left.
//!
//! The standard library's printing macros panic when a write fails, and a write fails as soon as
//! the reader of a pipe has left (`./scripts/oracle ... | head -1`). The loss of the reader is no
//! failure: the work goes on, and its exit code tells its result. Any other write error on standard
//! output, such as a full disk, is a failure; [`conclude`] reports it at the end.
//!
//! So this library has macros of the same names. They hide the standard library's macros in all
//! modules, so no caller can use the wrong macro.
//!
//! A `Table` shows figures to people: columns of fixed widths, under their headings. `shown` and
//! `briefly` format the times in such tables.

/// Writes to standard output, like the standard library's macro but without panics.
#[macro_export]
macro_rules! print {
    ($($what:tt)*) => {
        $crate::output::put(::std::format_args!($($what)*))
    };
}

/// Writes a line to standard output, like the standard library's macro but without panics.
#[macro_export]
macro_rules! println {
    ($($what:tt)*) => {
        $crate::output::put(::std::format_args!("{}\n", ::std::format_args!($($what)*)))
    };
}

/// Writes to standard error, like the standard library's macro but without panics.
#[macro_export]
macro_rules! eprint {
    ($($what:tt)*) => {
        $crate::output::complain(::std::format_args!($($what)*))
    };
}

/// Writes a line to standard error, like the standard library's macro but without panics.
#[macro_export]
macro_rules! eprintln {
    ($($what:tt)*) => {
        $crate::output::complain(::std::format_args!("{}\n", ::std::format_args!($($what)*)))
    };
}

use std::fmt::{Arguments, Display};
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::mem;
use std::process::ExitCode;
use std::sync::OnceLock;

/// The first write error of standard output, if any.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Writes to standard output; for the macros.
pub fn put(what: Arguments<'_>) {
    note(stdout().write_fmt(what));
}

/// Writes to standard error; for the macros. Ignores an error, as there is no place to report it.
pub fn complain(what: Arguments<'_>) {
    let _ = stderr().write_fmt(what);
}

fn note(written: io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        // Later errors mostly follow from the first, so only the first is kept.
        let _ = LOST.set(error);
    }
}

/// Returns the exit code of a program whose work has ended with `code`. If some output could not be
/// written, reports the error and turns success into failure.
pub fn conclude(program: &str, code: ExitCode) -> ExitCode {
    // Standard output buffers: the last write error shows only in a flush.
    note(stdout().flush());
    let Some(error) = LOST.get() else {
        return code;
    };
    eprintln!("{program}: standard output could not be written: {error}");
    // Another code than success already says more than a lost line would.
    if code == ExitCode::SUCCESS {
        return ExitCode::FAILURE;
    }
    code
}

/// A table built row by row.
pub struct Table {
    /// For each column: whether its cells begin at the left, its width, and the decimals of its
    /// numbers.
    columns: Vec<(bool, usize, usize)>,
    text: String,
}

impl Table {
    /// Makes a table, below a line if there is a `title`. The columns are separated by `|`. Each is
    /// `heading:width`, `heading:width.decimals`, or `heading:<width` for cells that begin at the
    /// left.
    pub fn new(title: &str, columns: &str) -> Self {
        // The formats are literals of this crate; a missing number means no width or no decimals.
        let number = |digits: &str| digits.parse().unwrap_or(0);
        let column = |column| {
            let (heading, form) = str::rsplit_once(column, ':').unwrap_or((column, "0"));
            let (width, decimals) = form.split_once('.').unwrap_or((form, "0"));
            let wide = number(width.trim_start_matches('<'));
            (
                heading.into(),
                (width.starts_with('<'), wide, number(decimals)),
            )
        };
        let (headings, columns): (Vec<String>, _) = columns.split('|').map(column).unzip();
        let text = title.into();
        let mut table = Self { columns, text };
        table.cells(headings);
        table
    }

    /// Adds a row with a cell for each column.
    pub fn row(&mut self, cells: &[&dyn Display]) {
        let cells: Vec<String> = (cells.iter().zip(&self.columns))
            // Rounding is for floats only; integers and text take no precision.
            .map(|(cell, &(_, _, decimals))| match decimals {
                0 => cell.to_string(),
                _ => format!("{cell:.decimals$}"),
            })
            .collect();
        self.cells(cells);
    }

    /// Adds a line between or after the rows.
    pub fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    /// Adds a row of ready-made text cells.
    pub fn cells(&mut self, cells: impl IntoIterator<Item = String>) {
        let cells = cells.into_iter().zip(&self.columns);
        let cells = cells.map(|(cell, &(begins_left, width, _))| match begins_left {
            true => format!("{cell:<width$}"),
            false => format!("{cell:>width$}"),
        });
        let line: String = cells.collect();
        self.line(&line);
    }

    /// Returns the table, or only the part added since the last call.
    pub fn text(&mut self) -> String {
        mem::take(&mut self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn cells_stand_below_their_headings_with_their_decimals() {
        let mut table = Table::new("a title\n", "name:<6|load:6.1|sets:6");
        table.row(&[&"one", &0.25, &7]);
        table.line("a line");
        let expected = "a title\nname    load  sets\none      0.2     7\na line\n";
        assert_eq!(table.text(), expected);
    }
}
