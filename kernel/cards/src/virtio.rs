//! virtio-net by PCI (Virtual I/O Device Version 1.1: 2.6 split rings, 4.1 PCI, 5.1 network).
//!
//! A frame is one descriptor: its header, which is zeros as nothing of it is negotiated, lies
//! right before it in its buffer.

use alloc::boxed::Box;
use core::sync::atomic::{Ordering, fence};

use executive::devices::dma::DmaMemory;
use executive::devices::pci::Function;
use executive::devices::registers::Registers;
use fass::platform::Buffer;

use super::{
    Buffers, Card, FILLED, Fault, LEAST_FRAME, Map, RING, Receive, Transmit, enable_reach,
    exchange, filled, framed, halves, mac, new_buffers, wait,
};

/// The bytes of the header.
const HEADER: usize = 12;

/// The message of received frames; of nothing else there is one.
const MESSAGE: u16 = 0;
const NO_MESSAGE: u16 = 0xffff;

/// Registers of the common configuration (4.1.4.3), and its length.
mod common {
    pub(super) const OFFER_SELECT: u64 = 0;
    pub(super) const OFFER: u64 = 4;
    pub(super) const CHOICE_SELECT: u64 = 8;
    pub(super) const CHOICE: u64 = 12;
    pub(super) const CONFIGURATION_MESSAGE: u64 = 16;
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

/// The link's state among the registers of the device, behind its address, and their length.
const LINK: u64 = 6;
const DEVICE: u64 = 8;

/// The parts of a ring's page: descriptors, those that the card is given, those that it is done
/// with. The latter two begin with flags, of which bit 0 is "do not call", and an index.
const GIVEN: usize = 16 * RING as usize;
const DONE: usize = 2048;

/// Opens a card.
pub(super) fn open(function: &Function<'_>, map: Map<'_>) -> Result<Card, Fault> {
    let interface = Interface::find(function, map)?;
    let Interface { common, device, .. } = interface;
    common.write8(common::STATUS, 0);
    wait(|| common.read8(common::STATUS) == 0)?;
    enable_reach(function);
    let (receiver, transmitter) = interface.start()?;
    let [a, b, c, d, e, g] = [0, 1, 2, 3, 4, 5].map(|at| device.read8(at));
    Ok(Card {
        mac: mac([a, b, c, d, e, g])?,
        message: MESSAGE,
        receiver: Box::new(receiver),
        transmitter: Box::new(transmitter),
    })
}

/// A card's registers.
#[derive(Clone, Copy)]
struct Interface {
    common: Registers,
    bells: Registers,
    /// The distance of two bells.
    distance: u32,
    device: Registers,
}

impl Interface {
    /// Finds the registers by the capabilities that tell of them (4.1.4).
    fn find(function: &Function<'_>, map: Map<'_>) -> Result<Self, Fault> {
        const VENDOR: u8 = 9;
        let lacks = Fault::Lacks("interface of virtio 1.0");
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
    fn start(&self) -> Result<(Receiver, Transmitter), Fault> {
        let Self { common, device, .. } = *self;
        common.write8(common::STATUS, DRIVEN);
        for (half, features) in [(0, ADDRESS_AND_LINK), (1, VERSION_1)] {
            common.write32(common::OFFER_SELECT, half);
            if common.read32(common::OFFER) & features != features {
                return Err(Fault::Lacks("address, state of its link, or version 1.0"));
            }
            common.write32(common::CHOICE_SELECT, half);
            common.write32(common::CHOICE, features);
        }
        common.write8(common::STATUS, CHOSEN);
        if common.read8(common::STATUS) != CHOSEN {
            return Err(Fault::Lacks("way to work without what it offers"));
        }
        common.write16(common::CONFIGURATION_MESSAGE, NO_MESSAGE);
        let mut receiver = Receiver {
            queue: Queue::new(self, 0, MESSAGE)?,
            device,
            dropped: 0,
        };
        let transmitter = Transmitter(Queue::new(self, 1, NO_MESSAGE)?);
        for id in 0..receiver.queue.size {
            receiver.queue.post_filled(id);
        }
        common.write8(common::STATUS, AT_WORK);
        receiver.queue.ring();
        Ok((receiver, transmitter))
    }
}

/// A ring.
struct Queue {
    memory: DmaMemory,
    buffers: Buffers,
    size: u16,
    /// The descriptors that the card has, a bit each.
    out: u64,
    /// How many it was given, and how many were taken back, ever.
    given: u16,
    taken: u16,
    /// It has said what cannot be.
    is_dead: bool,
    number: u16,
    bell: Registers,
}

impl Queue {
    fn new(interface: &Interface, number: u16, message: u16) -> Result<Self, Fault> {
        let common = interface.common;
        common.write16(common::QUEUE, number);
        let size = common.read16(common::QUEUE_SIZE).min(RING);
        if !size.is_power_of_two() {
            return Err(Fault::Lacks("queue whose length is a power of two"));
        }
        common.write16(common::QUEUE_SIZE, size);
        common.write16(common::QUEUE_MESSAGE, message);
        if common.read16(common::QUEUE_MESSAGE) != message {
            return Err(Fault::Lacks("message of received frames"));
        }
        let place = common.read16(common::QUEUE_BELL);
        let place = u64::from(place) * u64::from(interface.distance);
        let bell = interface.bells.part(place, 2);
        let bell = bell.filter(|_| place.is_multiple_of(2));
        let bell = bell.ok_or(Fault::Lacks("bell of a queue within its registers"))?;
        let mut memory = DmaMemory::new(4096).ok_or(Fault::NoMemory)?;
        let parts = (common::QUEUE_PARTS..).step_by(8).zip([0, GIVEN, DONE]);
        for (register, part) in parts {
            let [low, high] = halves(memory.address() + part as u64);
            common.write32(register, low);
            common.write32(register + 4, high);
        }
        memory.write16(GIVEN, 1);
        common.write16(common::QUEUE_ON, 1);
        Ok(Self {
            memory,
            buffers: new_buffers(size),
            size,
            out: 0,
            given: 0,
            taken: 0,
            is_dead: false,
            number,
            bell,
        })
    }

