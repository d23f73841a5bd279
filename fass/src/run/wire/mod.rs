//! The packets of a wire: places for them on their way in, and on their way out.
//!
//! A platform is the other side of each: it says what has arrived, and takes what is to go. All
//! [buffers](buffer) are made before the commit, and nothing here allocates, waits or loops without
//! a bound after that.
//!
//! # The way in
//!
//! A device of packets swaps a filled buffer for a buffer of the wire's. From a device of
//! bytes packets are put together in their place. A packet is shown when it is whole, so the
//! receiver finds whole packets only. A packet without a place is lost, even if there are places when
//! its end comes: the packets before stay.
//!
//! The receiver looks at a packet in its place, and notes the look: if a fault ends the instance
//! there, the place comes back at the next instance's start.
//!
//! # The way out
//!
//! The packets of an instance go at its completion, all or none. The function puts its
//! bytes into places ahead; the completion shows them, by a single store however many they are. If
//! a packet finds no place, or is too long, all of them are lost.

use alloc::sync::Arc;
use core::net::SocketAddrV4;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use sched_dag::lifecycle::Request;

use super::cell::places::{PlaceLevel, Putter, Taker, places};
use super::cell::{ExclusiveCell, SetOnce};
use super::effect::Effect;
use buffer::Buffer;

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

/// A packet on its way.
#[derive(Debug, Default)]
pub(crate) struct PacketInPlace {
    pub(crate) buffer: Buffer,
    /// When it was whole.
    pub(crate) time_ns: u64,
    /// Whom it is from, or to, where the device knows of such.
    pub(crate) peer: Option<SocketAddrV4>,
}

impl PacketInPlace {
    fn new(longest: usize) -> Self {
        Self {
            buffer: Buffer::new(Buffer::HEADROOM + longest),
            ..Self::default()
        }
    }

    /// Takes this byte away from the packet's end, if there. Returns the number of bytes taken.
    fn strip(&mut self, last: u8) -> usize {
        let is_there = self.buffer.content().last() == Some(&last);
        let range = self.buffer.range();
        let count = usize::from(is_there);
        self.buffer.set_range(range.start..range.end - count);
        count
    }

    /// Appends bytes to a packet of so many. Reports whether there was room.
    fn append(&mut self, after: usize, bytes: &[u8]) -> bool {
        let start = Buffer::HEADROOM;
        let (from, end) = (start + after, start + after + bytes.len());
        let place = self.buffer.whole().get_mut(from..end);
        let has_room = place.map(|place| place.copy_from_slice(bytes)).is_some();
        if has_room {
            self.buffer.set_range(start..end);
        }
        has_room
    }
}

/// The way in of a wire.
pub(crate) struct WireInput {
    framing: Framing,
    longest: usize,
    /// The device's end, and the arriving packet.
    arrivals: ExclusiveCell<(Putter<PacketInPlace>, OpenPacket)>,
    /// The receiver's end, until the receiver has it.
    taker: ExclusiveCell<Option<PacketTaker>>,
    level: PlaceLevel<PacketInPlace>,
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
    /// Makes a way in with places for so many packets.
    pub(crate) fn new(framing: Framing, longest: usize, count: usize) -> Self {
        let longest = match framing {
            // A fixed length is the longest packet, whatever the options say.
            Framing::Fixed(bytes) => bytes,
            _ => longest,
        };
        let (putter, taker, level) = places(count, || PacketInPlace::new(longest));
        let taker = PacketTaker {
            taker,
            is_held: false,
        };
        Self {
            framing,
            longest,
            arrivals: ExclusiveCell::new((putter, OpenPacket::default())),
            taker: ExclusiveCell::new(Some(taker)),
            level,
            packets: EventCounter::default(),
            bytes: EventCounter::default(),
            lost: EventCounter::default(),
            lost_bytes: EventCounter::default(),
            too_long: EventCounter::default(),
            refused: EventCounter::default(),
        }
    }

