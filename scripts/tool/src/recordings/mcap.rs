//! Writes recordings as MCAP files, by the specification on mcap.dev, version 0.
//!
//! Each channel of the recording becomes a channel named `/DAG/TOPIC`; other entries go to
//! `/DAG/events`. A message is a JSON object of the job and the value. Its log time is the
//! completion of the instance, its publish time the job's nominal release. Messages are in chunks
//! without compression, each with an index, so a reader finds a time without reading everything.
//!
//! Types are JSON schemas (draft 2020-12), and values are JSON. Viewers accept a part of a schema
//! only if it has a single type: lists of types, `anyOf`, tuples or arrays of arrays make them
//! refuse the channel. So
//!
//! - a tuple is an object with the fields `0`, `1` and so on;
//! - a part that may lack a value is not `required`, and without a value its object omits it: an
//!   option, a number (JSON has no NaN), and an array of numbers, as a whole;
//! - an array or an option as an element, and an option of an option, become the field `value` of
//!   an object of their own;
//! - an infinite number is `1e999`, beyond the range of numbers in every JSON reader.
//!
//! A schema describes exactly the output of this module; the tests check both against each other.

use std::collections::BTreeMap;
use std::fmt::{Display, Write as _};
use std::io::{self, Write};

use recording::{
    Crc, Decoder, Entry, EntryKind, Field, Header, Malformed, Part, Recordable, Recording, Role,
    Scalar, Schema, to_bytes,
};

use views::json::{Object, quoted};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// The kinds of records.
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0b;
const DATA_END: u8 = 0x0f;

/// The size of messages, in bytes, at which a chunk ends.
const CHUNK_BYTES: usize = 1 << 20;

/// Writes a recording, and returns the number of messages.
///
/// # Errors
///
/// The error of the output.
pub fn write(recording: &Recording<'_>, out: &mut dyn Write) -> io::Result<u64> {
    let header = recording.header();
    let channels = channels(header);
    let mut file = McapWriter {
        out,
        length: 0,
        chunk: MessageChunk::default(),
        chunk_indexes: Vec::new(),
        counts: BTreeMap::new(),
        times: None,
    };
    file.put(MAGIC)?;
    // No profile, and the library.
    let about = ["", concat!("fass-tool ", env!("CARGO_PKG_VERSION"))].map(String::from);
    file.record(HEADER, &to_bytes(&about))?;
    for (kind, content) in &channels {
        file.record(*kind, content)?;
    }
    let mut json = String::new();
    for entry in recording.entries() {
        let channel = message(header, &entry, &mut json);
        file.message(channel, &entry, json.as_bytes())?;
    }
    file.end_chunk()?;
    // The checksum of the data section is optional; each chunk has its own.
    file.record(DATA_END, &to_bytes(&0_u32))?;
    file.summary(&channels)
}

/// Writes an entry's message to `json`, and returns the number of its channel.
fn message(header: &Header, entry: &Entry<'_>, json: &mut String) -> u16 {
    json.clear();
    let number = |index: usize| u16::try_from(index).unwrap_or(u16::MAX);
    let channel = header.channels.get(usize::from(entry.place));
    match (entry.what, channel) {
        (EntryKind::Value, Some(channel)) => {
            // The recording's reader has checked every value, so this cannot fail.
            let _ = write_message((entry.job, &channel.schema, entry.value), json);
            entry.place
        }
        (what, channel) => {
            let subtask = match what {
                // The place of a lost value is its channel, of any other entry its subtask.
                EntryKind::Lost => channel.map_or(entry.place, |channel| channel.subtask),
                _ => entry.place,
            };
            let event = Object::new().text("what", what.name());
            let event = event.number("subtask", subtask);
            // Writing into a `String` cannot fail.
            let _ = write!(
                json,
                "{{\"job\":{},\"value\":{}}}",
                entry.job,
                event.into_text()
            );
            // The channels of events follow the channels of values, one for each DAG.
            number(header.channels.len()).saturating_add(entry.dag)
        }
    }
}

