//! Which core executes what.
//!
//! Idle cores form a stack: the core that has become idle last is taken first.
//! The kernel asks for a dispatch on the core that has just completed, so the
//! next instance in line starts there without an interrupt to another core.
//!
//! The core to be preempted first, with the largest key, is remembered as long
//! as changes leave it known: a larger key that comes in takes its place. When
//! the core itself changes, the next question looks at all cores. Between two
//! releases there is rarely one: what starts from the line has a key beyond
//! those that run.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::key::Key;
use crate::ids::{CoreId, to_u32};

/// The cores and their instances.
#[derive(Debug)]
pub(super) struct Cores {
    occupations: Box<[Occupation]>,
    idle: Vec<CoreId>,
    largest: Largest,
}

#[derive(Clone, Copy, Debug)]
enum Occupation {
    Idle,
    /// By an instance that keeps the core.
    Fixed(Key),
    /// By an instance that may be preempted.
    Preemptible(Key),
}

/// The core with the largest key among those that may be preempted.
#[derive(Clone, Copy, Debug)]
enum Largest {
    Known(CoreId, Key),
    None,
    /// To be looked for.
    Unknown,
}

impl Cores {
    pub(super) fn new(cores: u32) -> Self {
        Self {
            occupations: vec![Occupation::Idle; cores as usize].into_boxed_slice(),
            // Core 0 is on top.
            idle: (0..cores).rev().map(CoreId).collect(),
            largest: Largest::None,
        }
    }

    pub(super) fn running(&self, core: CoreId) -> Option<Key> {
        match self.occupations[core.index()] {
            Occupation::Idle => None,
            Occupation::Fixed(key) | Occupation::Preemptible(key) => Some(key),
        }
    }

    /// Reports whether any core is idle.
    pub(super) const fn any_idle(&self) -> bool {
        !self.idle.is_empty()
    }

    /// Returns an idle core, which the caller gives an instance.
    pub(super) fn take_idle(&mut self) -> Option<CoreId> {
        self.idle.pop()
    }

    /// Gives a core, idle or just preempted, an instance.
    pub(super) fn run(&mut self, core: CoreId, key: Key, may_be_preempted: bool) {
        self.forget(core);
        if !may_be_preempted {
            self.occupations[core.index()] = Occupation::Fixed(key);
            return;
        }
        self.occupations[core.index()] = Occupation::Preemptible(key);
        match self.largest {
            Largest::Known(_, largest) if key < largest => {}
            Largest::Unknown => {}
            Largest::Known(..) | Largest::None => self.largest = Largest::Known(core, key),
        }
    }

    /// Makes a core idle.
    pub(super) fn free(&mut self, core: CoreId) {
        self.forget(core);
        self.occupations[core.index()] = Occupation::Idle;
        self.idle.push(core);
    }

    /// Returns the largest key among the instances that may be preempted.
    pub(super) fn largest_preemptible(&mut self) -> Option<(CoreId, Key)> {
        if let Largest::Unknown = self.largest {
            self.largest = self.find_largest();
        }
        match self.largest {
            Largest::Known(core, key) => Some((core, key)),
            _ => None,
        }
    }

    /// The occupation of a core is about to change.
    fn forget(&mut self, core: CoreId) {
        if matches!(self.largest, Largest::Known(largest, _) if largest == core) {
            self.largest = Largest::Unknown;
        }
    }

    fn find_largest(&self) -> Largest {
        let preemptible = self.occupations.iter().enumerate();
        let keys = preemptible.filter_map(|(core, occupation)| match occupation {
            Occupation::Preemptible(key) => Some((*key, to_u32(core))),
            _ => None,
        });
        keys.max().map_or(Largest::None, |(key, core)| {
            Largest::Known(CoreId(core), key)
        })
    }
}
