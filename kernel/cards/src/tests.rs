//! Fakes of a card's parts, and what is asked of each card by them.

use alloc::boxed::Box;
use alloc::collections::{BTreeSet, VecDeque};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::cell::RefCell;

use executive::devices::pci::{Configuration, PciError, find};
use random::Random;

use super::*;

/// The configuration space of one function.
pub(crate) struct Words(RefCell<[u32; 64]>);

impl Words {
    pub(crate) fn new(words: &[(usize, u32)]) -> Self {
        let mut space = [0; 64];
        words.iter().for_each(|(at, word)| space[*at] = *word);
        Self(RefCell::new(space))
    }
}

impl Configuration for Words {
    fn read(&self, place: Place, offset: u16) -> u32 {
        let word = self.0.borrow()[usize::from(offset / 4) % 64];
        if place.0 == 8 { word } else { u32::MAX }
    }

    fn write(&self, _: Place, offset: u16, value: u32) {
        // The status, the upper half of the second word, stays as it is.
        let fixed = if offset == 4 { 0xffff_0000 } else { 0 };
        let word = &mut self.0.borrow_mut()[usize::from(offset / 4)];
        *word = *word & fixed | value & !fixed;
    }
}

/// Makes registers of memory.
pub(crate) fn registers(length: u64) -> Registers {
    let words = usize::try_from(length.div_ceil(8)).unwrap();
    Registers::over(Box::leak(alloc::vec![0; words].into()))
}

/// Opens a card whose ranges of registers are in memory.
pub(crate) fn open(words: &Words, map: &dyn Fn(u8) -> Option<Registers>) -> Result<Card, String> {
    let mut card = None;
    find(words, &mut |function| {
        let map = |bar| map(bar).ok_or(RangeError::Function(PciError::NoRange(bar)));
        card = open_by(&function, &map);
    });
    let card = card.unwrap().map_err(|error| error.to_string());
    // It reaches memory if it has come that far, and has no line.
    let command = words.0.borrow()[1] & 0x406;
    assert!(command == 0x406 || command == 0x402 && card.is_err());
    card
}

#[test]
fn a_function_that_is_no_known_card_is_left_alone() {
    for id in [0x1001_1af4, 0x1041_8086, 0x100e_8086, 0x10d3_1af4] {
        let words = Words::new(&[(0, id)]);
        find(&words, &mut |function| {
            assert!(super::open(&function).is_none())
        });
        assert_eq!(words.0.borrow()[1], 0);
    }
}

/// A card as its maker sees it.
pub(crate) trait Device {
    fn halves(&mut self) -> (&mut dyn Receive, &mut dyn Transmit);
    fn tables(&mut self) -> [&mut Buffers; 2];
    /// Fills a buffer, if the card has one.
    fn deliver(&mut self, frame: &[u8]) -> bool;
    /// Sends a frame, if there is one.
    fn fetch(&mut self) -> Option<Vec<u8>>;
    /// Gives back one of those that were sent, if there is one.
    fn finish(&mut self, random: &mut Random) -> bool;
    /// Returns whether the card has been told an address within a buffer and may use it.
    fn owns(&mut self, buffer: u64) -> bool;
    /// Returns whether the last call has turned messages off.
    fn is_masked(&self) -> bool;
    fn set_link(&mut self, is_up: bool);
}

/// Returns the memory of the buffer with an address in it, from there on.
pub(crate) fn at(buffers: &mut Buffers, address: u64) -> &mut [u8] {
    let start = |buffer: &mut Buffer| buffer.whole().as_ptr() as u64;
    let buffer = buffers.iter_mut().find_map(|buffer| {
        let offset = address.wrapping_sub(start(buffer));
        (offset < 2048).then(|| &mut buffer.whole()[usize::try_from(offset).unwrap()..])
    });
    buffer.unwrap()
}

/// Returns the addresses of all buffers, none of which is there twice.
pub(crate) fn addresses(card: &mut impl Device, hand: &mut [Buffer]) -> BTreeSet<u64> {
    let tables = card.tables().map(|table| table.iter_mut());
    let all = tables.into_iter().flatten().chain(hand);
    let all: Vec<_> = all.map(|buffer| filled(buffer).unwrap()).collect();
    let set: BTreeSet<_> = all.iter().copied().collect();
    assert_eq!(set.len(), all.len(), "a buffer has two owners");
    set
}

fn new_frame(random: &mut Random) -> Vec<u8> {
    let length = random.within(LEAST_FRAME..=MOST_FRAME);
    let first = random.number().to_le_bytes();
    first.into_iter().cycle().take(length).collect()
}

/// Frames that go both ways, and what a wire has in its hand.
struct Traffic<'d, D> {
    card: &'d mut D,
    random: Random,
    hand: [Buffer; 8],
    arriving: VecDeque<Vec<u8>>,
    /// How many may be, and are, on their way out.
    room: usize,
    in_flight: usize,
    /// How many found no buffer, were received, and found no room.
    counts: [u32; 3],
}

