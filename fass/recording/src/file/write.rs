//! Writing a recording.

use alloc::vec::Vec;

use super::entry::Entry;
use super::header::Header;
use super::stream::Stream;

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
/// let mut bytes = writer.finish();
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
#[derive(Clone, Debug)]
pub struct Writer {
    bytes: Vec<u8>,
    stream: Stream,
}

impl Writer {
    /// Begins a recording.
    ///
    /// See [`Writer`].
    #[must_use]
    pub fn new(header: &Header) -> Self {
        let mut bytes = Vec::new();
        let stream = Stream::begin(header, &mut |part| bytes.extend_from_slice(part));
        Self { bytes, stream }
    }

    /// Adds an entry. It has to fit to the header, or the recording will be refused.
    ///
    /// # Panics
    ///
    /// If the value has 4 GiB or more.
    ///
    /// See [`Writer`].
    pub fn write(&mut self, entry: &Entry<'_>) {
        let Self { bytes, stream } = self;
        stream.write(entry, &mut |part| bytes.extend_from_slice(part));
    }

    /// Ends the recording and returns its bytes. One in which something is lost says so.
    ///
    /// See [`Writer`].
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        let Self { mut bytes, stream } = self;
        stream.end(&mut |part| bytes.extend_from_slice(part));
        bytes
    }
}
