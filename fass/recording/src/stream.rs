//! The file: a mark, a header, entries, and an end, each with a checksum.
//!
//! ```text
//! 0x89 "FASSREC"  version, 2 bytes   then frames:
//! kind, 1 byte    length, 4 bytes    payload    checksum, 4 bytes
//! ```
//!
//! A frame's checksum covers all bytes from the file's first byte on, except checksums. So an
//! altered, missing, doubled or moved frame is found, and so is a cut at the end of a frame, by the
//! missing end frame. There are two kinds of ends. One ends a recording that accounts for
//! everything, if only as lost. The other ends a recording that knows nothing about the time after
//! its last entry; [`mended`](crate::mended) adds this end to the bytes left by a run that died.
//! Between entries there may be other facts about the run: its [commits](crate::Commit), the events
//! of its journals, the [times](crate::Times) of ended runs, and lines of text.
//!
//! Recordings are written here, frame by frame, to any sink of bytes.

use alloc::vec::Vec;

use super::bytes::Encoder;
use super::entry::{Commit, Times};
use super::entry::{Entry, EntryKind, Header};
use super::recordable::to_bytes;

/// The first bytes of each recording. The first byte is not text, so a transfer in text mode is
/// detected; it would alter the rest.
pub const MAGIC: [u8; 8] = *b"\x89FASSREC";

/// The version of the written format, including values. Earlier versions are read, too. The first
/// version has no entries of [`EntryKind::Clock`], and neither of [`EntryKind::Fault`]. Versions
/// before 4 have no text. Those before 5 have no commits, events and times, and no
/// [states](crate::Role::State). Those before 6 have no [waits](Commit::waits) and no
/// [answers](crate::Role::Answer). Those before 7 have no [pins](Commit::pins) and
/// [affinities](Commit::affinities). Those before 8 have no [answers](Commit::answers) and
/// [locks](Commit::locks), those before 9 no [device](Commit::device_ns), and those before 10 no
/// [lists](Commit::lists); version 10 has no pins.
pub const VERSION: u16 = 10;

/// The kinds of frames.
pub(super) const HEADER: u8 = 1;
pub(super) const ENTRY: u8 = 2;
pub(super) const END: u8 = 3;
pub(super) const CUT: u8 = 4;
pub(super) const TEXT: u8 = 5;
pub(super) const COMMIT: u8 = 6;
pub(super) const EVENTS: u8 = 7;
pub(super) const TIMES: u8 = 8;

/// The polynomial, its lowest power first.
const POLYNOMIAL: u32 = 0xedb8_8320;

/// The effect of eight zero bits on each value of the lowest byte.
static TABLE: [u32; 256] = table();

const fn table() -> [u32; 256] {
    let mut table = [0_u32; 256];
    let mut byte = 0_u32;
    while byte < 256 {
        let mut value = byte;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 1 == 1 {
                value >> 1 ^ POLYNOMIAL
            } else {
                value >> 1
            };
            bit += 1;
        }
        table[byte as usize] = value;
        byte += 1;
    }
    table
}

/// A checksum of bytes given piece by piece.
///
/// ```
/// use recording::Crc;
///
/// let mut crc = Crc::new();
/// crc.update(b"1234");
/// crc.update(b"56789");
/// assert_eq!(crc.value(), 0xcbf4_3926);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crc(u32);

impl Crc {
    /// Begins without any byte.
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Adds more bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |crc, &byte| {
            let [low, ..] = crc.to_le_bytes();
            TABLE[usize::from(low ^ byte)] ^ crc >> 8
        });
    }

    /// Returns the checksum of all bytes so far.
    pub const fn value(self) -> u32 {
        !self.0
    }
}

impl Default for Crc {
    fn default() -> Self {
        Self::new()
    }
}

/// A destination for the bytes of a recording.
///
/// See [`Stream`].
pub trait Sink {
    /// Takes the next bytes.
    fn put(&mut self, bytes: &[u8]);
}

