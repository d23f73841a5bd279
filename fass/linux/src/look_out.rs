//! Decides which thread looks at the scheduler's next event when the event is due.
//!
//! Each core without work has a sleeping thread. That thread sleeps only until the next event, and
//! then makes the step releasing a job, mostly on the job's future core: the scheduler prefers the
//! core that became idle last. With the release thread making the step instead, two threads would
//! wake up one after the other. So several threads *look out*, in this order:
//!
//! - the worker of the core that became idle last, at the event;
//! - the workers of the other idle cores a little later, in case the first worker was taken
//!   meanwhile;
//! - the release thread last, or at the event if no core is idle. Then the release thread preempts.
//!
//! The first thread to come *claims* the event, makes the step, and is the first to get work. The
//! others leave the event alone, find no due event afterwards, and sleep on without the scheduler's
//! lock. If two threads came at once, the thread getting the lock would have to wake the other
//! before the other could begin.
//!
//! The release thread is above all computing threads, so it should not wake up when a job begins.
//! If no core is idle, the release thread also looks a little before the event. If a core has
//! become idle by then, it sleeps on.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use sched_dag::CoreId;

/// How much later each thread looks than the thread before it, and how long the others leave an
/// event to the one that has claimed it.
const PATIENCE_NS: u64 = 15_000;

/// How long before an event the release thread looks whether a core has become idle.
const EARLY_NS: u64 = 200_000;

/// State shared by the threads looking out.
#[derive(Debug)]
pub(crate) struct LookOut {
    /// The instant of the scheduler's next event, on the clock; `u64::MAX`: never, 0: the run is
    /// over.
    next_ns: AtomicU64,
    /// The idle cores, as bits. No thread looks out for cores beyond bit 63.
    idle: AtomicU64,
    /// The core that became idle last.
    last: AtomicU32,
    /// Until when the next event is left to the thread that has claimed the event.
    claimed_until_ns: AtomicU64,
    /// Whether idle workers never sleep. Then events do not need the release thread: nothing is
    /// preempted, so an event due while all cores are busy is handled at the next completion.
    polls: bool,
}

impl LookOut {
    pub(crate) const fn new(polls: bool) -> Self {
        Self {
            polls,
            next_ns: AtomicU64::new(u64::MAX),
            idle: AtomicU64::new(0),
            last: AtomicU32::new(0),
            claimed_until_ns: AtomicU64::new(0),
        }
    }

    /// Publishes the instant of the next event. Called under the scheduler's lock.
    #[inline]
    pub(crate) fn announce(&self, next_ns: u64) {
        // Where workers poll, only the end of the run concerns the release thread.
        match self.polls && next_ns > 0 {
            true => self.next_ns.store(next_ns, Ordering::Release),
            false => self.next_ns.store(next_ns, Ordering::SeqCst),
        }
        // A claim was for the event before this one.
        self.claimed_until_ns.store(0, Ordering::Release);
    }

    /// Claims the next event, due now, and reports whether the claim is the first.
    pub(crate) fn claim(&self, now_ns: u64) -> bool {
        let before_ns = self.claimed_until_ns.load(Ordering::Acquire);
        let until_ns = now_ns.saturating_add(PATIENCE_NS);
        let (won, lost) = (Ordering::AcqRel, Ordering::Relaxed);
        let word = &self.claimed_until_ns;
        // An older claim counts for a while only: its thread may have lost its processor.
        before_ns <= now_ns
            && word
                .compare_exchange(before_ns, until_ns, won, lost)
                .is_ok()
    }

    /// Returns the instant of the next event.
    #[inline]
    pub(crate) fn next_ns(&self) -> u64 {
        self.next_ns.load(Ordering::SeqCst)
    }

    /// Marks a core as idle: its worker has nothing to do. Called under the scheduler's lock.
    pub(crate) fn rest(&self, core: CoreId) {
        if let Some(bit) = bit(core) {
            // Relaxed: a thread that sees an older state looks a little early or late, no more.
            self.idle.fetch_or(bit, Ordering::Relaxed);
            self.last.store(core.0, Ordering::Relaxed);
        }
    }

    /// Marks a core as not idle: its worker has something to do, or is about to see.
    pub(crate) fn leave(&self, core: CoreId) {
        if let Some(bit) = bit(core) {
            self.idle.fetch_and(!bit, Ordering::Relaxed);
        }
    }

    /// Returns when the worker of an idle core looks at an event.
    pub(crate) fn of_worker(&self, core: CoreId, next_ns: u64) -> u64 {
        let last = CoreId(self.last.load(Ordering::Relaxed));
        let is_idle = |bit| self.idle.load(Ordering::Relaxed) & bit != 0;
        let own_ns = match bit(core) {
            None => u64::MAX,
            // The release thread ends the run.
            _ if next_ns == 0 => u64::MAX,
            Some(_) if core == last || !bit(last).is_some_and(is_idle) => next_ns,
            Some(_) => next_ns.saturating_add(PATIENCE_NS),
        };
        own_ns.max(self.claimed_until_ns.load(Ordering::Acquire))
    }

