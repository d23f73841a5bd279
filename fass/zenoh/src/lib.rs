//! A client of a Zenoh router: protocol version 9, over UDP, best effort.
//!
//! A [`Session`] declares the keys it subscribes to and the tokens that tell of it, puts values
//! under keys and hears those of others. It has no clock, memory or device of its own, so the
//! machine, a socket of Linux and a fuzzer run the same code: the caller gives a datagram that came,
//! or a buffer for one to be sent. No length in a datagram is believed, no loop is longer than the
//! datagram, and nothing allocates.
//!
//! There is no TCP, no query and no fragment of ours: what is put has room in one datagram.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod bytes;
mod fragments;
mod message;
mod session;

pub use fragments::MOST_FRAGMENTED;
pub use message::{Declaration, Put};
pub use session::{MOST_BYTES, Session, SessionCounts, SessionOptions};
