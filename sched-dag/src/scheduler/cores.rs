//! Which core executes what.
//!
//! Idle cores form a stack: the core that has become idle last is taken first.
//! The kernel asks for a dispatch on the core that has just completed, so the
//! next instance in line starts there without an interrupt to another core. A driver
//! that knows of a core that is awake says so ([`Cores::prefer`]).
//!
//! The core to be preempted first is looked for among all cores when there is
//! need. That is rare: when no core is idle and something has become ready that
//! is not the first in line. Keeping the cores in order instead would cost every
//! start and every completion.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::key::Key;
use crate::ids::CoreId;

/// The cores and their instances.
#[derive(Clone, Debug, Hash)]
pub(super) struct Cores {
    occupations: Box<[Occupation]>,
    idle: Vec<CoreId>,
}

#[derive(Clone, Copy, Debug, Hash)]
struct Occupation {
    /// The key of what runs, if anything does.
    key: Key,
    may_be_preempted: bool,
}

const IDLE: Occupation = Occupation {
    key: Key::NONE,
    may_be_preempted: false,
};

impl Cores {
    #[inline]
    pub(super) fn new(cores: u32) -> Self {
        Self {
            occupations: vec![IDLE; cores as usize].into_boxed_slice(),
            // Core 0 is on top.
            idle: (0..cores).rev().map(CoreId).collect(),
        }
    }

    /// Returns the number of cores.
    #[inline]
    pub(super) const fn count(&self) -> usize {
        self.occupations.len()
    }

    #[inline]
    pub(super) fn running(&self, core: CoreId) -> Option<Key> {
        let key = self.occupations[core.index()].key;
        (!key.is_none()).then_some(key)
    }

    /// Reports whether any core is idle.
    #[inline]
    pub(super) const fn any_idle(&self) -> bool {
        !self.idle.is_empty()
    }

    /// Returns an idle core, which the caller gives an instance.
    #[inline]
    pub(super) fn take_idle(&mut self) -> Option<CoreId> {
        self.idle.pop()
    }

    /// Makes a core, if it is idle, the next one that is taken.
    pub(super) fn prefer(&mut self, core: CoreId) {
        if let Some(place) = self.idle.iter().rposition(|&idle| idle == core) {
            self.idle[place..].rotate_left(1);
        }
    }

    /// Gives a core, which is not among the idle ones, an instance.
    #[inline]
    pub(super) fn run(&mut self, core: CoreId, key: Key, may_be_preempted: bool) {
        self.occupations[core.index()] = Occupation {
            key,
            may_be_preempted,
        };
    }

    /// Makes a core idle.
    #[inline]
    pub(super) fn free(&mut self, core: CoreId) {
        self.occupations[core.index()] = IDLE;
        self.idle.push(core);
    }

    /// Returns the largest key among the instances that may be preempted.
    #[inline]
    pub(super) fn largest_preemptible(&self) -> Option<(CoreId, Key)> {
        let mut largest = None;
        for (core, occupation) in (0..).map(CoreId).zip(&self.occupations) {
            let is_larger = largest.is_none_or(|(_, key)| key < occupation.key);
            if occupation.may_be_preempted && is_larger {
                largest = Some((core, occupation.key));
            }
        }
        largest
    }
}
