//! The rings of a wire: one of packets on their way in, and one of bytes on their way out.
//!
//! A platform is the other side of each: it says what has arrived, and takes what is to go.
//! Both rings are made before the commit, and nothing here allocates, waits or loops without
//! a bound after that.
//!
//! # The way in
//!
//! Packets are put together where bytes arrive, and taken apart by the receiver. In the ring a
//! packet is its length, its time, and its bytes. It is shown when it is whole,
//! so the receiver finds whole packets only. One that finds no room is lost, however much room
//! there is when its end comes: the packets before it stay.
//!
//! # The way out
//!
//! The bytes that an instance sends go when it is complete, all or none. The function puts its
//! bytes ahead in the ring; the completion shows them, which is one store
//! however many they are. If one of them found no room, all that the instance sent is lost.
//!
//! # The ring
//!
//! Bytes go from one side that writes to one that reads, perhaps on another core. They are put
//! *ahead* of what is written, in any number of steps, and are there for the
//! reader when they are *shown*, all at once. Neither side ever waits. Each byte is an atomic
//! word, so nothing here is `unsafe`; that the reader finds what was put follows from the
//! `Release` store that shows it.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, AtomicUsize, Ordering};

use sched_dag::lifecycle::Request;

use super::cell::SharedCell;
use super::effect::Effect;

pub(crate) mod buffer;

#[cfg(test)]
mod tests;

/// Counts one side's events; several of them are looked at by another.
#[derive(Default)]
pub(crate) struct EventCounter(AtomicU64);

