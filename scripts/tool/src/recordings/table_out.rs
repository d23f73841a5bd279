//! A recording as tables of comma-separated values (RFC 4180): one for each channel, and one
//! of what else happened.
//!
//! A column for each number: structs, tuples and arrays are spread, and the name of a column is
//! the way to it. What has no fixed number of parts, a list or an option, is JSON in one cell,
//! and so is a large array; an option without a value is an empty cell.

use std::collections::BTreeMap;
use std::fmt::Write;

use recording::{
    Decoder, Entry, Field, Malformed, Part, Recording, Role, Scalar, Schema, What, write_json,
};

/// The most columns that an array becomes.
pub(super) const MOST_COLUMNS: usize = 256;

/// Returns the tables, with names for their files.
pub(super) fn tables(recording: &Recording<'_>) -> Vec<(String, String)> {
    let header = recording.header();
    let mut names = BTreeMap::<String, usize>::new();
    let mut tables: Vec<(String, String)> = Vec::new();
    for channel in &header.channels {
        let dag = &header.dags[usize::from(channel.dag)].name;
        let found = match channel.role {
            Role::Sample => ".sampled",
            Role::State => ".state",
            Role::Source | Role::Result => "",
        };
        let name = format!("{}.{}{found}", plain(dag), plain(&channel.topic));
        let same = names.entry(name.clone()).or_default();
        *same += 1;
        let name = if *same > 1 {
            format!("{name}-{same}.csv")
        } else {
            format!("{name}.csv")
        };
        let mut columns = Vec::from(["job", "release_ns", "at_ns"].map(String::from));
        spread(&channel.schema, "value", &mut columns);
        tables.push((name, row(&columns)));
    }
    let mut others =
        row(&["what", "dag", "subtask", "job", "release_ns", "at_ns"].map(String::from));
    let mut cells = Vec::new();
    for entry in recording.entries() {
        let Entry {
            dag,
            place,
            job,
            release_ns,
            at_ns,
            ..
        } = entry;
        cells.clear();
        if entry.what == What::Value {
            let place = usize::from(place);
            cells.extend([job, release_ns, at_ns].map(|number| number.to_string()));
            let schema = &header.channels[place].schema;
            // The reader has gone through every value.
            let _ = fill(
                schema,
                &mut Decoder::new(entry.value),
                entry.value,
                &mut cells,
            );
            tables[place].1 += &row(&cells);
            continue;
        }
        let subtask = match entry.what {
            What::Lost => header.channels[usize::from(place)].subtask,
            _ => place,
        };
        cells.extend([
            entry.what.name().into(),
            header.dags[usize::from(dag)].name.clone(),
        ]);
        cells.push(subtask.to_string());
        cells.extend([job, release_ns, at_ns].map(|number| number.to_string()));
        others += &row(&cells);
    }
    tables.push(("events.csv".into(), others));
    tables
}

/// Returns a name with nothing in it that a file system minds.
fn plain(name: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || letter == '-';
    name.chars()
        .map(|letter| if is_plain(letter) { letter } else { '_' })
        .collect()
}

/// Returns the cells as a line.
fn row(cells: &[String]) -> String {
    let mut line = String::new();
    for (number, cell) in cells.iter().enumerate() {
        if number > 0 {
            line.push(',');
        }
        match cell.contains(['"', ',', '\n', '\r']) {
            // Writing into a `String` cannot fail.
            true => _ = write!(line, "\"{}\"", cell.replace('"', "\"\"")),
            false => line += cell,
        }
    }
    line.push('\n');
    line
}

/// Returns how many columns a type takes.
fn width(schema: &Schema) -> usize {
    let sum = |width: usize, schema: &Schema| width.saturating_add(self::width(schema));
    match schema {
        Schema::Struct(_, fields) => (fields.iter().map(|field| &field.schema)).fold(0, sum),
        Schema::Tuple(elements) => elements.iter().fold(0, sum),
        Schema::Array(element, count) => spread_width(element, *count).unwrap_or(1),
        Schema::Scalar(_) | Schema::Option(_) | Schema::List(_) => 1,
    }
}

/// Returns how many columns an array takes, if it becomes columns.
pub(super) fn spread_width(element: &Schema, count: u32) -> Option<usize> {
    let all = width(element).checked_mul(usize::try_from(count).ok()?)?;
    Some(all).filter(|&all| all <= MOST_COLUMNS)
}

/// Adds the names of the columns that a type takes.
pub(super) fn spread(schema: &Schema, name: &str, columns: &mut Vec<String>) {
    let within = |part: &dyn std::fmt::Display| match name {
        "value" => part.to_string(),
        _ => format!("{name}_{part}"),
    };
    match schema {
        Schema::Struct(_, fields) => {
            for Field { name, schema } in fields {
                spread(schema, &within(name), columns);
            }
        }
        Schema::Tuple(elements) => {
            for (number, schema) in elements.iter().enumerate() {
                spread(schema, &within(&number), columns);
            }
        }
        Schema::Array(element, count) if spread_width(element, *count).is_some() => {
            (0..*count).for_each(|number| spread(element, &within(&number), columns));
        }
        _ => columns.push(name.into()),
    }
}

/// Adds the cells of a value of `all`, in as many columns.
fn fill(
    schema: &Schema,
    input: &mut Decoder<'_>,
    all: &[u8],
    cells: &mut Vec<String>,
) -> Result<(), Malformed> {
    match schema {
        Schema::Struct(_, fields) => {
            (fields.iter()).try_for_each(|field| fill(&field.schema, input, all, cells))
        }
        Schema::Tuple(elements) => {
            (elements.iter()).try_for_each(|element| fill(element, input, all, cells))
        }
        Schema::Array(element, count) if spread_width(element, *count).is_some() => {
            (0..*count).try_for_each(|_| fill(element, input, all, cells))
        }
        Schema::Scalar(scalar) => {
            let mut cell = String::new();
            let walked = schema.walk(input, &mut |part| cell = scalar_cell(*scalar, part));
            cells.push(cell);
            walked
        }
        Schema::Option(_) | Schema::List(_) | Schema::Array(..) => {
            let start = input.offset();
            schema.walk(input, &mut |_| ())?;
            let mut cell = String::new();
            write_json(schema, &all[start..input.offset()], &mut cell)?;
            cells.push(if cell == "null" { String::new() } else { cell });
            Ok(())
        }
    }
}

fn scalar_cell(scalar: Scalar, part: Part<'_>) -> String {
    match part {
        Part::Bool(truth) => truth.to_string(),
        Part::Char(letter) => letter.to_string(),
        Part::Text(text) => text.into(),
        Part::Unsigned(number) => number.to_string(),
        Part::Signed(number) => number.to_string(),
        Part::Single(number) => format!("{number:?}"),
        Part::Double(number) => format!("{number:?}"),
        _ => scalar.name().into(),
    }
}
