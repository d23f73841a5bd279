//! The driver for Intel's 82574 (82574 GbE Controller Family Datasheet), as emulated by QEMU's
//! `e1000e`: legacy descriptors, a single ring each way, a single message.

use core::sync::atomic::{Ordering, fence};

use executive::devices::{dma::DmaMemory, pci::Function, registers::Registers};

use super::half::{RING, Ring};
use super::{Card, Fault, Map, card, enable_reach, new_memory, tell_address, wait};

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
    pub(super) const ADDRESS: u64 = 0x5400;
    pub(super) const LENGTH: u64 = 0x5408;
}

/// Registers of a ring, relative to its first register.
const RING_LENGTH: u64 = 8;
const RING_TAIL: u64 = 0x18;

/// Bits of the control, the status and the extended control.
const RESET: u32 = 1 << 26;
const SET_LINK_UP: u32 = 1 << 6;
const LINK_UP: u32 = 1 << 1;
/// A message leaves the mask unchanged.
const KEEP_MASK: u32 = 1 << 27;

/// The cause "frame received", with its own message, and the register value for sending it as
/// message 0.
const RECEIVED: u32 = 1 << 20;
const MESSAGE_IS_RECEIVED: u32 = 1 << 3;

/// On, with broadcasts, without check sums, with buffers of 2048 bytes.
const RECEIVE_ON: u32 = 1 << 1 | 1 << 15 | 1 << 26;
/// On, with short frames padded, and the times of half-duplex given in the data sheet.
const TRANSMIT_ON: u32 = 1 << 1 | 1 << 3 | 0x0f << 4 | 0x40 << 12;

/// A descriptor: the buffer's address, 8 bytes; its length and the commands; its state.
const DESCRIPTOR: usize = 16;
const LENGTH: usize = 8;
const STATE: usize = 12;
/// Bits of the state: the card is done with the descriptor; the frame ends here. Errors are above.
const DONE: u32 = 1;
const WHOLE: u32 = 1 << 1;
const ERRORS: u32 = 0xff << 8;
/// The commands of a sent frame: it ends here, gets a check sum, and its state is reported.
const SEND: u32 = 0b1011 << 24;

/// The number of buffers given back to the card at a time: each time costs a write to a register.
const BATCH: u16 = 8;

/// Opens a card.
pub(super) fn open(function: &Function<'_>, map: Map<'_>) -> Result<Card, Fault> {
    let registers = map(0).map_err(Fault::Range)?;
    let registers = registers.part(0, register::LENGTH);
    let registers = registers.ok_or(Fault::Lacks("registers of its kind; use another card"))?;
    registers.write32(register::MASK_CLEAR, u32::MAX);
    let control = registers.read32(register::CONTROL);
    registers.write32(register::CONTROL, control | RESET);
    wait(|| registers.read32(register::CONTROL) & RESET == 0)?;
    enable_reach(function);
    let [a, b, c, d] = registers.read32(register::ADDRESS).to_le_bytes();
    let [e, g, ..] = registers.read32(register::ADDRESS + 4).to_le_bytes();
    card([a, b, c, d, e, g], start(registers)?)
}

/// Starts a card after its reset.
fn start(registers: Registers) -> Result<[LegacyRing; 2], Fault> {
    let control = registers.read32(register::CONTROL);
    registers.write32(register::CONTROL, control | SET_LINK_UP);
    let control = registers.read32(register::EXTENDED_CONTROL);
    registers.write32(register::EXTENDED_CONTROL, control | KEEP_MASK);
    registers.write32(register::MESSAGES, MESSAGE_IS_RECEIVED);
    registers.write32(register::AUTO_CLEAR, RECEIVED);
    let queue = |first| LegacyRing::new(registers, first);
    let queues = [queue(register::RECEIVE)?, queue(register::TRANSMIT)?];
    // Last: from now on the card reads the rings.
    registers.write32(register::RECEIVE_CONTROL, RECEIVE_ON);
    registers.write32(register::TRANSMIT_CONTROL, TRANSMIT_ON);
    Ok(queues)
}

