//! Intel's 82574 (82574 GbE Controller Family Datasheet), as QEMU's `e1000e` has it: legacy
//! descriptors, one ring each way, one message.

use alloc::boxed::Box;
use core::sync::atomic::{Ordering, fence};

use executive::devices::dma::DmaMemory;
use executive::devices::pci::Function;
use executive::devices::registers::Registers;
use fass::platform::Buffer;
use net::Mac;

use super::{
    Buffers, Card, Fault, LEAST_FRAME, Map, RING, Receive, Transmit, enable_reach, exchange,
    filled, framed, halves, mac, new_buffers, wait,
};

/// Registers (chapter 10).
mod register {
    pub(super) const CONTROL: u64 = 0;
    pub(super) const STATUS: u64 = 8;
    pub(super) const EXTENDED_CONTROL: u64 = 0x18;
    pub(super) const CAUSE: u64 = 0xc0;
    pub(super) const MASK_SET: u64 = 0xd0;
    pub(super) const MASK_CLEAR: u64 = 0xd8;
    pub(super) const AUTO_CLEAR: u64 = 0xdc;
    pub(super) const MESSAGES: u64 = 0xe4;
    pub(super) const RECEIVE_CONTROL: u64 = 0x100;
    pub(super) const TRANSMIT_CONTROL: u64 = 0x400;
    pub(super) const RECEIVE: u64 = 0x2800;
    pub(super) const TRANSMIT: u64 = 0x3800;
    pub(super) const FILTERS: u64 = 0x5200;
    pub(super) const ADDRESS: u64 = 0x5400;
    pub(super) const LENGTH: u64 = 0x5408;
}

/// Registers of a ring, from its first.
const RING_LENGTH: u64 = 8;
const RING_HEAD: u64 = 0x10;
const RING_TAIL: u64 = 0x18;

/// Bits of the control, the status and the extended control.
const RESET: u32 = 1 << 26;
const SET_LINK_UP: u32 = 1 << 6;
const LINK_UP: u32 = 1 << 1;
/// A message leaves the mask as it is.
const KEEP_MASK: u32 = 1 << 27;

/// The cause of a received frame, where it has a message of its own, and that message: number 0.
const RECEIVED: u32 = 1 << 20;
const MESSAGE: u16 = 0;
const MESSAGE_IS_RECEIVED: u32 = 1 << 3;

/// On, with broadcasts, without check sums, by buffers of 2048 bytes.
const RECEIVE_ON: u32 = 1 << 1 | 1 << 15 | 1 << 26;
/// On, with short frames padded, and the times of half-duplex that the data sheet names.
const TRANSMIT_ON: u32 = 1 << 1 | 1 << 3 | 0x0f << 4 | 0x40 << 12;

/// A descriptor: the buffer's address, 8 bytes; its length and the commands; its state.
const DESCRIPTOR: usize = 16;
const LENGTH: usize = 8;
const STATE: usize = 12;
/// Bits of the state: the card is done with it; the frame ends here. Errors are above them.
const DONE: u32 = 1;
const WHOLE: u32 = 1 << 1;
const ERRORS: u32 = 0xff << 8;
/// The commands of a frame that is sent: it ends here, has a check sum, and its state is wanted.
const SEND: u32 = 0b1011 << 24;

/// Buffers are given back to the card so many at a time: each time costs a register.
const BATCH: u16 = 8;

/// Opens a card.
pub(super) fn open(function: &Function<'_>, map: Map<'_>) -> Result<Card, Fault> {
    let registers = map(0).map_err(Fault::Range)?;
    let registers = registers.part(0, register::LENGTH);
    let registers = registers.ok_or(Fault::Lacks("registers of its kind"))?;
    reset(registers)?;
    enable_reach(function);
    let (mac, receiver, transmitter) = start(registers)?;
    Ok(Card {
        mac,
        message: MESSAGE,
        receiver: Box::new(receiver),
        transmitter: Box::new(transmitter),
    })
}

fn reset(registers: Registers) -> Result<(), Fault> {
    registers.write32(register::MASK_CLEAR, u32::MAX);
    let control = registers.read32(register::CONTROL);
    registers.write32(register::CONTROL, control | RESET);
    wait(|| registers.read32(register::CONTROL) & RESET == 0)
}

