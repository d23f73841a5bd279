//! A thread that runs instances, as the others see it: its mode, and what it sleeps on.
//!
//! A worker that is preempted is *demoted*, never stopped: when its core has nothing more
//! urgent it runs on, so a lock that it holds (the allocator's, an output stream's) is
//! given back, and nobody waits for it forever.
//!
//! # Demoted workers and the scheduler's lock
//!
//! A worker that is at a low level must not hold the scheduler's lock: its core would
//! compute something more urgent, and all others wait. So no demoted worker takes it:
//! one that has finished first says so in its mode. If it was demoted before, it
//! raises itself above all that compute. If it is to be demoted just then, by the
//! lock's owner, that one sees the mode and lets it be. The two may cross; then the owner
//! raises it again, before it gives the lock back. On the way of an instance that is not
//! preempted all that is one exchange of a word.
//!
//! # Waking up in time
//!
//! From a timer's interrupt to the thread that waits for it Linux takes some tens of
//! microseconds, in a virtual machine more, and most of it is the same each time. A thread that
//! has nothing else to do can have it pass before the instant: it wakes up a little early, and
//! watches the clock for the rest.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering, fence};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};

use fass::platform::SubtaskRunner;
use sched_dag::CoreId;

use crate::level::{Levels, Role};
use crate::sys::ThreadId;
use crate::{clock, section, sys};

/// It runs no instance: it waits, or has the scheduler's lock, or is about to take it. Where none is
/// ever demoted, always.
const REPORTS: u32 = 0;
/// It runs an instance as its core should.
const RUNS: u32 = 1;
/// It runs an instance that has lost its core.
const DEMOTED: u32 = 2;

/// The part of a worker that other threads see.
#[derive(Debug, Default)]
#[repr(align(128))]
pub(crate) struct Worker {
    /// Its thread, and that as sections know it.
    thread: OnceLock<(ThreadId, u32)>,
    mode: AtomicU32,
    /// The number of the core of which it was the active one when it had the lock last, and 1.
    seat: AtomicU32,
    /// Whether it sleeps until its mode changes.
    holds: AtomicBool,
    /// 1 if it is to look for work.
    call: AtomicU32,
    /// The runner of an instance that another thread has started for it, if it watches. Its own
    /// thread takes no other lock meanwhile, so the giver waits for a moment at most.
    given: Mutex<Option<Box<SubtaskRunner>>>,
    /// Whether it watches for that instead of sleeping.
    polls: bool,
}

/// The stack of each worker. All of it is locked in memory, if memory is.
const STACK_BYTES: usize = 512 * 1024;

/// Begins the thread of a worker.
pub(crate) fn begin(number: usize, work: impl FnOnce() + Send + 'static) -> JoinHandle<()> {
    thread::Builder::new()
        .name(format!("fass-worker-{number}"))
        .stack_size(STACK_BYTES)
        .spawn(work)
        .expect("the system has a thread for each worker of a run")
}

/// How often a worker looks before it lets other threads have its processor, in case there are
/// fewer processors than workers.
const PATIENCE: u32 = 5_000;

impl Worker {
    /// Makes one that watches for calls, or sleeps until one comes.
    pub(crate) fn new(polls: bool) -> Self {
        Self {
            polls,
            ..Self::default()
        }
    }

    /// Says which thread it is. To be called by that thread, first of all.
    pub(crate) fn register_thread(&self) {
        let _ = self.thread.set((sys::thread(), section::own()));
    }

    /// Returns its thread's number, once it has begun.
    pub(crate) fn thread(&self) -> Option<ThreadId> {
        self.thread.get().map(|of| of.0)
    }

    /// Gives it up as one that enters sections, with the section that it is in.
    pub(crate) fn give_up_sections(&self) {
        if let Some((_, thread)) = self.thread.get() {
            section::give_up(*thread);
        }
    }

