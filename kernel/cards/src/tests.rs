//! Fakes of a card's parts, and what is asked of each card by them.

use super::*;
use alloc::collections::{BTreeSet, VecDeque};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::cell::RefCell;
use executive::devices::pci::{Configuration, find};
use random::Random;

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
        let map = |bar| map(bar).ok_or(PciError::NoRange(bar));
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
        let mut known = 0;
        find(&words, &mut |function| {
            known += u32::from(super::open(&function).is_some())
        });
        assert_eq!((known, words.0.borrow()[1]), (0, 0));
    }
}

/// A card as its maker sees it: what it has of each half, and says of it.
pub(crate) trait Device: Sized {
    type Ring: Ring;
    /// Are descriptors given back in order?
    const IS_ORDERED: bool;

    fn new() -> Self;
    fn halves(&mut self) -> &mut [Half<Self::Ring>; 2];
    /// Returns what the card has been told of a half, and may use: number, address and length.
    fn owned(&mut self, half: usize) -> Vec<(u16, u64, u32)>;
    fn give_back(&mut self, half: usize, id: u16, length: u32);
    /// Returns whether the last call has turned messages off.
    fn is_masked(&self) -> bool;
    fn set_link(&self, is_up: bool);

    /// Chooses one of several descriptors that it has.
    fn choose(random: &mut Random, count: usize) -> usize {
        random.index(if Self::IS_ORDERED { 1 } else { count })
    }

    /// Returns the memory at an address that the card has been told.
    fn at(&mut self, half: usize, address: u64) -> &mut [u8] {
        let buffers = self.halves()[half].buffers.iter_mut();
        let mut places = buffers.map(|buffer| {
            let offset = usize::try_from(address.wrapping_sub(start(buffer))).unwrap();
            buffer.whole().get_mut(offset..)
        });
        places.find_map(|place| place).unwrap()
    }

    /// Fills a buffer, if the card has one.
    fn deliver(&mut self, random: &mut Random, frame: &[u8]) -> bool {
        let owned = self.owned(0);
        if owned.is_empty() {
            return false;
        }
        let (id, address, length) = owned[Self::choose(random, owned.len())];
        let header = Self::Ring::HEADER;
        let whole = self.at(0, address);
        assert!(length == 2048 && whole.len() == 2048);
        whole[..header].fill(0xff);
        whole[header..header + frame.len()].copy_from_slice(frame);
        self.give_back(0, id, u32::try_from(header + frame.len()).unwrap());
        true
    }
}

/// Returns where a buffer is.
fn start(buffer: &mut Buffer) -> u64 {
    buffer.whole().as_ptr() as u64
}

/// Makes a card and a hand of so many buffers. Returns the addresses of all buffers, too.
fn fixture<D: Device, const N: usize>() -> (D, [Buffer; N], BTreeSet<u64>) {
    let mut card = D::new();
    card.halves()[0].fill_all();
    let mut hand = [(); N].map(|()| Buffer::new(Buffer::LEAST_BYTES));
    let all = addresses(&mut card, &mut hand);
    assert_eq!(all.len(), 128 + N);
    (card, hand, all)
}

/// Returns the addresses of all buffers.
fn addresses(card: &mut impl Device, hand: &mut [Buffer]) -> BTreeSet<u64> {
    let tables = card.halves().iter_mut().map(|half| half.buffers.iter_mut());
    tables.flatten().chain(hand).map(start).collect()
}

/// Frames that go both ways, and what a wire has in its hand.
struct Traffic<D> {
    card: D,
    random: Random,
    hand: [Buffer; 8],
    arriving: VecDeque<Vec<u8>>,
    /// Those on their way out, and how many may be.
    sent: Vec<u16>,
    room: usize,
    /// How many found no buffer, were received, and found no room.
    counts: [u32; 3],
}

/// Has frames go both ways, in random order, by a ring with so much room.
pub(crate) fn exchange<D: Device>(room: usize) {
    let (card, hand, all) = fixture::<D, 8>();
    let mut traffic = Traffic {
        card,
        random: Random::new(1),
        hand,
        arriving: VecDeque::new(),
        sent: Vec::new(),
        room,
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
            assert_eq!(addresses(&mut traffic.card, &mut traffic.hand), all);
        }
    }
    let counts = traffic.counts;
    assert!(counts.into_iter().all(|count| count > 100), "{counts:?}");
    traffic.send_no_frames();
}

impl<D: Device> Traffic<D> {
    fn new_frame(&mut self) -> Vec<u8> {
        let length = self.random.within(14..=1514);
        let first = self.random.number().to_le_bytes();
        first.into_iter().cycle().take(length).collect()
    }

    fn assert_free(&mut self, buffer: u64) {
        let mut owned = (0..2).flat_map(|half| self.card.owned(half));
        assert!(!owned.any(|(_, address, _)| (buffer..buffer + 2048).contains(&address)));
    }

    fn arrive(&mut self) {
        let frame = self.new_frame();
        if self.card.deliver(&mut self.random, &frame) {
            self.arriving.push_back(frame);
        } else {
            self.counts[0] += 1;
        }
    }