impl Sink for Vec<u8> {
    fn put(&mut self, bytes: &[u8]) {
        self.extend_from_slice(bytes);
    }
}

impl Sink for fn(&[u8]) {
    fn put(&mut self, bytes: &[u8]) {
        self(bytes);
    }
}

/// Writes a recording piece by piece. After the header, entries and events allocate nothing, unless
/// the sink does.
///
/// ```
/// use recording::{Header, Recording, Stream};
///
/// let mut stream = Stream::begin(Vec::new());
/// stream.header(&Header::default());
/// assert!(Recording::read(&stream.cut()).unwrap().is_cut());
/// ```
#[derive(Clone, Debug)]
pub struct Stream<S: ?Sized> {
    /// Over all bytes except checksums.
    crc: Crc,
    entries: u64,
    lost: u64,
    to: S,
}

/// Writes a recording into memory.
///
/// ```
/// use recording::{Channel, DagHeader, Entry, Header, Recordable, Recording, Role, EntryKind, Writer};
///
/// let header = Header {
///     app: "demo".into(),
///     dags: vec![DagHeader { name: "wheel".into(), graph: 0 }],
///     channels: vec![Channel {
///         dag: 0,
///         subtask: 0,
///         role: Role::Source,
///         topic: "turns".into(),
///         schema: u32::schema(),
///     }],
/// };
/// let mut writer = Writer::new(&header);
/// writer.write(&Entry {
///     what: EntryKind::Value,
///     dag: 0,
///     place: 0,
///     job: 0,
///     release_ns: 0,
///     at_ns: 20,
///     value: &recording::to_bytes(&7_u32),
/// });
/// let mut bytes = writer.end();
///
/// let recording = Recording::read(&bytes).unwrap();
/// assert_eq!((recording.header(), recording.lost()), (&header, 0));
/// let entry = recording.entries().next().unwrap();
/// assert_eq!((entry.at_ns, u32::from_bytes(entry.value)), (20, Ok(7)));
///
/// let last = bytes.pop().unwrap();
/// let malformed = Recording::read(&bytes).unwrap_err();
/// assert!(malformed.to_string().ends_with("expected 4 bytes of a checksum, and more after them"));
/// bytes.push(last ^ 1);
/// assert!(Recording::read(&bytes).is_err());
/// ```
pub type Writer = Stream<Vec<u8>>;

/// The bytes of an entry before its value.
const ENTRY_HEAD: usize = 29;

/// The bytes of events before the first event.
const EVENTS_HEAD: usize = 10;

impl Writer {
    /// Begins a recording.
    pub fn new(header: &Header) -> Self {
        let mut writer = Self::begin(Vec::new());
        writer.header(header);
        writer
    }
}

impl<S: Sink> Stream<S> {
    /// Begins a recording.
    pub fn begin(to: S) -> Self {
        let mut stream = Self::behind(Crc::new(), (0, 0), to);
        stream.put(&MAGIC);
        // Right behind the mark, in every version: so a reader recognises versions it cannot read.
        stream.put(&VERSION.to_le_bytes());
        stream
    }

    /// Goes on behind a part of a recording consisting of whole frames.
    pub(super) const fn behind(crc: Crc, (entries, lost): (u64, u64), to: S) -> Self {
        Self {
            crc,
            entries,
            lost,
            to,
        }
    }

    /// Lends the sink.
    pub const fn sink(&mut self) -> &mut S {
        &mut self.to
    }

    /// Ends the recording, and returns its sink. The end states whether anything is lost.
    ///
    /// See [`Writer`].
    pub fn end(mut self) -> S {
        self.finish(END);
        self.to
    }

    /// Ends a recording that knows nothing about the time after its last entry.
    pub fn cut(mut self) -> S {
        self.finish(CUT);
        self.to
    }
}