    /// Brings its thread to a level, if there are levels.
    pub(crate) fn bring(&self, levels: Option<Levels>, role: Role) {
        if let (Some(levels), Some(thread)) = (levels, self.thread()) {
            levels.bring(thread, role);
        }
    }

    /// Takes note of the core of which it is the active one. By itself, under the lock.
    pub(crate) fn sit(&self, core: Option<CoreId>) {
        let place = core.map_or(0, |core| core.0 + 1);
        self.seat.store(place, Ordering::Relaxed);
        if core.is_none() {
            // With that of `call`: from now on it sleeps while it waits, so it sees the call before,
            // or the caller that it has no seat.
            fence(Ordering::SeqCst);
        }
    }

    /// Returns that core. While it waits, nobody takes that from it.
    pub(crate) fn seat(&self) -> Option<CoreId> {
        self.seat.load(Ordering::Relaxed).checked_sub(1).map(CoreId)
    }

    /// Makes it look for work.
    pub(crate) fn call(&self) {
        self.call.store(1, Ordering::Release);
        if self.polls {
            // With that of `sit`.
            fence(Ordering::SeqCst);
        }
        if !self.watches() {
            sys::wake(&self.call, 1);
        }
    }

    /// Leaves it, while it watches, the runner of an instance that was started for it.
    pub(crate) fn give(&self, runner: Box<SubtaskRunner>) {
        *self.given.lock().unwrap_or_else(PoisonError::into_inner) = Some(runner);
        self.call.store(1, Ordering::Release);
    }

    /// Takes the runner, if there is one. By itself.
    pub(crate) fn take_given(&self) -> Option<Box<SubtaskRunner>> {
        let mut given = self.given.lock().unwrap_or_else(PoisonError::into_inner);
        given.take()
    }

    /// Sleeps until it is called, or until an instant, for which it wakes up a little early. By
    /// itself. Reports whether it was called.
    pub(crate) fn wait_for_call(&self, until_ns: u64, lead: &mut Lead) -> bool {
        if self.watches() {
            return self.poll(until_ns);
        }
        let alarm_ns = (until_ns < u64::MAX).then(|| lead.before(until_ns));
        while self.call.swap(0, Ordering::Acquire) == 0 {
            if alarm_ns.is_some_and(|alarm_ns| clock::now_ns() >= alarm_ns) {
                return self.watch(until_ns);
            }
            sys::wait(&self.call, 0, alarm_ns);
            if let Some(alarm_ns) = alarm_ns
                && self.call.load(Ordering::Relaxed) == 0
            {
                let now_ns = clock::now_ns();
                if now_ns >= alarm_ns {
                    lead.learn(alarm_ns, now_ns);
                }
            }
        }
        true
    }

    /// Reports whether it watches while it waits: one without a core sleeps in any case.
    pub(crate) fn watches(&self) -> bool {
        self.polls && self.seat().is_some()
    }

    /// Watches for a call, and for an instant. Reports whether there is a call; it may also return
    /// for nothing, so that its caller sees what has changed else.
    fn poll(&self, until_ns: u64) -> bool {
        for _ in 0..PATIENCE {
            if self.call.load(Ordering::Relaxed) != 0 {
                return self.call.swap(0, Ordering::Acquire) != 0;
            }
            if until_ns < u64::MAX && clock::now_ns() >= until_ns {
                return false;
            }
            std::hint::spin_loop();
        }
        thread::yield_now();
        false
    }

    /// Watches the clock until an instant, or until it is called, and reports whether it was.
    fn watch(&self, until_ns: u64) -> bool {
        while clock::now_ns() < until_ns {
            if self.call.swap(0, Ordering::Acquire) != 0 {
                return true;
            }
            std::hint::spin_loop();
        }
        false
    }

    /// Takes note that it runs an instance from now on. Under the lock.
    pub(crate) fn run(&self) {
        self.mode.store(RUNS, Ordering::Relaxed);
    }

