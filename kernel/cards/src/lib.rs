//! Network cards, by PCI: virtio-net and Intel's 82574.
//!
//! A card has two rings of descriptors, each of which names a buffer: one ring of buffers that it
//! fills, one of buffers that it sends. A driver is in two halves, one for each ring, so that one
//! core may receive while another sends. Frames are not copied: their buffers are swapped.
//!
//! **Reach invariant**: a card is told the addresses of its rings, which are [DMA
//! memory](executive::devices::dma), and of [`Buffers`], each with a length within it. A buffer
//! leaves them when the card has said that it is done with it. Those of a driver that is
//! dropped are never given back.
//!
//! Nothing that a card says is believed. A length that cannot be costs the frame. A statement
//! about buffers that cannot be ends the ring: it receives or sends nothing any more. Against a
//! card that writes where it was not told, nothing here helps.

#![no_std]

extern crate alloc;

mod e1000e;
mod virtio;

#[cfg(test)]
mod tests;

use alloc::boxed::Box;
use core::fmt;
use core::mem::ManuallyDrop;

use executive::devices::pci::{Function, Place};
use executive::devices::registers::{RangeError, Registers};
use fass::platform::Buffer;
use net::Mac;

/// A card that is ready. It sends no message before it [is told to](Receive::set_interrupt).
pub struct Card {
    /// Its address.
    pub mac: Mac,
    /// The number of its message that tells of received frames.
    pub message: u16,
    /// The half that receives.
    pub receiver: Box<dyn Receive>,
    /// The half that sends.
    pub transmitter: Box<dyn Transmit>,
}

/// The half of a driver that receives.
pub trait Receive: Send {
    /// Takes the next frame that came, and hands its buffer to `each`, which may swap it for
    /// another of at least [`Buffer::LEAST_BYTES`]; the card fills it next. Returns false if there
    /// was none. A frame that cannot be is dropped: it counts as one, and `each` is not called.
    fn receive(&mut self, each: &mut dyn FnMut(&mut Buffer)) -> bool;

    /// Has the card send its message when a frame comes, or not. Returns whether there are frames
    /// already: of these there may be no message. One that was on its way comes all the same.
    fn set_interrupt(&mut self, is_on: bool) -> bool;

    /// Returns whether the card has a link, and works.
    fn is_linked(&self) -> bool;

    /// Returns how many frames were dropped since they cannot be.
    fn dropped(&self) -> u64;
}

/// The half of a driver that sends.
pub trait Transmit: Send {
    /// Takes a frame: swaps its buffer for a free one. Returns false if there is no room; the
    /// buffer is as before. What is no frame, by its length or without 12 bytes before it for the
    /// header of a card, is dropped.
    fn send(&mut self, frame: &mut Buffer) -> bool;

    /// Tells the card of what was sent since.
    fn ring(&mut self);
}

/// Why a card cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardError {
    /// What card it is.
    pub kind: &'static str,
    /// Where it is.
    pub place: Place,
    /// What is wrong.
    pub fault: Fault,
}

/// What is wrong with a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Its registers cannot be had.
    Range(RangeError),
    /// It does not offer what its driver needs.
    Lacks(&'static str),
    /// It does not end its reset.
    Stuck,
    /// There is no memory for its rings.
    NoMemory,
}

impl fmt::Display for CardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "network card {} at {} ", self.kind, self.place)?;
        match self.fault {
            Fault::Range(error) => error.fmt(f),
            Fault::Lacks(what) => write!(f, "has no {what}; use a card that has"),
            Fault::Stuck => f.write_str("does not end its reset; turn the machine off and on"),
            Fault::NoMemory => f.write_str("finds no memory for its rings; give the machine more"),
        }
    }
}

/// How a driver gets a range of its function's registers.
type Map<'m> = &'m dyn Fn(u8) -> Result<Registers, RangeError>;

/// Opens a function if it is a card that is known, and allocates all that it will ever need.
#[must_use]
pub fn open(function: &Function<'_>) -> Option<Result<Card, CardError>> {
    open_by(function, &|bar| Registers::of(function, bar))
}

