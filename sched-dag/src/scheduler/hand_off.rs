//! The short way from a completion to the next instance on the same core.
//!
//! Mostly a completion concerns one core: the instance that has finished leaves
//! it, and the first in line, often a successor that has become ready just then,
//! takes it over. Then the whole instant (completion, no release, dispatch)
//! comes to giving the core the first in line. [`Scheduler::pass_on`] does that
//! without a list of decisions. Where more is to be decided it says so, and the
//! driver ends the instant as ever.
//!
//! # When only one core is concerned
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
//! exactly one instance finishes; so its tests hold both to one law.

use super::instances::line_up;
use super::vertices::{Phase, Vertices};
use super::{Decision, OWED, Scheduler};
use crate::ids::{CoreId, Vertex};
use crate::journal::What;

/// What comes of a completion by [`Scheduler::pass_on`].
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
    /// Neither the finish nor that an instance has become ready is written down if that is the only
    /// one and the core begins it, for finish, ready and start are one entry then. Reports whether
    /// that is so.
    ///
    /// # Panics
    ///
    /// If no instance of the vertex has started, or it has ended before.
    #[inline(always)]
    pub fn pass_on(&mut self, now_ns: u64, core: CoreId, vertex: Vertex) -> (HandOff, bool) {
        let done = self.end_shortly(now_ns, core, vertex);
        if let HandOff::Idle = done.0 {
            self.cores.free(core);
        }
        done
    }

    /// Ends the instance on `core`, and gives the core the first in line if only one core is
    /// concerned: if there is none, it is not idle yet. If more is to be decided, it is. Reports
    /// whether it has still to be written down that the one has finished and the other is ready.
    #[inline(always)]
    fn end_shortly(&mut self, now_ns: u64, core: CoreId, vertex: Vertex) -> (HandOff, bool) {
        self.log.now_ns = self.log.now_ns.max(now_ns);
        let ending = self.vertices.get(vertex.0);
        // Otherwise a dispatch is owed from before, or the instance was to move.
        if self.fresh != 0 || ending.phase != Phase::Running(core) {
            let instance = self.instance_of(vertex);
            self.write_finish(core, vertex, now_ns);
            self.finish(instance);
            return (HandOff::Open, false);
        }
        let is_quiet = self.log.now_ns < self.quiet_until_ns;
        if ending.only_passes_on && is_quiet {
            let (fresh, next) = self.vertices.pass_on(vertex.0);
            match fresh {
                0 => {
                    self.write_finish(core, vertex, now_ns);
                    return (self.give_first(core), false);
                }
                1 if self.ready.is_empty() => return self.pass(next, core),
                _ => {
                    self.write_finish(core, vertex, now_ns);
                    self.line_up_successors(vertex.0);
                }
            }
        } else {
            self.write_finish(core, vertex, now_ns);
            self.end(vertex.0);
        }
        let concerns_others = self.fresh > 1 && self.cores.count() > 1;
        if concerns_others || self.log.now_ns >= self.quiet_until_ns {
            return (self.leave_open(core, vertex), false);
        }
        self.fresh = 0;
        (self.give_first(core), false)
    }

    /// Writes down that a core has finished the instance of a vertex.
    #[inline]
    fn write_finish(&mut self, core: CoreId, vertex: Vertex, finish_ns: u64) {
        self.log.here = core;
        let instance = self.instance_of(vertex);
        self.log.on_core(core, What::Finish, finish_ns, instance);
    }

    /// Leaves the instant to be begun again, and the core idle.
    #[inline]
    fn leave_open(&mut self, core: CoreId, ended: Vertex) -> HandOff {
        if self.log.now_ns >= self.quiet_until_ns {
            self.judge_ended(ended.0);
        }
        self.cores.free(core);
        self.fresh |= OWED;
        HandOff::Open
    }

    /// Gives a core the one instance that has just become ready, without putting it in
    /// line, unless that has a more urgent one.
    #[inline(always)]
    fn pass(&mut self, number: u32, core: CoreId) -> (HandOff, bool) {
        let next = self.vertices.get_mut(number);
        let instance = next.present_instance();
        let key = (self.ready).key(number, next, || {
            self.dags[next.dag.index()].jobs.job(next.progress)
        });
        next.phase = Phase::Running(core);
        self.cores.run(core, key, next.is_preemptible);
        let decision = Decision {
            what: What::Start,
            core,
            instance,
        };
        (HandOff::To(Vertex(number), decision), true)
    }

    /// Puts all successors of a vertex in line that its end has made ready.
    #[inline]
    fn line_up_successors(&mut self, vertex: u32) {
        for place in Vertices::successors(self.vertices.get(vertex)) {
            if let Some((number, next)) = self.vertices.ready_successor(place) {
                let job = self.dags[next.dag.index()].jobs.job(next.progress);
                line_up(number, next, job, &mut self.ready, &mut self.log);
                self.fresh += 1;
            }
        }
    }

    /// Gives a core the first in line.
    #[inline]
    fn give_first(&mut self, core: CoreId) -> HandOff {
        match self.ready.pop() {
            Some(key) => HandOff::To(Vertex(key.vertex()), self.give(core, key)),
            None => HandOff::Idle,
        }
    }
}
