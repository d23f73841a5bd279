//! A recording as an MCAP file, by the specification on mcap.dev, version 0.
//!
//! A channel for each of the recording's, named `/DAG/TOPIC`, and for what else happened
//! `/DAG/events`. A message is a JSON object, the job and the value, logged when the instance
//! was complete and published at the job's nominal release. Messages stand in chunks without
//! compression, each with its index, so that a reader finds a time without reading all.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, Write};

use recording::{Crc, Entry, Header, Recording, Role, What};

use super::mcap_json::{of_message, write_message};
use crate::json::Object;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// The records' kinds.
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0b;
const SUMMARY_OFFSET: u8 = 0x0e;
const DATA_END: u8 = 0x0f;

/// The bytes of messages after which a chunk ends.
const CHUNK_BYTES: usize = 1 << 20;

/// Writes a recording, and returns the number of messages.
///
/// # Errors
///
/// What the output says.
pub fn write(recording: &Recording<'_>, out: &mut dyn Write) -> io::Result<u64> {
    let header = recording.header();
    let channels = channels(header);
    let mut file = File {
        out,
        length: 0,
        chunk: Chunk::default(),
        chunk_indexes: Vec::new(),
        counts: BTreeMap::new(),
        times: None,
    };
    file.put(MAGIC)?;
    let mut about = Vec::new();
    text(&mut about, "");
    text(&mut about, concat!("fass-tool ", env!("CARGO_PKG_VERSION")));
    file.record(HEADER, &about)?;
    for (kind, content) in &channels {
        file.record(*kind, content)?;
    }
    let mut json = String::new();
    for entry in recording.entries() {
        let channel = message(header, &entry, &mut json);
        file.message(channel, &entry, json.as_bytes())?;
    }
    file.end_chunk()?;
    // Checksums of files are optional; each chunk has one.
    file.record(DATA_END, &0_u32.to_le_bytes())?;
    file.summary(&channels)
}

/// Returns the number of the channel that an entry is in, and writes its message.
fn message(header: &Header, entry: &Entry<'_>, json: &mut String) -> u16 {
    json.clear();
    let number = |index: usize| u16::try_from(index).unwrap_or(u16::MAX);
    let channel = header.channels.get(usize::from(entry.place));
    match (entry.what, channel) {
        (What::Value, Some(channel)) => {
            // The reader has gone through every value.
            let _ = write_message((entry.job, &channel.schema, entry.value), json);
            entry.place
        }
        (what, channel) => {
            let subtask = match what {
                What::Lost => channel.map_or(entry.place, |channel| channel.subtask),
                _ => entry.place,
            };
            let event = Object::new()
                .text("what", what.name())
                .number("subtask", subtask);
            // Writing into a `String` cannot fail.
            let _ = write!(json, "{{\"job\":{},\"value\":{}}}", entry.job, event.end());
            number(header.channels.len()).saturating_add(entry.dag)
        }
    }
}

/// Returns the records of schemas and channels: those of the recording, then one of each DAG
/// for what else happened.
fn channels(header: &Header) -> Vec<(u8, Vec<u8>)> {
    let event = "Event { what: text, subtask: u16 }";
    let event = recording::Schema::parse(event).expect("it is a schema");
    let dag = |number: u16| &header.dags[usize::from(number)].name;
    let of_values = header.channels.iter().map(|channel| {
        let found = match channel.role {
            Role::Sample => "/sampled",
            Role::State => "/state",
            Role::Source | Role::Result => "",
        };
        let topic = format!("/{}/{}{found}", dag(channel.dag), channel.topic);
        (topic, channel.role.name(), &channel.schema)
    });
    let of_events =
        (header.dags.iter()).map(|dag| (format!("/{}/events", dag.name), "events", &event));
    let (mut schemas, mut channels) = (Vec::new(), Vec::new());
    for (id, (topic, role, schema)) in (0_u16..).zip(of_values.chain(of_events)) {
        let mut content = Vec::new();
        // No schema has the number 0.
        content.extend((id + 1).to_le_bytes());
        text(&mut content, &schema.to_string());
        text(&mut content, "jsonschema");
        text(&mut content, &of_message(schema));
        schemas.push((SCHEMA, content));
        let mut content = Vec::new();
        content.extend(id.to_le_bytes());
        content.extend((id + 1).to_le_bytes());
        text(&mut content, &topic);
        text(&mut content, "json");
        let mut metadata = Vec::new();
        text(&mut metadata, "role");
        text(&mut metadata, role);
        bytes(&mut content, &metadata);
        channels.push((CHANNEL, content));
    }
    schemas.append(&mut channels);
    schemas
}

/// Adds bytes with their number before them.
fn bytes(to: &mut Vec<u8>, content: &[u8]) {
    // What is described here has names of some bytes.
    let length = u32::try_from(content.len()).unwrap_or(u32::MAX);
    to.extend(length.to_le_bytes());
    to.extend(content);
}

fn text(to: &mut Vec<u8>, text: &str) {
    bytes(to, text.as_bytes());
}

