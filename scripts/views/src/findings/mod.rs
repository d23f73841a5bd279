//! The findings in a run: its breaches of the model's rules, and its figures.
//!
//! The judge is [`sched_dag::law`], as for all runs, within a stated *bound*, because a decision
//! takes effect only after an interrupt.
//!
//! Lost events count as the oldest, so the judge looks only at events after the instant of the
//! first event left. An instance unfinished at the end of the trace breaks no rule, unless the run
//! says that it is complete.
//!
//! The figures of a trace:
//!
//! - *finish to ready*: from the last finish that an instance waited for to its readiness; the
//!   largest.
//! - *ready to start*: from readiness to the function's call, of instances that became ready while
//!   a core was idle, unless another instance with a smaller key became ready meanwhile and took
//!   the core.
//! - *preemption latency*: from the scheduler's request that a core run an instance to the start or
//!   resumption of the instance there. An overtaken request does not count: another request for the
//!   core came, or the instance runs elsewhere.
//! - *longest inversion*: the longest time for which an instance entitled to a core by R5 waited
//!   while an instance of lower priority ran or a core was idle.
//! - *load*: the part of the time from the first event to the last for which a core had an
//!   instance, in thousandths.
//!
//! A trace is *complete from* the first instant after the first event left; earlier events are not
//! judged.

use std::collections::BTreeMap;

use sched_dag::CoreId;
use sched_dag::journal::EventKind;
use sched_dag::law::sweep::WaitCounts;
use sched_dag::law::{self, Distribution, Violation};

use crate::record::Run;
use crate::units::shown;
use crate::view::View;

/// The findings in a run's trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Findings {
    /// The breaches by time.
    pub breaches: Vec<Violation>,
    /// The figures.
    pub figures: RunFigures,
}

/// Judges a run. `bound_ns` is the longest time for which an instance may wait for a core owed to
/// the instance; 0 is for virtual time.
pub fn check(run: &Run, bound_ns: u64) -> Findings {
    let (view, terms) = (View::new(run), run.terms(bound_ns));
    let verdict = law::judge(&run.task_set, terms, view.in_the_order_of_the_log());
    let by_time = view.events.iter().copied();
    let dispatch = law::judge_dispatch(&run.task_set, &run.options, terms, by_time);
    let mut breaches = verdict.violations;
    breaches.extend(dispatch.violations);
    // Two judges have reported; people read one list by time.
    breaches.sort_by_key(|breach| (breach.time_ns(), breach.rule()));
    Findings {
        breaches,
        figures: compute(&view, verdict.finish_to_ready_max_ns, dispatch.waits),
    }
}

/// The figures of one run. Times are in nanoseconds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunFigures {
    /// The number of judged events.
    pub events: usize,
    /// The number of instances that started.
    pub instances: usize,
    /// The number of suspensions.
    pub preemptions: u64,
    /// The first instant from which the trace is complete; 0 if no event was lost.
    pub from_ns: u64,
    /// The time from the first judged event to the last.
    pub span_ns: u64,
    /// See the module; 0 if there was no such time.
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
fn compute(view: &View<'_>, finish_to_ready_max_ns: u64, waits: WaitCounts) -> RunFigures {
    let first_ns = view.events.first().map_or(0, |event| event.time_ns);
    let span_ns = view.end_ns.saturating_sub(first_ns);
    let histories = view.histories.values();
    RunFigures {
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
    // For each core, the time of the next request after the one at hand.
    let mut next_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    // Backwards, so the next request for the core is already known.
    let requests = view.events.iter().rev();
    for event in requests.filter(|event| event.what == EventKind::Request) {
        let overtaken_ns = next_ns.insert(event.core, event.time_ns);
        let history = event.instance().and_then(|it| view.histories.get(&it));
        let slices = history.map_or(&[][..], |history| &history.slices);
        let mut later = slices.iter().filter(|it| it.from_ns >= event.time_ns);
        // The instance must come to this core, and before the core is wanted for another.
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
        // An instance running at the end of the trace has its core up to there.
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

/// Returns the figures of a distribution for people.
pub fn distribution(of: &Distribution) -> String {
    if of.count() == 0 {
        return "none".into();
    }
    format!(
        "median {}, p99 {}, max {} of {}",
        shown(of.median()),
        shown(of.p99()),
        shown(of.max()),
        of.count()
    )
}

/// Returns the figures of a distribution as JSON.
pub fn object(of: &Distribution) -> String {
    format!(
        "{{\"count\":{},\"median\":{},\"p99\":{},\"max\":{}}}",
        of.count(),
        of.median(),
        of.p99(),
        of.max()
    )
}

#[cfg(test)]
pub(crate) mod tests;
