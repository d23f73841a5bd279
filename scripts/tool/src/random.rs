//! Random numbers for sets that are drawn.

/// A small generator (xorshift64*): the same seed gives the same sets everywhere.
#[derive(Debug)]
pub struct Random(u64);

impl Random {
    /// Starts at a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        // Mixed, so that neighbouring seeds differ at once; never 0.
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x6a09_e667_f3bc_c909 | 1)
    }

    /// Returns a number of `least..=most`.
    pub const fn within(&mut self, least: u64, most: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let mixed = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 16;
        least + mixed % (most - least + 1)
    }
    /// Draws edges from subtasks to later ones, each of which is there once in `density` + 1 times.
    pub fn edges(&mut self, subtasks: usize, density: u64) -> Vec<(usize, usize)> {
        let pairs = (1..subtasks).flat_map(|to| (0..to).map(move |from| (from, to)));
        pairs.filter(|_| self.within(0, density) == 0).collect()
    }
}