    /// Gives the card a descriptor.
    fn post(&mut self, id: u16, address: u64, length: u16, is_filled: bool) {
        let descriptor = 16 * usize::from(id);
        self.memory.write64(descriptor, address);
        self.memory.write32(descriptor + 8, length.into());
        self.memory
            .write16(descriptor + 12, 2 * u16::from(is_filled));
        let place = GIVEN + 4 + 2 * usize::from(self.given & (self.size - 1));
        self.memory.write16(place, id);
        self.out |= 1 << id;
        self.given = self.given.wrapping_add(1);
        fence(Ordering::Release);
        self.memory.write16(GIVEN + 2, self.given);
    }

    /// Gives the card a descriptor whose buffer it is to fill.
    fn post_filled(&mut self, id: u16) {
        match filled(&mut self.buffers[usize::from(id)]) {
            Some(address) => self.post(id, address, FILLED, true),
            None => self.is_dead = true,
        }
    }

    /// Returns how many descriptors the card is done with, as it says.
    fn done(&self) -> u16 {
        self.memory.read16(DONE + 2).wrapping_sub(self.taken)
    }

    /// Takes back a descriptor, and how many bytes of its buffer were filled.
    fn take(&mut self) -> Option<(u16, u32)> {
        let done = self.done();
        if done == 0 || self.is_dead {
            return None;
        }
        fence(Ordering::Acquire);
        let place = DONE + 4 + 8 * usize::from(self.taken & (self.size - 1));
        let (id, length) = (self.memory.read32(place), self.memory.read32(place + 4));
        let bit = 1_u64.checked_shl(id).unwrap_or(0);
        // More than it was given, or one that it was not given.
        if done > self.given.wrapping_sub(self.taken) || self.out & bit == 0 {
            self.is_dead = true;
            return None;
        }
        self.out ^= bit;
        self.taken = self.taken.wrapping_add(1);
        Some((u16::try_from(id).ok()?, length))
    }

