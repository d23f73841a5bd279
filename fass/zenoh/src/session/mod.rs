//! A session with a router.
//!
//! ```text
//!            CLOSE           INIT             (ack)            OPEN            (ack)
//!   Fresh --------> Closed --------> Waiting -------> Agreed --------> Waiting -------> Up
//!     ^                      100 ms                                                     |
//!     +------ no answer, the router's CLOSE, its silence for a lease, a lost link ------+
//! ```
//!
//! CLOSE comes first because of older sessions with this address, such as the session before a
//! restart: a router with such a session would not answer INIT until the lease is over. CLOSE ends
//! the old session, and loses any datagrams that follow within some milliseconds.
//!
//! UDP loses datagrams, and a router does not ask for missing ones. So the datagrams keeping the
//! session alive repeat the declarations, in turn.

mod hear;
mod numbers;

use core::fmt;

use crate::bytes::Writer;
use crate::fragments::Fragments;
use crate::message::{self, Declaration};
use numbers::Numbers;

/// The protocol's version.
const VERSION: u8 = 9;
/// Messages of the transport, in the low bits of their headers.
const INIT: u8 = 1;
const OPEN: u8 = 2;
const CLOSE: u8 = 3;
const KEEP_ALIVE: u8 = 4;
const FRAME: u8 = 5;
const FRAGMENT: u8 = 6;
/// The mark of an answer to INIT and OPEN, and of a frame on the reliable channel.
const IS_ANSWER: u8 = 0x20;
const IS_RELIABLE: u8 = 0x20;
/// The mark of INIT with sizes, and of OPEN with a lease in seconds, not milliseconds.
const IS_SIZED: u8 = 0x40;
/// The size of numbers requested by INIT: 28 bits for a frame's number, in the form for 32 bits.
const RESOLUTION: u8 = 0x0a;
/// The most bytes of a datagram, in either direction.
pub const MOST_BYTES: u16 = 1400;
/// The most bytes of the cookie that the router wants back with OPEN.
const MOST_COOKIE: usize = 128;
/// The time between CLOSE and INIT.
const GAP_NS: u64 = 100_000_000;
/// After so long without an answer the session begins anew. In an open session, one declaration is
/// repeated at half this interval. Both times are shorter if the lease is short.
const RETRY_NS: u64 = 500_000_000;

/// The client of a session, and its lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionOptions {
    /// Distinguishes the client from all others; not 0. Zenoh shows the identity as `{:x}` does.
    pub identity: u128,
    /// After so long without a datagram of ours the router considers the client gone.
    pub lease_ms: u64,
}

/// Counts of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionCounts {
    /// Sessions opened by the router.
    pub opened: u64,
    /// Lost sessions: the router was silent or ended the session, or the link was gone.
    pub lost: u64,
    /// Values heard.
    pub puts: u64,
    /// Values sent.
    pub sent: u64,
    /// Values and declarations without room in a datagram.
    pub too_long: u64,
    /// Datagrams with an error. The part behind the error was dropped.
    pub malformed: u64,
    /// Messages unknown to a client, or exceeding the limit for a datagram. The rest of the
    /// datagram is dropped.
    pub foreign: u64,
    /// Datagrams that came twice or too late.
    pub repeated: u64,
    /// Frames before which others were lost.
    pub gaps: u64,
    /// Fragments heard.
    pub fragments: u64,
    /// Fragments dropped, each with those before: one was missing, or the message is too long.
    pub dropped: u64,
}

/// The stage of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// CLOSE is due.
    Fresh,
    /// INIT is due, a while after CLOSE.
    Closed,
    /// The answer to INIT is awaited.
    Initiated,
    /// OPEN is due.
    Agreed,
    /// The answer to OPEN is awaited.
    Opening,
    Up {
        since_ns: u64,
    },
    /// CLOSE is due, and nothing afterwards.
    Ending,
    Ended,
}

/// A session with a router, at most one at a time.
pub struct Session {
    options: SessionOptions,
    stage: Stage,
    /// The time of the latest sending or, in an open session, of the latest declaration.
    step_ns: u64,
    heard_ns: u64,
    cookie: [u8; MOST_COOKIE],
    cookie_length: usize,
    /// The router's limits, from its answers.
    most_bytes: u16,
    lease_ns: u64,
    numbers: Numbers,
    /// The place of the next declaration, and whether each has been sent once.
    next_declared: usize,
    is_declared: bool,
    fragments: Fragments,
    counts: SessionCounts,
}

impl Session {
    /// Creates a session that is not up: CLOSE is due first, then INIT.
    #[must_use]
    pub fn new(options: SessionOptions) -> Self {
        Self {
            options,
            stage: Stage::Fresh,
            step_ns: 0,
            heard_ns: 0,
            cookie: [0; MOST_COOKIE],
            cookie_length: 0,
            most_bytes: MOST_BYTES,
            lease_ns: 0,
            numbers: Numbers::new(options.identity),
            next_declared: 0,
            is_declared: false,
            fragments: Fragments::new(),
            counts: SessionCounts::default(),
        }
    }

