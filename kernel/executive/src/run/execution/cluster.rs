//! The clusters of a divided machine: the state each cluster has for itself.
//!
//! Each event on a core takes the lock of its cluster, steps the scheduler and writes into the
//! journal there; the hot path of a cluster therefore touches no word of another. The first core of
//! a cluster keeps the cluster's time.
//!
//! Undivided cores form one cluster. [`divided`](super::divided) divides the cores.
//!
//! Requests from a cluster to others (signals, pauses, modes, the end) are
//! [letters](sched_dag::lifecycle::Mailboxes): the sender wakes the other cluster's first core, and
//! that core takes the letters in a step of its own. Letters need no lock, so nobody waits.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};

use fass::platform::{Request, SetOnce};
use sched_dag::{ClusterId, CoreId, lifecycle};

use super::ClusterRun;
use crate::machine::spinlock::SpinLock;
use crate::machine::this_core::{self, Core};

/// The state of one cluster, on cache lines of its own.
#[repr(align(128))]
pub(super) struct ClusterState {
    pub(super) execution: SpinLock<Option<ClusterRun>>,
    /// When the first core's timer shall next step the scheduler, on the clock, in nanoseconds;
    /// `u64::MAX` if never.
    next_event_ns: AtomicU64,
    /// Whether the cluster has nothing left to do.
    pub(super) is_finished: AtomicBool,
    /// The number of jobs ended in this run, of DAGs with a limit of jobs.
    pub(super) jobs_ended: AtomicU64,
    /// Whether letters may be waiting.
    pub(super) has_letters: AtomicBool,
    pub(super) first_core: AtomicU32,
}

/// Cluster 0: of all cores, if the cores are not divided.
pub(super) static FIRST: ClusterState = ClusterState::new();

/// All other possible clusters, created when cores are divided for the first time.
pub(super) static OTHERS: SetOnce<alloc::boxed::Box<[ClusterState]>> = SetOnce::new();

/// The number of clusters besides cluster 0.
pub(super) static BESIDES: AtomicUsize = AtomicUsize::new(0);

/// The seat of a cluster's first core.
pub(super) const FIRST_SEAT: CoreId = CoreId(0);

impl ClusterState {
    /// Returns the number among all cores of the core in a seat.
    pub(super) fn core(&self, seat: CoreId) -> u32 {
        self.first_core.load(Ordering::Relaxed) + seat.0
    }

    /// Reports whether letters may be waiting.
    #[inline]
    pub(super) fn may_have_letters(&self) -> bool {
        // Only a sign: before a letter is read, `take_letters` swaps the flag with acquire
        // ordering.
        self.has_letters.load(Ordering::Relaxed)
    }

    /// Returns when the timer shall next step the scheduler, in nanoseconds; `u64::MAX` if never.
    pub(super) fn next_event_ns(&self) -> u64 {
        self.next_event_ns.load(Ordering::Acquire)
    }

    /// Publishes the time of the next step, and whether the cluster has nothing left to do.
    pub(super) fn publish(&self, at_ns: u64, is_finished: bool) {
        self.next_event_ns.store(at_ns, Ordering::Release);
        self.is_finished.store(is_finished, Ordering::Release);
    }

    pub(super) const fn new() -> Self {
        Self {
            execution: SpinLock::new(None),
            next_event_ns: AtomicU64::new(u64::MAX),
            is_finished: AtomicBool::new(false),
            jobs_ended: AtomicU64::new(0),
            has_letters: AtomicBool::new(false),
            first_core: AtomicU32::new(0),
        }
    }
}

/// Returns all clusters of the run.
pub(super) fn all() -> impl Iterator<Item = &'static ClusterState> {
    (0..count()).map(nth)
}

/// Returns the number of clusters.
pub fn count() -> usize {
    BESIDES.load(Ordering::Relaxed) + 1
}

/// Reports whether there are several clusters.
pub(super) fn are_divided() -> bool {
    count() > 1
}

/// Returns a cluster by number; cluster 0 if the number names none.
#[inline]
pub(super) fn nth(number: usize) -> &'static ClusterState {
    match number {
        0 => &FIRST,
        // Out of line: undivided cores, the usual case, pay a comparison only.
        _ => another(number),
    }
}

#[inline(never)]
fn another(number: usize) -> &'static ClusterState {
    let others = OTHERS.get().map_or(&[][..], |others| others);
    others.get(number - 1).unwrap_or(&FIRST)
}

/// Returns a core's cluster.
#[inline]
pub(super) fn cluster_of(core: &Core) -> &'static ClusterState {
    nth(core.group.load(Ordering::Relaxed) as usize)
}

/// Returns the number of a cluster's first core; the cluster's journal counts cores from there.
pub fn first_core(number: usize) -> u32 {
    nth(number).core(FIRST_SEAT)
}

/// Seats this core in another cluster, whose lock is held, and returns the core's own seat, to be
/// restored afterwards. The new seat is counted from the other cluster's first core.
pub(super) fn visit(cluster: &ClusterState) -> u32 {
    let core = this_core::get();
    // Wraps below 0 for a core before that cluster's first: the journal keeps 16 bits of the seat,
    // and adding the first core's number to those gives this core's number again.
    let seat = (core.index.wrapping_sub(cluster.core(FIRST_SEAT))) & u32::from(u16::MAX);
    core.place.swap(seat, Ordering::Relaxed)
}

/// A set of cores, as bits.
#[derive(Debug, Default)]
pub(super) struct CoreSet([u64; 4]);

impl CoreSet {
    pub(super) fn insert(&mut self, core: u32) {
        self.0[(core / 64) as usize] |= 1 << (core % 64);
    }

    /// Makes each core of the set look for work.
    #[inline]
    pub(super) fn wake(&self) {
        // Mostly the set is empty, and four words tell so without a look at each core.
        if self.0.iter().fold(0, |all, word| all | word) != 0 {
            self.wake_some();
        }
    }

    #[inline(never)]
    fn wake_some(&self) {
        for (word, first) in self.0.iter().zip((0..).step_by(64)) {
            let mut left = *word;
            while left != 0 {
                this_core::all()[first + left.trailing_zeros() as usize].wake_up();
                left &= left - 1;
            }
        }
    }
}

/// The mailboxes of a run, shared by all clusters. `None` if the cores are not divided.
pub(super) type Letters = Option<Arc<lifecycle::Mailboxes>>;

/// Sends a request to all other concerned clusters, adds the cores that have to take the letters,
/// and reports whether the request does not concern the sending cluster.
pub(super) fn send_to_others(
    letters: &Letters,
    from: ClusterId,
    request: Request,
    woken: &mut CoreSet,
) -> bool {
    letters.as_ref().is_some_and(|letters| {
        letters.send(Some(from), request, |cluster| {
            let there = nth(cluster.index());
            // The core that takes the letters also sees everything written before this store.
            there.has_letters.store(true, Ordering::Release);
            woken.insert(there.core(FIRST_SEAT));
        })
    })
}
