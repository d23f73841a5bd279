//! The packets of a wire: places for packets on their way in, and on their way out.
//!
//! A platform is the other side of each way: it passes in arrived bytes, and takes packets to send.
//! All [buffers](buffer) are made before the commit; after that, nothing here allocates, waits or
//! loops without a bound.
//!
//! # The way in
//!
//! A packet device swaps a filled buffer for a buffer of the wire. Bytes from a byte device are
//! assembled into packets in place. A packet is shown when it is whole, so the receiver finds only
//! whole packets. A packet without a place is lost, even if places are free by the time its end
//! comes: the earlier packets stay.
//!
//! The receiver looks at a packet in its place, and notes the look: if a fault ends the instance
//! there, the place comes back at the next instance's start.
//!
//! # The way out
//!
//! The packets of an instance leave at its completion, or those of a turn at the wait ending it,
//! all or none. The function puts its bytes into places ahead; the completion or the wait shows
//! them, by a single store however many they are. If a packet finds no place, or is too long, all
//! of them are lost.

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

/// Counts the events of one side, for the other side to read.
#[derive(Default)]
pub(crate) struct EventCounter(AtomicU64);

impl EventCounter {
    fn add(&self, count: usize) {
        // Only one side counts, so a load and a store suffice.
        let before = self.0.load(Ordering::Relaxed);
        self.0.store(before + count as u64, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The rule for the end of a packet in the bytes arriving on a [`Wire`](crate::shared::Wire).
///
/// The code taking bytes from a device needs to know only this rule, and so runs no code of the
/// app. The meaning of a packet is the app's: its decoder gets each packet.
///
/// See [`WireOptions`](crate::shared::WireOptions).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// With a line feed. The line feed is not in the packet; nor is a carriage return before it. An
    /// empty line is no packet.
    Lines,
    /// With this byte, which is not in the packet. Two of them in a row enclose no packet.
    Until(u8),
    /// After a fixed number of bytes.
    Fixed(usize),
    /// After as many bytes as the two bytes before say, the more significant byte first. A single
    /// wrong length displaces all later packets, so this is only for undisturbed connections.
    LengthFirst,
    /// Where the device had no more bytes: a packet is everything that arrived at once.
    Chunks,
}

/// A packet on its way.
#[derive(Debug, Default)]
pub(crate) struct PacketInPlace {
    pub(crate) buffer: Buffer,
    /// The time at which the packet was whole.
    pub(crate) time_ns: u64,
    /// The sender or the receiver, if the device distinguishes any.
    pub(crate) peer: Option<SocketAddrV4>,
}

impl PacketInPlace {
    fn new(longest: usize) -> Self {
        Self {
            buffer: Buffer::new(Buffer::HEADROOM + longest),
            ..Self::default()
        }
    }

    /// Removes this byte from the packet's end, if there. Returns the number of bytes removed.
    fn strip(&mut self, last: u8) -> usize {
        let is_there = self.buffer.content().last() == Some(&last);
        let range = self.buffer.range();
        let count = usize::from(is_there);
        self.buffer.set_range(range.start..range.end - count);
        count
    }

    /// Appends bytes to a packet of `after` bytes. Reports whether there was room.
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
    /// The receiver's end, until the receiver takes it.
    taker: ExclusiveCell<Option<PacketTaker>>,
    level: PlaceLevel<PacketInPlace>,
    /// The number of packets received, and of their bytes.
    pub(crate) packets: EventCounter,
    pub(crate) bytes: EventCounter,
    /// The number of packets without room, and of their bytes.
    pub(crate) lost: EventCounter,
    pub(crate) lost_bytes: EventCounter,
    /// The number of packets exceeding the longest permitted length.
    pub(crate) too_long: EventCounter,
    /// The number of packets refused by the decoder, counted by the receiver.
    pub(crate) refused: EventCounter,
}

/// The packet arriving now.
#[derive(Default)]
struct OpenPacket {
    /// The number of its bytes that have come.
    seen: usize,
    /// Whether some of them found no room.
    is_lost: bool,
    /// [`Framing::LengthFirst`]: the number of length bytes received, and the length announced by
    /// them.
    prefix: u8,
    announced: usize,
}

impl WireInput {
    /// Makes a way in with places for `count` packets.
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

    /// Takes arrived bytes. Reports whether a packet has become whole.
    pub(crate) fn arrive(&self, bytes: &[u8], now_ns: u64) -> bool {
        // Only one device has the wire, so the claim succeeds.
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

    /// Takes a packet in a buffer, by swapping that for the buffer of a place. Reports whether the
    /// packet is there.
    pub(crate) fn swap(
        &self,
        packet: &mut Buffer,
        peer: Option<SocketAddrV4>,
        now_ns: u64,
    ) -> bool {
        // Before the swap, after which `packet` is the place's old buffer.
        let mut seen = packet.content().len();
        let Some(mut arrivals) = self.arrivals.change() else {
            return false;
        };
        let putter = &mut arrivals.0;
        // The driver keeps the buffer of a packet too long or without a place; `close` only counts
        // it.
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

    /// Splits bytes into those belonging to the packet and those after it; takes at least one byte.
    /// Reports whether the packet ends between the two parts.
    fn divide<'b>(&self, open: &mut OpenPacket, bytes: &'b [u8]) -> (&'b [u8], &'b [u8], bool) {
        let end = match self.framing {
            Framing::Chunks => return (bytes, &[], true),
            // One byte at a time: the two bytes of the length may arrive apart.
            Framing::LengthFirst if open.prefix < 2 => {
                open.prefix += 1;
                open.announced = open.announced << 8 | usize::from(bytes[0]);
                // A packet of 0 bytes ends here, or it would end only with the first byte of the
                // next.
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
        // Saturating: a device may send on for ever without the end of a packet.
        let seen = open.seen.saturating_add(part.len());
        // A packet too long is counted to its end, but not stored: the next packet must begin at
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
    /// Whether an instance looks at the oldest packet, or a fault has ended the instance during its
    /// look.
    is_held: bool,
}

impl PacketTaker {
    /// Returns a mark between the present packets and later ones.
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
    // SAFETY: an end is claimed in turns of its subtask and by their completions only; handles that
    // may outlive an instance are checked for this. The subtask begins an instance now, so the
    // claim belongs to an instance that has ended, and is not in use.
    unsafe { end.forget_claim() };
}

/// The way out of a wire.
pub(crate) struct WireOutput {
    staging: ExclusiveCell<Staging>,
    leaving: ExclusiveCell<Leaving>,
    level: PlaceLevel<PacketInPlace>,
    /// The greatest number of bytes in a packet.
    most: AtomicUsize,
    /// Tells the device that there is something to send.
    ready: SetOnce<fn()>,
    /// The number of bytes shown to the device.
    pub(crate) sent: EventCounter,
    /// The number of bytes without room.
    pub(crate) lost: EventCounter,
}

/// The packets of an instance before its completion or next wait.
struct Staging {
    putter: Putter<PacketInPlace>,
    /// The numbers of whole packets, of bytes in the open packet after them, and of all bytes.
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
    /// The number of bytes of the oldest packet already sent.
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

    /// Limits the length of packets, and sets the function telling the device about packets to
    /// send.
    pub(crate) fn begin_packets(&self, most: usize, ready: fn()) {
        self.most.store(most, Ordering::Relaxed);
        self.ready.set(ready);
    }

    /// Begins an instance, with nothing sent.
    pub(crate) fn begin_instance(&self) {
        forget_claim(&self.staging);
        // Whatever an earlier instance has left staged, as after a fault, must not go out with this
        // one's.
        self.show(|_| false);
    }

    /// Puts bytes behind the bytes the instance has sent already. Reports whether there was room
    /// for all.
    pub(crate) fn stage(&self, bytes: &[u8]) -> bool {
        let Some(mut staging) = self.staging.change() else {
            return false;
        };
        let staging = &mut *staging;
        let has_room = staging.open + bytes.len() <= self.most.load(Ordering::Relaxed)
            && (staging.putter.place(staging.packets))
                .is_some_and(|place| place.append(staging.open, bytes));
        // Once a byte has found no room, no further byte is put: a packet with a hole is worse than
        // none.
        staging.is_lost |= !has_room && !bytes.is_empty();
        staging.open = staging.open.saturating_add(bytes.len());
        staging.bytes = staging.bytes.saturating_add(bytes.len());
        !staging.is_lost
    }

    /// Has `write` put a whole packet into its place, and return the packet's length in bytes.
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
            // Called all the same, to count the lost bytes.
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

    /// Sets the receiver of the instance's present packet and of those after it.
    pub(crate) fn address(&self, peer: Option<SocketAddrV4>) {
        if let Some(mut staging) = self.staging.change() {
            staging.peer = peer;
        }
    }

    /// Shows the instance's packets, if `is_complete` returns true, or loses them.
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

    /// Takes the next byte to be sent.
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

    /// Hands over the oldest packet to send. `send` may swap its buffer. Both report whether the
    /// packet has gone.
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

    /// Reports whether there is nothing to send.
    pub(crate) fn is_empty(&self) -> bool {
        self.level.is_empty()
    }
}

/// The effect of the sender's completion, and of each of its waits.
pub(crate) struct SendCompletion(pub(crate) Arc<WireOutput>);

impl Effect for SendCompletion {
    fn happen(&mut self, _completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self.0.show_staged();
    }

    fn wait(&mut self, _: (u64, u64), _: &mut dyn FnMut(Request)) -> bool {
        // A write waits until its bytes have gone, so they go out now and not at the finish.
        self.0.show_staged();
        false
    }
}
