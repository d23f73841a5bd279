//! Recordings: values that cross the edge of a run, as bytes with schemas, and files of them.
//!
//! The results of a DAG of functions follow from what enters it. So a *recording*, that is a
//! file of the values that sources returned, samples found, and of what became of jobs, is
//! enough to compute every value again. This crate has what is needed to write values down:
//!
//! - [`Recordable`]: a type whose values become bytes and come back; [`recordable!`] makes one
//!   of an app's struct;
//! - [`Schema`]: what such a type looks like, so that a program that does not know the type can
//!   read its values;
//! - [`Recording`], [`Writer`]: the file, read and written.
//!
//! The crate knows no DAG and no machine, for those that read recordings need neither: the host
//! tool, an app that takes a recording as its input.
//!
//! # The form of values
//!
//! Numbers are little-endian and as wide as their type, without padding: what has the same type
//! and the same value has the same bytes, on every machine.
//!
//! | type | bytes |
//! |---|---|
//! | `u8` to `u128`, `i8` to `i128`, `f32`, `f64` | 1 to 16 |
//! | `bool` | 1: 0 or 1 |
//! | `char` | 4: the scalar value |
//! | `Option<T>` | 1: 0, or 1 and the value |
//! | `Vec<T>`, [`List<T, N>`](List) | 4: how many, and these |
//! | `String`, [`Text`] | 4: how many bytes of UTF-8, and these |
//! | array, tuple, struct | the elements or fields, one after the other |
//! | `Arc<T>`, `Box<T>` | as `T` |
//!
//! `usize` and `isize` have no width of their own, so they cannot be recorded.
//!
//! # CDR
//!
//! The same types have a second form, for the wires of others: that of XCDR1, the Common Data
//! Representation of ROS 2, little-endian and without its header of 4 bytes. It differs in two points.
//! A number, or how many elements follow, begins at a multiple of its size, behind zeros; of lists
//! and arrays of numbers only the first one needs it, and an empty one does not. Text has a zero at
//! its end, which is counted. [`Encoder::cdr`] writes it, and [`Decoder::cdr`] reads it, whatever
//! stands in place of the zeros. Options, characters and numbers of 16 bytes have no such form over
//! there.
//!
//! # What is guaranteed
//!
//! - Writing into a buffer allocates nothing, and a buffer that is too small is told with what
//!   is needed.
//! - Reading any bytes gives a value or the offset of what is wrong. It does not panic, recurses
//!   to a depth that the type fixes, and allocates at most [`MOST_GROWTH`] times the bytes that
//!   it is given, for each level of that depth. Bytes that are accepted are those that the value
//!   would be written as.
//! - Reading a file takes a time that its length bounds: a type in it has at most
//!   [`MOST_WEIGHTLESS`] parts that take no bytes, so no value has many more parts than bytes.
//!
//! # What is not
//!
//! A checksum finds accidents, not intent: a person can make a file that says something else.

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