fn open_by(function: &Function<'_>, map: Map<'_>) -> Option<Result<Card, CardError>> {
    type Open = fn(&Function<'_>, Map<'_>) -> Result<Card, Fault>;
    let (kind, open): (_, Open) = match function.id {
        (0x1af4, 0x1000 | 0x1041) => ("virtio-net", virtio::open),
        (0x8086, 0x10d3) => ("82574", e1000e::open),
        _ => return None,
    };
    let place = function.place;
    // Whatever it was told before, it reaches no memory until it has been reset.
    function.enable();
    let card = open(function, map);
    Some(card.map_err(|fault| CardError { kind, place, fault }))
}

/// Lets a card reach memory, after its reset.
#[expect(unsafe_code, reason = "the one step that the compiler cannot judge")]
fn enable_reach(function: &Function<'_>) {
    // SAFETY: it is told nothing but its rings and `Buffers` (reach invariant).
    unsafe { function.enable_reach() };
}

/// Waits for a card. A read of a register takes a good part of a microsecond.
fn wait(is_done: impl Fn() -> bool) -> Result<(), Fault> {
    const READS: u32 = 100_000;
    let is_done = (0..READS).any(|_| is_done());
    is_done.then_some(()).ok_or(Fault::Stuck)
}

/// Returns an address, if it is that of one card.
fn mac(bytes: [u8; 6]) -> Result<Mac, Fault> {
    let is_one = bytes[0] & 1 == 0 && bytes != [0; 6];
    is_one.then_some(Mac(bytes)).ok_or(Fault::Lacks("address"))
}

/// Splits an address into the halves in which cards are told it, the lower one first.
fn halves(address: u64) -> [u32; 2] {
    let [a, b, c, d, high @ ..] = address.to_le_bytes();
    [[a, b, c, d], high].map(u32::from_le_bytes)
}

/// The most descriptors of a ring, and the buffers that are theirs, by their numbers.
const RING: u16 = 64;
type Buffers = ManuallyDrop<Box<[Buffer]>>;

fn new_buffers(count: u16) -> Buffers {
    let new = |_| Buffer::new(Buffer::LEAST_BYTES);
    ManuallyDrop::new((0..count).map(new).collect())
}

/// The lengths of frames: of Ethernet's header, of the shortest that is sent, and of the longest.
const LEAST_FRAME: usize = 14;
const PADDED_FRAME: usize = 60;
const MOST_FRAME: usize = 1514;

/// The bytes of a buffer that a card may fill.
const FILLED: u16 = 2048;
const _: () = assert!(FILLED as usize == Buffer::LEAST_BYTES);

/// Returns the address of a buffer, if a card may fill it.
fn filled(buffer: &mut Buffer) -> Option<u64> {
    let bytes = buffer.whole();
    let address = bytes.as_mut_ptr().expose_provenance() as u64;
    (bytes.len() >= Buffer::LEAST_BYTES).then_some(address)
}

/// Puts zeros before a frame, a header of a card, and after it where it is short. Returns the
/// address of the header and the whole length; `None`: that is no frame.
fn framed(buffer: &mut Buffer, header: usize) -> Option<(u64, u16)> {
    let frame = buffer.range();
    let start = frame.start.checked_sub(header)?;
    let end = frame.end.max(frame.start + PADDED_FRAME);
    let whole = buffer.whole();
    let is_frame = (LEAST_FRAME..=MOST_FRAME).contains(&frame.len()) && end <= whole.len();
    let length = u16::try_from(end - start).ok().filter(|_| is_frame)?;
    whole[start..frame.start].fill(0);
    whole[frame.end..end].fill(0);
    let address = whole[start..].as_mut_ptr().expose_provenance() as u64;
    Some((address, length))
}

/// Swaps a frame that was told to the card for the free buffer of its descriptor.
fn exchange(frame: &mut Buffer, free: &mut Buffer) {
    core::mem::swap(frame, free);
    frame.set_range(0..0);
}