    /// Writes the due datagram, if any, and returns its length, or else 0. `declared` returns the
    /// declarations by their places, and `None` beyond the last.
    pub fn due<'k>(
        &mut self,
        now_ns: u64,
        declared: impl Fn(usize) -> Option<Declaration<'k>>,
        out: &mut [u8],
    ) -> usize {
        let waited_ns = now_ns.saturating_sub(self.step_ns);
        match self.stage {
            Stage::Initiated | Stage::Opening if waited_ns >= self.retry_ns() => {
                self.stage = Stage::Fresh
            }
            Stage::Up { .. } if now_ns.saturating_sub(self.heard_ns) > self.lease_ns => self.lose(),
            _ => {}
        }
        let mut writer = Writer::new(out);
        self.stage = match self.stage {
            stage @ (Stage::Fresh | Stage::Ending) => {
                writer.bytes(&[CLOSE | 0x20, 0]);
                if stage == Stage::Fresh {
                    Stage::Closed
                } else {
                    Stage::Ended
                }
            }
            Stage::Closed if waited_ns >= GAP_NS => {
                self.write_init(&mut writer);
                Stage::Initiated
            }
            Stage::Agreed => {
                self.write_open(&mut writer);
                Stage::Opening
            }
            Stage::Up { .. } if !self.is_declared || waited_ns >= self.retry_ns() / 2 => {
                return self.declare(now_ns, declared, out);
            }
            _ => return 0,
        };
        self.step_ns = now_ns;
        writer.end().unwrap_or(0)
    }

    /// Writes a datagram with a put, and returns its length; `None` if the session is not up or the
    /// value is too long.
    pub fn put(
        &mut self,
        key: &str,
        attachment: &[u8],
        payload: &[u8],
        out: &mut [u8],
    ) -> Option<usize> {
        self.up_since_ns()?;
        let put = |writer: &mut Writer<'_>| message::put(writer, key, attachment, payload);
        self.frame(out, put).inspect(|_| self.counts.sent += 1)
    }

    /// Returns the time since which the session is up.
    #[must_use]
    pub const fn up_since_ns(&self) -> Option<u64> {
        match self.stage {
            Stage::Up { since_ns } => Some(since_ns),
            _ => None,
        }
    }

    /// Ends the session: CLOSE is due next, and nothing afterwards.
    pub const fn close(&mut self) {
        self.stage = Stage::Ending;
    }

    /// Gives up the session after the loss of the link, and opens another one, even after the end.
    pub const fn lose(&mut self) {
        if self.up_since_ns().is_some() {
            self.counts.lost += 1;
        }
        self.stage = Stage::Fresh;
    }

    /// Returns the counts.
    #[must_use]
    pub const fn counts(&self) -> SessionCounts {
        self.counts
    }

    /// Returns how long a step waits for its answer.
    fn retry_ns(&self) -> u64 {
        let lease_ns = self.options.lease_ms.saturating_mul(1_000_000);
        RETRY_NS.min(lease_ns / 2)
    }

    fn write_init(&self, writer: &mut Writer<'_>) {
        const CLIENT: u8 = 2;
        let identity = self.options.identity.to_le_bytes();
        // An identity has no leading zeroes. Its length is written minus one.
        let last = identity.iter().rposition(|byte| *byte != 0).unwrap_or(0);
        let [last_byte, ..] = last.to_le_bytes();
        writer.bytes(&[INIT | IS_SIZED, VERSION, last_byte << 4 | CLIENT]);
        writer.bytes(&identity[..=last]);
        writer.bytes(&[RESOLUTION]);
        writer.bytes(&MOST_BYTES.to_le_bytes());
    }

    fn write_open(&self, writer: &mut Writer<'_>) {
        let lease_ms = self.options.lease_ms;
        let (unit, lease) = match lease_ms % 1000 {
            0 => (IS_SIZED, lease_ms / 1000),
            _ => (0, lease_ms),
        };
        writer.bytes(&[OPEN | unit]);
        writer.number(lease);
        writer.number(self.numbers.next().into());
        writer.counted(&self.cookie[..self.cookie_length]);
    }

    /// Writes the next declaration, or, without declarations, a message keeping the session alive.
    fn declare<'k>(
        &mut self,
        now_ns: u64,
        declared: impl Fn(usize) -> Option<Declaration<'k>>,
        out: &mut [u8],
    ) -> usize {
        self.step_ns = now_ns;
        let mut next = declared(self.next_declared);
        if next.is_none() {
            self.next_declared = 0;
            if !self.is_declared {
                self.is_declared = true;
                return 0;
            }
            next = declared(0);
        }
        if let Some(declaration) = next {
            self.next_declared += 1;
            let id = self.next_declared as u64;
            let frame = self.frame(out, |writer| message::declare(writer, id, declaration));
            if let Some(length) = frame {
                return length;
            }
        }
        let mut writer = Writer::new(out);
        writer.bytes(&[KEEP_ALIVE]);
        writer.end().unwrap_or(0)
    }

    /// Writes a frame with a message, and returns its length; `None` if the message has no room.
    fn frame(&mut self, out: &mut [u8], message: impl FnOnce(&mut Writer<'_>)) -> Option<usize> {
        let most = out.len().min(self.most_bytes.into());
        let mut writer = Writer::new(&mut out[..most]);
        writer.bytes(&[FRAME | IS_RELIABLE]);
        writer.number(self.numbers.next().into());
        message(&mut writer);
        let length = writer.end();
        match length {
            Some(_) => self.numbers.advance(),
            None => self.counts.too_long += 1,
        }
        length
    }
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (stage, counts) = (self.stage, self.counts);
        write!(f, "Session {{ {stage:?}, {counts:?} }}")
    }
}
