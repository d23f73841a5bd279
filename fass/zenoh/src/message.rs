//! Messages of the network, which a frame carries. A client reads puts alone: a router tells of what
//! others declare, asks and answers only where it was asked to.

use crate::bytes::{Fault, Reader, Writer};

/// Kinds of messages, in the low bits of their headers.
const PUSH: u8 = 0x1d;
const DECLARE: u8 = 0x1e;
/// Contents of a push.
const PUT: u8 = 1;
const DELETE: u8 = 2;
/// The mark of a header before a key that has text, of a put with a time stamp, and of one with an
/// encoding.
const HAS_TEXT: u8 = 0x20;
const IS_STAMPED: u8 = 0x20;
const HAS_ENCODING: u8 = 0x40;
/// The extension of a put that has its attachment.
const ATTACHMENT: u8 = 3;

/// A value that somebody has put under a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Put<'d> {
    /// The key in full, not checked to be text.
    pub key: &'d [u8],
    /// The attachment, empty if there is none.
    pub attachment: &'d [u8],
    /// The value.
    pub payload: &'d [u8],
    /// The Unix time of its stamp, in nanoseconds.
    pub stamp_ns: Option<u64>,
}

/// A declaration of a client's, made again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Declaration<'k> {
    /// A subscription to a key.
    Subscriber(&'k str),
    /// A key that says that somebody is there.
    Token(&'k str),
}

/// Writes a declaration. The router keeps it by its number, so one that comes twice changes nothing.
pub(crate) fn declare(writer: &mut Writer<'_>, id: u64, declaration: Declaration<'_>) {
    let (kind, key) = match declaration {
        Declaration::Subscriber(key) => (2, key),
        Declaration::Token(key) => (6, key),
    };
    writer.bytes(&[DECLARE, kind | HAS_TEXT]);
    writer.number(id);
    writer.number(0);
    writer.counted(key.as_bytes());
}

/// Writes a put. It has its key in full: were a number for it declared once, and that datagram
/// lost, the topic would stay silent.
pub(crate) fn put(writer: &mut Writer<'_>, key: &str, attachment: &[u8], payload: &[u8]) {
    writer.bytes(&[PUSH | HAS_TEXT, 0]);
    writer.counted(key.as_bytes());
    if attachment.is_empty() {
        writer.bytes(&[PUT]);
    } else {
        writer.bytes(&[PUT | 0x80, 0x40 | ATTACHMENT]);
        writer.counted(attachment);
    }
    writer.counted(payload);
}

/// Reads a message, and returns the value, if it puts one.
pub(crate) fn read<'b>(reader: &mut Reader<'b>) -> Result<Option<Put<'b>>, Fault> {
    let header = reader.header()?;
    if header & 0x1f != PUSH {
        return Err(Fault::Foreign);
    }
    let number = reader.number()?;
    let key = match header & HAS_TEXT {
        0 => &[],
        _ => reader.counted()?,
    };
    // Quality of service, a time stamp, a router's number.
    reader.extensions(header, 0b1110, &mut |_, _| {})?;
    let kind = reader.byte()?;
    let (mut stamp_ns, mut attachment) = (None, &[][..]);
    if kind & IS_STAMPED != 0 {
        stamp_ns = Some(unix_ns(reader.number()?));
        reader.counted()?;
    }
    // An encoding has a schema if it is odd.
    if kind & HAS_ENCODING != 0 && reader.number()? & 1 != 0 {
        reader.counted()?;
    }
    // Not the extension of a value in shared memory: what follows there is no value.
    reader.extensions(kind, 0b1010, &mut |id, body| {
        if id == ATTACHMENT {
            attachment = body;
        }
    })?;
    match kind & 0x1f {
        PUT => {}
        DELETE => return Ok(None),
        _ => return Err(Fault::Foreign),
    }
    let put = Put {
        key,
        attachment,
        payload: reader.counted()?,
        stamp_ns,
    };
    // We have declared no number for a key, nor asked for any.
    Ok((number == 0).then_some(put))
}

/// Returns the nanoseconds of a time stamp, which has seconds and their fraction of 32 bits each.
const fn unix_ns(stamp: u64) -> u64 {
    const SECOND: u64 = 1_000_000_000;
    (stamp >> 32) * SECOND + (((stamp & 0xffff_ffff) * SECOND) >> 32)
}
