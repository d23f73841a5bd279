//! virtio-net on PCI (Virtual I/O Device Version 1.1: 2.6 split rings, 4.1 PCI, 5.1 network).
//!
//! A frame is a single descriptor. The frame's header lies right before it in its buffer, and is
//! all zeros, because no header feature is negotiated.

use core::sync::atomic::{Ordering, fence};

use executive::devices::{dma::DmaMemory, pci::Function, registers::Registers};

use super::half::{RING, Ring};
use super::{Card, Fault, MESSAGE, Map, card, enable_reach, new_memory, tell_address, wait};

/// No message.
const NONE: u16 = 0xffff;

/// Registers of the common configuration (4.1.4.3), and its length.
mod common {
    pub(super) const OFFER_SELECT: u64 = 0;
    pub(super) const OFFER: u64 = 4;
    pub(super) const CHOICE_SELECT: u64 = 8;
    pub(super) const CHOICE: u64 = 12;
    pub(super) const STATUS: u64 = 20;
    pub(super) const QUEUE: u64 = 22;
    pub(super) const QUEUE_SIZE: u64 = 24;
    pub(super) const QUEUE_MESSAGE: u64 = 26;
    pub(super) const QUEUE_ON: u64 = 28;
    pub(super) const QUEUE_BELL: u64 = 30;
    pub(super) const QUEUE_PARTS: u64 = 32;
    pub(super) const LENGTH: u64 = 56;
}

/// Values of the status (2.1): acknowledged, with a driver; features chosen; at work.
const DRIVEN: u8 = 1 | 2;
const CHOSEN: u8 = DRIVEN | 8;
const AT_WORK: u8 = CHOSEN | 4;

/// Features, by the halves of their word: an address and the state of the link; version 1.
const ADDRESS_AND_LINK: u32 = 1 << 5 | 1 << 16;
const VERSION_1: u32 = 1;

/// The link's state among the device's registers, after the device's address, and the length of
/// these registers.
const LINK: u64 = 6;
const DEVICE: u64 = 8;

/// The parts of a ring's page: the descriptors, those given to the card, and those the card is done
/// with. The latter two begin with flags, whose bit 0 means "do not call", and an index. The
/// elements of the last part, after the index, are words of 8 bytes.
const GIVEN: usize = 16 * RING as usize;
const DONE: usize = 2052;

/// Opens a card.
pub(super) fn open(function: &Function<'_>, map: Map<'_>) -> Result<Card, Fault> {
    let interface = Interface::find(function, map)?;
    let Interface { common, device, .. } = interface;
    common.write8(common::STATUS, 0);
    wait(|| common.read8(common::STATUS) == 0)?;
    enable_reach(function);
    let mac = [0, 1, 2, 3, 4, 5].map(|at| device.read8(at));
    card(mac, interface.start()?)
}

/// The registers of a card.
#[derive(Clone, Copy)]
struct Interface {
    common: Registers,
    bells: Registers,
    /// The distance between two bells, in bytes.
    distance: u32,
    device: Registers,
}

impl Interface {
    /// Finds the registers by the capabilities describing them (4.1.4).
    fn find(function: &Function<'_>, map: Map<'_>) -> Result<Self, Fault> {
        const VENDOR: u8 = 9;
        let lacks = Fault::Lacks("interface of virtio 1.0; use QEMU's virtio-net-pci");
        let find = |kind, least| {
            let mut all = function.capabilities(VENDOR);
            let at = all.find(|at| function.read(*at).to_le_bytes()[3] == kind);
            let at = at.ok_or(lacks)?;
            let [bar, ..] = function.read(at + 4).to_le_bytes();
            let (offset, length) = (function.read(at + 8), function.read(at + 12));
            let range = map(bar).map_err(Fault::Range)?;
            let range = range.part(offset.into(), length.into());
            let is_right = offset.is_multiple_of(4) && u64::from(length) >= least;
            Ok((range.filter(|_| is_right).ok_or(lacks)?, at))
        };
        let (bells, at) = find(2, 2)?;
        Ok(Self {
            common: find(1, common::LENGTH)?.0,
            bells,
            distance: function.read(at + 16),
            device: find(4, DEVICE)?.0,
        })
    }

