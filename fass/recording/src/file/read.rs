//! Reading a recording, all of which may be wrong.

use alloc::vec::Vec;

use super::commit::Commit;
use super::entry::{Entry, What};
use super::header::{Channel, Header};
use super::stream::Stream;
use super::times::Times;
use super::{COMMIT, CUT, END, ENTRY, EVENTS, HEADER, MAGIC, READ, TEXT, TIMES};
use crate::value::crc::Crc;
use crate::value::decode::{Decoder, Malformed};
use crate::value::recordable::Recordable;

/// A recording that is whole and unaltered.
///
/// See [`Writer`](crate::Writer).
#[derive(Clone, Debug)]
pub struct Recording<'b> {
    bytes: &'b [u8],
    header: Header,
    /// Where the first frame stands.
    first: usize,
    count: u64,
    lost: u64,
    is_cut: bool,
}

/// How far a recording was read.
struct Progress {
    header: Option<Header>,
    /// Where the first frame stands, and what is behind the last whole frame.
    first: usize,
    last: usize,
    crc: Crc,
    count: u64,
    lost: u64,
}

/// The entries of a recording, in the order in which they were written.
///
/// See [`Recording::entries`].
#[derive(Clone, Debug)]
pub struct Entries<'b>(Decoder<'b>);

/// A frame, and where its payload stands.
struct Frame<'b> {
    kind: u8,
    offset: usize,
    payload: &'b [u8],
    checksum: u32,
}

const CHECKSUM: &str = "the checksum of all before; the file is altered";

impl<'b> Recording<'b> {
    /// Reads all of a recording once, and makes sure that it is whole, that no byte was
    /// altered, and that every value is one of its type.
    ///
    /// # Errors
    ///
    /// The first place that is otherwise.
    ///
    /// See [`Writer`](crate::Writer).
    pub fn read(bytes: &'b [u8]) -> Result<Self, Malformed> {
        let mut progress = Progress::none();
        let is_cut = progress.read(bytes)?;
        Ok(Self {
            bytes,
            header: progress.header.unwrap_or_default(),
            first: progress.first,
            count: progress.count,
            lost: progress.lost,
            is_cut,
        })
    }

    /// Returns what the recording says of itself.
    ///
    /// See [`Writer`](crate::Writer).
    #[must_use]
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// Returns the number of entries.
    ///
    /// See [`Writer`](crate::Writer).
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Returns how many entries are of what was lost; 0, if the recording is not
    /// [cut](Self::is_cut): it is complete.
    ///
    /// See [`Writer`](crate::Writer).
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Reports whether the recording says nothing of what happened after its last entry: the
    /// run died, or its buffer was full of what is never lost.
    ///
    /// See [`Stream`].
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// Returns the entries.
    ///
    /// See [`Writer`](crate::Writer).
    #[must_use]
    pub fn entries(&self) -> Entries<'b> {
        Entries(Decoder::new(&self.bytes[self.first..]))
    }

    /// Returns all that is in the recording, in the order in which it was written.
    ///
    /// See [`Commit`], [`Events`], [`Times`].
    pub fn chunks(&self) -> impl Iterator<Item = Chunk<'b>> + use<'b> {
        let mut input = Decoder::new(&self.bytes[self.first..]);
        let frames = core::iter::from_fn(move || frame(&mut input).ok());
        // Whatever could be wrong was found when the recording was read.
        frames.map_while(|frame| Chunk::read(&frame).ok().flatten())
    }
}

