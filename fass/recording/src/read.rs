//! Reading a recording without any trust in its bytes: its chunks, and the values of one channel by
//! their type.

use alloc::borrow::Cow;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt::{self, Debug};

use super::bytes::{Decoder, Malformed};
use super::entry::{Channel, Entry, EntryKind, Header};
use super::entry::{Commit, Times};
use super::recordable::Recordable;
use super::stream::{
    COMMIT, CUT, Crc, END, ENTRY, EVENTS, HEADER, MAGIC, Stream, TEXT, TIMES, VERSION,
};

/// A whole and unaltered recording.
///
/// See [`Writer`](crate::Writer).
#[derive(Clone, Debug)]
pub struct Recording<'b> {
    bytes: &'b [u8],
    read: Progress,
    is_cut: bool,
}

/// How far a recording was read, and the contents so far.
#[derive(Clone, Debug)]
struct Progress {
    header: Header,
    has_header: bool,
    /// The offset of the first frame, and the offset after the last whole frame.
    first: usize,
    last: usize,
    crc: Crc,
    count: u64,
    lost: u64,
}

/// A frame, and the offset of its payload.
struct Frame<'b> {
    kind: u8,
    offset: usize,
    payload: &'b [u8],
    checksum: u32,
}

const CHECKSUM: &str = "the checksum of all before; the file is altered";

impl<'b> Recording<'b> {
    /// Reads a whole recording once. Makes sure that the recording is complete, that no byte was
    /// altered, and that every value fits its type.
    ///
    /// # Errors
    ///
    /// The first place with an error.
    ///
    /// See [`Writer`](crate::Writer).
    pub fn read(bytes: &'b [u8]) -> Result<Self, Malformed> {
        let mut read = Progress::none();
        let is_cut = read.read(bytes)?;
        Ok(Self {
            bytes,
            read,
            is_cut,
        })
    }

    /// Returns the header, the recording's statement about itself.
    ///
    /// See [`Writer`](crate::Writer).
    pub const fn header(&self) -> &Header {
        &self.read.header
    }

    /// Returns the number of entries.
    ///
    /// See [`Writer`](crate::Writer).
    pub const fn count(&self) -> u64 {
        self.read.count
    }

    /// Returns the number of entries for lost values. If the number is 0 and the recording is not
    /// [cut](Self::is_cut), no entry is missing. (Journals may have lost events all the same.)
    ///
    /// See [`Writer`](crate::Writer).
    pub const fn lost(&self) -> u64 {
        self.read.lost
    }

    /// Reports whether the recording may lack more than the values marked as lost: the run died,
    /// the buffer was full of entries that must never be lost, or only the jobs before a fault were
    /// kept.
    ///
    /// See [`Stream`].
    pub const fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// Returns the entries, in the order of writing.
    ///
    /// See [`Writer`](crate::Writer).
    pub fn entries(&self) -> impl Iterator<Item = Entry<'b>> + Clone + Debug + use<'b> {
        // Decoded again, not kept: the memory needed for reading does not grow with the recording.
        let entries = self.frames().filter(|frame| frame.kind == ENTRY);
        entries.filter_map(|frame| Entry::decode(frame.payload).ok())
    }

    /// Returns everything in the recording, in the order of writing.
    ///
    /// See [`Commit`], [`Events`], [`Times`].
    pub fn chunks(&self) -> impl Iterator<Item = Chunk<'b>> + Clone + Debug + use<'b> {
        self.frames()
            .map_while(|frame| Chunk::read(&frame).ok().flatten())
    }

    /// Returns the frames up to the end. The first reading of the recording has found any errors.
    fn frames(&self) -> impl Iterator<Item = Frame<'b>> + Clone + Debug + use<'b> {
        let mut input = Decoder::new(&self.bytes[self.read.first..]);
        let frames = core::iter::from_fn(move || frame(&mut input).ok());
        frames.take_while(|frame| !matches!(frame.kind, END | CUT))
    }
}