/// Returns the records of schemas and channels: those of the recording, then a channel of other
/// entries for each DAG.
fn channels(header: &Header) -> Vec<(u8, Vec<u8>)> {
    let event = "Event { what: text, subtask: u16 }";
    let event = recording::Schema::parse(event).expect("it is a schema");
    let dag = |number: u16| &header.dags[usize::from(number)].name;
    let of_values = header.channels.iter().map(|channel| {
        let found = match channel.role {
            Role::Sample => "/sampled",
            Role::State => "/state",
            Role::Answer => "/answers",
            Role::Source | Role::Result => "",
        };
        let topic = format!("/{}/{}{found}", dag(channel.dag), channel.topic);
        (topic, channel.role.name(), &channel.schema)
    });
    let of_events =
        (header.dags.iter()).map(|dag| (format!("/{}/events", dag.name), "events", &event));
    let (mut schemas, mut channels) = (Vec::new(), Vec::new());
    for (id, (topic, role, schema)) in (0_u16..).zip(of_values.chain(of_events)) {
        // The id 0 is reserved for "no schema".
        let of_schema = id + 1;
        let [name, form, encoding] = [&*schema.to_string(), "jsonschema", "json"].map(String::from);
        let content = (of_schema, name, form, of_message(schema));
        schemas.push((SCHEMA, to_bytes(&content)));
        let metadata = to_bytes(&["role", role].map(String::from));
        let content = (id, of_schema, topic, encoding, metadata);
        channels.push((CHANNEL, to_bytes(&content)));
    }
    schemas.append(&mut channels);
    schemas
}

/// The messages of a chunk.
#[derive(Default)]
struct MessageChunk {
    records: Vec<u8>,
    /// For each channel, the times of its messages and their offsets in the chunk.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
}

/// The earliest and the latest time of some messages.
type Times = Option<(u64, u64)>;

fn including(times: Times, time_ns: u64) -> Times {
    let (first, last) = times.unwrap_or((time_ns, time_ns));
    Some((first.min(time_ns), last.max(time_ns)))
}

/// The file as written so far.
struct McapWriter<'o> {
    out: &'o mut dyn Write,
    length: u64,
    chunk: MessageChunk,
    /// The records with the positions of the chunks.
    chunk_indexes: Vec<Vec<u8>>,
    counts: BTreeMap<u16, u64>,
    times: Times,
}

impl McapWriter<'_> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.length += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    fn record(&mut self, kind: u8, content: &[u8]) -> io::Result<()> {
        self.put(&[kind])?;
        self.put(&(content.len() as u64).to_le_bytes())?;
        self.put(content)
    }

    fn message(&mut self, channel: u16, entry: &Entry<'_>, json: &[u8]) -> io::Result<()> {
        let place = self.chunk.records.len() as u64;
        // The sequence number has 32 bits; the low bits of the job suffice to find gaps.
        let [low @ .., _, _, _, _] = entry.job.to_le_bytes();
        let fixed = to_bytes(&(channel, low, entry.at_ns, entry.release_ns));
        let length = (fixed.len() + json.len()) as u64;
        let records = &mut self.chunk.records;
        records.extend(to_bytes(&(MESSAGE, length)));
        records.extend(fixed);
        records.extend(json);
        self.chunk
            .index
            .entry(channel)
            .or_default()
            .push((entry.at_ns, place));
        *self.counts.entry(channel).or_default() += 1;
        self.times = including(self.times, entry.at_ns);
        match self.chunk.records.len() < CHUNK_BYTES {
            true => Ok(()),
            false => self.end_chunk(),
        }
    }

    /// Writes the messages so far as a chunk, with its index.
    fn end_chunk(&mut self) -> io::Result<()> {
        let MessageChunk { records, index } = std::mem::take(&mut self.chunk);
        // An empty chunk would have no times.
        if records.is_empty() {
            return Ok(());
        }
        let all = index.values().flatten();
        let times = all.fold(None, |times, &(time_ns, _)| including(times, time_ns));
        let (first, last) = times.unwrap_or_default();
        let size = records.len() as u64;
        let mut crc = Crc::new();
        crc.update(&records);
        // An empty name means no compression, so both sizes are equal.
        let none = String::new();
        let mut content = to_bytes(&(first, last, size, crc.value(), none.clone(), size));
        content.extend(records);
        let chunk_start = self.length;
        self.record(CHUNK, &content)?;
        let index_start = self.length;

        let mut places = Vec::new();
        for (channel, messages) in index {
            places.extend(to_bytes(&(channel, self.length)));
            let entries: Vec<u8> = messages.iter().flat_map(to_bytes).collect();
            self.record(MESSAGE_INDEX, &to_bytes(&(channel, entries)))?;
        }

        let of_chunk = (first, last, chunk_start, index_start - chunk_start);
        let of_index = (places, self.length - index_start);
        let content = to_bytes(&(of_chunk, of_index, none, size, size));
        self.chunk_indexes.push(content);
        Ok(())
    }

    /// Writes the summary after the messages, and returns their number.
    fn summary(&mut self, channels: &[(u8, Vec<u8>)]) -> io::Result<u64> {
        let start = self.length;
        let messages: u64 = self.counts.values().sum();
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        // `channels` contains a schema and a channel for each.
        let of_each = u16::try_from(channels.len() / 2).unwrap_or(u16::MAX);
        let no_attachments_and_metadata = [0_u32; 2];
        let counts: Vec<u8> = self
            .counts
            .iter()
            .flat_map(|(channel, count)| to_bytes(&(*channel, *count)))
            .collect();
        let statistics = to_bytes(&(
            messages,
            of_each,
            u32::from(of_each),
            no_attachments_and_metadata,
            count(self.chunk_indexes.len()),
            self.times.unwrap_or_default(),
            counts,
        ));

        let indexes = std::mem::take(&mut self.chunk_indexes);
        let indexes = indexes.into_iter().map(|content| (CHUNK_INDEX, content));
        let statistics = [(STATISTICS, statistics)];
        // Schemas and channels are repeated, so a reader needs the summary alone.
        let all = channels.iter().cloned().chain(indexes).chain(statistics);
        for (kind, content) in all {
            self.record(kind, &content)?;
        }
        // No offsets within the summary: it is short.
        self.record(FOOTER, &to_bytes(&(start, 0_u64, 0_u32)))?;
        self.put(MAGIC)?;
        Ok(messages)
    }
}

