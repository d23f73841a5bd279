//! Buffers: the memory of packets on their way between a device and an instance.
//!
//! A buffer has an owner: a place in a wire's ring, or a device. A device fills or empties its
//! buffers, and *swaps* each for a buffer of the wire. So no byte is copied, and each side keeps
//! its number of buffers.

use alloc::boxed::Box;
use core::ops::Range;

/// The memory of one packet, and the position of the packet's bytes in it.
///
/// ```
/// use fass::platform::Buffer;
///
/// let mut buffer = Buffer::new(Buffer::LEAST_BYTES);
/// buffer.whole()[..5].copy_from_slice(b"frame");
/// buffer.set_range(2..5);
/// assert_eq!(buffer.content(), b"ame");
/// ```
#[derive(Debug, Default)]
pub struct Buffer {
    bytes: Box<[u8]>,
    range: Range<usize>,
}

impl Buffer {
    /// The length of the shortest buffer, in bytes: an Ethernet frame, with the header put before
    /// it by network cards.
    pub const LEAST_BYTES: usize = 2048;

    /// The number of bytes before the packet left to the headers of a device.
    pub const HEADROOM: usize = 64;

    /// Makes an empty buffer of at least `bytes` bytes. Allocates.
    pub fn new(bytes: usize) -> Self {
        // A device swaps buffers with all its wires, so each has to hold the longest frame.
        Self {
            bytes: alloc::vec![0; bytes.max(Self::LEAST_BYTES)].into(),
            range: 0..0,
        }
    }

    /// Returns the whole memory.
    #[must_use]
    pub fn whole(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Returns the position of the packet's bytes.
    pub fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Sets the position of the packet's bytes.
    ///
    /// # Panics
    ///
    /// Panics if the range is not within the memory.
    pub fn set_range(&mut self, range: Range<usize>) {
        assert!(range.start <= range.end && range.end <= self.bytes.len());
        self.range = range;
    }

    /// Returns the packet's bytes.
    pub fn content(&self) -> &[u8] {
        &self.bytes[self.range()]
    }

    /// Returns the packet's bytes, to change them.
    #[must_use]
    pub fn content_mut(&mut self) -> &mut [u8] {
        &mut self.bytes[self.range.clone()]
    }
}

impl From<&[u8]> for Buffer {
    /// Makes a buffer with this packet in it. Allocates.
    fn from(packet: &[u8]) -> Self {
        let mut buffer = Self::new(Self::HEADROOM + packet.len());
        buffer.set_range(Self::HEADROOM..Self::HEADROOM + packet.len());
        buffer.content_mut().copy_from_slice(packet);
        buffer
    }
}

impl AsMut<[u8]> for Buffer {
    /// Returns the packet's bytes, to change them.
    fn as_mut(&mut self) -> &mut [u8] {
        self.content_mut()
    }
}
