//! Recordings: values crossing the edge of a run, as bytes with schemas, and files of such values.
//!
//! The results of a DAG of functions follow from the DAG's inputs and from what its functions
//! remember. So a *recording*, a file of the values returned by sources, of found samples and
//! states, of answers of devices, of told times, and of the fate of jobs, is enough to compute
//! every value again, from job 0 on, or from a job with all states recorded. This crate has the
//! parts for writing values down:
//!
//! - [`Recordable`]: a type whose values convert to bytes and back; [`recordable!`] makes an app's
//!   struct recordable;
//! - [`Schema`]: the form of such a type, so a program that does not know the type can read its
//!   values;
//! - [`Recording`], [`Writer`]: the file, read and written.
//!
//! The crate depends on no DAG and no machine, since readers of recordings need neither: the host
//! tool, or an app taking a recording as its input.
//!
//! # The form of values
//!
//! Numbers are little-endian and as wide as their type, without padding: the same value of the same
//! type has the same bytes on every machine.
//!
//! | type | bytes |
//! |---|---|
//! | `u8` to `u128`, `i8` to `i128`, `f32`, `f64` | 1 to 16 |
//! | `bool` | 1: 0 or 1 |
//! | `char` | 4: the scalar value |
//! | `Option<T>` | 1: 0, or 1 and the value |
//! | `Vec<T>`, [`List<T, N>`](List) | 4: how many, and the elements |
//! | `String`, [`Text`] | 4: how many bytes of UTF-8, and the bytes |
//! | array, tuple, struct | the elements or fields, one after the other |
//! | `Arc<T>`, `Box<T>` | as `T` |
//!
//! `usize` and `isize` have no width of their own, so they cannot be recorded.
//!
//! # CDR
//!
//! The same types have a second form, for the wires of other systems: XCDR1, the Common Data
//! Representation of ROS 2, little-endian and without its header of 4 bytes. The form differs in
//! two points. First, a number, or a count of elements, begins at a multiple of its size, behind
//! padding zeros. In lists and arrays of numbers only the first number needs padding, and an empty
//! list needs none. Second, text has a zero at its end, included in the length. [`Encoder::cdr`]
//! writes this form, and [`Decoder::cdr`] reads it, with any bytes in place of the zeros. Options,
//! characters and numbers of 16 bytes have no such form in ROS 2.
//!
//! # Guarantees
//!
//! - Writing into a buffer allocates nothing. If a buffer is too small, the error states the
//!   necessary size.
//! - Reading any bytes gives a value, or the offset of the first error. Reading does not panic,
//!   recurses to a depth fixed by the type, and allocates at most [`MOST_GROWTH`] times the given
//!   bytes, for each level of that depth. Only bytes in the exact form written for the value are
//!   accepted; in CDR, the padding is not compared.
//! - Reading a file takes a time bounded by the file's length: each type in a file has at most
//!   [`MOST_WEIGHTLESS`] parts taking no bytes, so no value has many more parts than bytes.
//!
//! # Limits
//!
//! A checksum finds accidents, not intent: a person can forge a file with other contents.

#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod bytes;
mod entry;
mod inline;
mod read;
mod recordable;
mod schema;
mod shown;
mod stream;

pub use bytes::{Decoder, Encoder, Full, Malformed};
pub use entry::{Channel, DagHeader, Entry, EntryKind, Header, Role, release_ns_of};
pub use entry::{
    Commit, CommittedDag, CommittedSubtask, CommittedTopic, Counted, DagTimes, SubtaskTimes, Times,
};
pub use inline::{List, Text};
pub use read::{Chunk, Events, Mismatch, Recording, completed, mended};
#[doc(hidden)]
pub use recordable::deepest;
pub use recordable::{MOST_GROWTH, Recordable, to_bytes};
pub use schema::{Field, MOST_DEPTH, MOST_WEIGHTLESS, Scalar, Schema};
pub use shown::{Part, Shown, write_json};
pub use stream::{Crc, MAGIC, Sink, Stream, VERSION, Writer};