    fn receive(&mut self) {
        let held = &mut self.hand[self.random.index(8)];
        let (mut given, is_swapped) = (None, self.random.chance(50));
        let is_one = self.card.halves()[0].receive(&mut |buffer| {
            given = Some((start(buffer), buffer.content().to_vec()));
            if is_swapped {
                core::mem::swap(buffer, held);
            }
        });
        let (address, frame) = given.unzip();
        assert_eq!(is_one, frame.is_some());
        assert_eq!(frame, self.arriving.pop_front());
        self.counts[1] += u32::from(is_one);
        if let Some(address) = address.filter(|_| is_swapped) {
            assert_eq!(start(held), address);
            self.assert_free(address);
        }
    }

    fn send(&mut self) {
        let (frame, place) = (self.new_frame(), self.random.within(12..=64));
        let held = &mut self.hand[self.random.index(8)];
        let before = (start(held), place..place + frame.len());
        held.set_range(before.1.clone());
        held.content_mut().copy_from_slice(&frame);
        let is_taken = self.card.halves()[1].send(held);
        let after = (start(held), held.range());
        self.card.halves()[1].ring();
        assert_eq!(is_taken, self.sent.len() < self.room);
        self.assert_free(after.0);
        if is_taken {
            assert_ne!(after.0, before.0);
            let sent = self.fetch().unwrap();
            assert_eq!(sent.len(), frame.len().max(60));
            let (content, padding) = sent.split_at(frame.len());
            assert!(content == frame && padding.iter().all(|byte| *byte == 0));
        } else {
            self.counts[2] += 1;
            assert_eq!(after, before);
        }
        assert!(self.fetch().is_none());
    }

    /// Sends a frame that is new, if there is one.
    fn fetch(&mut self) -> Option<Vec<u8>> {
        let mut owned = self.card.owned(1).into_iter();
        let (id, address, length) = owned.find(|(id, ..)| !self.sent.contains(id))?;
        self.sent.push(id);
        let whole = &self.card.at(1, address)[..usize::try_from(length).unwrap()];
        let (header, frame) = whole.split_at(D::Ring::HEADER);
        assert!(header.iter().all(|byte| *byte == 0));
        Some(frame.to_vec())
    }

    fn finish(&mut self) {
        if !self.sent.is_empty() {
            let place = D::choose(&mut self.random, self.sent.len());
            self.card.give_back(1, self.sent.remove(place), 0);
        }
    }

    /// Too short, too long, without room for a header, and beyond the buffer where it is padded.
    fn send_no_frames(&mut self) {
        (0..64).for_each(|_| self.finish());
        for range in [64..77, 64..64 + 1515, 2030..2048] {
            self.hand[0].set_range(range.clone());
            assert!(self.card.halves()[1].send(&mut self.hand[0]));
            self.card.halves()[1].ring();
            assert!(self.fetch().is_none() && self.hand[0].range() == range);
        }
    }
}

/// Has frames come while messages are off, and swaps a buffer that is too short for a card.
pub(crate) fn mask<D: Device>() -> D {
    let (mut card, _, _) = fixture::<D, 0>();
    let mut random = Random::new(1);
    assert!(card.is_masked(), "a card calls before it is asked to");
    assert!(!card.halves()[0].set_interrupt(true) && !card.is_masked());
    assert!(!card.halves()[0].set_interrupt(false) && card.is_masked());
    assert!(card.deliver(&mut random, &[1; 60]));
    assert!(card.halves()[0].set_interrupt(true) && !card.is_masked());
    assert!(card.halves()[0].receive(&mut |frame| assert_eq!(frame.content(), [1; 60])));
    assert!(!card.halves()[0].set_interrupt(true) && !card.is_masked());
    card.set_link(false);
    assert!(!card.halves()[0].is_linked());
    card.set_link(true);
    assert!(card.halves()[0].is_linked());
    // A buffer that the card would write beyond is never told to it.
    assert!((0..2).all(|_| card.deliver(&mut random, &[1; 60])));
    let mut short = Buffer::default();
    let each = &mut |buffer: &mut Buffer| core::mem::swap(buffer, &mut short);
    assert!(card.halves()[0].receive(each));
    assert!(!card.halves()[0].receive(&mut |_| ()));
    assert_dead(&mut card);
    card
}

/// A dead card is as one without a link, and asks for no message.
pub(crate) fn assert_dead(card: &mut impl Device) {
    card.set_link(true);
    assert!(card.halves()[0].is_dead && !card.halves()[0].is_linked());
    assert!(!card.halves()[0].set_interrupt(true) && card.is_masked());
}

/// Returns whether a frame was received, and where it ended in its buffer, which is swapped.
pub(crate) fn receive_one(half: &mut impl Receive, hand: &mut Buffer) -> (bool, Option<u32>) {
    let mut end = None;
    let is_one = half.receive(&mut |buffer| {
        end = u32::try_from(buffer.range().end).ok();
        core::mem::swap(buffer, hand);
    });
    (is_one, end)
}

/// Takes steps with a card that says anything, during which no buffer may be lost or double.
pub(crate) fn babble<D: Device>(mut step: impl FnMut(&mut D, &mut Random, &mut [Buffer; 2])) -> D {
    let (mut card, mut hand, all) = fixture::<D, 2>();
    let mut random = Random::new(1);
    for number in 0..100_000 {
        hand[1].set_range(64..164);
        step(&mut card, &mut random, &mut hand);
        card.halves()[0].set_interrupt(random.chance(50));
        if number % 101 == 0 {
            assert_eq!(addresses(&mut card, &mut hand), all);
        }
    }
    let dropped = card.halves()[0].dropped();
    assert!(dropped > 1000, "{dropped}");
    card
}