/// A part of a recording.
///
/// See [`Recording::chunks`].
#[derive(Clone, Debug)]
pub enum Chunk<'b> {
    /// The recording's statement about itself.
    Header(Header),
    /// A value, or the fate of a job.
    Entry(Entry<'b>),
    /// Other facts, in lines.
    Text(&'b str),
    /// The committed model; the chunks after it belong to this model.
    Commit(Commit),
    /// Events of a journal.
    Events(Events<'b>),
    /// The end of a run.
    Times(Times),
}

/// Events of a cluster's journal, one after the other.
///
/// ```
/// use recording::{Chunk, Recording, Stream};
///
/// let mut record = Stream::begin(Vec::new());
/// record.events(1, 40, &[[1, 2, 3], [4, 5, 6]]);
/// let bytes = record.end();
/// let recording = Recording::read(&bytes).unwrap();
/// let Some(Chunk::Events(events)) = recording.chunks().next() else { panic!() };
/// assert_eq!((events.cluster, events.before), (1, 40));
/// assert!(events.words().eq([[1, 2, 3], [4, 5, 6]]));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Events<'b> {
    /// The number of the cluster.
    pub cluster: u16,
    /// How many events of the run the cluster's journal has taken before these.
    pub before: u64,
    words: &'b [[u8; 24]],
}

impl<'b> Events<'b> {
    /// Returns the words of each event.
    pub fn words(&self) -> impl Iterator<Item = [u64; 3]> + use<'b> {
        let words = self.words.iter();
        words.map(|bytes| {
            let (words, _) = bytes.as_chunks::<8>();
            core::array::from_fn(|word| u64::from_le_bytes(words[word]))
        })
    }

    fn read(payload: &'b [u8]) -> Result<Self, Malformed> {
        let mut input = Decoder::new(payload);
        let (cluster, before) = Recordable::decode(&mut input)?;
        let malformed = input.expected("events of 24 bytes each");
        match input.take(input.remaining(), "events")?.as_chunks() {
            (words, []) => Ok(Self {
                cluster,
                before,
                words,
            }),
            _ => Err(malformed),
        }
    }
}

impl<'b> Chunk<'b> {
    /// Reads a frame, unless the frame is an end. Not inlined: this decodes every kind of chunk.
    #[inline(never)]
    fn read(frame: &Frame<'b>) -> Result<Option<Self>, Malformed> {
        let payload = frame.payload;
        let chunk = match frame.kind {
            HEADER => Header::from_bytes(payload).map(Chunk::Header),
            ENTRY => Entry::decode(payload).map(Chunk::Entry),
            TEXT => {
                let malformed = Decoder::new(payload).expected("a text of UTF-8");
                let text = core::str::from_utf8(payload).map_err(|_| malformed);
                text.map(Chunk::Text)
            }
            COMMIT => {
                // A commit of version 9 ends before the lists, of version 8 before the device, of
                // version 7 before the answers and locks, of version 6 before the pins, and of
                // version 5 before the waits: all missing parts are 0.
                let of_before = |lacks: usize| {
                    let bytes = [payload, &[0; 48][..lacks]].concat();
                    Commit::from_bytes(&bytes).ok()
                };
                let commit = Commit::from_bytes(payload);
                let commit = commit.or_else(|wrong| {
                    [4, 20, 28, 44, 48]
                        .into_iter()
                        .find_map(of_before)
                        .ok_or(wrong)
                });
                commit.map(Chunk::Commit)
            }
            EVENTS => Events::read(payload).map(Chunk::Events),
            TIMES => Times::from_bytes(payload).map(Chunk::Times),
            END | CUT => return Ok(None),
            _ => {
                let kinds = "an entry, text, commit, events or times, frame kind 2 or 5 to 8, or \
                             an end, 3 or 4";
                return Err(frame.expected(kinds));
            }
        };
        let inside = |malformed: Malformed| malformed.behind(frame.offset);
        chunk.map(Some).map_err(inside)
    }
}

impl Progress {
    fn none() -> Self {
        Self {
            header: Header::default(),
            has_header: false,
            first: 0,
            last: 0,
            crc: Crc::new(),
            count: 0,
            lost: 0,
        }
    }

