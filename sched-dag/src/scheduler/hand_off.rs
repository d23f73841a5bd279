//! The short way from a completion to the next instance on the same core.
//!
//! Mostly a completion concerns one core: the instance that has finished leaves
//! it, and the first in line, often a successor that has become ready just then,
//! takes it over. Then the whole instant (completion, no release, dispatch)
//! comes to giving the core the first in line. [`Scheduler::hand_off`] does that
//! without a list of decisions. Where more is to be decided it says so, and the
//! driver ends the instant as ever.
//!
//! # When one core is all there is to it
//!
//! No release and no deadline is due, and at most one instance has become ready
//! by the completion, or there is no other core. Before the instant no core was
//! idle while an instance was in line, and no ready key was smaller than one that
//! runs and may be preempted. If the new instance is the first in line, it takes
//! the core, and that remains so. If it is not, its key is larger than one that
//! was in line before, so it preempts nobody either, and no core is idle.
//!
//! [`decide`](Scheduler::decide) would come to the same: the core that has become
//! idle last is taken first. Virtual time goes either way, the short one where
//! exactly one instance finishes; so its tests compare both with one reference.

use super::vertices::Phase;
use super::{Decision, OWED, Observer, Scheduler};
use crate::ids::{CoreId, Vertex};

/// What comes of a completion by [`Scheduler::hand_off`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use = "the core has to carry it out"]
pub enum HandOff {
    /// The core begins or continues an instance of this vertex, and nothing else
    /// changes. The decision is never a preemption.
    To(Vertex, Decision),
    /// The core is idle, and nothing else changes.
    Idle,
    /// The core is idle, and the instant is not over: begin it again at the same
    /// time, and end it with a dispatch.
    Open,
}

impl Scheduler {
    /// Takes note that the instance which `core` has been given last has
    /// finished at `now_ns`, and gives the core the first in line if that is all
    /// there is to decide. A time earlier than one before counts as that one.
    ///
    /// # Panics
    ///
    /// If no instance of the vertex has started, or it has ended before.
    #[inline]
    pub fn hand_off(
        &mut self,
        now_ns: u64,
        core: CoreId,
        vertex: Vertex,
        observer: &mut impl Observer,
    ) -> HandOff {
        if !self.ends_shortly(now_ns, core, vertex, observer) {
            return HandOff::Open;
        }
        let Some(key) = self.ready.pop() else {
            self.cores.free(core);
            return HandOff::Idle;
        };
        HandOff::To(Vertex(key.vertex()), self.give(core, key))
    }

    /// Does the same on behalf of another core: the instance has finished on
    /// `core`, and what is first in line is for `idle`, which waits for work.
    ///
    /// For drivers whose idle cores look after those that compute: the one that has
    /// the scheduler in its cache goes on. If nothing is in line, both are idle, and
    /// `idle` stays the first to be given something.
    ///
    /// # Panics
    ///
    /// As [`hand_off`](Self::hand_off); if `idle` is not idle.
    #[inline]
    pub fn hand_over(
        &mut self,
        now_ns: u64,
        core: CoreId,
        vertex: Vertex,
        idle: CoreId,
        observer: &mut impl Observer,
    ) -> HandOff {
        if !self.ends_shortly(now_ns, core, vertex, observer) {
            return HandOff::Open;
        }
        self.cores.take_this(idle);
        self.cores.free(core);
        let Some(key) = self.ready.pop() else {
            self.cores.free(idle);
            return HandOff::Idle;
        };
        HandOff::To(Vertex(key.vertex()), self.give(idle, key))
    }

    /// Fetches into this processor's cache what the completion of the instance on
    /// `core` will write, and changes nothing. For a driver that waits for that
    /// completion, and has nothing better to do.
    ///
    /// # Panics
    ///
    /// If there is no such core.
    pub fn anticipate(&mut self, core: CoreId) {
        if let Some(key) = self.cores.running(core) {
            self.vertices.touch(key.vertex());
        }
    }

    /// Ends an instance, and reports whether one core is all there is to it: then
    /// that core is neither idle nor has it anything else to do yet. Otherwise it is
    /// idle.
    #[inline(always)]
    fn ends_shortly(
        &mut self,
        now_ns: u64,
        core: CoreId,
        vertex: Vertex,
        observer: &mut impl Observer,
    ) -> bool {
        self.now_ns = self.now_ns.max(now_ns);
        // Otherwise a dispatch is owed from before, or the instance was to move.
        let is_short = self.fresh == 0 && self.vertices.get(vertex.0).phase == Phase::Running(core);
        if !is_short {
            self.finish(self.instance_of(vertex), observer);
            return false;
        }
        self.end(vertex.0, observer);
        if !self.concerns_one_core() {
            self.cores.free(core);
            self.fresh |= OWED;
            return false;
        }
        self.fresh = 0;
        true
    }

    /// Reports whether the instant can end with a hand-off.
    #[inline]
    fn concerns_one_core(&self) -> bool {
        let concerns_others = self.fresh > 1 && self.cores.count() > 1;
        !concerns_others && self.now_ns < self.quiet_until_ns
    }
}