/// Returns the schema of a channel's messages: the job, and a value of this type.
pub(super) fn of_message(schema: &Schema) -> String {
    let job = Schema::Scalar(Scalar::U64);
    object([("job", &job), ("value", schema)].into_iter()).into_text()
}

/// Writes a message: the job, and a value of this type.
///
/// # Errors
///
/// The bytes are no value of the type.
pub(super) fn write_message(
    (job, schema, bytes): (u64, &Schema, &[u8]),
    out: &mut String,
) -> Result<(), Malformed> {
    // Writing into a `String` cannot fail.
    let _ = write!(out, "{{\"job\":{job}");
    let mut input = Decoder::new(bytes);
    let mut values = ValueWriter {
        input: &mut input,
        out,
    };
    values.write_field("value", schema)?;
    out.push('}');
    input.expect_end()
}

fn object<'s>(fields: impl Iterator<Item = (impl Display, &'s Schema)>) -> Object {
    let (mut properties, mut required) = (Object::new(), Vec::new());
    for (name, schema) in fields {
        let name = name.to_string();
        properties = properties.json(&name, &schema_text(schema));
        if !may_lack(schema) {
            required.push(quoted(&name));
        }
    }
    Object::new()
        .text("type", "object")
        .json("properties", &properties.into_text())
        .list("required", required)
}

/// Reports whether a part of this type may be left out.
fn may_lack(schema: &Schema) -> bool {
    match schema {
        Schema::Scalar(Scalar::F32 | Scalar::F64) | Schema::Option(_) => true,
        Schema::List(element) | Schema::Array(element, _) => {
            // A single NaN in an array of numbers leaves out the whole array.
            !is_wrapped(element) && may_lack(element)
        }
        _ => false,
    }
}

/// Reports whether an element of this type becomes an object of its own.
fn is_wrapped(schema: &Schema) -> bool {
    matches!(
        schema,
        Schema::Option(_) | Schema::List(_) | Schema::Array(..)
    )
}

fn schema_text(schema: &Schema) -> String {
    let of_type = |name| Object::new().text("type", name);
    let wrapped = |inner| object([("value", inner)].into_iter()).into_text();
    let of_element = |element| match is_wrapped(element) {
        true => wrapped(element),
        false => schema_text(element),
    };
    match schema {
        Schema::Scalar(scalar) => match scalar.name().as_bytes() {
            b"bool" => of_type("boolean").into_text(),
            b"char" | b"text" => of_type("string").into_text(),
            [b'f', ..] => of_type("number").into_text(),
            [b'u', ..] => of_type("integer").number("minimum", 0_u8).into_text(),
            _ => of_type("integer").into_text(),
        },
        Schema::Option(inner) if matches!(**inner, Schema::Option(_)) => wrapped(inner),
        Schema::Option(inner) => schema_text(inner),
        Schema::List(element) => of_type("array")
            .json("items", &of_element(element))
            .into_text(),
        Schema::Array(element, count) => of_type("array")
            .json("items", &of_element(element))
            .number("minItems", *count)
            .number("maxItems", *count)
            .into_text(),
        Schema::Tuple(elements) => object((0..).zip(elements)).into_text(),
        Schema::Struct(name, fields) => object(named(fields)).text("title", name).into_text(),
    }
}

fn named(fields: &[Field]) -> impl Iterator<Item = (&str, &Schema)> {
    fields.iter().map(|field| (&*field.name, &field.schema))
}

