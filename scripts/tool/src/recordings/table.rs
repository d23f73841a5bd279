//! Converts recordings from and to tables of comma-separated values (RFC 4180).
//!
//! In a table to be converted, each row is the value returned by a source in one job. The optional
//! columns `job`, `release_ns` and `at_ns` have the meanings of their names. The other columns, in
//! their order, are the numbers and texts of the type.
//!
//! A recording becomes a table for each channel, and a table for other entries. Each number has a
//! column: structs, tuples and arrays are spread, and the name of a column is the path to its
//! number. A part without a fixed number of columns, such as a list or an option, is JSON in a
//! single cell, and so is a large array; an option without a value is an empty cell.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

use fass_dag_file::time::parse_ns;
use recording::{
    Channel, DagHeader, Decoder, Entry, EntryKind, Field, Header, Malformed, Part, Recording, Role,
    Scalar, Schema, Writer, write_json,
};
use text::quoted;

use super::name;
use crate::files;
use crate::options::CommandLine;

/// Converts a table to a recording.
#[allow(clippy::too_many_lines, reason = "one pass over a table")]
pub(super) fn convert(file: &Path, options: &CommandLine) -> Result<Vec<u8>, String> {
    let text = files::read_text(file)?;
    let place = files::shown_path(file);
    let mut rows = TableRows {
        text: &text,
        line: 0,
    };
    let at = |line: usize, why: String| format!("{place}:{line}: {why}");
    let refuse = |(line, why): (usize, String)| at(line, why);
    let titles = rows.next().transpose().map_err(refuse)?;
    let titles = titles.ok_or_else(|| {
        at(
            1,
            "the table is empty; the first row names the columns".into(),
        )
    })?;
    let columns = ColumnRoles::new(&titles, options)?;
    if let Some(title) = twice(&titles, options) {
        let title = quoted(title);
        let why = format!("there are two columns {title}; rename one, or --ignore both");
        return Err(at(1, why));
    }
    let period_ns = match options.text(name::PERIOD).map(parse_ns) {
        Some(Err(why)) => return Err(format!("`--period`: {why}")),
        Some(Ok(period_ns)) => Some(period_ns),
        None => None,
    };
    // Every job needs a release; without a column it is a multiple of the period.
    if columns.release_ns.is_none() && period_ns.is_none() {
        let line = "there is no column release_ns; say by --period how far apart the rows are";
        return Err(at(1, line.into()));
    }
    let schema = schema(&columns, options).map_err(|why| at(1, why))?;
    let mut parts = Vec::new();
    spread(&schema, "value", &mut parts);
    let (wanted, here) = (parts.len(), columns.values.len());
    if wanted != here {
        let names = columns.names.join(", ");
        let why = format!(
            "the type has {wanted} numbers and texts, and there are {here} columns for them \
             ({names}); change `--type`, or leave columns out by `--ignore`"
        );
        return Err(at(1, why));
    }
    let app = options.text(name::DAG).unwrap_or_default();
    let mut writer = Writer::new(&Header {
        app: app.into(),
        dags: vec![DagHeader {
            name: app.into(),
            graph: 0,
        }],
        channels: vec![Channel {
            dag: 0,
            subtask: 0,
            role: Role::Source,
            topic: options.text(name::TOPIC).unwrap_or_default().into(),
            schema: schema.clone(),
        }],
    });
    let mut row = 0;
    let mut before: Option<(usize, u64, u64)> = None;
    let (mut first, mut off_grid) = (None, None);
    while let Some(cells) = rows.next() {
        let cells = cells.map_err(refuse)?;
        let line = rows.line;
        if cells.len() != titles.len() {
            let (here, wanted) = (cells.len(), titles.len());
            return Err(at(
                line,
                format!("{here} cells, and there are {wanted} columns"),
            ));
        }
        let number = |column: Option<usize>, otherwise: u64| match column {
            None => Ok(otherwise),
            Some(column) => cells[column].parse().map_err(|_| {
                let (cell, title) = (quoted(&cells[column]), quoted(&titles[column]));
                at(
                    line,
                    format!("{cell} is no whole number, as column {title} has them"),
                )
            }),
        };
        let job = number(columns.job, row)?;
        let by_period_ns = |job: u64| job.saturating_mul(period_ns.unwrap_or(0));
        let release_ns = number(columns.release_ns, by_period_ns(job))?;
        // A replay releases the jobs one after the other, each once.
        if let Some((other, of_job, of_ns)) = before.replace((line, job, release_ns))
            && (job <= of_job || release_ns <= of_ns)
        {
            let why = format!(
                "job {job} at {release_ns} ns is not after line {other}, job {of_job} at {of_ns} \
                 ns; put the rows in the order of jobs and times, each once"
            );
            return Err(at(line, why));
        }
        let (first_job, offset_ns) = *first.get_or_insert((job, release_ns));
        let due_ns = by_period_ns(job - first_job).saturating_add(offset_ns);
        if period_ns.is_some() && release_ns != due_ns {
            let why = format!(
                "job {job} is due at {due_ns} ns by --period, and at {release_ns} ns by column \
                 release_ns; number the jobs by the period, or leave --period out"
            );
            off_grid.get_or_insert(at(line, why));
        }
        let mut value = Vec::new();
        for ((_, part), &column) in parts.iter().zip(&columns.values) {
            encode(part, &cells[column], &mut value).map_err(|why| at(line, why))?;
        }
        writer.write(&Entry {
            what: EntryKind::Value,
            dag: 0,
            place: 0,
            job,
            release_ns,
            at_ns: number(columns.at_ns, release_ns)?,
            value: &value,
        });
        row += 1;
    }
    // A wrong order of rows tells more, so it is reported first.
    off_grid.map_or(Ok(writer.end()), Err)
}