/// Starts a card after its reset.
fn start(registers: Registers) -> Result<(Mac, Receiver, Transmitter), Fault> {
    let [a, b, c, d] = registers.read32(register::ADDRESS).to_le_bytes();
    let [e, g, ..] = registers.read32(register::ADDRESS + 4).to_le_bytes();
    let mac = mac([a, b, c, d, e, g])?;
    registers.write32(register::MASK_CLEAR, u32::MAX);
    let control = registers.read32(register::CONTROL);
    registers.write32(register::CONTROL, control | SET_LINK_UP);
    for filter in 0..128 {
        registers.write32(register::FILTERS + 4 * filter, 0);
    }
    let control = registers.read32(register::EXTENDED_CONTROL);
    registers.write32(register::EXTENDED_CONTROL, control | KEEP_MASK);
    registers.write32(register::MESSAGES, MESSAGE_IS_RECEIVED);
    registers.write32(register::AUTO_CLEAR, RECEIVED);
    let receive = Ring::new(registers, register::RECEIVE)?;
    let transmit = Ring::new(registers, register::TRANSMIT)?;
    let (receiver, transmitter) = (Receiver::new(receive), Transmitter::new(transmit));
    registers.write32(register::RECEIVE_CONTROL, RECEIVE_ON);
    registers.write32(register::TRANSMIT_CONTROL, TRANSMIT_ON);
    receiver.ring.tell(RING - 1);
    Ok((mac, receiver, transmitter))
}

/// A ring. The card has the descriptors from its head, which it moves, to the tail, which it is
/// told.
struct Ring {
    registers: Registers,
    first: u64,
    memory: DmaMemory,
    buffers: Buffers,
}

impl Ring {
    fn new(registers: Registers, first: u64) -> Result<Self, Fault> {
        let memory = DmaMemory::new(DESCRIPTOR * usize::from(RING)).ok_or(Fault::NoMemory)?;
        let [low, high] = halves(memory.address());
        registers.write32(first, low);
        registers.write32(first + 4, high);
        registers.write32(first + RING_LENGTH, 16 * u32::from(RING));
        registers.write32(first + RING_HEAD, 0);
        registers.write32(first + RING_TAIL, 0);
        Ok(Self {
            registers,
            first,
            memory,
            buffers: new_buffers(RING),
        })
    }

    /// Writes a descriptor that the card does not have.
    fn describe(&mut self, id: u16, address: u64, commands: u32) {
        let place = DESCRIPTOR * usize::from(id);
        self.memory.write64(place, address);
        self.memory.write32(place + LENGTH, commands);
        self.memory.write32(place + STATE, 0);
    }

    /// Returns the state of a descriptor, if the card is done with it.
    fn done(&self, id: u16) -> Option<u32> {
        let state = self.memory.read32(DESCRIPTOR * usize::from(id) + STATE);
        fence(Ordering::Acquire);
        (state & DONE != 0).then_some(state)
    }

    /// Gives the card the descriptors before a tail.
    fn tell(&self, tail: u16) {
        fence(Ordering::Release);
        self.registers.write32(self.first + RING_TAIL, tail.into());
    }
}

/// The half that receives.
struct Receiver {
    ring: Ring,
    /// The descriptor of the next frame.
    next: u16,
    dropped: u64,
    is_dead: bool,
}

impl Receiver {
    fn new(ring: Ring) -> Self {
        let mut receiver = Self {
            ring,
            next: 0,
            dropped: 0,
            is_dead: false,
        };
        (0..RING).for_each(|id| receiver.refill(id));
        receiver
    }

    /// Describes a buffer that the card is to fill.
    fn refill(&mut self, id: u16) {
        match filled(&mut self.ring.buffers[usize::from(id)]) {
            Some(address) => self.ring.describe(id, address, 0),
            None => self.is_dead = true,
        }
    }

    fn next_done(&self) -> Option<u32> {
        self.ring.done(self.next).filter(|_| !self.is_dead)
    }
}

impl Receive for Receiver {
    fn receive(&mut self, each: &mut dyn FnMut(&mut Buffer)) -> bool {
        let Some(state) = self.next_done() else {
            return false;
        };
        let (id, place) = (self.next, usize::from(self.next));
        let length = self.ring.memory.read16(DESCRIPTOR * place + LENGTH);
        let is_frame = (LEAST_FRAME..=Buffer::LEAST_BYTES).contains(&length.into());
        if is_frame && state & (WHOLE | ERRORS) == WHOLE {
            let buffer = &mut self.ring.buffers[place];
            buffer.set_range(0..length.into());
            each(buffer);
        } else {
            self.dropped += 1;
        }
        self.refill(id);
        self.next = (id + 1) % RING;
        if self.next.is_multiple_of(BATCH) && !self.is_dead {
            self.ring.tell(id);
        }
        true
    }

