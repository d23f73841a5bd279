//! Messages of the network layer, carried in frames. A client reads only puts: a router reports
//! declarations of others, asks and answers only on request.

use crate::bytes::{Fault, Reader, Writer};

/// Kinds of messages, in the low bits of their headers.
const PUSH: u8 = 0x1d;
const DECLARE: u8 = 0x1e;
/// Contents of a push.
const PUT: u8 = 1;
const DELETE: u8 = 2;
/// Header marks: of a key with text, of a put with a time stamp, and of a put with an encoding.
const HAS_TEXT: u8 = 0x20;
const IS_STAMPED: u8 = 0x20;
const HAS_ENCODING: u8 = 0x40;
/// The put extension for the attachment.
const ATTACHMENT: u8 = 3;

/// A value put under a key by another participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Put<'d> {
    /// The key in full, not checked to be text.
    pub key: &'d [u8],
    /// The attachment, empty if there is none.
    pub attachment: &'d [u8],
    /// The value.
    pub payload: &'d [u8],
    /// The Unix time of the put's stamp, in nanoseconds.
    pub stamp_ns: Option<u64>,
}

/// A client's declaration, repeated again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Declaration<'k> {
    /// A subscription to a key.
    Subscriber(&'k str),
    /// A key announcing somebody's presence.
    Token(&'k str),
}

/// Writes a declaration. The router keeps declarations by number, so a repeated declaration changes
/// nothing.
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

/// Writes a put, with its key in full. If the key were replaced by a number declared once, and that
/// declaration were lost, the topic would stay silent.
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

/// Reads a message, and returns the value of a put.
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
    // An odd encoding has a schema.
    if kind & HAS_ENCODING != 0 && reader.number()? & 1 != 0 {
        reader.counted()?;
    }
    // The extension for values in shared memory is unknown here: the bytes behind it are not a
    // value.
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

/// Returns the nanoseconds of a time stamp. The stamp has seconds and their fraction, 32 bits each.
const fn unix_ns(stamp: u64) -> u64 {
    const SECOND: u64 = 1_000_000_000;
    (stamp >> 32) * SECOND + (((stamp & 0xffff_ffff) * SECOND) >> 32)
}
