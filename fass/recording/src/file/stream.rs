//! A recording frame by frame, for a writer that cannot keep it.

use super::entry::{Entry, What};
use super::header::Header;
use super::{CUT, END, ENTRY, HEADER, MAGIC, TEXT, VERSION};
use crate::value::crc::Crc;
use crate::value::encode::Encoder;
use crate::value::recordable::to_bytes;

/// Writes a recording piece by piece to whatever takes bytes. After the header nothing is
/// allocated.
///
/// ```
/// use recording::{Header, Recording, Stream};
///
/// let mut file = Vec::new();
/// let mut send = |bytes: &[u8]| file.extend_from_slice(bytes);
/// let stream = Stream::begin(&Header::default(), &mut send);
/// stream.cut(&mut send);
/// assert!(Recording::read(&file).unwrap().is_cut());
/// ```
#[derive(Clone, Debug)]
pub struct Stream {
    /// Of all bytes that are no checksums.
    crc: Crc,
    entries: u64,
    lost: u64,
}

/// The bytes of an entry before its value.
const ENTRY_HEAD: usize = 29;

impl Stream {
    /// Begins a recording.
    ///
    /// See [`Stream`].
    pub fn begin(header: &Header, send: &mut dyn FnMut(&[u8])) -> Self {
        let mut stream = Self {
            crc: Crc::new(),
            entries: 0,
            lost: 0,
        };
        stream.put(&MAGIC, send);
        stream.put(&VERSION.to_le_bytes(), send);
        stream.whole(HEADER, &to_bytes(header), send);
        stream
    }

    /// Goes on behind a part of a recording, all of whose frames are whole.
    pub(super) const fn behind(crc: Crc, entries: u64, lost: u64) -> Self {
        Self { crc, entries, lost }
    }

    /// Adds an entry. It has to fit to the header, or the recording will be refused.
    ///
    /// # Panics
    ///
    /// If the value has 4 GiB or more.
    ///
    /// See [`Writer`](crate::Writer).
    pub fn write(&mut self, entry: &Entry<'_>, send: &mut dyn FnMut(&[u8])) {
        let value = entry.value;
        self.entries += 1;
        self.lost += u64::from(entry.what == What::Lost);
        let mut head = [0; ENTRY_HEAD];
        let mut out = Encoder::new(&mut head);
        Entry {
            value: &[],
            ..*entry
        }
        .encode(&mut out);
        self.head(ENTRY, ENTRY_HEAD + value.len(), send);
        self.put(&head, send);
        self.put(value, send);
        send(&self.crc.value().to_le_bytes());
    }

    /// Adds a text.
    ///
    /// # Panics
    ///
    /// If it has 4 GiB or more.
    ///
    /// ```
    /// use recording::{Header, Recording, Stream};
    ///
    /// let mut file = Vec::new();
    /// let mut send = |bytes: &[u8]| file.extend_from_slice(bytes);
    /// let mut stream = Stream::begin(&Header::default(), &mut send);
    /// stream.text("{}\n", &mut send);
    /// stream.end(&mut send);
    /// assert!(Recording::read(&file).unwrap().texts().eq(["{}\n"]));
    /// ```
    pub fn text(&mut self, text: &str, send: &mut dyn FnMut(&[u8])) {
        self.whole(TEXT, text.as_bytes(), send);
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

    /// Ends the recording. One in which something is lost says so.
    ///
    /// See [`Writer`](crate::Writer).
    pub fn end(self, send: &mut dyn FnMut(&[u8])) {
        self.finish(END, send);
    }

    /// Ends a recording that says nothing of what happened after its last entry.
    ///
    /// See [`Stream`].
    pub fn cut(self, send: &mut dyn FnMut(&[u8])) {
        self.finish(CUT, send);
    }

    fn finish(mut self, kind: u8, send: &mut dyn FnMut(&[u8])) {
        self.whole(kind, &to_bytes(&(self.entries, self.lost)), send);
    }

    /// Writes a frame.
    fn whole(&mut self, kind: u8, payload: &[u8], send: &mut dyn FnMut(&[u8])) {
        self.head(kind, payload.len(), send);
        self.put(payload, send);
        send(&self.crc.value().to_le_bytes());
    }

    fn head(&mut self, kind: u8, length: usize, send: &mut dyn FnMut(&[u8])) {
        let length = u32::try_from(length).expect("a payload of less than 4 GiB");
        self.put(&[kind], send);
        self.put(&length.to_le_bytes(), send);
    }

    fn put(&mut self, bytes: &[u8], send: &mut dyn FnMut(&[u8])) {
        self.crc.update(bytes);
        send(bytes);
    }
}
