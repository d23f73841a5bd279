//! Subtasks that wait: bounds for self-suspending DAGs.
//!
//! A subtask with waits consists of segments with a wait between any two. Each wait has a limit: at
//! the limit the wait ends, whatever a device does. No core is held during a wait. Such subtasks
//! are *self-suspending*, and most tests of the literature are wrong for them. `docs/bounds.md`,
//! "Subtasks that wait", proves the forms here; this is a summary.
//!
//! Follow a job back from the last segment to end. Each segment became eligible by the release, by
//! the end of its latest predecessor, or by the end of its own wait. Followed to the release, these
//! causes form a path `P`. At each instant of the response, `P` executes (`c(P)` in all), or waits
//! (`s(P)` at most), or has an eligible segment that does not execute. Let `X` be the time of the
//! third kind. During `X` all `m` cores execute something else. So waits enter the bound through
//! `P` only:
//!
//! - *One path*: `m X <= volume - c(P)`.
//! - *Reserved chains*: let `U` be `j` disjoint chains. During `X` at most `j` cores execute `U`,
//!   so `(m - j) X <= volume - c(P or U)`. Each `U` needs one longest path for a bound over all
//!   `P`.
//! - *Oblivious*: with waits executed instead, `multi_path` applies unchanged, with covers of WCETs
//!   and limits together; its proof exchanges chains by their weights only.
//!
//! Interference and blocking add to the work of the cores during `X`. The workloads of `workload`
//! and `interference` are valid for DAGs with waits, with the DAGs' own bounds as `R`: a wait only
//! takes work away from instants. All forms use one currency, the work left beside the span: `(m -
//! j) x` must reach it, with `x = r - span`. For the first two forms this work contains `m - j`
//! times the excess of `P` over the span.
//!
//! *Blocking.* Where segments keep their cores, an eligible segment may find as many lower-ranked
//! segments running as there are cores, and one less if its predecessor has just left a core. After
//! a wait no predecessor has just left a core. So the path pays `Delta(m)` at the release and after
//! each wait, and `Delta(m - 1)` after each predecessor. `Delta(q)` is the sum of the `q` longest
//! segments.
//!
//! Assumes: `R <= T` for each DAG in the equations, so jobs of one DAG do not overlap; and no core
//! idles while a segment is eligible. All forms are sustainable: no bound falls when executions or
//! waits get longer, so shorter executions and waits are covered.
//!
//! Preemptions may happen at any instant of real time, so divisions round up. If all times are
//! whole units, the first two forms may round down, as reference values do ([`Rounding`]).

use alloc::vec::Vec;

use super::blocking::Blocking;
use super::cover::{CoverChain, STEPS};
use super::task::{SubtaskWaits, Task};

/// The instants at which a schedule may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rounding {
    /// At any instant: bounds round up.
    Up,
    /// At whole units only: the forms of paths round down.
    Down,
}

impl Rounding {
    /// Prepares work of `cores` cores for a division by their number, rounded up.
    pub(super) const fn of(self, sum: u128, cores: u128) -> u128 {
        match self {
            Self::Down => sum.saturating_sub(cores - 1),
            Self::Up => sum,
        }
    }

    /// Divides the work of `cores` cores by their number.
    pub(super) const fn divide(self, left: u64, cores: u64) -> u64 {
        match self {
            Self::Down => left / cores,
            Self::Up => left.div_ceil(cores),
        }
    }
}

/// Returns the work left of a job for `m`, `m - 1`, .. cores while its path is ready without
/// executing, by the best form for each number. The covers belong to the oblivious task.
pub(super) fn beside_span(task: &Task, covers: &[u64], cores: u32) -> Vec<u64> {
    let volume_ns = task.oblivious().volume_ns();
    let mut left: Vec<u64> = covers.iter().map(|cover| volume_ns - cover).collect();
    // Without waits the other forms are no better.
    if task.has_waits() {
        lower(&mut left, &reserved(task, cores));
    }
    left
}

/// Lowers the work left to the results of the reserved chains.
pub(super) fn lower(left: &mut Vec<u64>, reserved: &[ReservedChains]) {
    for (j, with) in reserved.iter().enumerate() {
        // A form with numbers too large is useless, and so are the later forms, with more chains.
        match (u64::try_from(with.left), left.get_mut(j)) {
            (Ok(own), Some(least)) => *least = own.min(*least),
            (Ok(own), None) => left.push(own),
            (Err(_), Some(_)) => {}
            (Err(_), None) => return,
        }
    }
}

/// The form of some reserved chains: the chains of the entries before, and one more.
pub(super) struct ReservedChains {
    /// The last of the chains. Only the first entry's chain is empty.
    pub(super) chain: CoverChain,
    /// The cores left free by the chains.
    pub(super) free: u128,
    /// The most of `volume - c(P or U)`, plus the excess of `P` over the span on each free core,
    /// over all paths `P`.
    pub(super) left: u128,
}

/// Returns the forms of 0, 1, .. reserved chains. The chains are the heaviest, one after the other,
/// in the rest left by the path of the form without chains.
pub(super) fn reserved(task: &Task, cores: u32) -> Vec<ReservedChains> {
    let steps = (task.subtask_count() + task.edge_count()).max(1);
    let span = u128::from(task.span_ns());
    // The WCETs outside all chains, and the WCETs available to the next chain.
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
        // A chain takes the subtasks no other chain has, and passes the rest.
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

/// Returns the work left of a job on all cores beside its span, if its path is blocked wherever its
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