/// A ring. The card has the descriptors from the head, which the card moves, to the tail, which the
/// driver sets. If both are the same, the card has none. So the card has one descriptor less than
/// it was given.
struct LegacyRing {
    registers: Registers,
    first: u64,
    memory: DmaMemory,
    /// The total numbers of descriptors given to the card, and of descriptors taken back.
    given: u16,
    taken: u16,
}

impl LegacyRing {
    fn new(registers: Registers, first: u64) -> Result<Self, Fault> {
        let memory = new_memory()?;
        tell_address(registers, first, memory.address());
        registers.write32(first + RING_LENGTH, 16 * u32::from(RING));
        Ok(Self {
            registers,
            first,
            memory,
            given: 0,
            taken: 0,
        })
    }

    /// Returns the place of the next descriptor to be taken.
    fn next(&self) -> usize {
        DESCRIPTOR * usize::from(self.taken % RING)
    }
}

impl Ring for LegacyRing {
    const HEADER: usize = 0;

    fn free(&self) -> Option<u16> {
        let is_full = self.given.wrapping_sub(self.taken) >= RING - 1;
        (!is_full).then_some(self.given % RING)
    }

    fn post(&mut self, id: u16, address: u64, length: u16) {
        let place = DESCRIPTOR * usize::from(id);
        self.memory.write64(place, address);
        // Clears the state, too, in the word's upper half: `is_done` must not see the last use's.
        let word = u64::from(SEND | u32::from(length));
        self.memory.write64(place + LENGTH, word);
        self.given = self.given.wrapping_add(1);
    }

    fn ring(&mut self) {
        let is_filled = self.first == register::RECEIVE;
        if is_filled && !self.given.is_multiple_of(BATCH) {
            return;
        }
        // One less of the buffers to fill: all 64 are given, and a tail at the head means an empty
        // ring.
        let tail = self.given.wrapping_sub(is_filled.into()) % RING;
        // The card may read the descriptors as soon as it sees the new tail.
        fence(Ordering::Release);
        self.registers.write32(self.first + RING_TAIL, tail.into());
    }

    fn is_done(&self) -> bool {
        // A descriptor that the card was not given still shows the state of its last use.
        self.taken != self.given && self.memory.read32(self.next() + STATE) & DONE != 0
    }

    fn take(&mut self) -> Option<(u16, usize)> {
        // Read the descriptor only after its state has shown that the card is done with it.
        fence(Ordering::Acquire);
        let (id, place) = (self.taken % RING, self.next());
        let is_frame = self.memory.read32(place + STATE) & (WHOLE | ERRORS) == WHOLE;
        let length = self.memory.read16(place + LENGTH);
        self.taken = self.taken.wrapping_add(1);
        Some((id, if is_frame { length.into() } else { 0 }))
    }

    fn set_interrupt(&mut self, is_on: bool) {
        if !is_on {
            return self.registers.write32(register::MASK_CLEAR, RECEIVED);
        }
        // Clearing the cause makes the card forget the frames received with the message off; the
        // caller sees them without a message. Once the read is answered, the card has done so,
        // before anyone looks at the ring.
        self.registers.write32(register::CAUSE, RECEIVED);
        self.registers.write32(register::MASK_SET, RECEIVED);
        let _ = self.registers.read32(register::STATUS);
    }