impl EventCounter {
    fn add(&self, count: usize) {
        // One side counts, so a load and a store suffice.
        let before = self.0.load(Ordering::Relaxed);
        self.0.store(before + count as u64, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Where a packet ends in the bytes that arrive on a [`Wire`](crate::shared::Wire).
///
/// This much is known to the code that takes bytes from a device, and so it has no code of
/// the app's. The meaning of a packet is the app's: its decoder gets each.
///
/// See [`WireOptions`](crate::shared::WireOptions).
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

/// The header before a packet's bytes in the ring: its length and its time.
const HEADER_BYTES: usize = 4 + 8;

/// The way in of a wire.
pub(crate) struct WireInput {
    framing: Framing,
    longest: usize,
    ring: ByteRing,
    open: SharedCell<OpenPacket>,
    /// Packets that came, and their bytes.
    pub(crate) packets: EventCounter,
    pub(crate) bytes: EventCounter,
    /// Packets for which there was no room, and their bytes.
    pub(crate) lost: EventCounter,
    pub(crate) lost_bytes: EventCounter,
    /// Packets longer than they may be.
    pub(crate) too_long: EventCounter,
    /// Packets that the decoder refused. The receiver counts them.
    pub(crate) refused: EventCounter,
}

/// The packet that is arriving.
#[derive(Default)]
struct OpenPacket {
    /// How many bytes of it have come.
    seen: usize,
    /// Whether some of them found no room.
    is_lost: bool,
    /// [`Framing::LengthFirst`]: how many bytes of the length have come, and what they say.
    prefix: u8,
    announced: usize,
}

impl WireInput {
    /// Makes one with room for the longest packet at least.
    pub(crate) fn new(framing: Framing, longest: usize, room_bytes: usize) -> Self {
        let longest = match framing {
            // A fixed length is the longest packet, whatever the options say.
            Framing::Fixed(bytes) => bytes,
            _ => longest,
        };
        Self {
            framing,
            longest,
            ring: ByteRing::new(room_bytes.max(HEADER_BYTES + longest)),
            open: SharedCell::new(OpenPacket::default()),
            packets: EventCounter::default(),
            bytes: EventCounter::default(),
            lost: EventCounter::default(),
            lost_bytes: EventCounter::default(),
            too_long: EventCounter::default(),
            refused: EventCounter::default(),
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
    fn divide<'b>(&self, open: &mut OpenPacket, bytes: &'b [u8]) -> (&'b [u8], &'b [u8], bool) {
        let end = match self.framing {
            Framing::Chunks => return (bytes, &[], true),
            // One byte at a time: the two bytes of the length may arrive apart.
            Framing::LengthFirst if open.prefix < 2 => {
                open.prefix += 1;
                open.announced = open.announced << 8 | usize::from(bytes[0]);
                return (&[], &bytes[1..], open.prefix == 2 && open.announced == 0);
            }
            Framing::LengthFirst | Framing::Fixed(_) => {
                let length = match self.framing {
                    // A packet of 0 bytes would end before each byte, without end.
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
            // The delimiter belongs to neither part.
            Some(at) => (&bytes[..at], &bytes[at + 1..], true),
            None => (bytes, &[], false),
        }
    }

    /// Puts bytes of the packet into the ring, if it can still be shown.
    fn put(&self, open: &mut OpenPacket, part: &[u8]) {
        let seen = open.seen.saturating_add(part.len());
        // What is too long is counted to its end, and not stored: the next packet must begin at
        // the right byte.
        if seen <= self.longest && !part.is_empty() {
            open.is_lost |= !self.ring.put(HEADER_BYTES + open.seen, part);
        }
        open.seen = seen;
    }

    /// Ends the packet, and shows it. Reports whether there is one.
    fn close(&self, open: &mut OpenPacket, now_ns: u64) -> bool {
        let OpenPacket {
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
        // An empty line is no packet.
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
        // The header last, in front of bytes that are there: nothing is shown before all of it is.
        self.ring.put(0, &length);
        self.ring.put(length.len(), &now_ns.to_le_bytes());
        self.ring.show(HEADER_BYTES + seen);
        self.packets.add(1);
        self.bytes.add(seen);
        true
    }

    /// Reports whether no packet is there.
    pub(crate) fn is_empty(&self) -> bool {
        self.ring.waiting(self.mark()) == 0
    }

    /// Returns a mark between the packets that are there and those that come later.
    pub(crate) fn mark(&self) -> usize {
        self.ring.written()
    }

    /// Takes the oldest packet before the mark: its bytes, in front of the buffer, and its time.
    pub(crate) fn take_packet<'b>(
        &self,
        mark: usize,
        buffer: &'b mut [u8],
    ) -> Option<(&'b [u8], u64)> {
        // Up to the mark only: what comes while the instance runs is for a later one.
        if self.ring.waiting(mark) == 0 {
            return None;
        }
        let (mut length, mut time_ns) = ([0; 4], [0; 8]);
        self.ring.peek(0, &mut length);
        self.ring.peek(length.len(), &mut time_ns);
        let length = u32::from_le_bytes(length) as usize;
        let bytes = buffer.get_mut(..length)?;
        self.ring.peek(HEADER_BYTES, bytes);
        // Copied out, so the device may use the room again.
        self.ring.drop(HEADER_BYTES + length);
        Some((bytes, u64::from_le_bytes(time_ns)))
    }

    /// Counts a packet that the decoder has refused.
    pub(crate) fn refuse(&self) {
        self.refused.add(1);
    }
}

/// The way out of a wire.
pub(crate) struct WireOutput {
    ring: ByteRing,
    /// How many bytes the instance has sent that is not complete yet, and whether one of them
    /// found no room.
    staged: AtomicUsize,
    is_lost: AtomicBool,
    /// Bytes that were shown.
    pub(crate) sent: EventCounter,
    /// Bytes for which there was no room.
    pub(crate) lost: EventCounter,
}

impl WireOutput {
    pub(crate) fn new(room_bytes: usize) -> Self {
        Self {
            ring: ByteRing::new(room_bytes),
            staged: AtomicUsize::new(0),
            is_lost: AtomicBool::new(false),
            sent: EventCounter::default(),
            lost: EventCounter::default(),
        }
    }

    /// Forgets what an instance has sent that never was complete.
    pub(crate) fn discard_staged(&self) {
        self.staged.store(0, Ordering::Relaxed);
        self.is_lost.store(false, Ordering::Relaxed);
    }

    /// Puts bytes behind what the instance has sent already. Reports whether there was room for all.
    pub(crate) fn stage(&self, bytes: &[u8]) -> bool {
        let staged = self.staged.load(Ordering::Relaxed);
        // Once a byte has found no room, none is put any more: a packet with a hole is worse than
        // none.
        if self.is_lost.load(Ordering::Relaxed) || !self.ring.put(staged, bytes) {
            self.is_lost.store(true, Ordering::Relaxed);
        }
        let staged = staged.saturating_add(bytes.len());
        self.staged.store(staged, Ordering::Relaxed);
        !self.is_lost.load(Ordering::Relaxed)
    }

    /// Shows what the instance has sent, or loses it.
    fn show_staged(&self) {
        let staged = self.staged.load(Ordering::Relaxed);
        if self.is_lost.load(Ordering::Relaxed) {
            self.lost.add(staged);
        } else {
            self.ring.show(staged);
            self.sent.add(staged);
        }
        // The next instance begins with nothing staged.
        self.discard_staged();
    }

    /// Takes the next byte that is to go.
    pub(crate) fn take_byte(&self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let mut byte = [0];
        self.ring.peek(0, &mut byte);
        self.ring.drop(1);
        Some(byte[0])
    }

    /// Reports whether nothing is to go.
    pub(crate) fn is_empty(&self) -> bool {
        self.ring.waiting(self.ring.written()) == 0
    }
}

/// The effect of the sender's completion.
pub(crate) struct SendCompletion(pub(crate) Arc<WireOutput>);

impl Effect for SendCompletion {
    fn happen(&mut self, _completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.show_staged();
    }

    fn wait(&mut self, _: (u64, u64), _: &mut dyn FnMut(Request)) -> bool {
        self.0.show_staged();
        false
    }
}

struct ByteRing {
    /// A power of two.
    bytes: Box<[AtomicU8]>,
    /// How many bytes have ever been shown, and how many of them taken.
    written: AtomicUsize,
    read: AtomicUsize,
}

impl ByteRing {
    /// Makes a ring with room for so many bytes at least.
    fn new(room_bytes: usize) -> Self {
        let room = room_bytes.max(16).next_power_of_two();
        Self {
            bytes: (0..room).map(|_| AtomicU8::new(0)).collect(),
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
        }
    }

    #[inline(always)]
    fn byte(&self, at: usize) -> &AtomicU8 {
        &self.bytes[at & (self.bytes.len() - 1)]
    }

    /// Puts bytes so far ahead of what is written. Reports whether there was room for them.
    fn put(&self, ahead: usize, bytes: &[u8]) -> bool {
        let written = self.written.load(Ordering::Relaxed);
        let used = written.wrapping_sub(self.read.load(Ordering::Acquire));
        if bytes.len() > self.bytes.len().saturating_sub(used + ahead) {
            return false;
        }
        let mut at = written.wrapping_add(ahead);
        for byte in bytes {
            self.byte(at).store(*byte, Ordering::Relaxed);
            at = at.wrapping_add(1);
        }
        true
    }

    /// Returns the byte that was put so far ahead of what is written.
    fn ahead(&self, ahead: usize) -> u8 {
        let at = self.written.load(Ordering::Relaxed).wrapping_add(ahead);
        self.byte(at).load(Ordering::Relaxed)
    }

    /// Shows so many bytes, which were put.
    fn show(&self, count: usize) {
        let written = self.written.load(Ordering::Relaxed);
        self.written
            .store(written.wrapping_add(count), Ordering::Release);
    }

    /// Returns how many bytes have ever been shown.
    fn written(&self) -> usize {
        self.written.load(Ordering::Acquire)
    }

    /// Returns how many of those shown by `until` are there.
    fn waiting(&self, until: usize) -> usize {
        until.wrapping_sub(self.read.load(Ordering::Relaxed))
    }

    /// Looks at bytes that are there, from so many after the first.
    fn peek(&self, after: usize, bytes: &mut [u8]) {
        let read = self.read.load(Ordering::Relaxed);
        for (at, byte) in (read.wrapping_add(after)..).zip(bytes) {
            *byte = self.byte(at).load(Ordering::Relaxed);
        }
    }

    /// Takes so many bytes out.
    fn drop(&self, count: usize) {
        let read = self.read.load(Ordering::Relaxed);
        self.read.store(read.wrapping_add(count), Ordering::Release);
    }
}