/// Something of a recording.
///
/// See [`Recording::chunks`].
#[derive(Clone, Debug)]
pub enum Chunk<'b> {
    /// The recording's statement about itself.
    Header(Header),
    /// A value, or what became of a job.
    Entry(Entry<'b>),
    /// Facts known besides, in lines.
    Text(&'b str),
    /// The model that was committed; what follows is of it.
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
    /// How many events of the run its journal has taken before these.
    pub before: u64,
    words: &'b [[u8; 24]],
}

impl<'b> Events<'b> {
    /// Returns the words of each event.
    ///
    /// See [`Events`].
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
    /// Reads a frame, if it is no end.
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
            COMMIT => Commit::from_bytes(payload).map(Chunk::Commit),
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
    const fn none() -> Self {
        Self {
            header: None,
            first: 0,
            last: 0,
            crc: Crc::new(),
            count: 0,
            lost: 0,
        }
    }

    /// Reads all frames, and reports whether the last one is of a recording that is cut.
    fn read(&mut self, bytes: &[u8]) -> Result<bool, Malformed> {
        let mut input = Decoder::new(bytes);
        let mark = "the mark of a recording, 0x89 and `FASSREC`";
        if input.take(MAGIC.len(), mark)? != MAGIC {
            return Err(Decoder::new(bytes).expected(mark));
        }
        let malformed =
            input.expected("version 1 to 5 of recordings, which are those that are read");
        if !READ.contains(&u16::from_le_bytes(input.array(malformed.expected)?)) {
            return Err(malformed);
        }
        let mut crc = Crc::new();
        crc.update(&bytes[..input.offset()]);

        (self.first, self.last, self.crc) = (input.offset(), input.offset(), crc);
        loop {
            let frame = checked(&mut input, &mut crc)?;
            let inside = |malformed: Malformed| malformed.behind(frame.offset);
            match Chunk::read(&frame)? {
                Some(Chunk::Header(header)) => {
                    if self.header.is_some() || self.count > 0 {
                        return Err(frame.expected("no other header"));
                    }
                    let wrong = |expected| Malformed {
                        offset: frame.offset,
                        expected,
                    };
                    check_header(&header).map_err(wrong)?;
                    self.header = Some(header);
                }
                Some(Chunk::Entry(entry)) => {
                    let header = self.header.get_or_insert_default();
                    entry.check(header).map_err(inside)?;
                    self.count += 1;
                    self.lost += u64::from(entry.what == What::Lost);
                }
                Some(_) => {}
                None => {
                    let said = <(u64, u64)>::from_bytes(frame.payload).map_err(inside)?;
                    if said != (self.count, self.lost) {
                        return Err(inside(Malformed {
                            offset: 0,
                            expected: "how many entries there are, and how many of them are lost",
                        }));
                    }
                    if input.remaining() > 0 {
                        return Err(input.expected("the end of the file"));
                    }
                    return Ok(frame.kind == CUT);
                }
            }
            (self.last, self.crc) = (input.offset(), crc);
        }
    }
}

/// Returns a recording of what is whole and unaltered at the start of these bytes, as a run
/// leaves them that died. It is [cut](Recording::is_cut).
///
/// # Errors
///
/// Not even the first bytes are those of a recording: what is wrong with them.
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
    let whole = bytes[..progress.last].to_vec();
    let stream = Stream::behind(progress.crc, (progress.count, progress.lost), whole);
    Ok(stream.cut())
}

impl<'b> Iterator for Entries<'b> {
    type Item = Entry<'b>;

    fn next(&mut self) -> Option<Entry<'b>> {
        loop {
            // Whatever could be wrong was found when the recording was read.
            let frame = frame(&mut self.0).ok()?;
            match frame.kind {
                ENTRY => return Entry::decode(frame.payload).ok(),
                END | CUT => return None,
                _ => {}
            }
        }
    }
}

impl Frame<'_> {
    /// Says what was expected where the frame begins.
    const fn expected(&self, expected: &'static str) -> Malformed {
        Malformed {
            offset: self.offset - 5,
            expected,
        }
    }
}

/// Reads the next frame.
fn frame<'b>(input: &mut Decoder<'b>) -> Result<Frame<'b>, Malformed> {
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
    crc.update(&[frame.kind]);
    // It was a `u32`.
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

/// Makes sure that the parts of a header fit to each other.
fn check_header(header: &Header) -> Result<(), &'static str> {
    let (dags, channels) = (header.dags.len(), &header.channels);
    // Each has a number of 16 bits, also where both are numbered together.
    if dags + channels.len() >= usize::from(u16::MAX) {
        return Err("fewer than 65,535 DAGs and channels");
    }
    let is_known = |channel: &Channel| usize::from(channel.dag) < dags;
    match channels.iter().all(is_known) {
        true => Ok(()),
        false => Err("channels of DAGs that the header has"),
    }
}