    fn set_interrupt(&mut self, is_on: bool) -> bool {
        let registers = self.ring.registers;
        if is_on && !self.is_dead {
            // Of the frames that came since it was off no message tells, as they are seen below:
            // what the read brings about is that the card has forgotten the cause by then.
            registers.write32(register::CAUSE, RECEIVED);
            registers.write32(register::MASK_SET, RECEIVED);
            let _ = registers.read32(register::STATUS);
        } else {
            registers.write32(register::MASK_CLEAR, RECEIVED);
        }
        fence(Ordering::SeqCst);
        self.next_done().is_some()
    }

    fn is_linked(&self) -> bool {
        let status = self.ring.registers.read32(register::STATUS);
        // All ones: it is not there any more.
        status & LINK_UP != 0 && status != u32::MAX && !self.is_dead
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}

/// The half that sends.
struct Transmitter {
    ring: Ring,
    /// How many descriptors the card was given, and how many were taken back, ever.
    given: u16,
    taken: u16,
}

impl Transmitter {
    fn new(ring: Ring) -> Self {
        Self {
            ring,
            given: 0,
            taken: 0,
        }
    }
}

impl Transmit for Transmitter {
    fn send(&mut self, frame: &mut Buffer) -> bool {
        // As many at most as the card has.
        while self.taken != self.given && self.ring.done(self.taken % RING).is_some() {
            self.taken = self.taken.wrapping_add(1);
        }
        // Of a ring that is full the tail would be the head, as of one that is empty.
        if self.given.wrapping_sub(self.taken) == RING - 1 {
            return false;
        }
        let id = self.given % RING;
        if let Some((address, length)) = framed(frame, 0) {
            exchange(frame, &mut self.ring.buffers[usize::from(id)]);
            self.ring.describe(id, address, SEND | u32::from(length));
            self.given = self.given.wrapping_add(1);
        }
        true
    }