/// The roles of the columns, by their numbers.
#[derive(Default)]
struct ColumnRoles {
    job: Option<usize>,
    release_ns: Option<usize>,
    at_ns: Option<usize>,
    /// The columns of values, and their names.
    values: Vec<usize>,
    names: Vec<String>,
}

impl ColumnRoles {
    fn new(titles: &[String], options: &CommandLine) -> Result<Self, String> {
        let ignored = ignored(options);
        let unknown = ignored
            .iter()
            .find(|name| !titles.iter().any(|title| title == *name));
        if let Some(name) = unknown {
            let there = titles.join(", ");
            return Err(format!(
                "`--ignore`: there is no column {}; there are {there}",
                quoted(name)
            ));
        }
        let mut columns = Self::default();
        for (number, title) in titles.iter().enumerate() {
            match title.as_str() {
                title if ignored.contains(&title) => {}
                "job" => columns.job = Some(number),
                "release_ns" => columns.release_ns = Some(number),
                "at_ns" => columns.at_ns = Some(number),
                _ => {
                    columns.values.push(number);
                    columns.names.push(title.clone());
                }
            }
        }
        Ok(columns)
    }
}

/// Returns the names of the columns left out of the values.
fn ignored(options: &CommandLine) -> Vec<&str> {
    let all = options.text(name::IGNORE);
    all.map_or(Vec::new(), |all| all.split(',').collect())
}

/// Returns a name shared by two columns, unless the name is ignored.
fn twice<'t>(titles: &'t [String], options: &CommandLine) -> Option<&'t str> {
    let (ignored, mut seen) = (ignored(options), BTreeSet::new());
    let mut used = (titles.iter().map(String::as_str)).filter(|title| !ignored.contains(title));
    used.find(|title| !seen.insert(*title))
}

/// Returns the type of the values.
fn schema(columns: &ColumnRoles, options: &CommandLine) -> Result<Schema, String> {
    let Some(text) = options.text(name::TYPE) else {
        let field = |name: &String| Field {
            name: name.clone(),
            schema: Schema::Scalar(Scalar::F64),
        };
        return Ok(Schema::Struct(
            "Row".into(),
            columns.names.iter().map(field).collect(),
        ));
    };
    Schema::parse(text)
        .map_err(|(column, expected)| format!("`--type`, column {column}: expected {expected}"))
}

/// Parses a cell as a part of a value, and appends the bytes of the part.
fn encode(part: &Schema, cell: &str, out: &mut Vec<u8>) -> Result<(), String> {
    match part {
        Schema::Scalar(scalar) => {
            let refused = || format!("{} is no value of type {}", quoted(cell), scalar.name());
            out.extend(scalar.parse(cell.trim()).ok_or_else(refused)?);
            Ok(())
        }
        Schema::Option(inner) => {
            // An empty cell is an option without a value.
            out.push(u8::from(!cell.is_empty()));
            match (&**inner, cell.is_empty()) {
                (_, true) => Ok(()),
                (Schema::Scalar(_), false) => encode(inner, cell, out),
                // Other options are JSON in their cell; JSON is written but never read.
                _ => Err(format!("a value of type {part} is not read from a table")),
            }
        }
        Schema::List(_) => Err(format!("a list, {part}, is not read from a table")),
        // Structs, tuples and small arrays were spread before, so this is a large array.
        _ => Err(format!(
            "an array of more than {MOST_COLUMNS} columns, {part}, is not read from a table"
        )),
    }
}

/// The rows of a table (RFC 4180).
struct TableRows<'t> {
    text: &'t str,
    /// The line on which the latest row ended, counted from 1.
    line: usize,
}

