//! The dispatch (R5): the choice of the instances running from this instant on.
//!
//! Cores in tables and groups of cores come first, where there are any (the module `groups`). Then
//! idle cores take ready instances in the order of their keys, so no instance is preempted while a
//! core is idle. Last, as long as the smallest ready key is smaller than the largest key that runs
//! and may be preempted, both change places.
//!
//! Afterwards the running instances satisfy R5: the non-preemptible ones, and of all others the
//! instances with the smallest keys. No core is named in more than one exchange, since each
//! exchange brings in a larger key than the exchange before and a smaller key than it takes out.
//!
//! A dispatch leaves the cores *settled*: no ready key is smaller than a key that runs and may be
//! preempted. Ends keep them settled, since ends only make cores idle; only a newly ready instance
//! can unsettle them. So without a newly ready instance the second step is skipped.
//!
//! # The short way from a completion to the next instance on the same core
//!
//! Most completions concern a single core: the finished instance leaves the core, and the first
//! instance in line, often a successor that has become ready just then, takes it over. The whole
//! instant (completion, no release, dispatch) then amounts to giving the core the first instance in
//! line. [`Scheduler::pass_on`] does so without a list of decisions. When more is to be decided, it
//! says so, and the driver ends the instant the usual way.
//!
//! # When only one core is concerned
//!
//! No release and no deadline is due, and at most one instance has become ready by the completion,
//! or there is no other core. Before the instant no core was idle while an instance was in line,
//! and no ready key was smaller than a key that runs and may be preempted. If the new instance is
//! the first in line, it takes the core, and the condition still holds. Otherwise its key is larger
//! than a key that was in line before, so it preempts nobody either, and no core is idle.
//!
//! [`decide`](Scheduler::decide) would give the same result, because of all idle cores it takes
//! first the one that became idle last. Virtual time uses both ways, the short one where exactly
//! one instance finishes; so its tests hold both to the same law.
//!
//! A wait ends a turn by the same short way ([`Scheduler::wait_shortly`]). A wait of no time makes
//! its own instance ready, and no other. A limit reached while a core is idle concerns that core
//! only ([`Scheduler::wake_shortly`]).
//!
//! # The cores
//!
//! Idle cores form a stack: the core that became idle last is taken first. The kernel asks for a
//! dispatch on the core that has just completed an instance, so the next instance in line starts
//! there without an interrupt to another core. A driver that knows of an awake core says so
//! ([`CoreTable::prefer`]).
//!
//! The search for the core to preempt looks at all cores, but is rare: it happens only when an
//! instance has become ready, no core is left idle, and the line is not empty. Keeping the cores in
//! order instead would cost every start and every completion.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::instances::make_ready;
use super::key::DispatchKey;
use super::vertices::{EndKind, InstancePhase, Successors};
use super::{OWED, Scheduler};
use crate::ids::{CoreId, Instance, Vertex};
use crate::journal::EventKind;

/// A change of what a core executes.
///
/// A dispatch lists only changes: a core not named in the list goes on with its instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub struct Decision {
    /// [`Start`](EventKind::Start) or [`Resume`](EventKind::Resume): the core, idle or just
    /// preempted, begins or continues the instance, which may have run on another core before.
    /// [`Suspend`](EventKind::Suspend): the core gives up the instance, which keeps its progress;
    /// the next decision of the dispatch gives the core another instance.
    pub what: EventKind,
    /// The core.
    pub core: CoreId,
    /// The instance.
    pub instance: Instance,
}

impl Decision {
    /// Makes the decision.
    #[inline]
    pub const fn new(what: EventKind, core: CoreId, instance: Instance) -> Self {
        Self {
            what,
            core,
            instance,
        }
    }
}

impl Scheduler {
    /// Fills `decisions` with the changes of this dispatch.
    #[inline]
    pub(super) fn decide(&mut self) {
        // Decisions belong to one dispatch: a driver that missed the previous ones has lost them.
        self.decisions.clear();
        self.decide_apart();
        // First the idle cores: R5 preempts nobody while a core is idle.
        while self.cores.any_idle()
            && let Some(key) = self.ready.pop()
            && let Some(core) = self.cores.take_idle()
        {
            let decision = self.give(core, key);
            self.decisions.push(decision);
        }
        // Nothing has become ready, so the order is settled, whatever cores became idle. This saves
        // the scan of all cores below in every step that only ends instances.
        if core::mem::take(&mut self.fresh) & !OWED == 0 {
            return;
        }
        // Each exchange brings in a larger key than the one before and takes out a smaller one, so
        // the loop ends after at most as many rounds as there are cores.
        while let Some(ready) = self.ready.peek()
            && let Some((core, running)) = self.cores.largest_preemptible()
            && ready < running
            && let Some(key) = self.ready.pop()
        {
            // Suspend comes before Start in the list: a driver frees the core before filling it.
            self.preempt(core, running);
            let decision = self.give(core, key);
            self.decisions.push(decision);
        }
    }

