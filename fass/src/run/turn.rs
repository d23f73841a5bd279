//! The turns of a waiting subtask: the requested waits, and their checks.
//!
//! A *turn* is the execution of an instance from the start, or the end of a wait, to the finish, or
//! the next wait. One poll of the instance's future tells how the turn ends. With a ready future,
//! the instance has finished, and its outputs go out. With a pending future, a future of this crate
//! has begun a single wait in the turn. The completion of such a turn returns the wait, and causes
//! nothing else.
//!
//! A subtask states the number of waits and the limit of each. An instance with any other waits
//! panics with a [`WaitFault`].

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering};
use core::time::Duration;

use sched_dag::lifecycle::WaitLimit;
use sched_dag::{Wait, worded};

worded! {
    /// A fault of an instance whose waits differ from the waits stated by the subtask. Its text is
    /// the message of the instance's panic.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, WaitFault, create_dag, finish_create_dags, sleep};
    ///
    /// let machine = virtual_time::VirtualTime::new().contain_panics();
    /// let (dag, period) = (create_dag(), Duration::from_millis(10));
    /// dag.name("nap").jobs(1).relative_deadline(period);
    /// let nap = || async {
    ///     sleep(Duration::from_millis(4)).await;
    /// };
    /// let limit = Duration::from_millis(3);
    /// let attributes = SubtaskAttributes::named("nap").wait(limit);
    /// dag.register_periodic_async_subtask(nap, [], period, attributes);
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let message = &machine.run().panics[0].message;
    /// let asked = Duration::from_millis(4);
    /// assert_eq!(*message, WaitFault::TooLong { number: 0, asked, limit }.to_string());
    /// ```
    pub enum WaitFault {
        /// The function begins more waits than the subtask states.
        TooMany { stated: usize } = "wait_too_many",
            "a wait too many: the function begins one more than the {} that its subtask \
             states; state it by `wait`, or leave it out", stated;
        /// The function has returned after fewer waits than the subtask states.
        LeftOut { taken: u32, stated: usize } = "wait_left_out",
            "a wait left out: the function has returned after {} of the {} waits that \
             its subtask states; take each, one of no time if there is nothing to wait for, or \
             state fewer", taken, stated;
        /// The wait with this number, counted from 0, asks for more than the limit.
        TooLong { number: u32, asked: Duration, limit: Duration } = "wait_too_long",
            "a wait too long: wait {} asks for {:?}, and its limit is {:?}; ask \
             for less, or state a longer limit", number, asked, limit;
        /// The future begins a second wait in the same turn.
        TwoAtOnce = "two_waits_at_once",
            "two waits at once: the function begins a wait before the last one has ended; await \
             one after the other";
        /// The future has returned in the turn in which a wait has begun.
        NotAwaited = "wait_not_awaited",
            "a wait not awaited: the function has returned and dropped a wait that it has begun; \
             await it to its end";
        /// The future is pending for a reason other than a wait of this crate.
        Foreign = "foreign_wait",
            "a foreign wait: the function awaits what is none of its subtask's waits, and nothing \
             would end that; await `sleep`, `until`, a device's answer or a wire";
        /// A wait of this crate is polled outside the future of its subtask, in another job than it
        /// began in, or after its end.
        Outside = "wait_outside",
            "a wait outside: it is polled by something else than the instance that it is for, or \
             after its end; await it once, in the function of the async subtask that has it";
    }
}

impl WaitFault {
    #[cold]
    pub(crate) fn raise(self) -> ! {
        panic!("{self}")
    }
}

/// The requested end of a wait.
#[derive(Clone, Copy)]
pub(crate) enum WaitEnd {
    /// The stated limit.
    Limit,
    /// So many nanoseconds after the start of the wait.
    After(u64),
    /// So many, or the stated limit if that is less.
    AtMost(u64),
    /// So many nanoseconds after the release of the job.
    SinceRelease(u64),
}

/// The turn asks for no wait.
const NONE: u8 = 0;
/// The turn asks for a wait of the stored number of nanoseconds.
const AFTER: u8 = 1;
/// The turn asks for a wait until the stored number of nanoseconds after the release.
const SINCE_RELEASE: u8 = 2;

/// Stands for "no job".
const NO_JOB: u64 = u64::MAX;

/// The waits of a subtask, and its instance's progress in them. The users take turns, ordered by
/// the scheduler: the executing instance, its completion, the end of the wait. So no access here
/// needs a memory order.
pub(crate) struct TurnState {
    /// The stated limits.
    limits_ns: Box<[u64]>,
    /// The job of the instance that has started and not returned.
    job: AtomicU64,
    /// The number of waits begun by the instance.
    begun: AtomicU32,
    /// [`NONE`], [`AFTER`] or [`SINCE_RELEASE`], and how many nanoseconds.
    asks: AtomicU8,
    asked_ns: AtomicU64,
    has_timed_out: AtomicBool,
    /// The time since the release that has certainly passed, in ns.
    reached_ns: AtomicU64,
}

impl TurnState {
    pub(crate) fn new(waits: &[Wait]) -> Self {
        Self {
            limits_ns: waits.iter().map(|wait| wait.limit_ns).collect(),
            job: AtomicU64::new(NO_JOB),
            begun: AtomicU32::new(0),
            asks: AtomicU8::new(NONE),
            asked_ns: AtomicU64::new(0),
            has_timed_out: AtomicBool::new(false),
            reached_ns: AtomicU64::new(0),
        }
    }