    /// Returns when the release thread looks at an event, or looks whether a core has become idle.
    pub(crate) fn of_release(&self, next_ns: u64, now_ns: u64) -> u64 {
        if self.polls {
            return u64::MAX;
        }
        let early_ns = next_ns.saturating_sub(EARLY_NS);
        let own_ns = match self.idle.load(Ordering::Relaxed) {
            0 if now_ns < early_ns && next_ns < u64::MAX => return early_ns,
            0 => next_ns,
            _ => next_ns.saturating_add(2 * PATIENCE_NS),
        };
        own_ns.max(self.claimed_until_ns.load(Ordering::Acquire))
    }

    /// Reports whether the release thread, due to look at `looks_at_ns`, would come too late for
    /// the next event: later than its largest delay after an event.
    #[inline]
    pub(crate) fn is_late(&self, looks_at_ns: &AtomicU64, next_ns: u64) -> bool {
        // At the end of the run the release thread has to look in any case.
        let is_needed = !self.polls || next_ns == 0;
        let latest_ns = next_ns.saturating_add(2 * PATIENCE_NS);
        // In one order with `announce` and `Team::settle_look`, which store first and then read.
        is_needed && latest_ns < looks_at_ns.load(Ordering::SeqCst)
    }
}

const fn bit(core: CoreId) -> Option<u64> {
    1_u64.checked_shl(core.0)
}

#[cfg(test)]
mod tests {
    use super::{LookOut, PATIENCE_NS};
    use sched_dag::CoreId;

    #[test]
    fn the_core_that_became_idle_last_looks_first_and_the_release_thread_last() {
        let look_out = LookOut::new(false);
        assert_eq!(look_out.of_release(7, 0), 7, "nobody else is there");
        look_out.rest(CoreId(1));
        look_out.rest(CoreId(0));
        assert_eq!(look_out.of_worker(CoreId(0), 7), 7);
        assert_eq!(look_out.of_worker(CoreId(1), 7), 7 + PATIENCE_NS);
        assert_eq!(look_out.of_release(7, 0), 7 + 2 * PATIENCE_NS);
        assert!(!look_out.is_late(&(7 + 2 * PATIENCE_NS).into(), 7));
        look_out.leave(CoreId(0));
        // The first one has work.
        assert_eq!(look_out.of_worker(CoreId(1), 7), 7);
        look_out.leave(CoreId(1));
        assert_eq!(look_out.of_release(7, 0), 7);
        look_out.rest(CoreId(70));
        assert_eq!(look_out.of_release(7, 0), 7, "it has no bit");
        assert_eq!(look_out.of_worker(CoreId(70), 7), u64::MAX);
        assert_eq!(look_out.of_worker(CoreId(0), 0), u64::MAX);
    }

    #[test]
    fn one_thread_makes_the_step_and_the_others_leave_it_to_that_one_for_a_while() {
        let look_out = LookOut::new(false);
        look_out.announce(1_000);
        look_out.rest(CoreId(1));
        look_out.rest(CoreId(0));
        assert!(look_out.claim(1_000));
        // It wakes up, and looks no more: without the claim the other one would come at once.
        look_out.leave(CoreId(0));
        assert!(!look_out.claim(1_001));
        let until_ns = 1_000 + PATIENCE_NS;
        assert_eq!(look_out.of_worker(CoreId(1), 1_000), until_ns);
        assert!(look_out.of_release(1_000, 1_001) >= until_ns);
        assert!(look_out.claim(until_ns), "the first one did not come");
        look_out.announce(2_000);
        assert!(look_out.claim(2_000), "another event");
    }

    #[test]
    fn the_release_thread_does_not_wake_up_at_an_event_that_an_idle_core_sees_to() {
        let (look_out, next_ns) = (LookOut::new(false), 1_000_000);
        let early_ns = look_out.of_release(next_ns, 0);
        assert!(early_ns < next_ns, "all cores are busy yet");
        assert_eq!(look_out.of_release(next_ns, early_ns), next_ns);
        look_out.rest(CoreId(0));
        assert_eq!(
            look_out.of_release(next_ns, early_ns),
            next_ns + 2 * PATIENCE_NS
        );
        assert_eq!(look_out.of_release(u64::MAX, 0), u64::MAX);
        look_out.leave(CoreId(0));
        assert_eq!(look_out.of_release(u64::MAX, 0), u64::MAX);
    }
}
