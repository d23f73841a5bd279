//! Tables of tests: each row is a line, with ` | ` between its cells.
//!
//! In a cell `\n` stands for the end of a line, and `\?` for a character that must not be shown.

/// Returns the rows of a table, each of so many cells; those that a row leaves out are empty.
pub(crate) fn rows<const N: usize>(table: &str) -> impl Iterator<Item = [String; N]> {
    table.lines().filter(|row| !row.is_empty()).map(|row| {
        let told = |cell: &str| cell.replace(r"\n", "\n").replace(r"\?", "\u{202e}");
        let mut cells: Vec<String> = row.split(" | ").map(told).collect();
        cells.resize(cells.len().max(N), String::new());
        cells.try_into().expect(row)
    })
}

/// Returns a text in which something else stands in place of a part.
pub(crate) fn altered(text: &str, [from, to]: [&str; 2]) -> String {
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}
