//! The numbers of frames and fragments, which wrap: ours, and the router's of two channels.

/// Numbers of 28 bits, or of fewer if the router wants that.
pub(super) struct Numbers {
    mask: u32,
    next: u32,
    /// The latest that were heard of the best-effort and of the reliable channel.
    latest: [u32; 2],
}

impl Numbers {
    /// Creates numbers of which the first is taken from the top of an identity: so a test may begin
    /// where they wrap.
    pub(super) const fn new(identity: u128) -> Self {
        let [.., c, b, a, top] = identity.to_le_bytes();
        Self {
            mask: u32::MAX >> 4,
            next: u32::from_le_bytes([c, b, a, top]) >> 4,
            latest: [0; 2],
        }
    }

    /// Agrees on the size that the low bits of a resolution name. Returns `None` if that is more
    /// than was asked for.
    pub(super) fn agree(&mut self, resolution: u8) -> Option<()> {
        self.mask = *[0x7f, 0x3fff, u32::MAX >> 4].get(usize::from(resolution & 3))?;
        self.next &= self.mask;
        Some(())
    }

    /// Returns the number of our next frame.
    pub(super) const fn next(&self) -> u32 {
        self.next
    }

    /// Goes on to the next number.
    pub(super) const fn advance(&mut self) {
        self.next = self.next.wrapping_add(1) & self.mask;
    }

    /// Takes the number of the router's first frame in both channels. Returns `None` if it is too
    /// large.
    pub(super) fn expect(&mut self, first: u64) -> Option<()> {
        let first = self.number(first)?;
        self.latest = [first.wrapping_sub(1) & self.mask; 2];
        Some(())
    }

    /// Takes the number of a frame of a channel. Returns how far it is beyond the latest, 0 if it
    /// is not newer, and `None` if it is too large.
    pub(super) fn hear(&mut self, number: u64, is_reliable: bool) -> Option<u32> {
        let number = self.number(number)?;
        let latest = &mut self.latest[usize::from(is_reliable)];
        let ahead = number.wrapping_sub(*latest) & self.mask;
        if ahead > self.mask / 2 {
            return Some(0);
        }
        *latest = number;
        Some(ahead)
    }

    fn number(&self, number: u64) -> Option<u32> {
        let number = u32::try_from(number).ok();
        number.filter(|number| *number <= self.mask)
    }
}