    /// Gives a core a ready instance.
    #[inline]
    pub(super) fn give(&mut self, core: CoreId, key: DispatchKey) -> Decision {
        let what = self.seat(core, key);
        let instance = self.vertices.get(key.vertex()).present_instance();
        Decision::new(what, core, instance)
    }

    /// Likewise, and returns whether the instance starts or resumes.
    #[inline(always)]
    fn seat(&mut self, core: CoreId, key: DispatchKey) -> EventKind {
        let vertex = self.vertices.get_mut(key.vertex());
        let what = vertex.run(core);
        (self.cores).run(core, key, vertex.is_preemptible);
        what
    }

    /// Gives a core to the innermost begun entry of its list.
    #[inline]
    pub(super) fn give_to_entry(&mut self, core: CoreId, entry: u32) -> Decision {
        self.cores.run(core, DispatchKey::ENTRY, false);
        let vertex = self.vertices.get_mut(entry);
        Decision::new(vertex.run(core), core, vertex.present_instance())
    }

    /// Puts the instance running on a core back in line.
    #[inline]
    pub(super) fn preempt(&mut self, core: CoreId, running: DispatchKey) {
        let vertex = self.vertices.get_mut(running.vertex());
        vertex.phase = InstancePhase::Preempted;
        let decision = Decision::new(EventKind::Suspend, core, vertex.present_instance());
        self.decisions.push(decision);
        // With its old key: a preempted instance keeps its place in the order.
        self.ready.insert(vertex, running);
    }
}

/// The result of a completion by [`Scheduler::pass_on`], or of a wait by
/// [`Scheduler::wait_shortly`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use = "the core has to carry it out"]
pub enum HandOff {
    /// The core begins or continues an instance of this vertex, and nothing else changes. The
    /// decision is never a preemption.
    To(Vertex, Decision),
    /// The core is idle, and nothing else changes.
    Idle,
    /// The core is idle, or was to run another instance already, and the instant is not over: begin
    /// it again at the same time, and end it with a dispatch. A wait never leaves an instant open.
    Open,
}

/// The events of an end left for the driver to record, before the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unwritten {
    /// None.
    Nothing,
    /// The finish.
    Finish,
    /// The finish, and the event that it made the next instance ready: together with the start,
    /// both form a single journal entry.
    FinishAndReady,
}

impl Scheduler {
    /// Takes note that the instance last given to `core` has finished at `now_ns`, and gives the
    /// core the first instance in line if nothing else is to be decided. A time before the latest
    /// instant counts as that instant. Also returns the events left for the caller to record,
    /// before the start.
    ///
    /// # Panics
    ///
    /// If no instance of the vertex has started, or it waits or has ended before.
    #[inline(always)]
    pub fn pass_on(&mut self, now_ns: u64, core: CoreId, vertex: Vertex) -> (HandOff, Unwritten) {
        // Cores may report their times in another order than that of their clock readings: time
        // never goes back.
        self.log.now_ns = self.log.now_ns.max(now_ns);
        let ending = self.vertices.get(vertex.0);
        let is_here = ending.phase == InstancePhase::Running(core);
        // A due deadline or release has to come first, by the whole step.
        let is_quiet = self.log.now_ns < self.quiet_until_ns;
        // A dispatch is owed, or the core is to run another instance: the whole step has to decide.
        if self.fresh != 0 || !is_here {
            return (self.end_later(now_ns, core, vertex), Unwritten::Nothing);
        }
        let mut unwritten = Unwritten::Nothing;
        if ending.ends == EndKind::PassesOn && is_quiet {
            let (ready, others) = self.vertices.pass_on(vertex.0);
            match ready {
                // The end made nothing ready, so only instances already in line can take the core.
                None => {
                    self.log.here = core;
                    unwritten = Unwritten::Finish;
                }
                // The most frequent case in a chain: the successor never enters the queue, and a
                // single journal entry records finish, ready and start.
                Some(next) if others.is_empty() && self.ready.is_one_empty_line() => {
                    self.pass(next, core);
                    let done = self.hand_off(core, (next, EventKind::Start));
                    return (done, Unwritten::FinishAndReady);
                }
                // Several successors, or others in line: only their keys tell which is first.
                Some(next) => self.line_up_all((core, vertex, now_ns), next, others),
            }
        } else if ending.ends == EndKind::PassesOnInTable
            && is_quiet
            && let Some((next, instance)) = self.hop_in_list(core, vertex.0)
        {
            let decision = Decision::new(EventKind::Start, core, instance);
            let done = HandOff::To(Vertex(next), decision);
            return (done, Unwritten::FinishAndReady);
        } else {
            self.write_finish(core, vertex, now_ns);
            self.end_instance(vertex.0);
        }
        // The core takes one of the new instances; a second may concern another core. (The module
        // doc explains why a single one cannot.)
        let concerns_others = self.cores.count() > 1
            && self.fresh > 0
            && (self.ready).concern_others(self.fresh, core, || {
                !self.vertices.get(vertex.0).is_preemptible
            });
        if concerns_others || self.log.now_ns >= self.quiet_until_ns {
            debug_assert!(unwritten == Unwritten::Nothing, "a finish is all there is");
            return (self.leave_open(core, vertex), Unwritten::Nothing);
        }
        // The dispatch is made here: nothing in line preempts anybody.
        self.fresh = 0;
        if let Some(first) = self.give_first(core, vertex.0) {
            return (self.hand_off(core, first), unwritten);
        }
        if unwritten == Unwritten::Finish {
            self.write_finish(core, vertex, now_ns);
        }
        // Idle only now: a core that goes on with another instance never enters the stack of idle
        // cores.
        self.cores.free(core);
        (HandOff::Idle, Unwritten::Nothing)
    }