    /// Starts a card after its reset (3.1.1).
    fn start(&self) -> Result<[SplitRing; 2], Fault> {
        let common = self.common;
        common.write8(common::STATUS, DRIVEN);
        for (half, features) in [(0, ADDRESS_AND_LINK), (1, VERSION_1)] {
            common.write32(common::OFFER_SELECT, half);
            if common.read32(common::OFFER) & features != features {
                return Err(Fault::Lacks(
                    "address or state of its link; use QEMU's virtio-net-pci",
                ));
            }
            common.write32(common::CHOICE_SELECT, half);
            common.write32(common::CHOICE, features);
        }
        common.write8(common::STATUS, CHOSEN);
        // A card that needs other features takes the bit back (3.1.1).
        if common.read8(common::STATUS) != CHOSEN {
            return Err(Fault::Lacks(
                "way to do without its features; turn these off",
            ));
        }
        let queues = [
            SplitRing::new(self, 0, MESSAGE)?,
            SplitRing::new(self, 1, NONE)?,
        ];
        // Last: from now on the card serves its queues (3.1.1).
        common.write8(common::STATUS, AT_WORK);
        Ok(queues)
    }
}

/// A ring: number 0 is filled, number 1 is sent.
struct SplitRing {
    memory: DmaMemory,
    /// A bit for each descriptor held by the card.
    out: u64,
    /// The numbers of descriptors given to the card, and taken back, ever.
    given: u16,
    taken: u16,
    number: u16,
    bell: Registers,
    device: Registers,
}

impl SplitRing {
    fn new(interface: &Interface, number: u16, message: u16) -> Result<Self, Fault> {
        let common = interface.common;
        common.write16(common::QUEUE, number);
        if common.read16(common::QUEUE_SIZE) < RING {
            return Err(Fault::Lacks("queue of 64 frames; give it longer ones"));
        }
        common.write16(common::QUEUE_SIZE, RING);
        common.write16(common::QUEUE_MESSAGE, message);
        if common.read16(common::QUEUE_MESSAGE) != message {
            return Err(Fault::Lacks("message of a queue; give it vectors"));
        }
        let place = u64::from(common.read16(common::QUEUE_BELL)) * u64::from(interface.distance);
        let bell = interface.bells.part(place, 2);
        let bell = bell.filter(|_| place.is_multiple_of(2));
        let bell = bell.ok_or(Fault::Lacks("bell of a queue; use QEMU's virtio-net-pci"))?;
        let mut memory = new_memory()?;
        let parts = (common::QUEUE_PARTS..).step_by(8).zip([0, GIVEN, DONE]);
        parts.for_each(|(register, part)| {
            tell_address(common, register, memory.address() + part as u64);
        });
        // No message before one is asked for.
        memory.write16(GIVEN, 1);
        // After the queue's other registers (4.1.4.3).
        common.write16(common::QUEUE_ON, 1);
        Ok(Self {
            memory,
            out: 0,
            given: 0,
            taken: 0,
            number,
            bell,
            device: interface.device,
        })
    }

    /// Returns the place of an element of a part, after flags and index, by the element's number
    /// since the start.
    fn place(&self, part: usize, bytes: usize, number: u16) -> usize {
        part + 4 + bytes * usize::from(number & (RING - 1))
    }

    /// Returns the number of descriptors the card reports as done.
    fn done(&self) -> u16 {
        self.memory.read16(DONE + 2).wrapping_sub(self.taken)
    }
}

impl Ring for SplitRing {
    const HEADER: usize = 12;

    fn free(&self) -> Option<u16> {
        let id = u16::try_from(self.out.trailing_ones()).ok();
        id.filter(|id| *id < RING)
    }

    fn post(&mut self, id: u16, address: u64, length: u16) {
        let descriptor = 16 * usize::from(id);
        self.memory.write64(descriptor, address);
        let is_filled = u64::from(self.number == 0);
        let length = u64::from(length) | is_filled << 33;
        self.memory.write64(descriptor + 8, length);
        self.memory.write16(self.place(GIVEN, 2, self.given), id);
        self.out |= 1 << id;
        self.given = self.given.wrapping_add(1);
        // The card may read the descriptor as soon as it sees the new index: publish that last.
        fence(Ordering::Release);
        self.memory.write16(GIVEN + 2, self.given);
    }

    fn ring(&mut self) {
        // The index must be visible before the flag is read: otherwise the card could go to sleep
        // without a call.
        fence(Ordering::SeqCst);
        // A card that looks at the ring anyway asks not to be called.
        if self.memory.read16(DONE) & 1 == 0 {
            self.bell.write16(0, self.number);
        }
    }