    fn ring(&mut self) {
        self.ring.tell(self.given % RING);
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use random::Random;

    use super::*;
    use crate::tests::{self, Device, Words, accept_mutants, registers};

    struct Fake {
        registers: Registers,
        receiver: Receiver,
        transmitter: Transmitter,
        /// The heads, and how many of those that were fetched were not given back.
        heads: [u16; 2],
        sent: u16,
    }

    impl Fake {
        fn new() -> Self {
            let registers = registers(register::LENGTH);
            registers.write32(register::ADDRESS, 0x1200_5452);
            registers.write32(register::ADDRESS + 4, 0x8000_5634);
            let (mac, receiver, transmitter) = start(registers).unwrap();
            assert_eq!(mac, Mac([0x52, 0x54, 0, 0x12, 0x34, 0x56]));
            Self {
                registers,
                receiver,
                transmitter,
                heads: [0; 2],
                sent: 0,
            }
        }

        fn tail(&self, ring: u64) -> u16 {
            u16::try_from(self.registers.read32(ring + RING_TAIL)).unwrap()
        }
    }

    impl Device for Fake {
        fn halves(&mut self) -> (&mut dyn Receive, &mut dyn Transmit) {
            (&mut self.receiver, &mut self.transmitter)
        }

        fn tables(&mut self) -> [&mut Buffers; 2] {
            let rings = [&mut self.receiver.ring, &mut self.transmitter.ring];
            rings.map(|ring| &mut ring.buffers)
        }

        fn deliver(&mut self, frame: &[u8]) -> bool {
            let head = self.heads[0];
            if head == self.tail(register::RECEIVE) {
                return false;
            }
            self.heads[0] = (head + 1) % RING;
            let Ring {
                memory, buffers, ..
            } = &mut self.receiver.ring;
            let place = DESCRIPTOR * usize::from(head);
            let whole = tests::at(buffers, memory.read64(place));
            whole[..frame.len()].copy_from_slice(frame);
            memory.write16(place + LENGTH, u16::try_from(frame.len()).unwrap());
            memory.write32(place + STATE, DONE | WHOLE);
            true
        }

        fn fetch(&mut self) -> Option<Vec<u8>> {
            let head = self.heads[1];
            (head != self.tail(register::TRANSMIT)).then(|| {
                self.heads[1] = (head + 1) % RING;
                self.sent += 1;
                let Ring {
                    memory, buffers, ..
                } = &mut self.transmitter.ring;
                let place = DESCRIPTOR * usize::from(head);
                let commands = memory.read32(place + LENGTH);
                assert_eq!(commands >> 16, SEND >> 16);
                let whole = tests::at(buffers, memory.read64(place));
                whole[..usize::try_from(commands & 0xffff).unwrap()].to_vec()
            })
        }

        fn finish(&mut self, _: &mut Random) -> bool {
            let is_one = self.sent > 0;
            if is_one {
                let id = (self.heads[1] + RING - self.sent) % RING;
                self.sent -= 1;
                let place = DESCRIPTOR * usize::from(id) + STATE;
                self.transmitter.ring.memory.write32(place, DONE);
            }
            is_one
        }

        fn owns(&mut self, buffer: u64) -> bool {
            let first = [self.heads[0], (self.heads[1] + RING - self.sent) % RING];
            let tails = [register::RECEIVE, register::TRANSMIT].map(|ring| self.tail(ring));
            let memories = [&self.receiver.ring.memory, &self.transmitter.ring.memory];
            (0..2).any(|ring| {
                let ids = (0..RING).map(|id| (first[ring] + id) % RING);
                let mut owned = ids.take_while(|id| *id != tails[ring]);
                owned.any(|id| {
                    let address = memories[ring].read64(DESCRIPTOR * usize::from(id));
                    (buffer..buffer + 2048).contains(&address)
                })
            })
        }

        fn is_masked(&self) -> bool {
            let registers = [register::MASK_CLEAR, register::MASK_SET];
            let [cleared, set] = registers.map(|register| self.registers.read32(register));
            registers
                .iter()
                .for_each(|register| self.registers.write32(*register, 0));
            assert!(cleared == 0 || cleared == RECEIVED || cleared == u32::MAX);
            set != RECEIVED
        }

        fn set_link(&mut self, is_up: bool) {
            let link = if is_up { LINK_UP } else { 0 };
            self.registers.write32(register::STATUS, link);
        }
    }

    #[test]
    fn frames_go_both_ways_and_no_buffer_is_lost_or_has_two_owners() {
        tests::exchange(&mut Fake::new(), 63);
    }

    #[test]
    fn a_masked_card_is_looked_at_again() {
        let mut card = Fake::new();
        tests::masking(&mut card);
        // Of what was seen it does not tell any more.
        assert_eq!(card.registers.read32(register::CAUSE), RECEIVED);
        card.registers.write32(register::STATUS, u32::MAX);
        assert!(!card.receiver.is_linked());
    }

    #[test]
    fn a_card_that_answers_nonsense_gets_nothing_and_takes_nothing() {
        let mut card = Fake::new();
        accept_mutants(&mut card, |card, random, [first, second]| {
            let Fake {
                receiver,
                transmitter,
                ..
            } = card;
            let place = DESCRIPTOR * usize::from(receiver.next);
            let length = random.one_of(&[0, 13, 14, 60, 2048, 2049, u16::MAX]);
            let state = random.one_of(&[0, 1, 2, 3, 3, 3, 0x103, 0x8003, u32::MAX, 0xff]);
            receiver.ring.memory.write16(place + LENGTH, length);
            receiver.ring.memory.write32(place + STATE, state);
            let is_frame = (14..=2048).contains(&length) && matches!(state, 3 | 0xff);
            let mut frames = 0;
            let is_one = receiver.receive(&mut |buffer| {
                frames += 1;
                assert_eq!(buffer.range(), 0..length.into());
                core::mem::swap(buffer, first);
            });
            assert_eq!((is_one, frames), (state & 1 == 1, u32::from(is_frame)));
            let id = random.within(0..=RING - 1);
            let place = DESCRIPTOR * usize::from(id) + STATE;
            transmitter.ring.memory.write32(place, random.within(0..=3));
            second.set_range(64..164);
            transmitter.send(second);
            let out = transmitter.given.wrapping_sub(transmitter.taken);
            assert!(out < RING, "{out}");
        });
        assert!(card.receiver.dropped() > 1000);
    }

    #[test]
    fn a_card_without_registers_or_end_of_its_reset_is_refused() {
        let words = Words::new(&[(0, 0x10d3_8086)]);
        let open = |length| {
            tests::open(&words, &|_| Some(registers(length)))
                .err()
                .unwrap()
        };
        let refused =
            "network card 82574 at 00:01.0 has no registers of its kind; use a card that has";
        assert_eq!(open(register::LENGTH - 8), refused);
        assert!(open(register::LENGTH).contains("does not end its reset; turn"));
        for address in [0, 0x0001] {
            let registers = registers(register::LENGTH);
            registers.write32(register::ADDRESS, address);
            assert_eq!(start(registers).err(), Some(Fault::Lacks("address")));
        }
    }
}