    /// Tells the card of what it was given, if it wants to know.
    fn ring(&self) {
        fence(Ordering::SeqCst);
        if self.memory.read16(DONE) & 1 == 0 {
            self.bell.write16(0, self.number);
        }
    }
}

/// The half that receives.
struct Receiver {
    queue: Queue,
    device: Registers,
    dropped: u64,
}

impl Receive for Receiver {
    fn receive(&mut self, each: &mut dyn FnMut(&mut Buffer)) -> bool {
        let Some((id, length)) = self.queue.take() else {
            return false;
        };
        let buffer = &mut self.queue.buffers[usize::from(id)];
        match usize::try_from(length) {
            Ok(end) if (HEADER + LEAST_FRAME..=Buffer::LEAST_BYTES).contains(&end) => {
                buffer.set_range(HEADER..end);
                each(buffer);
            }
            _ => self.dropped += 1,
        }
        self.queue.post_filled(id);
        self.queue.ring();
        true
    }

    fn set_interrupt(&mut self, is_on: bool) -> bool {
        let is_on = is_on && !self.queue.is_dead;
        self.queue.memory.write16(GIVEN, u16::from(!is_on));
        // What the card has done by now is seen; of what it does after that it tells.
        fence(Ordering::SeqCst);
        self.queue.done() != 0 && !self.queue.is_dead
    }

    fn is_linked(&self) -> bool {
        !self.queue.is_dead && self.device.read16(LINK) & 1 != 0
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}

/// The half that sends.
struct Transmitter(Queue);

impl Transmit for Transmitter {
    fn send(&mut self, frame: &mut Buffer) -> bool {
        // As many at most as the card has.
        while self.0.take().is_some() {}
        let id = u16::try_from(self.0.out.trailing_ones()).ok();
        let id = id.filter(|id| *id < self.0.size && !self.0.is_dead);
        let Some(id) = id else {
            return false;
        };
        if let Some((address, length)) = framed(frame, HEADER) {
            exchange(frame, &mut self.0.buffers[usize::from(id)]);
            self.0.post(id, address, length, false);
        }
        true
    }

    fn ring(&mut self) {
        self.0.ring();
    }
}

#[cfg(test)]
mod tests {
    use alloc::collections::BTreeMap;
    use alloc::vec::Vec;

    use random::Random;

    use super::*;
    use crate::tests::{self, Device, Words, accept_mutants, registers};

    /// A ring as the card sees it.
    #[derive(Default)]
    struct Side {
        seen: u16,
        done: u16,
        /// The address and length of each descriptor that the card has.
        owned: BTreeMap<u16, (u64, u32)>,
        /// Those of them that were sent, but not given back.
        sent: Vec<u16>,
    }

    impl Side {
        /// Takes what the driver has given.
        fn look(&mut self, queue: &Queue) {
            let memory = &queue.memory;
            while self.seen != memory.read16(GIVEN + 2) {
                let place = GIVEN + 4 + 2 * usize::from(self.seen % queue.size);
                let id = memory.read16(place);
                let descriptor = 16 * usize::from(id);
                let buffer = (memory.read64(descriptor), memory.read32(descriptor + 8));
                let before = self.owned.insert(id, buffer);
                assert!(before.is_none(), "descriptor {id} is given twice");
                self.seen = self.seen.wrapping_add(1);
            }
        }

        fn give_back(&mut self, queue: &mut Queue, id: u16, length: u32) {
            self.owned.remove(&id);
            let place = DONE + 4 + 8 * usize::from(self.done % queue.size);
            queue.memory.write32(place, id.into());
            queue.memory.write32(place + 4, length);
            self.done = self.done.wrapping_add(1);
            queue.memory.write16(DONE + 2, self.done);
        }
    }

    struct Fake {
        device: Registers,
        receiver: Receiver,
        transmitter: Transmitter,
        sides: [Side; 2],
    }

    impl Fake {
        fn new(size: u16) -> Self {
            let (common, device) = (registers(common::LENGTH), registers(DEVICE));
            common.write32(common::OFFER, ADDRESS_AND_LINK | VERSION_1);
            common.write16(common::QUEUE_SIZE, size);
            common.write16(common::QUEUE_BELL, 3);
            let interface = Interface {
                common,
                bells: registers(16),
                distance: 4,
                device,
            };
            let (receiver, transmitter) = interface.start().unwrap();
            assert_eq!(common.read8(common::STATUS), AT_WORK);
            let parts = common.read64(common::QUEUE_PARTS);
            assert_eq!(parts, transmitter.0.memory.address());
            Self {
                device,
                receiver,
                transmitter,
                sides: Default::default(),
            }
        }
    }