/// Returns numbers as bytes, one behind the other.
fn longs<const COUNT: usize>(numbers: [u64; COUNT]) -> impl Iterator<Item = u8> {
    numbers.into_iter().flat_map(u64::to_le_bytes)
}

/// The messages that are written together.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    /// By channel, the times of the messages and where they stand.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
}

/// The earliest and the latest time of messages.
type Times = Option<(u64, u64)>;

fn including(times: Times, time_ns: u64) -> Times {
    let (first, last) = times.unwrap_or((time_ns, time_ns));
    Some((first.min(time_ns), last.max(time_ns)))
}

/// The file as far as it is written.
struct File<'o> {
    out: &'o mut dyn Write,
    length: u64,
    chunk: Chunk,
    /// The records that say where the chunks are.
    chunk_indexes: Vec<Vec<u8>>,
    counts: BTreeMap<u16, u64>,
    times: Times,
}

impl File<'_> {
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
        let records = &mut self.chunk.records;
        records.push(MESSAGE);
        records.extend((22 + json.len() as u64).to_le_bytes());
        records.extend(channel.to_le_bytes());
        // A counter of 32 bits; its low bits are enough to find gaps.
        let [low @ .., _, _, _, _] = entry.job.to_le_bytes();
        records.extend(low);
        records.extend(longs([entry.at_ns, entry.release_ns]));
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

    /// Writes the messages so far, and their index.
    fn end_chunk(&mut self) -> io::Result<()> {
        let Chunk { records, index } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let all = index.values().flatten();
        let times = all.fold(None, |times, &(time_ns, _)| including(times, time_ns));
        let (first, last) = times.unwrap_or_default();
        let size = records.len() as u64;
        let mut crc = Crc::new();
        crc.update(&records);
        let mut content = Vec::with_capacity(records.len() + 64);
        content.extend(longs([first, last, size]));
        content.extend(crc.value().to_le_bytes());
        text(&mut content, "");
        content.extend(longs([size]));
        content.extend(records);
        let chunk_start = self.length;
        self.record(CHUNK, &content)?;
        let index_start = self.length;

        let mut places = Vec::new();
        for (channel, messages) in index {
            places.extend(channel.to_le_bytes());
            places.extend(self.length.to_le_bytes());
            let mut entries = Vec::with_capacity(messages.len() * 16);
            for (time_ns, place) in messages {
                entries.extend(longs([time_ns, place]));
            }
            let mut content = channel.to_le_bytes().to_vec();
            bytes(&mut content, &entries);
            self.record(MESSAGE_INDEX, &content)?;
        }

        let mut content = Vec::new();
        content.extend(longs([first, last, chunk_start, index_start - chunk_start]));
        bytes(&mut content, &places);
        content.extend(longs([self.length - index_start]));
        text(&mut content, "");
        content.extend(longs([size, size]));
        self.chunk_indexes.push(content);
        Ok(())
    }

    /// Writes what stands after the messages, and returns their number.
    fn summary(&mut self, channels: &[(u8, Vec<u8>)]) -> io::Result<u64> {
        let start = self.length;
        let messages: u64 = self.counts.values().sum();
        let mut statistics = messages.to_le_bytes().to_vec();
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let of_each = u16::try_from(channels.len() / 2).unwrap_or(u16::MAX);
        statistics.extend(of_each.to_le_bytes());
        statistics.extend(u32::from(of_each).to_le_bytes());
        // No attachments, no metadata.
        statistics.extend([0; 8]);
        statistics.extend(count(self.chunk_indexes.len()).to_le_bytes());
        let (first, last) = self.times.unwrap_or_default();
        statistics.extend(longs([first, last]));
        let mut counts = Vec::new();
        for (channel, count) in &self.counts {
            counts.extend(channel.to_le_bytes());
            counts.extend(count.to_le_bytes());
        }
        bytes(&mut statistics, &counts);

        let indexes = std::mem::take(&mut self.chunk_indexes);
        let indexes = indexes.into_iter().map(|content| (CHUNK_INDEX, content));
        let statistics = [(STATISTICS, statistics)];
        let all = channels.iter().cloned().chain(indexes).chain(statistics);
        let mut groups: Vec<(u8, u64, u64)> = Vec::new();
        for (kind, content) in all {
            let start = self.length;
            self.record(kind, &content)?;
            match groups.last_mut().filter(|(of, ..)| *of == kind) {
                Some((_, start, length)) => *length = self.length - *start,
                None => groups.push((kind, start, self.length - start)),
            }
        }
        let offsets = self.length;
        for (kind, start, length) in groups {
            let mut content = vec![kind];
            content.extend(longs([start, length]));
            self.record(SUMMARY_OFFSET, &content)?;
        }
        let mut footer: Vec<u8> = longs([start, offsets]).collect();
        footer.extend(0_u32.to_le_bytes());
        self.record(FOOTER, &footer)?;
        self.put(MAGIC)?;
        Ok(messages)
    }
}
