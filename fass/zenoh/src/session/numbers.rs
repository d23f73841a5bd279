//! The wrapping numbers of frames and fragments: ours, and the router's on two channels.

/// Numbers of 28 bits, or fewer if the router wants.
pub(super) struct Numbers {
    mask: u32,
    next: u32,
    /// The latest numbers heard on the best-effort and on the reliable channel.
    latest: [u32; 2],
}

impl Numbers {
    /// Creates numbers. The first number comes from the top of an identity, so a test may begin
    /// near the wrap.
    pub(super) const fn new(identity: u128) -> Self {
        let [.., c, b, a, top] = identity.to_le_bytes();
        Self {
            mask: u32::MAX >> 4,
            next: u32::from_le_bytes([c, b, a, top]) >> 4,
            latest: [0; 2],
        }
    }

    /// Agrees on the size given by the low bits of a resolution. Returns `None` if the size exceeds
    /// the requested one.
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

    /// Takes the number of the router's first frame in both channels. Returns `None` if the number
    /// is too large.
    pub(super) fn expect(&mut self, first: u64) -> Option<()> {
        let first = self.number(first)?;
        self.latest = [first.wrapping_sub(1) & self.mask; 2];
        Some(())
    }

    /// Takes the number of a frame of a channel. Returns the distance from the latest number, 0 if
    /// the frame is not newer, and `None` if the number is too large.
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
