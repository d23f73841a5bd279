//! Network cards, by PCI: virtio-net and Intel's 82574.
//!
//! A card has two rings of descriptors, each of which names a buffer: one ring of buffers that it
//! fills, one of buffers that it sends. A driver is in two halves, one for each ring, so that one
//! core may receive while another sends. Frames are not copied: their buffers are swapped.
//!
//! **Reach invariant**: a card is told the addresses of its rings, which are [DMA
//! memory](executive::devices::dma), and of the buffers of its halves, each with a length within
//! it. A buffer leaves these when the card has said that it is done with it. Those of a driver
//! that is dropped are never given back.
//!
//! Nothing that a card says is believed. A length that cannot be costs the frame. A statement
//! about buffers that cannot be ends the ring: it receives or sends nothing any more. Against a
//! card that writes where it was not told, nothing here helps.

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
    /// The place of its function.
    pub place: Place,
    /// The fault.
    pub fault: Fault,
}

/// A fault of a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Its registers cannot be had.
    Range(PciError),
    /// There is none of this, which its driver needs.
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

/// How a driver gets a range of its function's registers.
type Map<'m> = &'m dyn Fn(u8) -> Result<Registers, PciError>;

/// Opens a function if it is a card that is known, and allocates all that it will ever need.
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
    // Whatever it was told before, it reaches no memory until it has been reset.
    function.enable();
    let place = function.place;
    Some(open(function, map).map_err(|fault| CardError { place, fault }))
}

/// Makes a card of its address and its rings.
fn card<R: Ring>(mac: [u8; 6], [receive, transmit]: [R; 2]) -> Result<Card, Fault> {
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

/// The message of received frames, of either card.
const MESSAGE: u16 = 0;

/// Lets a card reach memory, after its reset.
#[expect(unsafe_code, reason = "the one step that the compiler cannot judge")]
fn enable_reach(function: &Function<'_>) {
    // SAFETY: it is told nothing but its rings and the buffers of its halves (reach invariant).
    unsafe { function.enable_reach() };
}

/// Waits for the end of a card's reset. A read of a register takes a good part of a microsecond.
fn wait(is_reset: impl Fn() -> bool) -> Result<(), Fault> {
    let lacks = Fault::Lacks("end of its reset; turn the machine off and on");
    (0..100_000).any(|_| is_reset()).then_some(()).ok_or(lacks)
}

/// Allocates a ring.
fn new_memory() -> Result<DmaMemory, Fault> {
    let lacks = Fault::Lacks("memory for its rings; give the machine more");
    DmaMemory::new(4096).ok_or(lacks)
}

/// Tells a card an address, by the two registers of its halves.
fn tell_address(registers: Registers, register: u64, address: u64) {
    let [a, b, c, d, high @ ..] = address.to_le_bytes();
    registers.write32(register, u32::from_le_bytes([a, b, c, d]));
    registers.write32(register + 4, u32::from_le_bytes(high));
}