    /// Reads all frames, and reports whether the last frame marks a cut recording.
    fn read(&mut self, bytes: &[u8]) -> Result<bool, Malformed> {
        let mut input = Decoder::new(bytes);
        let mark = "the mark of a recording, 0x89 and `FASSREC`";
        if input.take(MAGIC.len(), mark)? != MAGIC {
            return Err(Decoder::new(bytes).expected(mark));
        }
        let malformed =
            input.expected("version 1 to 10 of recordings, which are those that are read");
        // A later version may have kinds that this code cannot check; an earlier version only lacks
        // some kinds.
        if !(1..=VERSION).contains(&u16::from_le_bytes(input.array(malformed.expected)?)) {
            return Err(malformed);
        }
        let mut crc = Crc::new();
        // Mark and version are in all checksums, so a frame fits no file of another version.
        crc.update(&bytes[..input.offset()]);

        (self.first, self.last, self.crc) = (input.offset(), input.offset(), crc);
        loop {
            let frame = checked(&mut input, &mut crc)?;
            let inside = |malformed: Malformed| malformed.behind(frame.offset);
            match Chunk::read(&frame)? {
                Some(Chunk::Header(header)) => {
                    // Entries are checked against the header, so the header cannot change or come
                    // after them.
                    if self.has_header || self.count > 0 {
                        return Err(frame.expected("no other header"));
                    }
                    let wrong = |expected| Malformed {
                        offset: frame.offset,
                        expected,
                    };
                    check_header(&header).map_err(wrong)?;
                    (self.header, self.has_header) = (header, true);
                }
                Some(Chunk::Entry(entry)) => {
                    entry.check(&self.header).map_err(inside)?;
                    self.count += 1;
                    self.lost += u64::from(entry.what == EntryKind::Lost);
                }
                Some(_) => {}
                None => {
                    let said = <(u64, u64)>::from_bytes(frame.payload).map_err(inside)?;
                    // Checksums find altered frames; this check finds a writer that has miscounted.
                    if said != (self.count, self.lost) {
                        return Err(inside(Malformed {
                            offset: 0,
                            expected: "how many entries there are, and how many of them are lost",
                        }));
                    }
                    // No checksum covers bytes behind the end, so nobody vouches for them.
                    if input.remaining() > 0 {
                        return Err(input.expected("the end of the file"));
                    }
                    return Ok(frame.kind == CUT);
                }
            }
            // Only now: `mended` goes on from here, behind the last correct frame.
            (self.last, self.crc) = (input.offset(), crc);
        }
    }
}

/// Returns a recording of the whole and unaltered part at the start of these bytes, left behind by
/// a run that died. The result is [cut](Recording::is_cut).
///
/// # Errors
///
/// Even the first bytes do not belong to a recording: the error says why.
///
/// ```
/// use recording::{Header, Recording, Writer};
///
/// let mut bytes = Writer::new(&Header::default()).end();
/// bytes.pop();
/// assert!(Recording::read(&bytes).is_err());
/// let mended = recording::mended(&bytes).unwrap();
/// assert!(Recording::read(&mended).unwrap().is_cut());
/// ```
pub fn mended(bytes: &[u8]) -> Result<Vec<u8>, Malformed> {
    let mut progress = Progress::none();
    let malformed = progress.read(bytes).err();
    if let Some(malformed) = malformed
        && progress.last == 0
    {
        return Err(malformed);
    }
    // An old end, if there was one, is left out: a new end is written, with the counts of the
    // remaining part.
    let whole = bytes[..progress.last].to_vec();
    let stream = Stream::behind(progress.crc, (progress.count, progress.lost), whole);
    Ok(stream.cut())
}

/// Returns a whole recording as it is. If a recording only ends too early, left by a killed program
/// or a full disk, returns the [`mended`] recording instead.
///
/// # Errors
///
/// The bytes are not a recording, or are altered.
///
/// ```
/// use recording::{Header, Recording, Writer, completed};
///
/// let whole = Writer::new(&Header::default()).end();
/// assert_eq!(completed(&whole).unwrap(), whole);
/// let cut = completed(&whole[..whole.len() - 1]).unwrap();
/// assert!(Recording::read(&cut).unwrap().is_cut());
/// ```
pub fn completed<'b>(bytes: impl Into<Cow<'b, [u8]>>) -> Result<Cow<'b, [u8]>, Malformed> {
    let bytes = bytes.into();
    let mut progress = Progress::none();
    match progress.read(&bytes) {
        Ok(_) => Ok(bytes),
        // A whole frame with an error was altered; here, the next frame is not whole.
        Err(_)
            if progress.last > 0 && frame(&mut Decoder::new(&bytes[progress.last..])).is_err() =>
        {
            mended(&bytes).map(Cow::Owned)
        }
        Err(malformed) => Err(malformed),
    }
}

impl Frame<'_> {
    /// Returns an error naming the part expected at the frame's start.
    const fn expected(&self, expected: &'static str) -> Malformed {
        Malformed {
            offset: self.offset - 5,
            expected,
        }
    }
}