/// Writes values, each behind the previous value.
struct ValueWriter<'v, 'b> {
    input: &'v mut Decoder<'b>,
    out: &'v mut String,
}

impl ValueWriter<'_, '_> {
    /// Writes a field after others, if the field has a value.
    fn write_field(&mut self, name: impl Display, schema: &Schema) -> Result<(), Malformed> {
        let before = self.out.len();
        let comma = if self.out.ends_with('{') { "" } else { "," };
        let _ = write!(self.out, "{comma}{}:", quoted(&name.to_string()));
        if !self.write(schema)? {
            // Without a value, the field's name is removed, too.
            self.out.truncate(before);
        }
        Ok(())
    }

    fn write_object<'s>(
        &mut self,
        fields: impl Iterator<Item = (impl Display, &'s Schema)>,
    ) -> Result<bool, Malformed> {
        self.out.push('{');
        for (name, schema) in fields {
            self.write_field(name, schema)?;
        }
        self.out.push('}');
        Ok(true)
    }

    fn write_array(&mut self, element: &Schema, count: u32) -> Result<bool, Malformed> {
        let mut has_all = true;
        for number in 0..count {
            self.out.push(if number == 0 { '[' } else { ',' });
            // All elements are read in any case: the next field begins behind them.
            has_all &= match is_wrapped(element) {
                true => self.write_object([("value", element)].into_iter())?,
                false => self.write(element)?,
            };
        }
        *self.out += if count == 0 { "[]" } else { "]" };
        Ok(has_all)
    }

    /// Writes a value. Returns `false` for a missing value; the caller then drops the text.
    fn write(&mut self, schema: &Schema) -> Result<bool, Malformed> {
        match schema {
            Schema::Scalar(_) => self.write_scalar(schema),
            Schema::Option(inner) => match (bool::decode(self.input)?, &**inner) {
                (false, _) => Ok(false),
                (true, Schema::Option(_)) => self.write_object([("value", &**inner)].into_iter()),
                (true, inner) => self.write(inner),
            },
            Schema::List(element) => {
                let count = u32::decode(self.input)?;
                self.write_array(element, count)
            }
            Schema::Array(element, count) => self.write_array(element, *count),
            Schema::Tuple(elements) => self.write_object((0..).zip(elements)),
            Schema::Struct(_, fields) => self.write_object(named(fields)),
        }
    }

