//! What the lock's owner does: it has the scheduler end what somebody has finished, and
//! hands out what that gives.
//!
//! It may do so for itself and for others. What others are given goes into their mailboxes;
//! what it runs itself is returned. The scheduler's clock goes on to the next release as soon
//! as nothing runs.

use std::marker::PhantomData;
use std::sync::atomic::Ordering;

use sched_dag::journal::What;
use sched_dag::{CoreId, Decision, HandOff, Instance, Scheduler, Vertex};

use super::Team;
use crate::execute::Execute;
use crate::mailbox::{Assignment, End};
use crate::others::Others;
use crate::reports::{Reports, Shared};
use crate::watch::Watch;

/// What is under the lock.
pub(super) struct State<B, W> {
    pub(super) scheduler: Scheduler,
    pub(super) reports: Reports<Shared<B>>,
    pub(super) watch: PhantomData<fn() -> W>,
    pub(super) now_ns: u64,
    /// How many workers have an instance.
    pub(super) busy: u32,
    /// By worker, the turn of its latest post that was taken note of.
    pub(super) noted: Box<[u32]>,
    /// Whether others have been told that they need not try for the lock.
    pub(super) is_attended: bool,
    /// A copy of the last dispatch, to be carried out.
    pub(super) decisions: Vec<Decision>,
}

impl<B: Execute, W: Watch, O: Others> Team<B, W, O> {
    /// Has the scheduler end what `core` has finished, and gives the same core the first in
    /// line. Returns what `here` runs next.
    #[inline]
    pub(super) fn finish(
        &self,
        state: &mut State<B, W>,
        here: CoreId,
        core: CoreId,
        end: End,
    ) -> Option<Assignment> {
        self.take_note(state, here, core, core, end)
    }

    /// Has the scheduler end what `core` has finished, and gives `taker` the first in line:
    /// the same core, or `here`, if that has nothing to do. Returns what `here` runs next.
    #[inline(always)]
    pub(super) fn take_note(
        &self,
        state: &mut State<B, W>,
        here: CoreId,
        core: CoreId,
        taker: CoreId,
        End {
            vertex,
            has_signals,
        }: End,
    ) -> Option<Assignment> {
        state.busy -= 1;
        if W::STEP_NS > 0 {
            state.now_ns += W::STEP_NS;
        }
        let State {
            scheduler,
            reports,
            now_ns,
            ..
        } = state;
        if has_signals || self.others.have_knocked() {
            let instance = scheduler.instance_of(vertex);
            scheduler.log.here = core;
            let mut moment = scheduler.at(*now_ns);
            moment.complete(instance);
            if has_signals {
                for dag in self.mailboxes[core.index()].signals().drain(..) {
                    if !self.others.send(dag) {
                        moment.signal(dag);
                    }
                }
            }
            return self.proceed(state, here);
        }
        let done = if core == taker {
            scheduler.hand_off(*now_ns, core, vertex)
        } else {
            scheduler.hand_over(*now_ns, core, vertex, taker)
        };
        reports.act(scheduler);
        match done {
            HandOff::To(vertex, decision) => {
                let assignment = state.assign(vertex, decision.instance(), taker);
                if taker == here {
                    return Some(assignment);
                }
                self.mailboxes[taker.index()].assign(assignment);
                None
            }
            HandOff::Idle if state.busy > 0 => None,
            HandOff::Idle | HandOff::Open => self.proceed(state, here),
        }
    }

    /// Makes a step because another cluster has knocked. Returns what `here` runs next.
    #[cold]
    pub(super) fn open(&self, state: &mut State<B, W>, here: CoreId) -> Option<Assignment> {
        // If nobody is busy the run has not begun.
        if state.busy > 0 {
            state.now_ns += W::STEP_NS;
        }
        self.proceed(state, here)
    }

    /// Takes letters and ends the instant; goes on to the next event if nothing runs and nothing
    /// starts. Returns what `here` runs next.
    pub(super) fn proceed(&self, state: &mut State<B, W>, here: CoreId) -> Option<Assignment> {
        loop {
            let mut moment = state.scheduler.at(state.now_ns);
            self.others.take(|dag| moment.signal(dag));
            let decisions = moment.release_due().dispatch();
            state.decisions.clear();
            state.decisions.extend_from_slice(decisions);
            state.reports.act(&mut state.scheduler);
            if !state.decisions.is_empty() {
                return self.carry_out(state, here);
            }
            if state.busy > 0 {
                return None;
            }
            let (due_ns, then_ns) = (state.scheduler.next_event_ns(), state.now_ns + W::STEP_NS);
            let Some(event_ns) = self.others.next_ns(due_ns, then_ns) else {
                self.is_over.0.store(true, Ordering::Release);
                return None;
            };
            state.now_ns = event_ns.max(state.now_ns);
        }
    }

    fn carry_out(&self, state: &mut State<B, W>, here: CoreId) -> Option<Assignment> {
        let mut own = None;
        for index in 0..state.decisions.len() {
            let decision = state.decisions[index];
            let vertex = state.scheduler.vertex(decision.instance());
            let assignment = state.assign(vertex, decision.instance(), decision.core());
            if decision.core() == here {
                own = Some(assignment);
            } else {
                self.mailboxes[decision.core().index()].assign(assignment);
            }
        }
        own
    }
}

impl<B, W: Watch> State<B, W> {
    #[inline]
    fn assign(&mut self, vertex: Vertex, instance: Instance, core: CoreId) -> Assignment {
        self.busy += 1;
        if W::STEP_NS > 0 {
            (self.scheduler.log).on_core(core, What::Start, self.now_ns, instance);
        }
        Assignment {
            vertex,
            job: instance.job,
        }
    }
}