    fn is_done(&self) -> bool {
        self.done() != 0
    }

    fn take(&mut self) -> Option<(u16, usize)> {
        // Read the element only after the index that covers it.
        fence(Ordering::Acquire);
        let element = self.memory.read64(self.place(DONE, 8, self.taken));
        let (id, end) = (element & 0xffff_ffff, element >> 32);
        // The first comparison also guards the shift: the card may state any number.
        let is_out = id < 64 && self.out >> id & 1 == 1;
        // A card that returns a descriptor it does not hold, or more than it was given, is not
        // trusted any more: the ring ends.
        if !is_out || self.done() > self.given.wrapping_sub(self.taken) {
            return None;
        }
        self.out ^= 1 << id;
        self.taken = self.taken.wrapping_add(1);
        Some((u16::try_from(id).ok()?, usize::try_from(end).ok()?))
    }

    fn set_interrupt(&mut self, is_on: bool) {
        self.memory.write16(GIVEN, u16::from(!is_on));
    }

    fn is_linked(&self) -> bool {
        self.device.read16(LINK) & 1 != 0
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use random::Random;

    use super::*;
    use crate::half::Half;
    use crate::tests::{self, Device, Words, registers};
    use crate::{Receive, Transmit};

    struct Fake {
        device: Registers,
        halves: [Half<SplitRing>; 2],
        /// How many of those that it was given it has seen, by half, and what it has of them.
        seen: [u16; 2],
        owned: [Vec<(u16, u64, u32)>; 2],
    }

    /// Makes registers of a card that offers what is needed.
    fn offering(length: u64) -> Registers {
        let common = registers(length);
        common.write32(common::OFFER, ADDRESS_AND_LINK | VERSION_1);
        common.write16(common::QUEUE_SIZE, 256);
        common.write16(common::QUEUE_BELL, 3);
        common
    }

    impl Device for Fake {
        type Ring = SplitRing;
        const IS_ORDERED: bool = false;

        fn new() -> Self {
            let (common, device) = (offering(common::LENGTH), registers(DEVICE));
            let interface = Interface {
                common,
                bells: registers(16),
                distance: 4,
                device,
            };
            let queues = interface.start().unwrap();
            assert_eq!(common.read8(common::STATUS), AT_WORK);
            let parts = common.read64(common::QUEUE_PARTS);
            assert_eq!(parts, queues[1].memory.address());
            Self {
                device,
                halves: queues.map(Half::new),
                seen: [0; 2],
                owned: [const { Vec::new() }; 2],
            }
        }

        fn halves(&mut self) -> &mut [Half<SplitRing>; 2] {
            &mut self.halves
        }

        fn owned(&mut self, half: usize) -> Vec<(u16, u64, u32)> {
            let (seen, memory) = (&mut self.seen[half], &self.halves[half].ring.memory);
            let owned = &mut self.owned[half];
            while *seen != memory.read16(GIVEN + 2) {
                let id = memory.read16(GIVEN + 4 + 2 * usize::from(*seen % RING));
                let at = 16 * usize::from(id);
                assert!(!owned.iter().any(|(known, ..)| *known == id), "given twice");
                owned.push((id, memory.read64(at), memory.read32(at + 8)));
                assert_eq!(memory.read16(at + 12), [2, 0][half]);
                *seen = seen.wrapping_add(1);
            }
            owned.clone()
        }

        fn give_back(&mut self, half: usize, id: u16, length: u32) {
            self.owned[half].retain(|(known, ..)| *known != id);
            let memory = &mut self.halves[half].ring.memory;
            let done = memory.read16(DONE + 2);
            let place = DONE + 4 + 8 * usize::from(done % RING);
            memory.write32(place, id.into());
            memory.write32(place + 4, length);
            memory.write16(DONE + 2, done.wrapping_add(1));
        }

        fn is_masked(&self) -> bool {
            self.halves[0].ring.memory.read16(GIVEN) == 1
        }

        fn set_link(&self, is_up: bool) {
            self.device.write16(LINK, is_up.into());
        }
    }

    #[test]
    fn frames_go_both_ways_and_no_buffer_is_lost_or_has_two_owners() {
        tests::exchange::<Fake>(64);
    }

    #[test]
    fn a_masked_card_is_looked_at_again() {
        tests::mask::<Fake>();
    }

    /// Has the card say something of a ring. Returns the length that it says, if the descriptor
    /// may be taken back.
    fn say(queue: &mut SplitRing, random: &mut Random) -> Option<u32> {
        let out = queue.given.wrapping_sub(queue.taken);
        let any = random.within(0..=u16::MAX);
        let done = random.one_of(&[0, 1, 1, 1, 2, out, out + 1, any]);
        let id = random.within(0..=63) << (5 * u32::from(random.once_in(4)));
        let length = random.one_of(&[0, 25, 26, 60, 2048, 2049, u32::MAX]);
        let place = queue.place(DONE, 8, queue.taken);
        queue.memory.write32(place, id);
        queue.memory.write32(place + 4, length);
        let index = queue.taken.wrapping_add(done);
        queue.memory.write16(DONE + 2, index);
        let is_out = id < 64 && queue.out >> id & 1 == 1;
        (done > 0 && done <= out && is_out).then_some(length)
    }

    #[test]
    fn a_card_that_answers_nonsense_gets_nothing_and_takes_nothing() {
        let mut deaths = 0;
        let mut card = tests::babble::<Fake>(|card, random, [first, second]| {
            let length = say(&mut card.halves[0].ring, random);
            let end = length.filter(|end| (26..=2048).contains(end));
            let received = tests::receive_one(&mut card.halves[0], first);
            assert_eq!(received, (length.is_some(), end));
            say(&mut card.halves[1].ring, random);
            card.halves[1].send(second);
            for half in &mut card.halves {
                let queue = &mut half.ring;
                let out = queue.given.wrapping_sub(queue.taken);
                assert_eq!(queue.out.count_ones(), out.into());
                // For the next step it gets one more life.
                deaths += u32::from(core::mem::take(&mut half.is_dead));
                queue.memory.write16(DONE + 2, queue.taken);
            }
        });
        assert!(deaths > 10_000, "{deaths}");
        // Dead, it is as one without a link, and asks for no message.
        let queue = &mut card.halves[0].ring;
        queue.memory.write16(DONE + 2, queue.taken.wrapping_sub(1));
        assert!(!card.halves[0].receive(&mut |_| ()));
        tests::assert_dead(&mut card);
    }

    #[test]
    fn a_card_is_opened_by_what_it_states_or_refused() {
        // The registers are all in range 4.
        let capability = |at, head, offset| [(at, head), (at + 1, 4), (at + 2, offset)];
        let capabilities = [
            capability(16, 0x0110_5009, 0),
            capability(20, 0x0214_6809, 0x40),
            capability(26, 0x0410_0009, 0x80),
            [(0, 0x1000_1af4), (1, 1 << 20), (13, 0x40)],
            [(19, 56), (23, 8), (29, 8)],
        ];
        let open = |word: (usize, u32), change: &dyn Fn(Registers)| {
            let range = offering(256);
            range.write32(0x80, 0x1200_5452);
            range.write32(0x84, 0x5634);
            change(range);
            let words = [&capabilities.concat()[..], &[(24, 2), word]].concat();
            tests::open(&Words::new(&words), &|bar| (bar == 4).then_some(range))
        };
        let card = open((24, 2), &|_| ()).unwrap();
        assert_eq!(card.mac.0, [0x52, 0x54, 0, 0x12, 0x34, 0x56]);
        let refused = |word, change: &dyn Fn(Registers), what| {
            let error = open(word, change).err().unwrap();
            let text = error.strip_prefix("network card at 00:01.0 has no ");
            assert!(text.unwrap().starts_with(what), "{error}");
        };
        // None of a kind, an odd place, a length beyond the range, and lengths that are too short.
        refused((16, 0x0310_5009), &|_| (), "interface of virtio 1.0; use");
        for word in [(18, 2), (19, 257), (19, 55), (23, 1), (29, 7)] {
            refused(word, &|_| (), "interface of virtio 1.0; use");
        }
        refused((27, 5), &|_| (), "registers in memory at BAR 5;");
        refused((24, u32::MAX), &|_| (), "bell of a queue;");
        refused((24, 1), &|_| (), "bell of a queue;");
        for (at, value, what) in [
            (common::QUEUE_SIZE, 32, "queue of 64 frames;"),
            (common::OFFER, 1, "address or state of its link;"),
            (common::OFFER, 0x20, "address or state"),
            (0x80, 0x5453, "address of one card;"),
        ] {
            refused((24, 2), &|range| range.write16(at, value), what);
        }
    }
}
