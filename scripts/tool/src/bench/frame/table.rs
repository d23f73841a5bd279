//! Figures for people: columns of fixed widths, under their headings.

use std::fmt::Display;

/// A heading, how wide its column is, and the decimals of its numbers. In a column of a negative
/// width the cells begin at the left.
pub(in crate::bench) type Column<'a> = (&'a str, isize, usize);

/// A table that grows row by row.
#[derive(Debug)]
pub(in crate::bench) struct Table<'a> {
    columns: &'a [Column<'a>],
    text: String,
}

impl<'a> Table<'a> {
    /// Begins a table, below a line if there is a `title`.
    pub(in crate::bench) fn new(title: &str, columns: &'a [Column<'a>]) -> Self {
        let text = title.into();
        let mut table = Self { columns, text };
        let headings = columns.iter().map(|&(heading, ..)| heading.to_string());
        table.cells(headings);
        table
    }

    /// Adds a row with a cell for each column.
    pub(in crate::bench) fn row(&mut self, cells: &[&dyn Display]) {
        let cells = cells.iter().zip(self.columns);
        let cells = cells.map(|(cell, &(_, _, decimals))| match decimals {
            0 => cell.to_string(),
            _ => format!("{cell:.decimals$}"),
        });
        self.cells(cells);
    }

    /// Adds a line between the rows, or after them.
    pub(in crate::bench) fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    /// Adds a row of cells that are text already.
    pub(in crate::bench) fn cells(&mut self, cells: impl IntoIterator<Item = String>) {
        let cells = cells.into_iter().zip(self.columns);
        let cells = cells.map(|(cell, &(_, width, _))| {
            let wide = width.unsigned_abs();
            match width {
                ..0 => format!("{cell:<wide$}"),
                0.. => format!("{cell:>wide$}"),
            }
        });
        self.line(&cells.collect::<String>());
    }

    /// Returns the whole table.
    pub(in crate::bench) fn text(self) -> String {
        self.text
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn cells_stand_below_their_headings_with_their_decimals() {
        let columns = [("name", -6, 0), ("load", 6, 1), ("sets", 6, 0)];
        let mut table = Table::new("a title\n", &columns);
        table.row(&[&"one", &0.25, &7]);
        table.line("a line");
        let expected = "a title\nname    load  sets\none      0.2     7\na line\n";
        assert_eq!(table.text(), expected);
    }
}