    fn is_linked(&self) -> bool {
        let status = self.registers.read32(register::STATUS);
        // All ones: the card is not there any more.
        status & LINK_UP != 0 && status != u32::MAX
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::Transmit;
    use crate::half::Half;
    use crate::tests::{self, Device, Words, registers};

    struct Fake {
        registers: Registers,
        halves: [Half<LegacyRing>; 2],
        /// The first descriptor that the card has, by half.
        heads: [u16; 2],
    }

    impl Device for Fake {
        type Ring = LegacyRing;
        const IS_ORDERED: bool = true;

        fn new() -> Self {
            let registers = registers(register::LENGTH);
            Self {
                registers,
                halves: start(registers).unwrap().map(Half::new),
                heads: [0; 2],
            }
        }

        fn halves(&mut self) -> &mut [Half<LegacyRing>; 2] {
            &mut self.halves
        }

        fn owned(&mut self, half: usize) -> Vec<(u16, u64, u32)> {
            let LegacyRing { first, memory, .. } = &self.halves[half].ring;
            let tail = self.registers.read32(first + RING_TAIL);
            let ids = (0..RING).map(|id| (self.heads[half] + id) % RING);
            let ids = ids.take_while(|id| u32::from(*id) != tail);
            let describe = |id| {
                let place = DESCRIPTOR * usize::from(id);
                let commands = memory.read32(place + LENGTH);
                assert!(half == 0 || commands >> 16 == SEND >> 16);
                (id, memory.read64(place), commands & 0xffff)
            };
            ids.map(describe).collect()
        }

        fn give_back(&mut self, half: usize, id: u16, length: u32) {
            let place = DESCRIPTOR * usize::from(id);
            let memory = &mut self.halves[half].ring.memory;
            memory.write32(place + LENGTH, length);
            memory.write32(place + STATE, DONE | WHOLE);
            self.heads[half] = (id + 1) % RING;
        }

        fn is_masked(&self) -> bool {
            let is_masked = self.registers.read32(register::MASK_SET) == 0;
            let cleared = self.registers.read32(register::MASK_CLEAR);
            assert!(cleared == 0 || cleared == RECEIVED && is_masked);
            self.registers.write32(register::MASK_SET, 0);
            self.registers.write32(register::MASK_CLEAR, 0);
            is_masked
        }

        fn set_link(&self, is_up: bool) {
            let link = if is_up { LINK_UP } else { 0 };
            self.registers.write32(register::STATUS, link);
        }
    }

    #[test]
    fn frames_go_both_ways_and_no_buffer_is_lost_or_has_two_owners() {
        tests::exchange::<Fake>(63);
    }

    #[test]
    fn a_masked_card_is_looked_at_again() {
        let card = tests::mask::<Fake>();
        // Of what was seen it does not tell any more.
        assert_eq!(card.registers.read32(register::CAUSE), RECEIVED);
        card.registers.write32(register::STATUS, u32::MAX);
        assert!(!card.halves[0].ring.is_linked());
    }

    #[test]
    fn a_card_that_answers_nonsense_gets_nothing_and_takes_nothing() {
        tests::babble::<Fake>(|card, random, [first, second]| {
            let queue = &mut card.halves[0].ring;
            let place = queue.next();
            let length = random.one_of(&[0, 13, 14, 60, 2048, 2049, u16::MAX]);
            let state = random.one_of(&[0, 1, 2, 3, 3, 3, 0x103, 0x8003, u32::MAX, 0xff]);
            queue.memory.write16(place + LENGTH, length);
            queue.memory.write32(place + STATE, state);
            let is_frame = (14..=2048).contains(&length) && matches!(state, 3 | 0xff);
            let end = is_frame.then_some(length.into());
            let received = tests::receive_one(&mut card.halves[0], first);
            assert_eq!(received, (state & 1 == 1, end));
            let queue = &mut card.halves[1].ring;
            let place = DESCRIPTOR * usize::from(random.within(0..=RING - 1));
            queue.memory.write32(place + STATE, random.within(0..=3));
            card.halves[1].send(second);
            let queue = &card.halves[1].ring;
            assert!(queue.given.wrapping_sub(queue.taken) < RING);
        });
    }

    #[test]
    fn a_card_without_registers_or_end_of_its_reset_is_refused() {
        let words = Words::new(&[(0, 0x10d3_8086)]);
        let open = |length| tests::open(&words, &|_| Some(registers(length)));
        for (length, what) in [
            (8, "registers of its kind; use"),
            (0, "end of its reset; turn"),
        ] {
            let error = open(register::LENGTH - length).err().unwrap();
            let text = alloc::format!("network card at 00:01.0 has no {what}");
            assert!(error.starts_with(&text), "{error}");
        }
    }
}
