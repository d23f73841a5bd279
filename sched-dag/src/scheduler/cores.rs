//! Which core executes what.
//!
//! Idle cores form a stack: the core that has become idle last is taken first.
//! The kernel asks for a dispatch on the core that has just completed, so the
//! next instance in line starts there without an interrupt to another core.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::heap::IndexedHeap;
use super::key::Key;
use crate::ids::{CoreId, to_u32};

/// The cores and their instances.
#[derive(Debug)]
pub(super) struct Cores {
    running: Box<[Option<Key>]>,
    idle: Vec<CoreId>,
    /// The cores whose instance may be preempted, the largest key on top.
    preemptible: IndexedHeap<Reverse<Key>>,
}

impl Cores {
    pub(super) fn new(cores: u32) -> Self {
        Self {
            running: vec![None; cores as usize].into_boxed_slice(),
            // Core 0 is on top.
            idle: (0..cores).rev().map(CoreId).collect(),
            preemptible: IndexedHeap::new(cores as usize),
        }
    }

    pub(super) fn running(&self, core: CoreId) -> Option<Key> {
        self.running[core.index()]
    }

    /// Returns an idle core, which the caller gives an instance.
    pub(super) fn take_idle(&mut self) -> Option<CoreId> {
        self.idle.pop()
    }

    /// Gives a core an instance.
    pub(super) fn run(&mut self, core: CoreId, key: Key, may_be_preempted: bool) {
        self.running[core.index()] = Some(key);
        if may_be_preempted {
            self.preemptible.set(core.index(), Reverse(key));
        } else {
            self.preemptible.remove(core.index());
        }
    }

    /// Makes a core idle.
    pub(super) fn free(&mut self, core: CoreId) {
        self.running[core.index()] = None;
        self.preemptible.remove(core.index());
        self.idle.push(core);
    }

    /// Returns the largest key among the instances that may be preempted.
    pub(super) fn largest_preemptible(&self) -> Option<(CoreId, Key)> {
        self.preemptible
            .peek()
            .map(|(Reverse(key), core)| (CoreId(to_u32(core)), key))
    }
}