    impl Device for Fake {
        fn halves(&mut self) -> (&mut dyn Receive, &mut dyn Transmit) {
            (&mut self.receiver, &mut self.transmitter)
        }

        fn tables(&mut self) -> [&mut Buffers; 2] {
            let queues = [&mut self.receiver.queue, &mut self.transmitter.0];
            queues.map(|queue| &mut queue.buffers)
        }

        fn deliver(&mut self, frame: &[u8]) -> bool {
            let (side, queue) = (&mut self.sides[0], &mut self.receiver.queue);
            side.look(queue);
            let taken = if side.done % 3 == 0 {
                side.owned.last_key_value()
            } else {
                side.owned.first_key_value()
            };
            let Some((&id, &(address, length))) = taken else {
                return false;
            };
            assert_eq!(length, 2048);
            let whole = tests::at(&mut queue.buffers, address);
            whole[..HEADER].fill(0xff);
            whole[HEADER..HEADER + frame.len()].copy_from_slice(frame);
            let length = u32::try_from(HEADER + frame.len()).unwrap();
            side.give_back(queue, id, length);
            true
        }

        fn fetch(&mut self) -> Option<Vec<u8>> {
            let (side, queue) = (&mut self.sides[1], &mut self.transmitter.0);
            side.look(queue);
            let mut new = side.owned.iter().filter(|(id, _)| !side.sent.contains(id));
            // As one is fetched after each that is sent, there is no other.
            let (&id, &(address, length)) = new.next()?;
            side.sent.push(id);
            let sent = &tests::at(&mut queue.buffers, address)[..usize::try_from(length).unwrap()];
            assert_eq!(sent[..HEADER], [0; HEADER]);
            Some(sent[HEADER..].to_vec())
        }

        fn finish(&mut self, random: &mut Random) -> bool {
            let (side, queue) = (&mut self.sides[1], &mut self.transmitter.0);
            if side.sent.is_empty() {
                return false;
            }
            let id = side.sent.swap_remove(random.index(side.sent.len()));
            side.give_back(queue, id, 0);
            true
        }

        fn owns(&mut self, buffer: u64) -> bool {
            self.sides[0].look(&self.receiver.queue);
            self.sides[1].look(&self.transmitter.0);
            let mut owned = self.sides.iter().flat_map(|side| side.owned.values());
            owned.any(|(address, _)| (buffer..buffer + 2048).contains(address))
        }

        fn is_masked(&self) -> bool {
            self.receiver.queue.memory.read16(GIVEN) == 1
        }

        fn set_link(&mut self, is_up: bool) {
            self.device.write16(LINK, is_up.into());
        }
    }

    #[test]
    fn frames_go_both_ways_and_no_buffer_is_lost_or_has_two_owners() {
        for size in [1, 8, 256] {
            tests::exchange(&mut Fake::new(size), size.min(RING).into());
        }
    }

    #[test]
    fn a_masked_card_is_looked_at_again() {
        tests::masking(&mut Fake::new(64));
    }

    /// Has the card say something of a ring. Returns the length that it says, if the descriptor
    /// may be taken back.
    fn say(queue: &mut Queue, random: &mut Random) -> Option<u32> {
        let out = queue.given.wrapping_sub(queue.taken);
        let near = [
            0,
            1,
            1,
            1,
            2,
            out,
            out.wrapping_add(1),
            random.within(0..=u16::MAX),
        ];
        let done = random.one_of(&near);
        let id = random.within(0..=63) << (5 * u32::from(random.once_in(4)));
        let length = random.one_of(&[0, 25, 26, 60, 2048, 2049, u32::MAX]);
        let place = DONE + 4 + 8 * usize::from(queue.taken & 63);
        queue.memory.write32(place, id);
        queue.memory.write32(place + 4, length);
        queue
            .memory
            .write16(DONE + 2, queue.taken.wrapping_add(done));
        let is_out = id < 64 && queue.out >> id & 1 == 1;
        (done > 0 && done <= out && is_out).then_some(length)
    }

