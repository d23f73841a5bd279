//! The router's datagrams, and their handling by a session.

use super::{
    CLOSE, FRAGMENT, FRAME, INIT, IS_ANSWER, IS_RELIABLE, IS_SIZED, KEEP_ALIVE, MOST_BYTES, OPEN,
    RESOLUTION, Session, SessionCounts, Stage, VERSION,
};
use crate::bytes::{Fault, Reader};
use crate::fragments::Fragment;
use crate::message::{self, Put};

/// Message kinds from here on belong to the network layer. A transport message ends a frame.
const FIRST_OF_NETWORK: u8 = 0x08;
/// Marks of a fragment by extensions: the fragment is the first of its message, or the message is
/// dropped.
const IS_FIRST: u16 = 1 << 2;
const IS_DROPPED: u16 = 1 << 3;

type Each<'e> = &'e mut dyn FnMut(Put<'_>);

impl Session {
    /// Takes a datagram from the router, and hands over each value in the datagram.
    pub fn hear(&mut self, now_ns: u64, datagram: &[u8], each: Each<'_>) {
        let mut reader = Reader::new(datagram);
        while !reader.rest().is_empty() {
            let count = match self.transport(now_ns, &mut reader, each) {
                Err(Fault::Malformed) => &mut self.counts.malformed,
                Err(Fault::Foreign) => {
                    self.heard_ns = now_ns;
                    &mut self.counts.foreign
                }
                Err(Fault::Repeated) => &mut self.counts.repeated,
                Ok(()) => {
                    self.heard_ns = now_ns;
                    continue;
                }
            };
            *count += 1;
            return;
        }
    }

    /// Reads a message of the transport.
    fn transport(&mut self, now_ns: u64, from: &mut Reader<'_>, each: Each<'_>) -> Read {
        let header = from.header()?;
        let is_answer = header & IS_ANSWER != 0;
        match (header & 0x1f, self.stage) {
            (INIT, Stage::Initiated) if is_answer => self.hear_init(from, header),
            (OPEN, Stage::Opening) if is_answer => self.hear_open(now_ns, from, header),
            (CLOSE, stage) => {
                from.byte()?;
                // Before a session is up, this CLOSE answers our own CLOSE, or a step tried again.
                if let Stage::Up { .. } = stage {
                    self.lose();
                }
                Ok(())
            }
            (KEEP_ALIVE, _) => from.extensions(header, 0, &mut |_, _| {}),
            (FRAME | FRAGMENT, Stage::Up { .. }) => self.hear_frame(from, header, each),
            (INIT | OPEN | FRAME | FRAGMENT, _) => Err(Fault::Repeated),
            _ => Err(Fault::Foreign),
        }
    }

    fn hear_init(&mut self, from: &mut Reader<'_>, header: u8) -> Read {
        if from.byte()? != VERSION {
            return Err(Fault::Foreign);
        }
        let who = from.byte()?;
        from.bytes(u64::from(who >> 4) + 1)?;
        let (mut resolution, mut most_bytes) = (RESOLUTION, MOST_BYTES);
        if header & IS_SIZED != 0 {
            resolution = from.byte()?;
            most_bytes = u16::from_le_bytes([from.byte()?, from.byte()?]);
        }
        let cookie = from.counted()?;
        from.extensions(header, 0, &mut |_, _| {})?;
        let kept = self.cookie.get_mut(..cookie.len());
        kept.ok_or(Fault::Malformed)?.copy_from_slice(cookie);
        self.cookie_length = cookie.len();
        self.numbers.agree(resolution).ok_or(Fault::Malformed)?;
        self.most_bytes = most_bytes.min(MOST_BYTES);
        self.stage = Stage::Agreed;
        Ok(())
    }

    fn hear_open(&mut self, now_ns: u64, from: &mut Reader<'_>, header: u8) -> Read {
        let unit_ns = if header & IS_SIZED != 0 {
            1_000_000_000
        } else {
            1_000_000
        };
        let lease_ns = from.number()?.saturating_mul(unit_ns);
        let first = from.number()?;
        from.extensions(header, 0, &mut |_, _| {})?;
        self.numbers.expect(first).ok_or(Fault::Malformed)?;
        self.lease_ns = lease_ns;
        self.stage = Stage::Up { since_ns: now_ns };
        self.counts.opened += 1;
        (self.next_declared, self.is_declared) = (0, false);
        self.fragments.clear();
        Ok(())
    }

    /// Reads a frame with its messages, or a fragment.
    fn hear_frame(&mut self, from: &mut Reader<'_>, header: u8, each: Each<'_>) -> Read {
        let is_reliable = header & IS_RELIABLE != 0;
        let (number, mut marks) = (from.number()?, 0);
        from.extensions(header, 0, &mut |id, _| marks |= 1 << id)?;
        let ahead = self.numbers.hear(number, is_reliable);
        let ahead = ahead.ok_or(Fault::Malformed)?;
        if ahead == 0 {
            return Err(Fault::Repeated);
        }
        self.counts.gaps += u64::from(ahead > 1);
        if header & 0x1f == FRAME {
            return messages(from, &mut self.counts, each);
        }
        self.counts.fragments += 1;
        let fragment = Fragment {
            is_reliable,
            is_first: marks & IS_FIRST != 0,
            has_more: header & 0x40 != 0,
            is_next: ahead == 1 && marks & IS_DROPPED == 0,
            bytes: from.take_rest(),
        };
        match self.fragments.add(&fragment, &mut self.counts.dropped) {
            Some(whole) => messages(&mut Reader::of_one(whole), &mut self.counts, each),
            None => Ok(()),
        }
    }
}

type Read = Result<(), Fault>;

/// Reads messages of the network layer up to the end, or to the next transport message.
fn messages(from: &mut Reader<'_>, counts: &mut SessionCounts, each: Each<'_>) -> Read {
    let is_ours = |header: &u8| header & 0x1f >= FIRST_OF_NETWORK;
    while from.rest().first().is_some_and(is_ours) {
        if let Some(put) = message::read(from)? {
            counts.puts += 1;
            each(put);
        }
    }
    Ok(())
}
