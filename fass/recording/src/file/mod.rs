//! The file: a mark, a header, entries, and an end, each with a checksum.
//!
//! ```text
//! 0x89 "FASSREC"  version, 2 bytes   then frames:
//! kind, 1 byte    length, 4 bytes    payload    checksum, 4 bytes
//! ```
//!
//! The checksum of a frame is that of all bytes from the file's first one on, checksums left
//! out. So a frame that is altered, left out, doubled or moved is found, and so is a cut at a
//! frame's end, by the missing frame of the end. There are two kinds of ends: of a recording
//! that says of everything what became of it, if only that it is lost, and of one that says
//! nothing of what came after its last entry. [`mended`](read::mended) gives the second one to
//! what a run that died has left. Between entries there may be the rest of what is known of the
//! run: its [commits](commit::Commit), the events of its journals, the [times](times::Times) of
//! runs that have ended, and lines of text.

use core::ops::RangeInclusive;

pub(crate) mod commit;
pub(crate) mod entry;
pub(crate) mod header;
pub(crate) mod read;
pub(crate) mod stream;
pub(crate) mod times;
pub(crate) mod values;

/// The first bytes of each recording. The first one is no text, so that a transfer of text is
/// found, which would alter the rest.
pub const MAGIC: [u8; 8] = *b"\x89FASSREC";

/// The version of the format that is written, of values included. Those before are read, too: the
/// first has no entries of [`What::Clock`](crate::What::Clock), and neither of
/// [`What::Fault`](crate::What::Fault); those before 4 have no text, and
/// those before 5 no commits, events and times, and no [states](crate::Role::State).
pub const VERSION: u16 = 5;

/// The versions that are read.
const READ: RangeInclusive<u16> = 1..=VERSION;

/// The kinds of frames.
const HEADER: u8 = 1;
const ENTRY: u8 = 2;
const END: u8 = 3;
const CUT: u8 = 4;
const TEXT: u8 = 5;
const COMMIT: u8 = 6;
const EVENTS: u8 = 7;
const TIMES: u8 = 8;