    #[test]
    fn a_card_that_answers_nonsense_gets_nothing_and_takes_nothing() {
        let mut card = Fake::new(64);
        let mut deaths = 0;
        accept_mutants(&mut card, |card, random, [first, second]| {
            let Fake {
                receiver,
                transmitter,
                ..
            } = card;
            let length = say(&mut receiver.queue, random);
            let mut frames = 0;
            let is_one = receiver.receive(&mut |buffer| {
                frames += 1;
                assert_eq!(u32::try_from(buffer.range().end).ok(), length);
                core::mem::swap(buffer, first);
            });
            let is_frame = length.is_some_and(|length| (26..=2048).contains(&length));
            assert_eq!((is_one, frames), (length.is_some(), u32::from(is_frame)));
            say(&mut transmitter.0, random);
            second.set_range(64..164);
            transmitter.send(second);
            for queue in [&mut receiver.queue, &mut transmitter.0] {
                let out = queue.given.wrapping_sub(queue.taken);
                assert_eq!(queue.out.count_ones(), out.into());
                // For the next step it gets one more life.
                deaths += u32::from(core::mem::take(&mut queue.is_dead));
                queue.memory.write16(DONE + 2, queue.taken);
            }
        });
        assert!(deaths > 10_000 && card.receiver.dropped() > 1000);
        // Dead, it is as one without a link, and asks for no message.
        card.set_link(true);
        assert!(card.receiver.is_linked());
        let queue = &mut card.receiver.queue;
        queue.memory.write16(DONE + 2, queue.taken.wrapping_sub(1));
        assert!(
            !card
                .receiver
                .receive(&mut |_| panic!("a frame of a dead card"))
        );
        assert!(!card.receiver.set_interrupt(true) && card.is_masked());
        assert!(!card.receiver.is_linked());
    }

    /// The capabilities of a card whose registers are all in range 4.
    const CAPABILITIES: [(usize, u32); 14] = [
        (1, 1 << 20),
        (13, 0x40),
        (16, 0x0110_5009),
        (17, 4),
        (18, 0),
        (19, 56),
        (20, 0x0214_6809),
        (21, 4),
        (22, 0x40),
        (23, 8),
        (24, 2),
        (26, 0x0410_0009),
        (27, 4),
        (28, 0x80),
    ];

    #[test]
    fn a_card_is_opened_by_what_it_states_or_refused() {
        let open = |words: &[(usize, u32)], change: &dyn Fn(Registers)| {
            let range = registers(256);
            range.write32(common::OFFER, ADDRESS_AND_LINK | VERSION_1);
            range.write16(common::QUEUE_SIZE, 256);
            range.write16(common::QUEUE_BELL, 3);
            range.write32(0x80, 0x1200_5452);
            range.write32(0x84, 0x5634);
            change(range);
            let all = [&CAPABILITIES[..], &[(0, 0x1000_1af4), (29, 8)], words].concat();
            tests::open(&Words::new(&all), &|bar| (bar == 4).then_some(range))
        };
        let none = |_: Registers| ();
        let card = open(&[], &none).unwrap();
        assert_eq!(
            alloc::format!("{} {}", card.mac, card.message),
            "52:54:00:12:34:56 0"
        );
        let refused = |words: &[(usize, u32)], change: &dyn Fn(Registers), what: &str| {
            let error = open(words, change).err().unwrap();
            let text = alloc::format!("network card virtio-net at 00:01.0 has no {what}");
            assert!(error.starts_with(&text), "{error}");
        };
        let interface = "interface of virtio 1.0; use a card that has";
        // None of a kind, an odd place, a length beyond the range, and lengths that are too short.
        for word in [
            (16, 0x0310_5009),
            (18, 2),
            (19, 257),
            (19, 55),
            (23, 1),
            (29, 7),
        ] {
            refused(&[word], &none, interface);
        }
        refused(&[(27, 5)], &none, "registers in memory at BAR 5;");
        refused(&[(24, u32::MAX)], &none, "bell of a queue");
        refused(&[(24, 1)], &none, "bell of a queue");
        for (at, value, what) in [
            (common::QUEUE_SIZE, 0, "queue whose length"),
            (common::QUEUE_SIZE, 48, "queue whose length"),
            (
                common::OFFER,
                1,
                "address, state of its link, or version 1.0;",
            ),
            (common::OFFER, 0x20, "address, state"),
            (0x80, 0x5453, "address;"),
        ] {
            refused(&[], &|range| range.write16(at, value), what);
        }
    }
}