    /// Returns the hand-off by which a core begins or continues the instance of a vertex.
    #[inline(always)]
    pub(super) fn hand_off(&self, core: CoreId, (next, what): (u32, EventKind)) -> HandOff {
        let instance = self.vertices.get(next).present_instance();
        HandOff::To(Vertex(next), Decision::new(what, core, instance))
    }

    /// Ends an instance while a dispatch is owed from before, or an instance already preempted in
    /// the scheduler's eyes.
    #[cold]
    #[inline]
    fn end_later(&mut self, finish_ns: u64, core: CoreId, vertex: Vertex) -> HandOff {
        self.write_finish(core, vertex, finish_ns);
        self.finish(self.instance_of(vertex));
        HandOff::Open
    }

    /// Records that a core has finished the instance of a vertex.
    #[inline]
    fn write_finish(&mut self, core: CoreId, vertex: Vertex, finish_ns: u64) {
        self.log.here = core;
        let instance = self.instance_of(vertex);
        self.log
            .on_core(core, EventKind::Finish, finish_ns, instance);
    }

    /// Leaves the instant open, to be begun again, and the core idle.
    #[cold]
    #[inline]
    fn leave_open(&mut self, core: CoreId, ended: Vertex) -> HandOff {
        // Judge the late sink now, before another instance of its vertex hides the progress of this
        // one.
        if self.log.now_ns >= self.quiet_until_ns {
            self.judge_ended(ended.0);
        }
        // The core that became idle last is taken first, so the following dispatch gives it the
        // first instance in line.
        self.cores.free(core);
        self.ready.lists.end(core, ended.0);
        self.fresh |= OWED;
        HandOff::Open
    }

    /// Gives a core the single instance just made ready, without putting it in line.
    #[inline(always)]
    fn pass(&mut self, number: u32, core: CoreId) {
        let next = self.vertices.get_mut(number);
        let key = (self.ready).key(number, next, || {
            self.dags[next.dag.index()].jobs.job(next.progress)
        });
        next.phase = InstancePhase::Running(core);
        (self.cores).run(core, key, next.is_preemptible);
    }

    /// Records that a core has finished the instance of a vertex. Puts in line the first successor
    /// made ready by the finish, and all later successors that are ready, too.
    #[inline]
    fn line_up_all(
        &mut self,
        (core, ended, finish_ns): (CoreId, Vertex, u64),
        mut next: u32,
        mut others: Successors,
    ) {
        let before = self.log.here;
        let is_next = (self.ready).is_next(|| self.vertices.get(next).line, core);
        self.write_finish(core, ended, finish_ns);
        let Self {
            vertices,
            dags,
            ready,
            log,
            ..
        } = self;
        loop {
            let vertex = vertices.get_mut(next);
            let (dag, sequence) = (vertex.dag, vertex.progress);
            let job = || dags[dag.index()].jobs.job(sequence);
            make_ready(next, vertex, job, ready, log);
            self.fresh += 1;
            match vertices.next_ready(&mut others) {
                Some(number) => next = number,
                None => break,
            }
        }
        // A sole instance leaves no trace of the core, in line or not, so no record depends on the
        // way taken.
        if is_next && self.fresh == 1 {
            self.log.here = before;
        }
    }