impl<S: Sink + ?Sized> Stream<S> {
    /// Adds the header; once, before the first entry.
    pub fn header(&mut self, header: &Header) {
        self.whole(HEADER, &[&to_bytes(header)]);
    }

    /// Adds an entry. The entry has to fit the header, or the recording will be refused.
    ///
    /// # Panics
    ///
    /// If the value has 4 GiB or more.
    ///
    /// See [`Writer`].
    pub fn write(&mut self, entry: &Entry<'_>) {
        self.entries += 1;
        self.lost += u64::from(entry.what == EntryKind::Lost);
        // On the stack, and the value is written from its own place: an entry allocates nothing.
        let mut head = [0; ENTRY_HEAD];
        let mut out = Encoder::new(&mut head);
        Entry {
            value: &[],
            ..*entry
        }
        .encode(&mut out);
        self.whole(ENTRY, &[&head, entry.value]);
    }

    /// Adds a text.
    ///
    /// # Panics
    ///
    /// If the text has 4 GiB or more.
    ///
    /// ```
    /// use recording::{Chunk, Recording, Stream};
    ///
    /// let mut stream = Stream::begin(Vec::new());
    /// stream.text("{}\n");
    /// let bytes = stream.end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// assert!(matches!(recording.chunks().next(), Some(Chunk::Text("{}\n"))));
    /// ```
    pub fn text(&mut self, text: &str) {
        self.whole(TEXT, &[text.as_bytes()]);
    }

    /// Adds a commit. The parts written afterwards belong to its DAGs.
    ///
    /// See [`Commit`].
    pub fn commit(&mut self, commit: &Commit) {
        self.whole(COMMIT, &[&bytes_of_commit(commit)]);
    }

    /// Adds events of a cluster's journal; `before` counts the journal's earlier events.
    ///
    /// See [`Events`](crate::Events).
    pub fn events(&mut self, cluster: u16, before: u64, words: &[[u64; 3]]) {
        let mut head = [0; EVENTS_HEAD];
        crate::Recordable::encode(&(cluster, before), &mut Encoder::new(&mut head));
        // The length comes first, and is known without a copy of the events.
        self.head(EVENTS, EVENTS_HEAD + size_of_val(words));
        self.put(&head);
        for word in words.as_flattened() {
            self.put(&word.to_le_bytes());
        }
        self.checksum();
    }

    /// Adds the end of a run.
    ///
    /// See [`Times`].
    pub fn times(&mut self, times: &Times) {
        self.whole(TIMES, &[&bytes_of_times(times)]);
    }

    /// Returns the number of entries so far.
    pub const fn entries(&self) -> u64 {
        self.entries
    }

    /// Returns the number of entries for lost values.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    fn finish(&mut self, kind: u8) {
        // The counts are in the end, not in the header: the writer never goes back.
        self.whole(kind, &[&to_bytes(&(self.entries, self.lost))]);
    }

    /// Writes a frame.
    fn whole(&mut self, kind: u8, payload: &[&[u8]]) {
        self.head(kind, payload.iter().map(|part| part.len()).sum());
        payload.iter().for_each(|part| self.put(part));
        self.checksum();
    }

    fn head(&mut self, kind: u8, length: usize) {
        let length = u32::try_from(length).expect("a payload of less than 4 GiB");
        self.put(&[kind]);
        self.put(&length.to_le_bytes());
    }

    fn put(&mut self, bytes: &[u8]) {
        self.crc.update(bytes);
        self.to.put(bytes);
    }

    fn checksum(&mut self) {
        // Not by `put`: a checksum covers all bytes except the checksums themselves.
        self.to.put(&self.crc.value().to_le_bytes());
    }
}

/// Returns the bytes of a commit. Not generic, like the next function: so the code is compiled
/// here, for size, whatever the sink.
fn bytes_of_commit(commit: &Commit) -> Vec<u8> {
    to_bytes(commit)
}

fn bytes_of_times(times: &Times) -> Vec<u8> {
    to_bytes(times)
}
