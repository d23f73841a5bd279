//! Writing a recording frame by frame, to whatever takes bytes.

use alloc::vec::Vec;

use super::commit::Commit;
use super::entry::{Entry, What};
use super::header::Header;
use super::times::Times;
use super::{COMMIT, CUT, END, ENTRY, EVENTS, HEADER, MAGIC, TEXT, TIMES, VERSION};
use crate::value::crc::Crc;
use crate::value::encode::Encoder;
use crate::value::recordable::to_bytes;

/// A place that takes the bytes of a recording.
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

/// Writes a recording piece by piece. After the header, entries and events allocate nothing.
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
    /// Of all bytes that are no checksums.
    crc: Crc,
    entries: u64,
    lost: u64,
    to: S,
}

/// Writes a recording into memory.
///
/// ```
/// use recording::{Channel, DagHeader, Entry, Header, Recordable, Recording, Role, What, Writer};
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
///     what: What::Value,
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

/// The bytes of events before the first one.
const EVENTS_HEAD: usize = 10;

impl Writer {
    /// Begins a recording.
    ///
    /// See [`Writer`].
    #[must_use]
    pub fn new(header: &Header) -> Self {
        let mut writer = Self::begin(Vec::new());
        writer.header(header);
        writer
    }
}

impl<S: Sink> Stream<S> {
    /// Begins a recording.
    ///
    /// See [`Stream`].
    pub fn begin(to: S) -> Self {
        let mut stream = Self::behind(Crc::new(), (0, 0), to);
        stream.put(&MAGIC);
        stream.put(&VERSION.to_le_bytes());
        stream
    }

    /// Goes on behind a part of a recording, all of whose frames are whole.
    pub(super) const fn behind(crc: Crc, (entries, lost): (u64, u64), to: S) -> Self {
        Self {
            crc,
            entries,
            lost,
            to,
        }
    }

    /// Lends what takes the bytes.
    ///
    /// See [`Stream`].
    pub const fn sink(&mut self) -> &mut S {
        &mut self.to
    }

    /// Ends the recording, and returns what has taken its bytes. One in which something is lost
    /// says so.
    ///
    /// See [`Writer`].
    pub fn end(mut self) -> S {
        self.finish(END);
        self.to
    }

    /// Ends a recording that says nothing of what happened after its last entry.
    ///
    /// See [`Stream`].
    pub fn cut(mut self) -> S {
        self.finish(CUT);
        self.to
    }
}

impl<S: Sink + ?Sized> Stream<S> {
    /// Says what the recording is of; once, before the first entry.
    ///
    /// See [`Stream`].
    pub fn header(&mut self, header: &Header) {
        self.whole(HEADER, &[&to_bytes(header)]);
    }

    /// Adds an entry. It has to fit to the header, or the recording will be refused.
    ///
    /// # Panics
    ///
    /// If the value has 4 GiB or more.
    ///
    /// See [`Writer`].
    pub fn write(&mut self, entry: &Entry<'_>) {
        self.entries += 1;
        self.lost += u64::from(entry.what == What::Lost);
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
    /// If it has 4 GiB or more.
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

    /// Adds what was committed; what follows is of these DAGs.
    ///
    /// See [`Commit`].
    pub fn commit(&mut self, commit: &Commit) {
        self.whole(COMMIT, &[&to_bytes(commit)]);
    }

    /// Adds events of a cluster's journal, of which so many came before.
    ///
    /// See [`Events`](crate::Events).
    pub fn events(&mut self, cluster: u16, before: u64, words: &[[u64; 3]]) {
        let mut head = [0; EVENTS_HEAD];
        crate::Recordable::encode(&(cluster, before), &mut Encoder::new(&mut head));
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
        self.whole(TIMES, &[&to_bytes(times)]);
    }

    /// Returns the number of entries so far.
    ///
    /// See [`Stream`].
    #[must_use]
    pub const fn entries(&self) -> u64 {
        self.entries
    }

    /// Returns how many of these are of what was lost.
    ///
    /// See [`Stream`].
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    pub(super) fn finish(&mut self, kind: u8) {
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
        self.to.put(&self.crc.value().to_le_bytes());
    }
}