    /// Takes the receiver's end, once.
    pub(crate) fn taker(&self) -> Option<PacketTaker> {
        self.taker.change()?.take()
    }

    /// Takes bytes that have arrived. Reports whether a packet is whole now.
    pub(crate) fn arrive(&self, bytes: &[u8], now_ns: u64) -> bool {
        // One device has the wire, and so this succeeds.
        let Some(mut arrivals) = self.arrivals.change() else {
            self.lost_bytes.add(bytes.len());
            return false;
        };
        let (putter, open) = &mut *arrivals;
        let (mut is_whole, mut rest) = (false, bytes);
        while !rest.is_empty() {
            let (part, after, ends) = self.divide(open, rest);
            self.put(putter, open, part);
            rest = after;
            if ends {
                is_whole |= self.close(putter, core::mem::take(open), now_ns);
            }
        }
        is_whole
    }

    /// Takes a packet in a buffer, by swapping the buffer for a place's. Reports whether the packet
    /// is there.
    pub(crate) fn swap(
        &self,
        packet: &mut Buffer,
        peer: Option<SocketAddrV4>,
        now_ns: u64,
    ) -> bool {
        let mut seen = packet.content().len();
        let Some(mut arrivals) = self.arrivals.change() else {
            return false;
        };
        let putter = &mut arrivals.0;
        let place = putter.place(0).filter(|_| seen <= self.longest);
        let is_lost = place.is_none();
        if let Some(place) = place {
            core::mem::swap(&mut place.buffer, packet);
            place.peer = peer;
            if self.framing == Framing::Lines {
                seen -= place.strip(b'\n');
            }
        }
        let open = OpenPacket {
            seen,
            is_lost,
            ..OpenPacket::default()
        };
        self.close(putter, open, now_ns)
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

    /// Puts bytes of the packet into its place, if it can still be shown.
    fn put(&self, putter: &mut Putter<PacketInPlace>, open: &mut OpenPacket, part: &[u8]) {
        let seen = open.seen.saturating_add(part.len());
        // What is too long is counted to its end, and not stored: the next packet must begin at
        // the right byte.
        if seen <= self.longest && !part.is_empty() {
            let place = putter.place(0);
            open.is_lost |= !place.is_some_and(|place| place.append(open.seen, part));
        }
        open.seen = seen;
    }

    /// Ends the packet, and shows it. Reports whether there is one.
    fn close(
        &self,
        putter: &mut Putter<PacketInPlace>,
        OpenPacket {
            mut seen, is_lost, ..
        }: OpenPacket,
        now_ns: u64,
    ) -> bool {
        if seen > self.longest {
            self.too_long.add(1);
            return false;
        }
        if let Some(place) = putter.place(0).filter(|_| seen > 0 && !is_lost) {
            place.time_ns = now_ns;
            if self.framing == Framing::Lines {
                seen -= place.strip(b'\r');
            }
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
        putter.show(1);
        self.packets.add(1);
        self.bytes.add(seen);
        true
    }

    /// Reports whether no packet is there.
    pub(crate) fn is_empty(&self) -> bool {
        self.level.is_empty()
    }

    /// Counts a packet refused by the decoder.
    pub(crate) fn refuse(&self) {
        self.refused.add(1);
    }
}

/// The receiver's end of the way in.
pub(crate) struct PacketTaker {
    taker: Taker<PacketInPlace>,
    /// Whether an instance looks at the oldest packet, or a fault has ended it there.
    is_held: bool,
}

impl PacketTaker {
    /// Returns a mark between the packets that are there and those that come later.
    pub(crate) fn mark(&self) -> usize {
        self.taker.mark()
    }

    /// Looks at the oldest packet before the mark, and gives the packet back. Up to the mark only:
    /// later packets are for a later instance.
    pub(crate) fn take<R>(
        &mut self,
        mark: usize,
        look: impl FnOnce(&PacketInPlace) -> R,
    ) -> Option<R> {
        self.give_back();
        let place = self.taker.front(mark)?;
        self.is_held = true;
        let seen = look(place);
        self.give_back();
        Some(seen)
    }

    /// Gives back the packet held by an instance.
    pub(crate) fn give_back(&mut self) {
        if core::mem::take(&mut self.is_held) {
            self.taker.give_back();
        }
    }
}

/// The receiver's end for handles that may outlive an instance.
#[doc(hidden)]
pub struct SharedTaker(ExclusiveCell<PacketTaker>);

impl SharedTaker {
    pub(crate) const fn new(taker: PacketTaker) -> Self {
        Self(ExclusiveCell::new(taker))
    }

    /// Looks at the oldest packet.
    pub(crate) fn take<R>(&self, look: impl FnOnce(&PacketInPlace) -> R) -> Option<R> {
        let mut taker = self.0.change()?;
        let mark = taker.mark();
        taker.take(mark, look)
    }

    /// Begins an instance.
    pub(crate) fn begin_instance(&self) {
        forget_claim(&self.0);
    }
}

/// Forgets the claim of an instance ended by a fault.
fn forget_claim<T>(end: &ExclusiveCell<T>) {
    // SAFETY: an end is claimed in turns of its subtask and by their completions only, which is
    // checked where a handle may outlive an instance; the subtask begins an instance now, and so the
    // claim is of one that has ended.
    unsafe { end.forget_claim() };
}

/// The way out of a wire.
pub(crate) struct WireOutput {
    staging: ExclusiveCell<Staging>,
    leaving: ExclusiveCell<Leaving>,
    level: PlaceLevel<PacketInPlace>,
    /// The most bytes of a packet.
    most: AtomicUsize,
    /// Tells the device that there is something to go.
    ready: SetOnce<fn()>,
    /// Bytes that were shown.
    pub(crate) sent: EventCounter,
    /// Bytes for which there was no room.
    pub(crate) lost: EventCounter,
}

/// The packets of an instance before its completion.
struct Staging {
    putter: Putter<PacketInPlace>,
    /// The numbers of whole packets, of bytes of the packet behind them, and of all bytes.
    packets: usize,
    open: usize,
    bytes: usize,
    /// Whether a byte found no room.
    is_lost: bool,
    peer: Option<SocketAddrV4>,
}

/// The device's end of the way out.
struct Leaving {
    taker: Taker<PacketInPlace>,
    /// How many bytes of the oldest packet have gone.
    gone: usize,
}

impl Staging {
    /// Ends the open packet, if not empty.
    fn end_packet(&mut self) {
        if core::mem::take(&mut self.open) > 0 && !self.is_lost {
            if let Some(place) = self.putter.place(self.packets) {
                place.peer = self.peer;
            }
            self.packets += 1;
        }
    }
}

impl WireOutput {
    pub(crate) fn new(longest: usize, count: usize) -> Self {
        let (putter, taker, level) = places(count, || PacketInPlace::new(longest));
        Self {
            staging: ExclusiveCell::new(Staging {
                putter,
                packets: 0,
                open: 0,
                bytes: 0,
                is_lost: false,
                peer: None,
            }),
            leaving: ExclusiveCell::new(Leaving { taker, gone: 0 }),
            level,
            most: AtomicUsize::new(usize::MAX),
            ready: SetOnce::new(),
            sent: EventCounter::default(),
            lost: EventCounter::default(),
        }
    }

    /// Lets no packet be longer, and has the device told when there is something to go.
    pub(crate) fn begin_packets(&self, most: usize, ready: fn()) {
        self.most.store(most, Ordering::Relaxed);
        self.ready.set(ready);
    }

    /// Begins an instance, with nothing sent.
    pub(crate) fn begin_instance(&self) {
        forget_claim(&self.staging);
        self.show(|_| false);
    }

    /// Puts bytes behind what the instance has sent already. Reports whether there was room for all.
    pub(crate) fn stage(&self, bytes: &[u8]) -> bool {
        let Some(mut staging) = self.staging.change() else {
            return false;
        };
        let staging = &mut *staging;
        let has_room = staging.open + bytes.len() <= self.most.load(Ordering::Relaxed)
            && (staging.putter.place(staging.packets))
                .is_some_and(|place| place.append(staging.open, bytes));
        // Once a byte has found no room, none is put any more: a packet with a hole is worse than
        // none.
        staging.is_lost |= !has_room && !bytes.is_empty();
        staging.open = staging.open.saturating_add(bytes.len());
        staging.bytes = staging.bytes.saturating_add(bytes.len());
        !staging.is_lost
    }

    /// Has `write` put a whole packet into its place, and return how many bytes it has.
    pub(crate) fn stage_packet(&self, write: impl FnOnce(&mut [u8]) -> usize) {
        let Some(mut staging) = self.staging.change() else {
            return;
        };
        let staging = &mut *staging;
        staging.end_packet();
        let most = self.most.load(Ordering::Relaxed);
        let place = staging.putter.place(staging.packets);
        let buffer = place.map(|place| &mut place.buffer);
        let length = match buffer {
            Some(buffer) => {
                let room = most.min(buffer.whole().len() - Buffer::HEADROOM);
                let length = write(&mut buffer.whole()[Buffer::HEADROOM..][..room]);
                staging.is_lost |= length > room;
                buffer.set_range(Buffer::HEADROOM..Buffer::HEADROOM + length.min(room));
                length
            }
            // For the count of what is lost.
            None => {
                staging.is_lost = true;
                write(&mut [])
            }
        };
        (staging.open, staging.bytes) = (length, staging.bytes.saturating_add(length));
        staging.end_packet();
    }

    /// Ends the instance's open packet.
    pub(crate) fn end_packet(&self) {
        if let Some(mut staging) = self.staging.change() {
            staging.end_packet();
        }
    }

    /// Says whom the instance's packet, and those after it, are to.
    pub(crate) fn address(&self, peer: Option<SocketAddrV4>) {
        if let Some(mut staging) = self.staging.change() {
            staging.peer = peer;
        }
    }

    /// Shows the instance's packets, if it `is_complete`, or loses them.
    fn show(&self, is_complete: impl FnOnce(&Staging) -> bool) {
        let Some(mut staging) = self.staging.change() else {
            return;
        };
        staging.end_packet();
        let packets = core::mem::take(&mut staging.packets);
        let goes = is_complete(&staging) && packets > 0;
        if goes {
            staging.putter.show(packets);
        }
        // The next instance begins with nothing staged.
        (staging.bytes, staging.is_lost, staging.peer) = (0, false, None);
        drop(staging);
        if let Some(ready) = self.ready.get().filter(|_| goes) {
            ready();
        }
    }

    /// Shows the complete instance's packets, or loses them where there was no room.
    fn show_staged(&self) {
        self.show(|staging| {
            let count = if staging.is_lost {
                &self.lost
            } else {
                &self.sent
            };
            count.add(staging.bytes);
            !staging.is_lost
        });
    }

    /// Takes the next byte that is to go.
    pub(crate) fn take_byte(&self) -> Option<u8> {
        let mut leaving = self.leaving.change()?;
        let Leaving { taker, gone } = &mut *leaving;
        let packet = taker.front(taker.mark())?.buffer.content();
        let byte = packet.get(*gone).copied();
        *gone += 1;
        if *gone >= packet.len() {
            *gone = 0;
            taker.give_back();
        }
        byte
    }

    /// Hands over the oldest packet to go. `send` may swap its buffer, and reports whether the packet
    /// has gone, as does this.
    pub(crate) fn take_packet(&self, send: impl FnOnce(&mut PacketInPlace) -> bool) -> bool {
        let Some(mut leaving) = self.leaving.change() else {
            return false;
        };
        let taker = &mut leaving.taker;
        let mark = taker.mark();
        let has_gone = taker.front(mark).is_some_and(send);
        if has_gone {
            taker.give_back();
        }
        has_gone
    }

    /// Reports whether nothing is to go.
    pub(crate) fn is_empty(&self) -> bool {
        self.level.is_empty()
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