    /// Returns the address of this state, to identify the subtask.
    pub(crate) fn address(&self) -> usize {
        core::ptr::from_ref(self).addr()
    }

    /// Reports whether the instance of a job has started and not returned.
    pub(crate) fn is_of(&self, job: u64) -> bool {
        self.job.load(Ordering::Relaxed) == job
    }

    pub(crate) fn start(&self, job: u64) {
        // The previous instance may have been cancelled, or have failed, at any of its waits, and
        // so may have left any state here.
        self.job.store(job, Ordering::Relaxed);
        self.begun.store(0, Ordering::Relaxed);
        self.asks.store(NONE, Ordering::Relaxed);
        self.reached_ns.store(0, Ordering::Relaxed);
    }

    /// Returns the job and the number of waits begun.
    pub(crate) fn latest(&self) -> (u64, u32) {
        let (job, begun) = (&self.job, &self.begun);
        (job.load(Ordering::Relaxed), begun.load(Ordering::Relaxed))
    }

    /// Reports whether the present turn has begun a wait.
    pub(crate) fn is_asking(&self) -> bool {
        self.asks.load(Ordering::Relaxed) != NONE
    }

    /// Begins the next wait.
    #[inline(always)]
    pub(crate) fn begin(&self, end: WaitEnd) {
        let number = self.begun.load(Ordering::Relaxed);
        let stated = self.limits_ns.len();
        let Some(&limit_ns) = self.limits_ns.get(number as usize) else {
            WaitFault::TooMany { stated }.raise()
        };
        if self.is_asking() {
            WaitFault::TwoAtOnce.raise()
        }
        let reached_ns = self.reached_ns.load(Ordering::Relaxed);
        // An instant of the job is checked against the time that has certainly passed, not against
        // the present time: so the wait is a fault in every run, or in none.
        let (asks, asked_ns, most_ns) = match end {
            WaitEnd::Limit => (AFTER, limit_ns, limit_ns),
            WaitEnd::After(ns) => (AFTER, ns, ns),
            WaitEnd::AtMost(ns) => (AFTER, ns.min(limit_ns), limit_ns),
            // Saturating: an instant that an earlier wait has reached takes no time, and is no
            // fault.
            WaitEnd::SinceRelease(ns) => (SINCE_RELEASE, ns, ns.saturating_sub(reached_ns)),
        };
        if most_ns > limit_ns {
            let [asked, limit] = [most_ns, limit_ns].map(Duration::from_nanos);
            WaitFault::TooLong {
                number,
                asked,
                limit,
            }
            .raise()
        }
        self.begun.store(number + 1, Ordering::Relaxed);
        self.asked_ns.store(asked_ns, Ordering::Relaxed);
        self.asks.store(asks, Ordering::Relaxed);
        if asks == SINCE_RELEASE {
            let reached_ns = reached_ns.max(asked_ns);
            self.reached_ns.store(reached_ns, Ordering::Relaxed);
        }
    }

    /// Checks that a turn with a pending future has begun a wait.
    pub(crate) fn expect_wait(&self) {
        if !self.is_asking() {
            WaitFault::Foreign.raise()
        }
    }

    /// Ends the last turn.
    pub(crate) fn finish(&self) {
        if self.is_asking() {
            WaitFault::NotAwaited.raise()
        }
        // Fewer waits would not harm the response-time bound, but a replay and the law count on
        // each stated wait.
        let (taken, stated) = (self.begun.load(Ordering::Relaxed), self.limits_ns.len());
        if (taken as usize) < stated {
            WaitFault::LeftOut { taken, stated }.raise()
        }
        self.job.store(NO_JOB, Ordering::Relaxed);
    }

    /// Takes a turn of a job without calling the function, and reports whether it is the last. Each
    /// stated wait is taken, for no time.
    pub(crate) fn pass(&self, job: u64) -> bool {
        // The job number alone tells the job's first turn, as in a turn that calls the function.
        if !self.is_of(job) {
            self.start(job);
        }
        let is_last = self.latest().1 as usize == self.limits_ns.len();
        match is_last {
            true => self.finish(),
            false => self.begin(WaitEnd::AtMost(0)),
        }
        is_last
    }

    /// Takes the wait in which the turn has ended, if the instance has not finished, with its
    /// longest duration in ns.
    pub(super) fn take_wait(&self) -> Option<(WaitLimit, u64)> {
        let ns = self.asked_ns.load(Ordering::Relaxed);
        let asks = self.asks.load(Ordering::Relaxed);
        // The next turn has to ask anew: `expect_wait` would take this wait for its own.
        self.asks.store(NONE, Ordering::Relaxed);
        match asks {
            NONE => None,
            AFTER => Some((WaitLimit::For(ns), ns)),
            // The release is not later than the end of the turn, so `ns` bounds the wait.
            _ => Some((WaitLimit::SinceRelease(ns), ns)),
        }
    }

    /// Reports whether the latest wait has ended by the limit.
    pub(crate) fn has_timed_out(&self) -> bool {
        self.has_timed_out.load(Ordering::Relaxed)
    }

    /// Notes how the wait has ended, before the next turn.
    pub(crate) fn wake(&self, has_timed_out: bool) {
        self.has_timed_out.store(has_timed_out, Ordering::Relaxed);
    }
}
