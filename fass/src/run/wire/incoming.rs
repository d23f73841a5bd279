//! Packets on their way in: put together where bytes arrive, taken apart by the receiver.
//!
//! In the ring a packet is its length, its time, and its bytes. It is shown when it is whole,
//! so the receiver finds whole packets only. One that finds no room is lost, however much room
//! there is when its end comes: the packets before it stay.

use alloc::boxed::Box;

use super::Counter;
use super::ring::Ring;
use crate::run::cell::Shared;

/// Where a packet ends in the bytes that arrive on a [`Wire`](crate::Wire).
///
/// This much is known to the code that takes bytes from a device, and so it has no code of
/// the app's. What the packet means is the app's: its decoder gets each.
///
/// See [`WireOptions`](crate::WireOptions).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// With a line feed, which is not in the packet; nor is a carriage return before it. An
    /// empty line is no packet.
    Lines,
    /// With this byte, which is not in the packet. Nothing between two of them is no packet.
    Until(u8),
    /// After so many bytes.
    Fixed(usize),
    /// After as many bytes as the two before it say, the more significant one first. One
    /// wrong length displaces all that follow, so this is for what cannot be disturbed.
    LengthFirst,
    /// Where the device had no more: a packet is what arrived at once.
    Chunks,
}

/// What stands before a packet's bytes in the ring: its length and its time.
const HEADER_BYTES: usize = 4 + 8;

/// The way in of a wire.
pub(crate) struct Incoming {
    framing: Framing,
    longest: usize,
    ring: Ring,
    open: Shared<Open>,
    /// Packets that came, and their bytes.
    pub(crate) packets: Counter,
    pub(crate) bytes: Counter,
    /// Packets for which there was no room, and their bytes.
    pub(crate) lost: Counter,
    pub(crate) lost_bytes: Counter,
    /// Packets longer than they may be.
    pub(crate) too_long: Counter,
    /// Packets that the decoder refused. The receiver counts them.
    pub(crate) refused: Counter,
}

/// The packet that is arriving.
#[derive(Default)]
struct Open {
    /// How many bytes of it have come.
    seen: usize,
    /// Whether some of them found no room.
    is_lost: bool,
    /// [`Framing::LengthFirst`]: how many bytes of the length have come, and what they say.
    prefix: u8,
    announced: usize,
}

impl Incoming {
    /// Makes one with room for the longest packet at least.
    pub(crate) fn new(framing: Framing, longest: usize, room_bytes: usize) -> Self {
        let longest = match framing {
            Framing::Fixed(bytes) => bytes,
            _ => longest,
        };
        Self {
            framing,
            longest,
            ring: Ring::new(room_bytes.max(HEADER_BYTES + longest)),
            open: Shared::new(Open::default()),
            packets: Counter::default(),
            bytes: Counter::default(),
            lost: Counter::default(),
            lost_bytes: Counter::default(),
            too_long: Counter::default(),
            refused: Counter::default(),
        }
    }

    /// Makes room for the longest packet.
    pub(crate) fn buffer(&self) -> Box<[u8]> {
        alloc::vec![0; self.longest].into()
    }

    /// Takes bytes that have arrived. Reports whether a packet is whole now.
    pub(crate) fn arrive(&self, bytes: &[u8], now_ns: u64) -> bool {
        // One device has the wire, and so this succeeds.
        let Some(mut open) = self.open.change() else {
            self.lost_bytes.add(bytes.len());
            return false;
        };
        let (mut is_whole, mut rest) = (false, bytes);
        while !rest.is_empty() {
            let (part, after, ends) = self.divide(&mut open, rest);
            self.put(&mut open, part);
            rest = after;
            if ends {
                is_whole |= self.close(&mut open, now_ns);
            }
        }
        is_whole
    }

    /// Divides bytes into those that belong to the packet and those after it, at least one in
    /// all. Reports whether the packet ends between them.
    fn divide<'b>(&self, open: &mut Open, bytes: &'b [u8]) -> (&'b [u8], &'b [u8], bool) {
        let end = match self.framing {
            Framing::Chunks => return (bytes, &[], true),
            Framing::LengthFirst if open.prefix < 2 => {
                open.prefix += 1;
                open.announced = open.announced << 8 | usize::from(bytes[0]);
                return (&[], &bytes[1..], open.prefix == 2 && open.announced == 0);
            }
            Framing::LengthFirst | Framing::Fixed(_) => {
                let length = match self.framing {
                    Framing::Fixed(length) => length.max(1),
                    _ => open.announced,
                };
                let (part, after) = bytes.split_at(bytes.len().min(length - open.seen));
                return (part, after, open.seen + part.len() == length);
            }
            Framing::Lines => b'\n',
            Framing::Until(end) => end,
        };
        match bytes.iter().position(|byte| *byte == end) {
            Some(at) => (&bytes[..at], &bytes[at + 1..], true),
            None => (bytes, &[], false),
        }
    }

    /// Puts bytes of the packet into the ring, if it can still be shown.
    fn put(&self, open: &mut Open, part: &[u8]) {
        let seen = open.seen.saturating_add(part.len());
        if seen <= self.longest && !part.is_empty() {
            open.is_lost |= !self.ring.put(HEADER_BYTES + open.seen, part);
        }
        open.seen = seen;
    }

    /// Ends the packet, and shows it. Reports whether there is one.
    fn close(&self, open: &mut Open, now_ns: u64) -> bool {
        let Open {
            mut seen, is_lost, ..
        } = core::mem::take(open);
        if seen > self.longest {
            self.too_long.add(1);
            return false;
        }
        let is_line = self.framing == Framing::Lines && seen > 0 && !is_lost;
        if is_line && self.ring.ahead(HEADER_BYTES + seen - 1) == b'\r' {
            seen -= 1;
        }
        if seen == 0 {
            return false;
        }
        if is_lost {
            self.lost.add(1);
            self.lost_bytes.add(seen);
            return false;
        }
        // Its bytes lie beyond, so there is room for these.
        let length = u32::try_from(seen).unwrap_or(u32::MAX).to_le_bytes();
        self.ring.put(0, &length);
        self.ring.put(length.len(), &now_ns.to_le_bytes());
        self.ring.show(HEADER_BYTES + seen);
        self.packets.add(1);
        self.bytes.add(seen);
        true
    }

    /// Returns what tells the packets that are there from those that come later.
    pub(crate) fn mark(&self) -> usize {
        self.ring.written()
    }

    /// Takes the oldest packet before the mark: its bytes, in front of the buffer, and its time.
    pub(crate) fn take<'b>(&self, mark: usize, buffer: &'b mut [u8]) -> Option<(&'b [u8], u64)> {
        if self.ring.waiting(mark) == 0 {
            return None;
        }
        let (mut length, mut time_ns) = ([0; 4], [0; 8]);
        self.ring.peek(0, &mut length);
        self.ring.peek(length.len(), &mut time_ns);
        let length = u32::from_le_bytes(length) as usize;
        let bytes = buffer.get_mut(..length)?;
        self.ring.peek(HEADER_BYTES, bytes);
        self.ring.drop(HEADER_BYTES + length);
        Some((bytes, u64::from_le_bytes(time_ns)))
    }

    /// Counts a packet that the decoder has refused.
    pub(crate) fn refuse(&self) {
        self.refused.add(1);
    }
}