    fn write_scalar(&mut self, schema: &Schema) -> Result<bool, Malformed> {
        let (mut real, mut text) = (0.0, String::new());
        schema.walk(self.input, &mut |part| {
            real = match part {
                Part::Single(number) => number.into(),
                Part::Double(number) => number,
                _ => 0.0,
            };
            text = part.to_string();
        })?;
        *self.out += match real {
            // Shown as `null`, an infinite number would be left out like NaN.
            f64::INFINITY => "1e999",
            f64::NEG_INFINITY => "-1e999",
            _ => &text,
        };
        Ok(!real.is_nan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;
    use views::json::{Value, parse};

    /// Returns all types up to a depth of nesting.
    fn types(depth: u32) -> Vec<String> {
        let scalars = ["bool", "text", "u16", "i64", "f64"].map(String::from);
        let deeper = |inner: String| {
            ["T?", "[T]", "[T; 2]", "(T, f64)", "Whole { of: T }"].map(|of| of.replace('T', &inner))
        };
        let inner = depth.checked_sub(1).map_or(Vec::new(), types);
        inner.into_iter().flat_map(deeper).chain(scalars).collect()
    }

    fn draw_value(random: &mut Random, schema: &Schema, bytes: &mut Vec<u8>) {
        let choice = random.within(0..=4_u16);
        let number = usize::from(choice);
        let mut draw = |schema| draw_value(random, schema, bytes);
        match schema {
            Schema::Scalar(scalar) => bytes.extend(match scalar.name() {
                "bool" => to_bytes(&(choice < 2)),
                "text" => to_bytes(&String::from(["", "{", "a\"\n", ",", "null"][number])),
                "u16" => to_bytes(&choice),
                "i64" => to_bytes(&-i64::from(choice)),
                _ => to_bytes(&[0.5, -1e300, f64::NAN, f64::INFINITY, 7.0][number]),
            }),
            Schema::Option(inner) => {
                bytes.push(u8::from(choice < 3));
                (0..u8::from(choice < 3)).for_each(|_| draw_value(random, inner, bytes));
            }
            Schema::List(element) => {
                bytes.extend(u32::from(choice).to_le_bytes());
                (0..choice).for_each(|_| draw_value(random, element, bytes));
            }
            Schema::Array(element, count) => (0..*count).for_each(|_| draw(element)),
            Schema::Tuple(parts) => parts.iter().for_each(draw),
            Schema::Struct(_, fields) => fields.iter().for_each(|field| draw(&field.schema)),
        }
    }

    /// Reports whether Foxglove's and Lichtblick's `parseJsonSchema` accepts a part of a schema,
    /// and the part has no other members.
    fn is_taken(part: &Value, is_element: bool) -> bool {
        let Value::Object(members) = part else {
            return false;
        };
        let kind = part.get("type").and_then(Value::as_text);
        let says = match (kind, part.get("properties"), part.get("items")) {
            (Some("boolean" | "string" | "number"), None, None) => vec![],
            (Some("integer"), None, None) => vec!["minimum"],
            (Some("object"), Some(Value::Object(fields)), None)
                if fields.iter().all(|(_, field)| is_taken(field, false)) =>
            {
                vec!["properties", "required", "title"]
            }
            (Some("array"), None, Some(items)) if !is_element && is_taken(items, true) => {
                vec!["items", "minItems", "maxItems"]
            }
            _ => return false,
        };
        (members.iter()).all(|(name, _)| name == "type" || says.contains(&&**name))
    }

    /// Reports whether a value matches a schema.
    fn is_of(schema: &Value, value: &Value) -> bool {
        let bound = |name| schema.get(name).and_then(Value::as_u64);
        match (schema.get("type").and_then(Value::as_text), value) {
            (Some("boolean"), Value::Bool(_))
            | (Some("string"), Value::Text(_))
            | (Some("number"), Value::Integer(_) | Value::Decimal(_)) => true,
            (Some("integer"), Value::Integer(number)) => *number >= 0 || bound("minimum").is_none(),
            (Some("array"), Value::Array(elements)) => {
                let count = elements.len() as u64;
                let items = schema.get("items").expect("items");
                (bound("minItems").is_none_or(|least| least <= count))
                    && bound("maxItems").is_none_or(|most| most >= count)
                    && elements.iter().all(|element| is_of(items, element))
            }
            (Some("object"), Value::Object(fields)) => {
                let required = schema.get("required").expect("a list").elements();
                let is_there = |name: &Value| value.get(name.as_text().expect("a name")).is_some();
                let is_right = |(name, field): &(String, Value)| {
                    (schema.at(&["properties", name])).is_some_and(|schema| is_of(schema, field))
                };
                required.iter().all(is_there) && fields.iter().all(is_right)
            }
            _ => false,
        }
    }

    #[test]
    fn viewers_take_every_schema_and_each_value_is_of_its_schema() {
        let mut random = Random::new(1);
        for name in types(3) {
            let schema = Schema::parse(&name).expect(&name);
            let text = of_message(&schema);
            let json = parse(&text).expect(&text);
            assert!(is_taken(&json, false), "{name}: {text}");
            for job in 0..20 {
                let (mut bytes, mut message) = (Vec::new(), String::new());
                draw_value(&mut random, &schema, &mut bytes);
                write_message((job, &schema, &bytes), &mut message).expect("a value");
                // Our own reader takes no number that is beyond its range.
                let value = parse(&message.replace("1e999", "1e300")).expect(&message);
                assert!(is_of(&json, &value), "{name}: {text}: {message}");
            }
        }
    }

    #[test]
    fn a_value_is_whole_but_for_what_json_cannot_say() {
        type Parts = (
            Option<u8>,
            f64,
            [f32; 2],
            Vec<Option<[f64; 1]>>,
            [[i8; 1]; 2],
        );
        let message = |parts: &Parts| {
            let mut message = String::new();
            write_message((7, &Parts::schema(), &to_bytes(parts)), &mut message).expect("one");
            message
        };
        let (reals, fields) = ([-f32::INFINITY, 2.0], vec![Some([3.0]), None]);
        let whole = r#"{"job":7,"value":{"0":1,"1":0.5,"2":[-1e999,2.0],"3":[{"value":[3.0]},{}],"4":[{"value":[4]},{"value":[5]}]}}"#;
        assert_eq!(message(&(Some(1), 0.5, reals, fields, [[4], [5]])), whole);
        let (reals, fields) = ([f32::NAN, 2.0], vec![Some([f64::NAN])]);
        let rest = r#"{"job":7,"value":{"3":[{}],"4":[{"value":[4]},{"value":[5]}]}}"#;
        assert_eq!(message(&(None, f64::NAN, reals, fields, [[4], [5]])), rest);
    }
}
