//! What a trace tells in numbers.
//!
//! - *finish to ready*: from the finish that was the last thing an instance
//!   waited for to its readiness; the largest.
//! - *ready to start*: from readiness to the function's call, of instances for
//!   which a core was idle when they became ready, unless another instance with
//!   a smaller key became ready meanwhile and took it.
//! - *preemption latency*: from the scheduler's request that a core run an
//!   instance to that instance's start or resumption there. A request that is
//!   overtaken, by another one for the core or because the instance runs
//!   elsewhere, does not count.
//! - *longest inversion*: the longest time for which an instance that should
//!   have run by R5 waited while one of lower priority ran or a core was idle.
//! - *load*: the part of the time from the first event to the last for which a
//!   core had an instance, in thousandths.

use std::collections::BTreeMap;

use sched_dag::CoreId;
use sched_dag::journal::What;
use sched_dag::law::Distribution;
use sched_dag::law::sweep::Waits;

use super::view::View;

/// The figures of one run. Times are in nanoseconds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Figures {
    /// Events that were judged.
    pub events: usize,
    /// Instances that started.
    pub instances: usize,
    /// How often an instance was suspended.
    pub preemptions: u64,
    /// The first instant from which the trace is complete; 0 if nothing was
    /// lost.
    pub from_ns: u64,
    /// From the first judged event to the last.
    pub span_ns: u64,
    /// See the module; 0 if there was none.
    pub finish_to_ready_max_ns: u64,
    /// See the module.
    pub ready_to_start: Distribution,
    /// See the module.
    pub preemption: Distribution,
    /// See the module.
    pub longest_inversion_ns: u64,
    /// See the module; by core.
    pub load_permille: Vec<u64>,
}

/// Computes the figures of a run.
pub(super) fn compute(view: &View<'_>, finish_to_ready_max_ns: u64, waits: Waits) -> Figures {
    let first_ns = view.events.first().map_or(0, |event| event.time_ns);
    let span_ns = view.end_ns.saturating_sub(first_ns);
    let histories = view.histories.values();
    Figures {
        events: view.events.len(),
        instances: histories.filter(|it| it.start_ns.is_some()).count(),
        preemptions: view.histories.values().map(|it| it.suspensions).sum(),
        from_ns: view.from_ns,
        span_ns,
        finish_to_ready_max_ns,
        ready_to_start: Distribution::new(waits.ready_to_start_ns),
        preemption: Distribution::new(preemption_latencies_ns(view)),
        longest_inversion_ns: waits.longest_owed_ns,
        load_permille: load_permille(view, first_ns, span_ns),
    }
}

fn preemption_latencies_ns(view: &View<'_>) -> Vec<u64> {
    let mut latencies_ns = Vec::new();
    // The next request for each core, as seen from the one at hand.
    let mut next_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    let requests = view.events.iter().rev();
    for event in requests.filter(|event| event.what == What::Request) {
        let overtaken_ns = next_ns.insert(event.core, event.time_ns);
        let history = event.instance().and_then(|it| view.histories.get(&it));
        let slices = history.map_or(&[][..], |history| &history.slices);
        let mut later = slices.iter().filter(|it| it.from_ns >= event.time_ns);
        if let Some(slice) = later.next()
            && slice.core == event.core
            && overtaken_ns.is_none_or(|overtaken_ns| slice.from_ns <= overtaken_ns)
        {
            latencies_ns.push(slice.from_ns - event.time_ns);
        }
    }
    latencies_ns
}

fn load_permille(view: &View<'_>, first_ns: u64, span_ns: u64) -> Vec<u64> {
    let mut busy_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    for slice in view.histories.values().flat_map(|it| &it.slices) {
        let to_ns = slice.to_ns.unwrap_or(view.end_ns);
        let from_ns = slice.from_ns.max(first_ns);
        let busy_ns = busy_ns.entry(slice.core).or_insert(0);
        *busy_ns = busy_ns.saturating_add(to_ns.saturating_sub(from_ns));
    }
    let permille = |core: u32| {
        let busy_ns = busy_ns.get(&CoreId(core)).copied().unwrap_or(0);
        let permille = u128::from(busy_ns) * 1000 / u128::from(span_ns.max(1));
        u64::try_from(permille).unwrap_or(u64::MAX)
    };
    (0..view.run.options.cores).map(permille).collect()
}
