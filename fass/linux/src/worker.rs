//! A thread running instances, as seen by other threads: its mode, and the words on which it
//! sleeps.
//!
//! A preempted worker is *demoted*, never stopped. When its core has nothing more urgent, the
//! worker runs on, so it gives back any locks it holds (the allocator's, an output stream's), and
//! nobody waits for such a lock forever.
//!
//! # Demoted workers and the scheduler's lock
//!
//! A worker at a low level must not hold the scheduler's lock: its core would compute something
//! more urgent, while all other threads wait. So no demoted worker takes the lock. A worker whose
//! instance has finished first records the end in its mode. If it was demoted before, it raises
//! itself above all computing threads. If the lock's owner is about to demote the worker just then,
//! the owner sees the mode and leaves the worker alone. The two steps may cross; then the owner
//! raises the worker again, before giving the lock back. For an instance that is not preempted, the
//! whole protocol costs one exchange of a word.
//!
//! # Waking up in time
//!
//! Between a timer's interrupt and the waiting thread's first instruction, Linux takes some tens of
//! microseconds, and more in a virtual machine. Most of this delay is the same each time. A thread
//! without other work can let the delay pass before the instant: the thread wakes up a little
//! early, and watches the clock for the rest.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering, fence};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};

use fass::platform::SubtaskRunner;
use sched_dag::CoreId;

use crate::level::{Levels, Role};
use crate::sys::ThreadId;
use crate::{clock, section, sys};

/// The worker runs no instance: it waits, or has the scheduler's lock or is about to take it.
/// Without demotions, the mode is always this.
const REPORTS: u32 = 0;
/// The worker runs an instance as its core should.
const RUNS: u32 = 1;
/// The worker runs an instance that has lost its core.
const DEMOTED: u32 = 2;

/// The part of a worker that other threads see.
#[derive(Debug, Default)]
#[repr(align(128))]
pub(crate) struct Worker {
    /// The worker's thread, and the number of the same thread in sections.
    thread: OnceLock<(ThreadId, u32)>,
    mode: AtomicU32,
    /// 1 plus the number of the worker's core when it last had the lock; 0 if the worker was not
    /// active.
    seat: AtomicU32,
    /// Whether the worker sleeps until its mode changes.
    holds: AtomicBool,
    /// 1 if the worker has to look for work.
    call: AtomicU32,
    /// The runner of an instance started by another thread, for a watching worker. The worker's own
    /// thread takes no other lock meanwhile, so the giver waits only for a moment.
    given: Mutex<Option<Box<SubtaskRunner>>>,
    /// Whether the worker watches for calls instead of sleeping.
    polls: bool,
}

/// The size of each worker's stack. If memory is locked, the whole stack is locked.
const STACK_BYTES: usize = 512 * 1024;

/// Begins the thread of a worker.
pub(crate) fn begin(number: usize, work: impl FnOnce() + Send + 'static) -> JoinHandle<()> {
    thread::Builder::new()
        .name(format!("fass-worker-{number}"))
        .stack_size(STACK_BYTES)
        .spawn(work)
        .expect("the system has a thread for each worker of a run")
}

/// How often a worker looks before yielding its processor to other threads, in case there are fewer
/// processors than workers.
const PATIENCE: u32 = 5_000;

impl Worker {
    /// Makes a worker that watches for calls, or sleeps until a call comes.
    pub(crate) fn new(polls: bool) -> Self {
        Self {
            polls,
            ..Self::default()
        }
    }

    /// Records the worker's thread. That thread must call this first of all.
    pub(crate) fn register_thread(&self) {
        let _ = self.thread.set((sys::thread(), section::own()));
    }

    /// Returns the number of the worker's thread, once the thread has begun.
    pub(crate) fn thread(&self) -> Option<ThreadId> {
        self.thread.get().map(|of| of.0)
    }

    /// Gives the worker's thread up, with the section it is in.
    pub(crate) fn give_up_sections(&self) {
        if let Some((_, thread)) = self.thread.get() {
            section::give_up(*thread);
        }
    }

    /// Brings the worker's thread to a level, if there are levels.
    pub(crate) fn bring(&self, levels: Option<Levels>, role: Role) {
        if let (Some(levels), Some(thread)) = (levels, self.thread()) {
            levels.bring(thread, role);
        }
    }

    /// Notes the core for which the worker is active. Called by the worker itself, under the lock.
    pub(crate) fn sit(&self, core: Option<CoreId>) {
        let place = core.map_or(0, |core| core.0 + 1);
        self.seat.store(place, Ordering::Relaxed);
        if core.is_none() {
            // Pairs with the fence in `call`. From now on the worker sleeps while it waits, so
            // either the worker sees the call first, or the caller sees that the worker has no
            // seat.
            fence(Ordering::SeqCst);
        }
    }

    /// Returns the worker's core. While the worker waits, nobody takes the core from it.
    pub(crate) fn seat(&self) -> Option<CoreId> {
        self.seat.load(Ordering::Relaxed).checked_sub(1).map(CoreId)
    }

    /// Makes the worker look for work.
    pub(crate) fn call(&self) {
        self.call.store(1, Ordering::Release);
        if self.polls {
            // Pairs with the fence in `sit`.
            fence(Ordering::SeqCst);
        }
        if !self.watches() {
            sys::wake(&self.call, 1);
        }
    }