    /// Gets ready to take the lock, after an instance has ended. By itself. Reports
    /// whether it has raised itself for that; then it is to lower itself under the lock.
    pub(crate) fn report(&self, levels: Option<Levels>) -> bool {
        let was_demoted = self.mode.swap(REPORTS, Ordering::AcqRel) == DEMOTED;
        if was_demoted {
            self.bring(levels, Role::Report);
        }
        was_demoted
    }

    /// Reports whether the instance that its core has with it is over: it is about to take the
    /// lock, or has been told to. Under the lock.
    pub(crate) fn has_returned(&self) -> bool {
        self.mode.load(Ordering::Acquire) == REPORTS
    }

    /// Demotes it to a role, and reports whether it has: not if its instance has just
    /// ended. Under the lock.
    pub(crate) fn demote(&self, levels: Option<Levels>, role: Role) -> bool {
        if !self.exchange(RUNS, DEMOTED) {
            return false;
        }
        self.bring(levels, role);
        if self.mode.load(Ordering::Acquire) != DEMOTED {
            // It has raised itself, perhaps before we lowered it.
            self.bring(levels, Role::Report);
        }
        self.tell_holder();
        true
    }

    /// Lets it run again what it ran when it was demoted. Under the lock.
    pub(crate) fn promote(&self, levels: Option<Levels>) {
        // If its instance has ended meanwhile, it is about to report that.
        self.exchange(DEMOTED, RUNS);
        self.bring(levels, Role::Run);
        self.tell_holder();
    }

    /// Changes the mode if it is the expected one, and reports whether it was.
    ///
    /// In one order with the look at `holds` behind it: a holder says that it holds, and then looks
    /// at the mode, so one of both sees the other.
    fn exchange(&self, expected: u32, mode: u32) -> bool {
        let (won, lost) = (Ordering::SeqCst, Ordering::Acquire);
        let exchanged = self.mode.compare_exchange(expected, mode, won, lost);
        exchanged.is_ok()
    }

    fn tell_holder(&self) {
        if self.holds.load(Ordering::SeqCst) {
            sys::wake(&self.mode, 1);
        }
    }

    /// Sleeps for so long of the time in which it is not demoted. By itself.
    pub(crate) fn hold(&self, mut left_ns: u64) {
        self.holds.store(true, Ordering::SeqCst);
        while left_ns > 0 {
            // Where nothing is ever demoted, nobody keeps a mode.
            let mode = self.mode.load(Ordering::SeqCst);
            if mode == DEMOTED {
                sys::wait(&self.mode, DEMOTED, None);
                continue;
            }
            let from_ns = clock::now_ns();
            sys::wait(&self.mode, mode, Some(from_ns.saturating_add(left_ns)));
            left_ns = left_ns.saturating_sub(clock::now_ns().saturating_sub(from_ns));
        }
        self.holds.store(false, Ordering::Relaxed);
    }
}

/// The lead that a thread gives itself, learnt from how late it woke up.
///
/// It follows the delay that 19 of 20 do not exceed: a step up after a longer one, a nineteenth
/// of it down after a shorter one. So a rare long delay moves it no further than a usual one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lead {
    ns: u64,
}

impl Default for Lead {
    /// Begins with what it takes where it takes long, so that the first wake-ups are in time, too.
    fn default() -> Self {
        Self { ns: 60_000 }
    }
}

impl Lead {
    /// By how much a shorter delay changes it, and a longer one nineteen times.
    const STEP_NS: u64 = 250;
    /// How much of each period a thread watches the clock at most.
    const MOST_NS: u64 = 100_000;

    /// Returns when to set the alarm for an instant.
    pub(crate) const fn before(self, instant_ns: u64) -> u64 {
        instant_ns.saturating_sub(self.ns)
    }