/// Has frames go both ways, in random order, by a ring with so much room.
pub(crate) fn exchange(card: &mut impl Device, room: usize) {
    let mut hand = [(); 8].map(|()| Buffer::new(Buffer::LEAST_BYTES));
    let before = addresses(card, &mut hand);
    let mut traffic = Traffic {
        card,
        random: Random::new(1),
        hand,
        arriving: VecDeque::new(),
        room,
        in_flight: 0,
        counts: [0; 3],
    };
    for step in 0..100_000_u32 {
        match traffic.random.within(0..=3) {
            0 => traffic.arrive(),
            1 => traffic.receive(),
            2 => traffic.send(),
            // Now and then none is given back for a while.
            _ if step / 1000 % 2 == 0 => traffic.finish(),
            _ => {}
        }
        if step % 101 == 0 {
            assert_eq!(addresses(traffic.card, &mut traffic.hand), before);
        }
    }
    let counts = traffic.counts;
    assert!(counts.into_iter().all(|count| count > 100), "{counts:?}");
    traffic.send_no_frames();
}

impl<D: Device> Traffic<'_, D> {
    fn arrive(&mut self) {
        let frame = new_frame(&mut self.random);
        if self.card.deliver(&frame) {
            self.arriving.push_back(frame);
        } else {
            self.counts[0] += 1;
        }
    }

    fn receive(&mut self) {
        let held = &mut self.hand[self.random.index(8)];
        let (mut given, is_swapped) = (None, self.random.chance(50));
        let is_one = self.card.halves().0.receive(&mut |buffer| {
            given = Some((filled(buffer).unwrap(), buffer.content().to_vec()));
            if is_swapped {
                core::mem::swap(buffer, held);
            }
        });
        let (address, frame) = given.unzip();
        assert_eq!(
            (is_one, &frame),
            (frame.is_some(), &self.arriving.pop_front())
        );
        self.counts[1] += u32::from(is_one);
        if is_one && is_swapped {
            assert_eq!(filled(held), address);
            assert!(!self.card.owns(address.unwrap()));
        }
    }

    fn send(&mut self) {
        let (frame, start) = (new_frame(&mut self.random), self.random.within(12..=64));
        let held = &mut self.hand[self.random.index(8)];
        let before = (filled(held), start..start + frame.len());
        held.set_range(before.1.clone());
        held.content_mut().copy_from_slice(&frame);
        let is_taken = self.card.halves().1.send(held);
        self.card.halves().1.ring();
        assert_eq!(is_taken, self.in_flight < self.room);
        assert!(!self.card.owns(filled(held).unwrap()));
        if is_taken {
            self.in_flight += 1;
            let mut sent = self.card.fetch().unwrap();
            assert_eq!(sent.len(), frame.len().max(60));
            assert!(sent.split_off(frame.len()).iter().all(|byte| *byte == 0));
            assert_eq!(sent, frame);
            assert_ne!(filled(held), before.0);
        } else {
            self.counts[2] += 1;
            assert_eq!((filled(held), held.range()), before);
        }
        assert!(self.card.fetch().is_none());
    }

    fn finish(&mut self) {
        self.in_flight -= usize::from(self.card.finish(&mut self.random));
    }

    /// Too short, too long, without room for a header, and beyond the buffer where it is padded.
    fn send_no_frames(&mut self) {
        while self.card.finish(&mut self.random) {}
        for range in [64..77, 64..64 + 1515, 2030..2048] {
            self.hand[0].set_range(range.clone());
            assert!(self.card.halves().1.send(&mut self.hand[0]));
            self.card.halves().1.ring();
            assert!(self.card.fetch().is_none() && self.hand[0].range() == range);
        }
    }
}

/// Has frames come while messages are off, and a buffer that is too short.
pub(crate) fn masking(card: &mut impl Device) {
    assert!(card.is_masked(), "a card calls before it is asked to");
    assert!(!card.halves().0.set_interrupt(true) && !card.is_masked());
    assert!(!card.halves().0.set_interrupt(false) && card.is_masked());
    assert!(card.deliver(&[1; 60]));
    assert!(card.halves().0.set_interrupt(true) && !card.is_masked());
    assert!(card.halves().0.receive(&mut |_| ()));
    assert!(!card.halves().0.set_interrupt(true) && !card.is_masked());
    card.set_link(false);
    assert!(!card.halves().0.is_linked());
    card.set_link(true);
    assert!(card.halves().0.is_linked());
    // A buffer that the card would write beyond is never told to it.
    assert!(card.deliver(&[1; 60]) && card.deliver(&[2; 60]));
    let mut short = Buffer::default();
    let each = &mut |buffer: &mut Buffer| core::mem::swap(buffer, &mut short);
    assert!(card.halves().0.receive(each));
    assert!(!card.halves().0.is_linked() && !card.halves().0.receive(&mut |_| ()));
    assert!(!card.halves().0.set_interrupt(true) && card.is_masked());
}

/// Takes steps with a card that says anything, during which no buffer may be lost or double.
pub(crate) fn accept_mutants<D: Device>(
    card: &mut D,
    mut step: impl FnMut(&mut D, &mut Random, &mut [Buffer; 2]),
) {
    let mut random = Random::new(1);
    let mut hand = [(); 2].map(|()| Buffer::new(Buffer::LEAST_BYTES));
    let before = addresses(card, &mut hand);
    for number in 0..100_000 {
        step(card, &mut random, &mut hand);
        card.halves().0.set_interrupt(random.chance(50));
        if number % 101 == 0 {
            assert_eq!(addresses(card, &mut hand), before);
        }
    }
}