    /// Gives the core of an ended vertex the first instance in line. Returns its vertex, and
    /// whether the instance starts or resumes.
    #[inline(always)]
    pub(super) fn give_first(&mut self, core: CoreId, ended: u32) -> Option<(u32, EventKind)> {
        if !self.ready.is_one_line() {
            return self.give_first_apart(core, ended);
        }
        let key = self.ready.pop()?;
        Some((key.vertex(), self.seat(core, key)))
    }

    /// Not inlined, as most sets have a single line.
    #[inline(never)]
    fn give_first_apart(&mut self, core: CoreId, ended: u32) -> Option<(u32, EventKind)> {
        self.ready.lists.end(core, ended);
        // The list first: entries precede all lines (T1).
        if let Some(entry) = self.follow(core) {
            return Some((entry, self.give_to_entry(core, entry).what));
        }
        let key = self.ready.pop_for(core)?;
        Some((key.vertex(), self.seat(core, key)))
    }
}

/// The cores and their instances.
#[derive(Clone, Debug, Hash)]
pub(super) struct CoreTable {
    occupations: Box<[CoreOccupancy]>,
    idle: Vec<CoreId>,
}

#[derive(Clone, Copy, Debug, Hash)]
struct CoreOccupancy {
    /// The key of the running instance, if any.
    key: DispatchKey,
    /// Whether a more urgent member of the core's group may preempt the instance.
    may_be_preempted: bool,
}

const IDLE: CoreOccupancy = CoreOccupancy {
    key: DispatchKey::NONE,
    may_be_preempted: false,
};

impl CoreTable {
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
    pub(super) fn running(&self, core: CoreId) -> Option<DispatchKey> {
        let key = self.occupations[core.index()].key;
        (!key.is_none()).then_some(key)
    }

    /// Reports whether any core is idle.
    #[inline]
    pub(super) const fn any_idle(&self) -> bool {
        !self.idle.is_empty()
    }

    /// Returns an idle core, for the caller to give an instance.
    #[inline]
    pub(super) fn take_idle(&mut self) -> Option<CoreId> {
        self.idle.pop()
    }

    /// Returns the core among these that became idle last, for the caller to give an instance.
    #[inline]
    pub(super) fn take_idle_of(&mut self, cores: &[CoreId]) -> Option<CoreId> {
        let place = self.idle.iter().rposition(|idle| cores.contains(idle))?;
        Some(self.idle.remove(place))
    }

    /// Makes a core, if it is idle, the next to be taken.
    pub(super) fn prefer(&mut self, core: CoreId) {
        // From the top of the stack, where the preferred core usually is.
        if let Some(place) = self.idle.iter().rposition(|&idle| idle == core) {
            // Rotated, not swapped: the other cores keep the order in which they became idle.
            self.idle[place..].rotate_left(1);
        }
    }

    /// Gives an instance to a core that is not in the idle stack.
    #[inline]
    pub(super) fn run(&mut self, core: CoreId, key: DispatchKey, may_be_preempted: bool) {
        self.occupations[core.index()] = CoreOccupancy {
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
    fn largest_preemptible(&self) -> Option<(CoreId, DispatchKey)> {
        largest_preemptible((0..).map(CoreId).zip(&self.occupations))
    }

    /// Likewise, among these cores.
    #[inline]
    pub(super) fn largest_preemptible_of(&self, cores: &[CoreId]) -> Option<(CoreId, DispatchKey)> {
        let occupations = cores.iter().map(|core| &self.occupations[core.index()]);
        largest_preemptible(cores.iter().copied().zip(occupations))
    }
}

#[inline]
fn largest_preemptible<'o>(
    occupations: impl Iterator<Item = (CoreId, &'o CoreOccupancy)>,
) -> Option<(CoreId, DispatchKey)> {
    let mut largest = None;
    for (core, occupation) in occupations {
        // Idle cores have the largest key of all, but may not be preempted, so they do not win.
        let is_larger = largest.is_none_or(|(_, key)| key < occupation.key);
        if occupation.may_be_preempted && is_larger {
            largest = Some((core, occupation.key));
        }
    }
    largest
}