/// Reads the next frame.
fn frame<'b>(input: &mut Decoder<'b>) -> Result<Frame<'b>, Malformed> {
    // Kind and length are 5 bytes before the payload; `Frame::expected` subtracts these bytes.
    let [kind] = input.array("another frame; the recording has no end, so a part is missing")?;
    let length = u32::from_le_bytes(input.array("4 bytes, how long the frame is")?);
    let length = usize::try_from(length).unwrap_or(usize::MAX);
    let offset = input.offset();
    let payload = input.take(
        length,
        "a frame of the length that it states, and more after it",
    )?;
    let checksum = input.array("4 bytes of a checksum, and more after them")?;
    Ok(Frame {
        kind,
        offset,
        payload,
        checksum: u32::from_le_bytes(checksum),
    })
}

/// Reads the next frame, and makes sure that no byte up to its end was altered.
fn checked<'b>(input: &mut Decoder<'b>, crc: &mut Crc) -> Result<Frame<'b>, Malformed> {
    let frame = frame(input)?;
    // In the order of the file, without the checksums, as the writer has computed it.
    crc.update(&[frame.kind]);
    // The length was a `u32`.
    let length = u32::try_from(frame.payload.len()).unwrap_or(u32::MAX);
    crc.update(&length.to_le_bytes());
    crc.update(frame.payload);
    match crc.value() == frame.checksum {
        true => Ok(frame),
        false => Err(Malformed {
            offset: frame.offset + frame.payload.len(),
            expected: CHECKSUM,
        }),
    }
}

/// Makes sure that the parts of a header fit each other.
fn check_header(header: &Header) -> Result<(), &'static str> {
    let (dags, channels) = (header.dags.len(), &header.channels);
    // Each has a 16-bit number, also where both are numbered together.
    if dags + channels.len() >= usize::from(u16::MAX) {
        return Err("fewer than 65,535 DAGs and channels");
    }
    let is_known = |channel: &Channel| usize::from(channel.dag) < dags;
    match channels.iter().all(is_known) {
        true => Ok(()),
        false => Err("channels of DAGs that the header has"),
    }
}

/// A recording lacks the requested data.
///
/// See [`Recording::values`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mismatch(String);

impl<'b> Recording<'b> {
    /// Returns the values written by a DAG's subtask to a topic, with their jobs.
    ///
    /// # Errors
    ///
    /// The recording has no values of this topic, or values of another type.
    ///
    /// ```
    /// use recording::{Header, Recording, Writer};
    ///
    /// let bytes = Writer::new(&Header::default()).end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// let refused = recording.values::<u8>("lidar", "points").unwrap_err();
    /// assert_eq!(
    ///     refused.to_string(),
    ///     "there is nothing of topic `points` of dag `lidar`; there is nothing at all"
    /// );
    /// ```
    pub fn values<T: Recordable>(
        &self,
        dag: &str,
        topic: &str,
    ) -> Result<impl Iterator<Item = (u64, T)> + Clone + Debug + use<'b, T>, Mismatch> {
        let header = self.header();
        let name_of = |dag: u16| &*header.dags[usize::from(dag)].name;
        let mut channels = (0_u16..).zip(&header.channels);
        let found = channels.find(|(_, channel)| {
            // DAGs may sample a topic as well: only its writer's channel has the value of each job.
            let is_written = channel.role.is_written();
            is_written && channel.topic == topic && name_of(channel.dag) == dag
        });
        let Some((number, channel)) = found else {
            let there = header.channels.iter();
            let there =
                there.map(|it| format!("topic `{}` of dag `{}`", it.topic, name_of(it.dag)));
            let there = match &there.collect::<Vec<String>>()[..] {
                [] => "nothing at all".to_string(),
                there => there.join(", "),
            };
            return Err(Mismatch(format!(
                "there is nothing of topic `{topic}` of dag `{dag}`; there is {there}"
            )));
        };
        let wanted = T::schema();
        if channel.schema != wanted {
            let here = &channel.schema;
            return Err(Mismatch(format!(
                "topic `{topic}` of dag `{dag}` has values of type {here}, and {wanted} is \
                 wanted; record it again"
            )));
        }
        let is_of_channel =
            move |entry: &Entry<'_>| entry.what == EntryKind::Value && entry.place == number;
        // Each value fits the type: the recording was read by the same schema.
        let value = |entry: Entry<'_>| Some((entry.job, T::from_bytes(entry.value).ok()?));
        Ok(self.entries().filter(is_of_channel).filter_map(value))
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for Mismatch {}
