//! A client of a Zenoh router: protocol version 9, over UDP, best effort.
//!
//! A [`Session`] declares the keys of its subscriptions and its tokens, puts values under keys, and
//! hears other participants' values. The session has no clock, memory or device of its own, so the
//! machine, a socket of Linux and a fuzzer run the same code: the caller passes in received
//! datagrams, and buffers for datagrams to send. No length in a datagram is trusted, no loop is
//! longer than the datagram, and nothing allocates.
//!
//! There is no TCP and no query, and we send no fragments: each put fits into one datagram.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod bytes;
mod fragments;
mod message;
mod session;

pub use fragments::MOST_FRAGMENTED;
pub use message::{Declaration, Put};
pub use session::{MOST_BYTES, Session, SessionCounts, SessionOptions};