impl Iterator for TableRows<'_> {
    type Item = Result<Vec<String>, (usize, String)>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.text.is_empty() {
            return None;
        }
        self.line += 1;
        let first = self.line;
        let (mut cells, mut cell, mut quotes) = (Vec::new(), String::new(), false);
        let mut letters = self.text.char_indices().peekable();
        while let Some((place, letter)) = letters.next() {
            match letter {
                // Two quotation marks within a quoted cell stand for one.
                '"' if quotes && letters.next_if(|(_, next)| *next == '"').is_some() => {
                    cell.push('"')
                }
                '"' if quotes || cell.is_empty() => quotes = !quotes,
                ',' if !quotes => cells.push(std::mem::take(&mut cell)),
                // A row may end in CR LF, or in LF alone.
                '\r' if !quotes => {}
                '\n' if !quotes => {
                    self.text = &self.text[place + 1..];
                    cells.push(cell);
                    return Some(Ok(cells));
                }
                other => {
                    // A quoted cell may contain line ends; messages still name the right line.
                    self.line += usize::from(other == '\n');
                    cell.push(other);
                }
            }
        }
        self.text = "";
        // The rest of the table would be a single cell.
        if quotes {
            let why = "a cell that begins with a quotation mark has no end";
            return Some(Err((first, why.into())));
        }
        cells.push(cell);
        Some(Ok(cells))
    }
}

/// The largest number of columns that an array is spread into.
const MOST_COLUMNS: u64 = 256;

/// Returns the tables, with the names of their files.
#[allow(clippy::too_many_lines, reason = "tables, row by row")]
pub(super) fn tables(recording: &Recording<'_>) -> Vec<(String, String)> {
    let header = recording.header();
    let mut names = BTreeMap::<String, usize>::new();
    let (mut tables, mut parts_of) = (Vec::new(), Vec::new());
    for channel in &header.channels {
        let dag = &header.dags[usize::from(channel.dag)].name;
        let found = match channel.role {
            Role::Sample => ".sampled",
            Role::State => ".state",
            Role::Answer => ".answers",
            Role::Source | Role::Result => "",
        };
        let name = format!("{}.{}{found}", plain(dag), plain(&channel.topic));
        // Two names may differ only in characters that `plain` replaces.
        let same = names.entry(name.clone()).or_default();
        *same += 1;
        let name = if *same > 1 {
            format!("{name}-{same}.csv")
        } else {
            format!("{name}.csv")
        };
        let mut columns = Vec::from(["job", "release_ns", "at_ns"].map(String::from));
        let mut parts = Vec::new();
        spread(&channel.schema, "value", &mut parts);
        columns.extend(parts.iter().map(|(name, _)| name.clone()));
        tables.push((name, row(&columns)));
        parts_of.push(parts);
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
        if entry.what == EntryKind::Value {
            let place = usize::from(place);
            cells.extend([job, release_ns, at_ns].map(|number| number.to_string()));
            let mut input = Decoder::new(entry.value);
            for (_, part) in &parts_of[place] {
                // The recording's reader has checked every value, so this cannot fail.
                cells.push(cell(part, &mut input, entry.value).unwrap_or_default());
            }
            tables[place].1 += &row(&cells);
            continue;
        }
        let subtask = match entry.what {
            EntryKind::Lost => header.channels[usize::from(place)].subtask,
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

/// Returns a name without characters that a file system may reject.
fn plain(name: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || letter == '-';
    name.chars()
        .map(|letter| if is_plain(letter) { letter } else { '_' })
        .collect()
}

/// Returns the cells as a line of the table.
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

/// Adds the columns of a type: for each, its name and its part of a value.
fn spread<'s>(schema: &'s Schema, name: &str, columns: &mut Vec<(String, &'s Schema)>) {
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
        Schema::Array(element, count) => {
            let mut of_one = Vec::new();
            spread(element, name, &mut of_one);
            match of_one.len() as u64 * u64::from(*count) <= MOST_COLUMNS {
                true => (0..*count).for_each(|number| spread(element, &within(&number), columns)),
                false => columns.push((name.into(), schema)),
            }
        }
        _ => columns.push((name.into(), schema)),
    }
}

/// Returns the cell for a part of a value, read from `input`, a decoder of `all`.
fn cell(part: &Schema, input: &mut Decoder<'_>, all: &[u8]) -> Result<String, Malformed> {
    let (start, mut cell) = (input.offset(), String::new());
    part.walk(input, &mut |part| cell = shown(part))?;
    if !matches!(part, Schema::Scalar(_)) {
        cell.clear();
        write_json(part, &all[start..input.offset()], &mut cell)?;
        if cell == "null" {
            cell.clear();
        }
    }
    Ok(cell)
}

/// Returns a scalar as Rust writes it, and text unchanged.
fn shown(part: Part<'_>) -> String {
    match part {
        Part::Char(letter) => letter.to_string(),
        Part::Text(text) => text.into(),
        Part::Single(number) => format!("{number:?}"),
        Part::Double(number) => format!("{number:?}"),
        other => other.to_string(),
    }
}
