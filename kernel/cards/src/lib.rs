//! Drivers for PCI network cards: virtio-net and Intel's 82574.
//!
//! A card has two rings of descriptors: the first for buffers to fill, the other for buffers to
//! send. Each descriptor names a buffer. A driver has two halves, one for each ring, so that a core
//! may receive while another core sends. Frames are not copied: their buffers are swapped.
//!
//! **Reach invariant**: a card is told only the addresses of its rings, which are [DMA
//! memory](executive::devices::dma), and of its halves' buffers, each with a length within the
//! buffer. A buffer leaves its half only after the card has reported that it is done with the
//! buffer. The buffers of a dropped driver are never freed.
//!
//! Nothing a card reports is trusted. An impossible length costs the frame. An impossible statement
//! about buffers ends the ring, which then receives or sends nothing any more. Nothing here helps
//! against a card that writes outside of its buffers.

#![no_std]

extern crate alloc;

mod e1000e;
mod half;
mod virtio;

#[cfg(test)]
mod tests;

use alloc::boxed::Box;
use core::fmt;

use executive::devices::dma::DmaMemory;
use executive::devices::pci::{Function, PciError, Place};
use executive::devices::registers::Registers;
use fass::platform::Buffer;
use net::Mac;

use half::{Half, Ring};

/// A card ready for use. It sends no message before [a call](Receive::set_interrupt) allows
/// messages.
pub struct Card {
    /// The card's address.
    pub mac: Mac,
    /// The number of the card's message about received frames.
    pub message: u16,
    /// The receiving half.
    pub receiver: Box<dyn Receive>,
    /// The sending half.
    pub transmitter: Box<dyn Transmit>,
}

/// The receiving half of a driver.
pub trait Receive: Send {
    /// Takes the next received frame, and hands its buffer to `each`. `each` may swap the buffer
    /// for another of at least [`Buffer::LEAST_BYTES`], which the card fills next. Returns false if
    /// there was no frame. An impossible frame is dropped: it counts as a frame, but `each` is not
    /// called.
    fn receive(&mut self, each: &mut dyn FnMut(&mut Buffer)) -> bool;

    /// Allows or stops the card's message about a received frame. Returns whether frames have been
    /// received already; there may be no message about them. A message on its way comes all the
    /// same.
    fn set_interrupt(&mut self, is_on: bool) -> bool;

    /// Returns whether the card has a link, and works.
    fn is_linked(&self) -> bool;

    /// Returns the number of frames dropped as impossible.
    fn dropped(&self) -> u64;
}

/// The sending half of a driver.
pub trait Transmit: Send {
    /// Takes a frame: swaps its buffer for a free one. Returns false, with the buffer unchanged, if
    /// there is no room. A frame with an invalid length, or less than 12 bytes of room in front for
    /// a card's header, is dropped, and the result is true.
    fn send(&mut self, frame: &mut Buffer) -> bool;

    /// Tells the card about the frames sent since the last call.
    fn ring(&mut self);
}

/// The reason why a card cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardError {
    /// The place of the card's PCI function.
    pub place: Place,
    /// The fault.
    pub fault: Fault,
}

/// A fault of a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The card's registers are not accessible.
    Range(PciError),
    /// The card lacks this, which its driver needs.
    Lacks(&'static str),
}

impl fmt::Display for CardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "network card at {} ", self.place)?;
        match self.fault {
            Fault::Range(error) => error.fmt(f),
            Fault::Lacks(what) => write!(f, "has no {what}"),
        }
    }
}

/// A function by which a driver gets a range of its card's registers.
type Map<'m> = &'m dyn Fn(u8) -> Result<Registers, PciError>;

/// Opens a PCI function if it is a known card, and allocates everything it will ever need.
#[must_use]
pub fn open(function: &Function<'_>) -> Option<Result<Card, CardError>> {
    open_by(function, &|bar| Registers::of(function, bar))
}

fn open_by(function: &Function<'_>, map: Map<'_>) -> Option<Result<Card, CardError>> {
    let open: fn(&Function<'_>, Map<'_>) -> Result<Card, Fault> = match function.id {
        (0x1af4, 0x1000 | 0x1041) => virtio::open,
        (0x8086, 0x10d3) => e1000e::open,
        _ => return None,
    };
    // Whatever the card was told before, it reaches no memory until it has been reset.
    function.enable();
    let place = function.place;
    Some(open(function, map).map_err(|fault| CardError { place, fault }))
}

/// Makes a card from its address and its rings.
fn card<R: Ring>(mac: [u8; 6], [receive, transmit]: [R; 2]) -> Result<Card, Fault> {
    // The lowest bit marks the address of a group.
    let is_one = mac[0] & 1 == 0 && mac != [0; 6];
    let lacks = Fault::Lacks("address of one card; give it one");
    let mac = is_one.then_some(Mac(mac)).ok_or(lacks)?;
    let mut receiver = Half::new(receive);
    receiver.fill_all();
    Ok(Card {
        mac,
        message: MESSAGE,
        receiver: Box::new(receiver),
        transmitter: Box::new(Half::new(transmit)),
    })
}

/// The message about received frames, of either card.
const MESSAGE: u16 = 0;

/// Lets a card reach memory, after its reset.
#[expect(unsafe_code, reason = "the one step that the compiler cannot judge")]
fn enable_reach(function: &Function<'_>) {
    // SAFETY: the card is told nothing but its rings and the buffers of its halves (reach
    // invariant).
    unsafe { function.enable_reach() };
}

/// Waits for the end of a card's reset. Reading a register takes a good part of a microsecond.
fn wait(is_reset: impl Fn() -> bool) -> Result<(), Fault> {
    let lacks = Fault::Lacks("end of its reset; turn the machine off and on");
    (0..100_000).any(|_| is_reset()).then_some(()).ok_or(lacks)
}

/// Allocates a ring.
fn new_memory() -> Result<DmaMemory, Fault> {
    let lacks = Fault::Lacks("memory for its rings; give the machine more");
    DmaMemory::new(4096).ok_or(lacks)
}

/// Tells a card an address, by the two registers of the address's halves.
fn tell_address(registers: Registers, register: u64, address: u64) {
    let [a, b, c, d, high @ ..] = address.to_le_bytes();
    registers.write32(register, u32::from_le_bytes([a, b, c, d]));
    registers.write32(register + 4, u32::from_le_bytes(high));
}