    /// Notes when a thread woke up, and when its alarm was due.
    fn learn(&mut self, alarm_ns: u64, woke_ns: u64) {
        let late_ns = woke_ns.saturating_sub(alarm_ns);
        self.ns = match late_ns > self.ns {
            true => (self.ns + 19 * Self::STEP_NS).min(Self::MOST_NS),
            false => self.ns.saturating_sub(Self::STEP_NS),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_just_ended_is_not_demoted() {
        let worker = Worker::default();
        worker.register_thread();
        worker.run();
        assert!(worker.demote(None, Role::Demoted));
        assert!(!worker.demote(None, Role::Demoted), "it is demoted already");
        worker.promote(None);
        assert!(worker.demote(None, Role::Demoted));
        worker.report(None);
        worker.promote(None);
        assert!(!worker.demote(None, Role::Demoted), "it has reported");
    }

    #[test]
    fn a_call_before_the_wait_is_not_lost() {
        let worker = Worker::default();
        worker.call();
        assert!(worker.wait_for_call(u64::MAX, &mut Lead::default()));
        assert_eq!(worker.call.load(Ordering::Relaxed), 0);
    }

    /// Has a worker called so many times, each time it waits, by a thread.
    fn call_often(worker: &Worker, leaves: bool) {
        let rounds = if cfg!(miri) { 5 } else { 2_000 };
        let (calls, seen) = (AtomicU32::new(0), AtomicU32::new(0));
        thread::scope(|scope| {
            scope.spawn(|| {
                for round in 1..=rounds {
                    calls.store(round, Ordering::Relaxed);
                    worker.call();
                    while seen.load(Ordering::Acquire) < round {
                        thread::yield_now();
                    }
                }
            });
            for round in 1..=rounds {
                // A lost call makes itself felt by the time, far beyond any delay.
                let end_ns = clock::now_ns() + 60_000_000_000;
                worker.sit(Some(CoreId(0)));
                if leaves {
                    worker.sit(None);
                }
                while !worker.wait_for_call(end_ns, &mut Lead::default()) {
                    assert!(clock::now_ns() < end_ns, "call {round} is lost");
                }
                assert_eq!(calls.load(Ordering::Relaxed), round, "what came before it");
                seen.store(round, Ordering::Release);
            }
        });
    }

    #[test]
    fn no_call_is_lost_asleep_or_watching_or_by_leaving_a_seat() {
        for (polls, leaves) in [(false, false), (true, false), (true, true)] {
            call_often(&Worker::new(polls), leaves);
        }
    }

    /// A holder that is promoted goes on; were it not told, it would sleep for ever.
    #[test]
    fn one_that_holds_is_told() {
        for _ in 0..if cfg!(miri) { 5 } else { 1_000 } {
            let worker = Worker::default();
            worker.run();
            thread::scope(|scope| {
                scope.spawn(|| worker.hold(1));
                worker.demote(None, Role::Demoted);
                worker.promote(None);
            });
        }
    }

    /// Counted in processor time, so other programs add nothing.
    #[test]
    fn one_that_holds_takes_no_processor_time_where_none_is_demoted() {
        let (from_ns, hold_ns) = (sys::own_processor_time_ns(), 50_000_000);
        Worker::default().hold(hold_ns);
        assert!(sys::own_processor_time_ns() - from_ns < hold_ns / 10);
    }

    #[test]
    fn it_wakes_up_by_itself_and_not_before_the_instant() {
        let (worker, mut lead) = (Worker::default(), Lead::default());
        for _ in 0..5 {
            let instant_ns = clock::now_ns() + 1_000_000;
            assert!(!worker.wait_for_call(instant_ns, &mut lead));
            assert!(clock::now_ns() >= instant_ns);
        }
    }

    #[test]
    fn it_follows_the_usual_delays_and_no_single_one() {
        let mut lead = Lead::default();
        for wake in 0..400_u64 {
            let late_ns = if wake % 50 == 0 { 5_000_000 } else { 30_000 };
            lead.learn(0, late_ns);
        }
        assert!((25_000..=35_000).contains(&lead.ns), "{lead:?}");
        for _ in 0..200 {
            lead.learn(0, u64::MAX);
        }
        assert_eq!(lead.before(1_000_000), 1_000_000 - Lead::MOST_NS);
    }
}
