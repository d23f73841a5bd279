//! Subtasks that wait: bounds of DAGs that suspend themselves.
//!
//! A subtask with waits is segments with a wait between any two: each wait has a limit, after
//! which it ends whatever a device does, and no core is held meanwhile. Such subtasks are
//! *self-suspending*, and most tests of the literature are wrong for them. These forms are
//! proven in `docs/bounds.md`, "Subtasks that wait"; here in short.
//!
//! Follow a job back from the segment that ends last: to the release, the end of the latest
//! predecessor or the end of its own wait, whichever made it eligible. That gives a path `P`. At
//! each instant of the response `P` executes, for `c(P)` in all, or it waits, for `s(P)` at most,
//! or a segment of it is eligible and does not execute. For `X`, the time of the third kind, all
//! `m` cores execute something else. So waits enter the bound through `P` only:
//!
//! - *One path*: `m X <= volume - c(P)`.
//! - *Reserved chains*: let `U` be `j` disjoint chains. In `X` at most `j` cores execute `U`, so
//!   `(m - j) X <= volume - c(P or U)`. Each `U` takes one longest path to bound over all `P`.
//! - *Oblivious*: where waits are executed instead, `multi_path` holds as it stands, with covers
//!   of WCETs and limits together; the proof exchanges chains by their weights only.
//!
//! Interference and blocking are added to what the cores execute in `X`. The workloads of `workload`
//! and `interference` hold for DAGs that wait, with their own bounds as `R`: a wait only takes
//! work away from instants. What is left beside the span, `x = r - span`, is the common
//! currency: the first two forms are `m - j` times the span above it, or more, for each `j`.
//!
//! *Blocking.* Where segments keep their cores, a segment that becomes eligible may find as many
//! lower-ranked ones running as there are cores, and one less where its predecessor has just
//! left a core. After a wait nobody has. So the path pays `Delta(m)` at the release and after
//! each wait, and `Delta(m - 1)` after each predecessor, `Delta(q)` being the `q` longest segments.
//!
//! Assumes: `R <= T` of each DAG that enters, so that jobs of one DAG do not overlap; no core
//! idles while a segment is eligible. All of it is sustainable: no bound falls where executions
//! or waits get longer, so shorter ones are covered.
//!
//! Preemptions may be at any instant of real time, so divisions round up. Where all times are
//! whole units, the first two forms may round down; reference values do ([`Rounding`]).

use alloc::vec::Vec;

use super::blocking::Blocking;
use super::cover::{CoverChain, STEPS};
use super::task::{SubtaskWaits, Task};

/// At which instants a schedule may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rounding {
    /// At any: bounds round up.
    Up,
    /// At whole units: the forms of paths round down.
    Down,
}

impl Rounding {
    /// Prepares what so many cores are to execute, to be divided by their number and rounded up.
    pub(super) const fn of(self, sum: u128, cores: u128) -> u128 {
        match self {
            Self::Down => sum.saturating_sub(cores - 1),
            Self::Up => sum,
        }
    }

    /// Divides what so many cores are to execute.
    pub(super) const fn divide(self, left: u64, cores: u64) -> u64 {
        match self {
            Self::Down => left / cores,
            Self::Up => left.div_ceil(cores),
        }
    }
}

/// Returns what is left of a job for `m`, `m - 1`, .. cores while its path is ready and does not
/// execute, by the best form for each; the covers are those of the oblivious task.
pub(super) fn beside_span(task: &Task, covers: &[u64], cores: u32) -> Vec<u64> {
    let volume_ns = task.oblivious().volume_ns();
    let mut left: Vec<u64> = covers.iter().map(|cover| volume_ns - cover).collect();
    // Without waits the others are no better.
    if task.has_waits() {
        lower(&mut left, &reserved(task, cores));
    }
    left
}

