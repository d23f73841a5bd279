//! Half a driver: a ring of one kind of card, and the buffers of its descriptors.

use alloc::boxed::Box;
use core::mem::ManuallyDrop;
use core::sync::atomic::{Ordering, fence};

use fass::platform::Buffer;

use super::{Receive, Transmit};

/// The descriptors of a ring.
pub(crate) const RING: u16 = 64;

/// The bytes of a buffer that a card may fill.
pub(crate) const FILLED: u16 = 2048;
const _: () = assert!(FILLED as usize == Buffer::LEAST_BYTES);

/// The lengths of frames: of Ethernet's header, of the shortest that is sent, and of the longest.
const LEAST_FRAME: usize = 14;
const PADDED_FRAME: usize = 60;
const MOST_FRAME: usize = 1514;

/// The buffers of a ring, by the numbers of their descriptors.
pub(crate) type Buffers = ManuallyDrop<Box<[Buffer]>>;

/// A ring of descriptors. What it says is what the card says.
pub(crate) trait Ring: Send + 'static {
    /// The bytes of the header before each frame.
    const HEADER: usize;

    /// Returns a descriptor that the card does not have.
    fn free(&self) -> Option<u16>;
    /// Gives the card a descriptor that it does not have, with a buffer.
    fn post(&mut self, id: u16, address: u64, length: u16);
    /// Tells the card of descriptors that it was given.
    fn ring(&mut self);
    /// Returns whether the card is done with a descriptor.
    fn is_done(&self) -> bool;
    /// Takes that descriptor back, with the end of what was filled, 0 if that is no frame. `None`:
    /// the card says what cannot be.
    fn take(&mut self) -> Option<(u16, usize)>;
    /// Has the card send its message for a descriptor that it is done with, or not.
    fn set_interrupt(&mut self, is_on: bool);
    /// Returns whether the card has a link.
    fn is_linked(&self) -> bool;
}

/// A ring and its buffers. It is dead after the card has said what cannot be.
pub(crate) struct Half<R> {
    pub(crate) ring: R,
    pub(crate) buffers: Buffers,
    pub(crate) is_dead: bool,
    dropped: u64,
}

impl<R: Ring> Half<R> {
    pub(crate) fn new(ring: R) -> Self {
        let new = |_| Buffer::new(Buffer::LEAST_BYTES);
        Self {
            buffers: ManuallyDrop::new((0..RING).map(new).collect()),
            ring,
            is_dead: false,
            dropped: 0,
        }
    }

    /// Gives the card all buffers to be filled.
    pub(crate) fn fill_all(&mut self) {
        (0..RING).for_each(|id| self.fill(id));
    }

    /// Gives the card a buffer to be filled. Of one that is too short the half dies.
    fn fill(&mut self, id: u16) {
        let bytes = self.buffers[usize::from(id)].whole();
        if bytes.len() < FILLED.into() {
            self.is_dead = true;
            return;
        }
        self.ring.post(id, address(bytes), FILLED);
        self.ring.ring();
    }

    fn is_done(&self) -> bool {
        !self.is_dead && self.ring.is_done()
    }

    fn take(&mut self) -> Option<(u16, usize)> {
        let taken = self.is_done().then(|| self.ring.take())?;
        self.is_dead = taken.is_none();
        taken
    }
}

impl<R: Ring> Receive for Half<R> {
    fn receive(&mut self, each: &mut dyn FnMut(&mut Buffer)) -> bool {
        let Some((id, end)) = self.take() else {
            return false;
        };
        if (R::HEADER + LEAST_FRAME..=FILLED.into()).contains(&end) {
            let buffer = &mut self.buffers[usize::from(id)];
            buffer.set_range(R::HEADER..end);
            each(buffer);
        } else {
            self.dropped += 1;
        }
        self.fill(id);
        true
    }

    fn set_interrupt(&mut self, is_on: bool) -> bool {
        self.ring.set_interrupt(is_on && !self.is_dead);
        // What the card has done by now is seen; of what it does after that it tells.
        fence(Ordering::SeqCst);
        self.is_done()
    }

    fn is_linked(&self) -> bool {
        !self.is_dead && self.ring.is_linked()
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}

impl<R: Ring> Transmit for Half<R> {
    fn send(&mut self, frame: &mut Buffer) -> bool {
        // Two, so that each frame pays for one at most besides its own, and all come back.
        (0..2).all(|_| self.take().is_some());
        let Some(id) = self.ring.free().filter(|_| !self.is_dead) else {
            return false;
        };
        if let Some((address, length)) = framed(frame, R::HEADER) {
            core::mem::swap(frame, &mut self.buffers[usize::from(id)]);
            frame.set_range(0..0);
            self.ring.post(id, address, length);
        }
        true
    }

    fn ring(&mut self) {
        self.ring.ring();
    }
}

/// Returns the address by which a card reaches bytes of the heap.
fn address(bytes: &mut [u8]) -> u64 {
    bytes.as_mut_ptr().expose_provenance() as u64
}

/// Puts zeros before a frame, a header of a card, and after it where it is short. Returns the
/// address of the header and the whole length; `None`: that is no frame.
fn framed(buffer: &mut Buffer, header: usize) -> Option<(u64, u16)> {
    let frame = buffer.range();
    let start = frame.start.checked_sub(header)?;
    let end = frame.end.max(frame.start + PADDED_FRAME);
    let is_frame = (LEAST_FRAME..=MOST_FRAME).contains(&frame.len());
    let whole = buffer.whole().get_mut(start..end).filter(|_| is_frame)?;
    whole[..header].fill(0);
    whole[header + frame.len()..].fill(0);
    Some((address(whole), u16::try_from(end - start).ok()?))
}