    /// Hands a watching worker the runner of an instance started for the worker.
    pub(crate) fn give(&self, runner: Box<SubtaskRunner>) {
        // Before the call, which makes the worker look here. No wake-up: a watching worker is
        // awake.
        *self.given.lock().unwrap_or_else(PoisonError::into_inner) = Some(runner);
        self.call.store(1, Ordering::Release);
    }

    /// Takes the given runner, if there is one. Called by the worker itself.
    pub(crate) fn take_given(&self) -> Option<Box<SubtaskRunner>> {
        let mut given = self.given.lock().unwrap_or_else(PoisonError::into_inner);
        given.take()
    }

    /// Sleeps until the worker is called, or until an instant, waking up a little early for the
    /// instant. Called by the worker itself. Reports whether the worker was called.
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
            // After a call, the wake-up says nothing about the timer's delay.
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

    /// Reports whether the worker watches while waiting. A worker without a core sleeps in any
    /// case.
    pub(crate) fn watches(&self) -> bool {
        self.polls && self.seat().is_some()
    }

    /// Watches for a call, and for an instant. Reports whether there is a call. May return early,
    /// so the caller sees other changes.
    fn poll(&self, until_ns: u64) -> bool {
        for _ in 0..PATIENCE {
            // A load in each round, not a swap: a swap would take the cache line from the caller.
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

    /// Watches the clock until an instant, or until a call comes, and reports whether a call came.
    fn watch(&self, until_ns: u64) -> bool {
        while clock::now_ns() < until_ns {
            if self.call.swap(0, Ordering::Acquire) != 0 {
                return true;
            }
            std::hint::spin_loop();
        }
        false
    }

    /// Notes that the worker runs an instance from now on. Called under the lock.
    pub(crate) fn run(&self) {
        // Relaxed: a demotion comes under the same lock, and so after this.
        self.mode.store(RUNS, Ordering::Relaxed);
    }

    /// Prepares the worker for taking the lock after an instance has ended. Called by the worker
    /// itself. Reports whether the worker has raised itself; then it has to lower itself under the
    /// lock.
    pub(crate) fn report(&self, levels: Option<Levels>) -> bool {
        // One exchange tells both sides: a demotion before it is seen here, a later one finds
        // `REPORTS`.
        let was_demoted = self.mode.swap(REPORTS, Ordering::AcqRel) == DEMOTED;
        if was_demoted {
            self.bring(levels, Role::Report);
        }
        was_demoted
    }

    /// Reports whether the instance on the worker's core is over: the worker is about to take the
    /// lock, or has been told to. Called under the lock.
    pub(crate) fn has_returned(&self) -> bool {
        self.mode.load(Ordering::Acquire) == REPORTS
    }

    /// Demotes the worker to a role, and reports whether it did: not if the worker's instance has
    /// just ended. Called under the lock.
    pub(crate) fn demote(&self, levels: Option<Levels>, role: Role) -> bool {
        if !self.exchange(RUNS, DEMOTED) {
            return false;
        }
        self.bring(levels, role);
        if self.mode.load(Ordering::Acquire) != DEMOTED {
            // The worker has raised itself, perhaps before it was lowered here.
            self.bring(levels, Role::Report);
        }
        self.tell_holder();
        true
    }

    /// Lets the worker resume the instance it ran when it was demoted. Called under the lock.
    pub(crate) fn promote(&self, levels: Option<Levels>) {
        // If the instance has ended meanwhile, the worker is about to report the end.
        self.exchange(DEMOTED, RUNS);
        self.bring(levels, Role::Run);
        self.tell_holder();
    }

    /// Changes the mode if the mode is the expected one, and reports whether it was.
    ///
    /// Sequentially consistent with the later look at `holds`: a holder first stores `holds` and
    /// then looks at the mode, so one of the two threads sees the other's store.
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

    /// Sleeps for `left_ns` of the time in which the worker is not demoted. Called by the worker
    /// itself.
    pub(crate) fn hold(&self, mut left_ns: u64) {
        self.holds.store(true, Ordering::SeqCst);
        while left_ns > 0 {
            // The mode need not be `RUNS`: where workers are never demoted, nobody maintains it.
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

/// The lead of a thread's alarm before an instant, learnt from the delays of earlier wake-ups.
///
/// The lead follows the 95th percentile of the delays: a step up after a longer delay, a nineteenth
/// of the step down after a shorter delay. So a rare long delay moves the lead no further than a
/// usual one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lead {
    ns: u64,
}

impl Default for Lead {
    /// Begins with the delay of slow systems, so the first wake-ups are in time, too.
    fn default() -> Self {
        Self { ns: 60_000 }
    }
}

impl Lead {
    /// The change after a shorter delay; a longer delay changes the lead by nineteen times as much.
    const STEP_NS: u64 = 250;
    /// The most time of each period for which a thread watches the clock.
    const MOST_NS: u64 = 100_000;

    /// Returns when to set the alarm for an instant.
    pub(crate) const fn before(self, instant_ns: u64) -> u64 {
        instant_ns.saturating_sub(self.ns)
    }

    /// Learns from a wake-up: when the thread woke up, and when its alarm was due.
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