/// Lowers what is left to what reserved chains give.
pub(super) fn lower(left: &mut Vec<u64>, reserved: &[ReservedChains]) {
    for (j, with) in reserved.iter().enumerate() {
        // A form whose numbers are too large is of no use, nor are those of more chains after it.
        match (u64::try_from(with.left), left.get_mut(j)) {
            (Ok(own), Some(least)) => *least = own.min(*least),
            (Ok(own), None) => left.push(own),
            (Err(_), Some(_)) => {}
            (Err(_), None) => return,
        }
    }
}

/// The form of some reserved chains: those of the entries before, and one more.
pub(super) struct ReservedChains {
    /// The last of the chains; none of them is empty but the first.
    pub(super) chain: CoverChain,
    /// The cores that they leave free.
    pub(super) free: u128,
    /// The most of `volume - c(P or U)`, and the excess of `P` over the span on each free core,
    /// over all paths `P`.
    pub(super) left: u128,
}

/// Returns the forms of 0, 1, .. reserved chains: the heaviest, one after the other, of what the
/// path of the form without chains leaves.
pub(super) fn reserved(task: &Task, cores: u32) -> Vec<ReservedChains> {
    let steps = (task.subtask_count() + task.edge_count()).max(1);
    let span = u128::from(task.span_ns());
    // The WCETs of what is in no chain, and of what may be in the next one.
    let mut outside = Vec::from(task.wcets_ns());
    let mut unused = outside.clone();
    let mut chain = CoverChain::new();
    let mut found = Vec::new();
    for free in (1..=u128::from(cores)).rev().take((STEPS / steps).max(2)) {
        for &(subtask, _) in chain.iter().filter(|(_, takes)| *takes) {
            outside[subtask] = 0;
        }
        let whole_ns = task.oblivious().wcets_ns().iter().map(|&ns| u128::from(ns));
        let weights = whole_ns.zip(&outside);
        let weights = weights.map(|(whole, &own)| free * whole - u128::from(own));
        let weights: Vec<u128> = weights.collect();
        let path = task.longest_complete_path(&weights);
        let left: u128 = outside.iter().map(|&own| u128::from(own)).sum();
        let heaviest: u128 = path.iter().map(|&subtask| weights[subtask]).sum();
        let left = left + heaviest - free * span;
        if found.is_empty() {
            path.iter().for_each(|&subtask| unused[subtask] = 0);
        }
        found.push(ReservedChains { chain, free, left });
        // A chain takes what no other has, and passes the rest.
        let next = task.longest_complete_path(&unused).into_iter();
        chain = next
            .map(|subtask| (subtask, core::mem::take(&mut unused[subtask]) > 0))
            .collect();
        if chain.iter().all(|(_, takes)| !takes) {
            break;
        }
    }
    found
}

/// Returns what is left of a job on all cores beside its span, if its path is blocked where its
/// segments become eligible.
pub(super) fn with_blocking(task: &Task, cores: u32, blocking: &Blocking) -> u128 {
    let count = cores as usize;
    let (all, but_one) = (blocking.sum(count), blocking.sum(count - 1));
    let cores = u128::from(cores);
    let no_wait = SubtaskWaits {
        count: 0,
        limits_ns: 0,
        longest_segment_ns: 0,
    };
    let waits = task.waits().iter().chain(core::iter::repeat(&no_wait));
    // All DAGs' WCETs together are far below 96 bits, and counts of subtasks and waits have 32.
    let weights = task.wcets_ns().iter().zip(waits).map(|(&wcet_ns, waits)| {
        let own = (cores - 1) * u128::from(wcet_ns) + cores * u128::from(waits.limits_ns);
        own + but_one + u128::from(waits.count) * all
    });
    let weights: Vec<u128> = weights.collect();
    let path = task.longest_complete_path(&weights).into_iter();
    let heaviest: u128 = path.map(|subtask| weights[subtask]).sum();
    let sum = u128::from(task.volume_ns()) + all - but_one + heaviest;
    sum - cores * u128::from(task.span_ns())
}
