//! Writing a recording.

use alloc::vec::Vec;

use super::entry::{Entry, What};
use super::header::Header;
use super::{END, ENTRY, HEADER, MAGIC, VERSION};
use crate::value::crc::Crc;
use crate::value::encode::{Encoder, Full};
use crate::value::recordable::{Recordable, to_bytes};

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
    /// Of all bytes that are no checksums.
    crc: Crc,
    entries: u64,
    lost: u64,
}

impl Writer {
    /// Begins a recording.
    ///
    /// See [`Writer`].
    #[must_use]
    pub fn new(header: &Header) -> Self {
        let mut writer = Self {
            bytes: MAGIC.to_vec(),
            crc: Crc::new(),
            entries: 0,
            lost: 0,
        };
        writer.bytes.extend(VERSION.to_le_bytes());
        writer.crc.update(&writer.bytes);
        writer.frame(HEADER, |out| header.encode(out));
        writer
    }

    /// Adds an entry. It has to fit to the header, or the recording will be refused.
    ///
    /// See [`Writer`].
    pub fn write(&mut self, entry: &Entry<'_>) {
        self.entries += 1;
        self.lost += u64::from(entry.what == What::Lost);
        self.frame(ENTRY, |out| entry.encode(out));
    }

    /// Ends the recording and returns its bytes. One in which something is lost says so.
    ///
    /// See [`Writer`].
    #[must_use]
    pub fn finish(mut self) -> Vec<u8> {
        let end = to_bytes(&(self.entries, self.lost));
        self.frame(END, |out| out.put(&end));
        self.bytes
    }

    /// # Panics
    ///
    /// If the payload has 4 GiB or more.
    fn frame(&mut self, kind: u8, payload: impl Fn(&mut Encoder<'_>)) {
        /// What stands before the payload.
        const HEAD: usize = 5;
        let start = self.bytes.len();
        self.bytes.extend([kind, 0, 0, 0, 0]);
        // An entry is short, so mostly one pass is enough.
        let mut room = 256;
        let length = loop {
            self.bytes.resize(start + HEAD + room, 0);
            let mut out = Encoder::new(&mut self.bytes[start + HEAD..]);
            payload(&mut out);
            match out.finish() {
                Ok(length) => break length,
                Err(Full { needed }) => room = needed,
            }
        };
        let count = u32::try_from(length).expect("a payload of less than 4 GiB");
        self.bytes[start + 1..start + HEAD].copy_from_slice(&count.to_le_bytes());
        self.bytes.truncate(start + HEAD + length);
        self.crc.update(&self.bytes[start..]);
        self.bytes.extend(self.crc.value().to_le_bytes());
    }
}
