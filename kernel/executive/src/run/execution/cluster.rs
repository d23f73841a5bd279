//! The clusters that the cores are divided into: what each has for itself.
//!
//! Each event on a core takes its cluster's lock, steps its cluster's scheduler and
//! writes into its cluster's journal; so the hot path of one cluster touches no word of
//! another's. The first core of a cluster keeps its time.
//!
//! Where the cores are not divided there is one cluster. How they are divided is in
//! [`divided`](super::divided).
//!
//! Requests of one cluster to others (signals, pauses, modes, the end) are
//! [letters](sched_dag::lifecycle::Mailboxes): the other cluster's first core is woken, which takes
//! them in a step of its own. That takes no lock, so nobody waits.

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
    /// When the first core's timer shall next step the scheduler, on the clock;
    /// `u64::MAX` if never.
    next_event_ns: AtomicU64,
    /// Whether nothing is left to be done.
    pub(super) is_finished: AtomicBool,
    /// Jobs of DAGs with a limit that have ended in this run.
    pub(super) jobs_ended: AtomicU64,
    /// Whether there may be a letter.
    pub(super) has_letters: AtomicBool,
    pub(super) first_core: AtomicU32,
}

/// Cluster 0: of all cores, if they are not divided.
pub(super) static FIRST: ClusterState = ClusterState::new();

/// The other ones that there can be, made when cores are divided for the first time.
pub(super) static OTHERS: SetOnce<alloc::boxed::Box<[ClusterState]>> = SetOnce::new();

/// How many there are besides cluster 0.
pub(super) static BESIDES: AtomicUsize = AtomicUsize::new(0);

/// The seat of a cluster's first core.
pub(super) const FIRST_SEAT: CoreId = CoreId(0);

impl ClusterState {
    /// Returns the number of the core in a seat among all cores.
    pub(super) fn core(&self, seat: CoreId) -> u32 {
        self.first_core.load(Ordering::Relaxed) + seat.0
    }

    /// Reports whether there may be a letter.
    #[inline]
    pub(super) fn may_have_letters(&self) -> bool {
        self.has_letters.load(Ordering::Relaxed)
    }

    /// Returns when the timer shall next step the scheduler; `u64::MAX` if never.
    pub(super) fn next_event_ns(&self) -> u64 {
        self.next_event_ns.load(Ordering::Acquire)
    }

    /// Notes that, and whether nothing is left to be done.
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

/// Returns how many there are.
pub fn count() -> usize {
    BESIDES.load(Ordering::Relaxed) + 1
}

/// Reports whether there are several.
pub(super) fn are_divided() -> bool {
    count() > 1
}

/// Returns a cluster; cluster 0 if there is no such one.
#[inline]
pub(super) fn nth(number: usize) -> &'static ClusterState {
    match number {
        0 => &FIRST,
        _ => another(number),
    }
}

#[inline(never)]
fn another(number: usize) -> &'static ClusterState {
    let others = OTHERS.get().map_or(&[][..], |others| others);
    others.get(number - 1).unwrap_or(&FIRST)
}

/// Returns the cluster that a core is in.
#[inline]
pub(super) fn cluster_of(core: &Core) -> &'static ClusterState {
    nth(core.group.load(Ordering::Relaxed) as usize)
}

/// Returns the number of a cluster's first core; those in its journal count from that.
pub fn first_core(number: usize) -> u32 {
    nth(number).core(FIRST_SEAT)
}

/// Has this core belong to another cluster, whose lock is held, and returns its own seat, which it
/// is to take again. Its seat, if it has one there, is then counted from that cluster's first core.
pub(super) fn visit(cluster: &ClusterState) -> u32 {
    let core = this_core::get();
    // As journals have it, and back in the number that it is added to.
    let seat = (core.index.wrapping_sub(cluster.core(FIRST_SEAT))) & u32::from(u16::MAX);
    core.place.swap(seat, Ordering::Relaxed)
}

/// Some of the cores, as bits.
#[derive(Debug, Default)]
pub(super) struct CoreSet([u64; 4]);

impl CoreSet {
    pub(super) fn insert(&mut self, core: u32) {
        self.0[(core / 64) as usize] |= 1 << (core % 64);
    }

    /// Makes each of the cores look for work.
    #[inline]
    pub(super) fn wake(&self) {
        // Mostly nobody is to be told.
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

/// The mailboxes of a run; all clusters have the same ones. None where cores are not divided.
pub(super) type Letters = Option<Arc<lifecycle::Mailboxes>>;

/// Sends a request to the other clusters that it concerns, adds the cores that have to take it, and
/// reports whether it does not concern the cluster itself.
pub(super) fn send_to_others(
    letters: &Letters,
    from: ClusterId,
    request: Request,
    woken: &mut CoreSet,
) -> bool {
    letters.as_ref().is_some_and(|letters| {
        letters.send(Some(from), request, |cluster| {
            let there = nth(cluster.index());
            // What was left before is seen by the core that takes the letters.
            there.has_letters.store(true, Ordering::Release);
            woken.insert(there.core(FIRST_SEAT));
        })
    })
}
