//! The short way from a completion to the next instance on the same core.
//!
//! Mostly a completion concerns one core: the instance that has finished leaves
//! it, and the first in line, often a successor that has become ready just then,
//! takes it over. Then the whole instant (completion, no release, dispatch)
//! comes to giving the core the first in line. [`Scheduler::hand_off`] does that
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
//! exactly one instance finishes; so its tests compare both with one reference.

use super::instances::line_up;
use super::vertices::{Phase, Vertices};
use super::{Decision, OWED, Scheduler};
use crate::ids::{CoreId, Vertex};
use crate::journal::What;

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
    pub fn hand_off(&mut self, now_ns: u64, core: CoreId, vertex: Vertex) -> HandOff {
        let (done, is_untold) = self.pass_on(now_ns, core, vertex);
        self.tell(done, is_untold, now_ns, core, vertex)
    }

    /// Does the same, except that neither the finish nor that an instance has become ready is
    /// written down if that is the only one and the core begins it: for drivers to which finish,
    /// ready and start are one entry. Reports whether that is so.
    ///
    /// # Panics
    ///
    /// As [`hand_off`](Self::hand_off).
    #[inline(always)]
    pub fn pass_on(&mut self, now_ns: u64, core: CoreId, vertex: Vertex) -> (HandOff, bool) {
        let done = self.end_shortly(now_ns, core, vertex, core);
        if let HandOff::Idle = done.0 {
            self.cores.free(core);
        }
        done
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
    ) -> HandOff {
        let (done, is_untold) = self.end_shortly(now_ns, core, vertex, idle);
        if let HandOff::Open = done {
            return done;
        }
        self.cores.take_this(idle);
        self.cores.free(core);
        if let HandOff::Idle = done {
            self.cores.free(idle);
        }
        self.tell(done, is_untold, now_ns, core, vertex)
    }

    /// Fetches into this processor's cache what the completion of the instance on
    /// `core` will write, and changes nothing. For a driver that waits for that
    /// completion, and has nothing better to do.
    ///
    /// # Panics
    ///
    /// If there is no such core.
    #[inline]
    pub fn anticipate(&mut self, core: CoreId) {
        if let Some(key) = self.cores.running(core) {
            self.vertices.touch(key.vertex());
        }
    }

    /// Ends the instance on `core`, and gives `taker` the first in line if only one core is
    /// concerned: then `core` is not idle yet, and `taker` not taken from the
    /// idle ones. If more is to be decided, `core` is idle. Reports whether it has still to be
    /// written down that the one has finished and the other is ready.
    #[inline(always)]
    fn end_shortly(
        &mut self,
        now_ns: u64,
        core: CoreId,
        vertex: Vertex,
        taker: CoreId,
    ) -> (HandOff, bool) {
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
                    return (self.give_first(taker), false);
                }
                1 if self.ready.is_empty() => return self.pass(next, taker),
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
        (self.give_first(taker), false)
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
    fn pass(&mut self, number: u32, taker: CoreId) -> (HandOff, bool) {
        let next = self.vertices.get_mut(number);
        let instance = next.present_instance();
        let key = (self.ready).key(number, next, || {
            self.dags[next.dag.index()].jobs.job(next.progress)
        });
        next.phase = Phase::Running(taker);
        self.cores.run(taker, key, next.is_preemptible);
        let core = taker;
        let decision = Decision::Start { core, instance };
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
    fn give_first(&mut self, taker: CoreId) -> HandOff {
        match self.ready.pop() {
            Some(key) => HandOff::To(Vertex(key.vertex()), self.give(taker, key)),
            None => HandOff::Idle,
        }
    }

    /// Writes down what is not written yet.
    #[inline]
    fn tell(
        &mut self,
        done: HandOff,
        is_untold: bool,
        finish_ns: u64,
        core: CoreId,
        vertex: Vertex,
    ) -> HandOff {
        if let HandOff::To(_, decision) = done
            && is_untold
        {
            self.write_finish(core, vertex, finish_ns);
            self.log.of(What::Ready, decision.instance());
        }
        done
    }
}
