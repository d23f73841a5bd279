//! Reassembles the fragments of messages too long for a datagram.
//!
//! There is one buffer, for the message that began last. A message is whole only if there is no gap
//! between the numbers of its fragments. A message longer than the buffer is dropped.

/// The most bytes of a reassembled message.
pub const MOST_FRAGMENTED: usize = 8 * 1024;

/// A fragment, with the facts from its header.
pub(crate) struct Fragment<'b> {
    pub(crate) is_reliable: bool,
    pub(crate) is_first: bool,
    pub(crate) has_more: bool,
    /// Whether nothing is missing between the fragment and the frame or fragment before.
    pub(crate) is_next: bool,
    pub(crate) bytes: &'b [u8],
}

pub(crate) struct Fragments {
    bytes: [u8; MOST_FRAGMENTED],
    /// The channel of the present fragments (true if reliable), and their length so far.
    begun: Option<(bool, usize)>,
}

impl Fragments {
    pub(crate) const fn new() -> Self {
        let bytes = [0; MOST_FRAGMENTED];
        Self { bytes, begun: None }
    }

    /// Drops the fragments so far.
    pub(crate) const fn clear(&mut self) {
        self.begun = None;
    }

    /// Adds a fragment, and returns the message if the fragment completes one. `dropped` counts
    /// fragments of messages that never become whole, each fragment together with any earlier
    /// fragments of the same message.
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
            // A fragment of the other channel, whose place in the buffer is lost, does not disturb
            // this message.
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
