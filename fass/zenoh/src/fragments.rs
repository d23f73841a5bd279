//! Fragments of a message that is too long for a datagram, put together again.
//!
//! There is one buffer: the message that began last has it. A message is whole only if the numbers
//! of its fragments are without gap, and one that is longer than the buffer is dropped.

/// The most bytes of a message that came in fragments.
pub const MOST_FRAGMENTED: usize = 8 * 1024;

/// A fragment, as its header says.
pub(crate) struct Fragment<'b> {
    pub(crate) is_reliable: bool,
    pub(crate) is_first: bool,
    pub(crate) has_more: bool,
    /// Whether nothing is missing between it and the frame or fragment before it.
    pub(crate) is_next: bool,
    pub(crate) bytes: &'b [u8],
}

pub(crate) struct Fragments {
    bytes: [u8; MOST_FRAGMENTED],
    /// Of what is there so far: whether it is of the reliable channel, and its length.
    begun: Option<(bool, usize)>,
}

impl Fragments {
    pub(crate) const fn new() -> Self {
        let bytes = [0; MOST_FRAGMENTED];
        Self { bytes, begun: None }
    }

    /// Drops what is there so far.
    pub(crate) const fn clear(&mut self) {
        self.begun = None;
    }

    /// Adds a fragment, and returns the message that it ends, if it ends one. `dropped` counts
    /// fragments of a message that does not become whole, each with what was there of it.
    pub(crate) fn add(&mut self, fragment: &Fragment<'_>, dropped: &mut u64) -> Option<&[u8]> {
        let begun = self.begun.take();
        let length = match begun {
            _ if fragment.is_first => {
                *dropped += u64::from(begun.is_some());
                Some(0)
            }
            Some((is_reliable, length)) if is_reliable == fragment.is_reliable => {
                fragment.is_next.then_some(length)
            }
            // One of the other channel, which has lost its place, does not disturb.
            _ => {
                self.begun = begun;
                None
            }
        };
        let room = length.and_then(|from| {
            let to = from + fragment.bytes.len();
            let room = self.bytes.get_mut(from..to)?;
            room.copy_from_slice(fragment.bytes);
            Some(to)
        });
        let Some(end) = room else {
            *dropped += 1;
            return None;
        };
        if fragment.has_more {
            self.begun = Some((fragment.is_reliable, end));
            return None;
        }
        self.bytes.get(..end)
    }
}
