//! Which thread looks at the scheduler's next event when it is due.
//!
//! A core without work has a thread that sleeps. It sleeps until the next event, and so makes the
//! step that releases a job on the core where that job mostly begins: the scheduler takes the
//! core that has become idle last. Were the release thread to do it, two threads would wake up
//! one after the other. So this *looks out*:
//!
//! - the worker of the core that has become idle last, at the event;
//! - those of the other idle cores a little later, in case the first was taken meanwhile;
//! - the release thread last, or at the event if no core is idle. Then it preempts.
//!
//! The first that comes makes the step. The others find no event due and sleep on, without the
//! scheduler's lock.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use sched_dag::CoreId;

/// How much later than the one before it a thread looks.
const PATIENCE_NS: u64 = 15_000;

/// What those that look out share.
#[derive(Debug)]
pub(crate) struct LookOut {
    /// When the scheduler has its next event, on the clock; `u64::MAX`: never, 0: all is over.
    next_ns: AtomicU64,
    /// The idle cores, as bits. No thread looks out for cores beyond them.
    idle: AtomicU64,
    /// The core that has become idle last.
    last: AtomicU32,
}

impl LookOut {
    pub(crate) const fn new() -> Self {
        Self {
            next_ns: AtomicU64::new(u64::MAX),
            idle: AtomicU64::new(0),
            last: AtomicU32::new(0),
        }
    }

    /// Says when the next event is. Under the scheduler's lock.
    #[inline]
    pub(crate) fn announce(&self, next_ns: u64) {
        self.next_ns.store(next_ns, Ordering::SeqCst);
    }

    /// Returns when the next event is.
    #[inline]
    pub(crate) fn next_ns(&self) -> u64 {
        self.next_ns.load(Ordering::SeqCst)
    }

    /// Takes note that a core's worker has nothing to do. Under the scheduler's lock.
    pub(crate) fn rest(&self, core: CoreId) {
        if let Some(bit) = bit(core) {
            self.idle.fetch_or(bit, Ordering::Relaxed);
            self.last.store(core.0, Ordering::Relaxed);
        }
    }

    /// Takes note that it has something to do, or is about to see.
    pub(crate) fn leave(&self, core: CoreId) {
        if let Some(bit) = bit(core) {
            self.idle.fetch_and(!bit, Ordering::Relaxed);
        }
    }

    /// Returns when the worker of an idle core looks at an event.
    pub(crate) fn of_worker(&self, core: CoreId, next_ns: u64) -> u64 {
        let last = CoreId(self.last.load(Ordering::Relaxed));
        let is_idle = |bit| self.idle.load(Ordering::Relaxed) & bit != 0;
        match bit(core) {
            None => u64::MAX,
            // The release thread ends the run.
            _ if next_ns == 0 => u64::MAX,
            Some(_) if core == last || !bit(last).is_some_and(is_idle) => next_ns,
            Some(_) => next_ns.saturating_add(PATIENCE_NS),
        }
    }

    /// Returns when the release thread looks at an event.
    pub(crate) fn of_release(&self, next_ns: u64) -> u64 {
        match self.idle.load(Ordering::Relaxed) {
            0 => next_ns,
            _ => next_ns.saturating_add(2 * PATIENCE_NS),
        }
    }

    /// Reports whether the release thread, which looks at `looks_at_ns`, would come too late for
    /// the next event, or longer after it than it ever may.
    pub(crate) const fn is_late(looks_at_ns: u64, next_ns: u64) -> bool {
        next_ns.saturating_add(2 * PATIENCE_NS) < looks_at_ns
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
        let look_out = LookOut::new();
        assert_eq!(look_out.of_release(7), 7, "nobody else is there");
        look_out.rest(CoreId(1));
        look_out.rest(CoreId(0));
        assert_eq!(look_out.of_worker(CoreId(0), 7), 7);
        assert_eq!(look_out.of_worker(CoreId(1), 7), 7 + PATIENCE_NS);
        assert_eq!(look_out.of_release(7), 7 + 2 * PATIENCE_NS);
        assert!(!LookOut::is_late(7 + 2 * PATIENCE_NS, 7));
        look_out.leave(CoreId(0));
        assert_eq!(
            look_out.of_worker(CoreId(1), 7),
            7,
            "the first one has work"
        );
        look_out.leave(CoreId(1));
        assert_eq!(look_out.of_release(7), 7);
        look_out.rest(CoreId(70));
        assert_eq!(look_out.of_release(7), 7, "it has no bit");
        assert_eq!(look_out.of_worker(CoreId(70), 7), u64::MAX);
        assert_eq!(look_out.of_worker(CoreId(0), 0), u64::MAX);
    }
}
