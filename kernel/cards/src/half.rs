//! Half of a driver: a ring of some kind of card, and the buffers of its descriptors.

use alloc::boxed::Box;
use core::mem::ManuallyDrop;
use core::sync::atomic::{Ordering, fence};

use fass::platform::Buffer;

use super::{Receive, Transmit};

/// The number of descriptors of a ring.
pub(crate) const RING: u16 = 64;

/// The size of a buffer for a card to fill, in bytes.
pub(crate) const FILLED: u16 = 2048;
const _: () = assert!(FILLED as usize == Buffer::LEAST_BYTES);

/// The lengths of frames, in bytes: of Ethernet's header, of the shortest frame sent, and of the
/// longest frame.
const LEAST_FRAME: usize = 14;
const PADDED_FRAME: usize = 60;
const MOST_FRAME: usize = 1514;

/// The buffers of a ring, indexed by the numbers of their descriptors.
pub(crate) type Buffers = ManuallyDrop<Box<[Buffer]>>;

/// A ring of descriptors. Its answers are the card's, and so not trusted.
pub(crate) trait Ring: Send + 'static {
    /// The bytes of the header before each frame.
    const HEADER: usize;

    /// Returns a descriptor not held by the card.
    fn free(&self) -> Option<u16>;
    /// Gives the card a descriptor not held by it, with a buffer.
    fn post(&mut self, id: u16, address: u64, length: u16);
    /// Tells the card about the descriptors it was given.
    fn ring(&mut self);
    /// Returns whether the card is done with a descriptor.
    fn is_done(&self) -> bool;
    /// Takes back the descriptor, with the end of the filled bytes, 0 if they are no frame. Returns
    /// `None` if the card's answer is impossible.
    fn take(&mut self) -> Option<(u16, usize)>;
    /// Allows or stops the card's message about a descriptor it is done with.
    fn set_interrupt(&mut self, is_on: bool);
    /// Returns whether the card has a link.
    fn is_linked(&self) -> bool;
}

/// A ring and its buffers. The half is dead after an impossible answer of the card.
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

    /// Gives the card a buffer to be filled. A buffer that is too short kills the half.
    fn fill(&mut self, id: u16) {
        let bytes = self.buffers[usize::from(id)].whole();
        // `receive` lets its caller swap buffers: the card would write beyond one that is too
        // short.
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
        // A dead half takes no frame, so its messages would never end.
        self.ring.set_interrupt(is_on && !self.is_dead);
        // After the fence: frames finished before messages were on are seen here, later ones bring
        // a message.
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
        // Each frame sent takes back two buffers at most: a bounded cost, and yet all buffers come
        // back.
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

/// Puts zeros before a frame, as a card's header, and after a short frame. Returns the address of
/// the header and the whole length, or `None` if the buffer has no valid frame.
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
