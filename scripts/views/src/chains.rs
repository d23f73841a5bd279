//! The latencies of effects in a run, from DAG to DAG, next to their bounds.

use sched_dag::DagId;
use sched_dag::chains::{Chain, SubtaskRef};
use sched_dag::law::Distribution;

use crate::links;
use crate::record::Run;
use crate::view::View;

/// The times of a chain in a run, and their bounds.
#[derive(Debug)]
pub struct MeasuredChain {
    /// The subtasks of the chain, each with the name of its DAG.
    pub names: Vec<String>,
    /// The age of an output, the data age and the reaction time.
    pub times: [(Distribution, Result<u64, DagId>); 3],
    /// The longest of each for which a bound holds, by clocks that may be wrong.
    pub longest_ns: [u64; 3],
    /// The stated delay of the links on the chain, if any.
    pub stated_ns: Option<u64>,
}

impl MeasuredChain {
    /// Returns the number of times beyond their bounds by more than the tolerance.
    pub fn exceeded(&self, tolerance_ns: u64) -> usize {
        let is_beyond = |(longest_ns, (_, bound)): &(&u64, &(_, Result<u64, DagId>))| {
            bound.is_ok_and(|ns| **longest_ns > ns.saturating_add(tolerance_ns))
        };
        let times = self.longest_ns.iter().zip(&self.times);
        times.filter(is_beyond).count()
    }
}

/// Returns the chains of a run by its samplings and links: all, or only those between two subtasks.
pub fn of(run: &Run, ends: Option<(SubtaskRef, SubtaskRef)>) -> Vec<Chain> {
    let links = run.links.iter().map(|link| link.edge);
    let samplings: Vec<_> = run.samplings.iter().copied().chain(links).collect();
    match ends {
        None => Chain::all(&run.task_set, &samplings),
        Some((from, to)) => Chain::between(&run.task_set, &samplings, from, to),
    }
}

/// Measures chains of a run.
pub fn measured(view: &View<'_>, chains: &[Chain]) -> Vec<MeasuredChain> {
    let run = view.run;
    let events: Vec<_> = view.in_the_order_of_the_log().collect();
    let sampled = [true, false].map(|with_late| links::sampled(run, with_late, &events));
    let measured = |chain: &Chain| {
        let times = |by| chain.latencies_by(by, &run.task_set, events.iter().copied());
        let [times, judged] = sampled.each_ref().map(times);
        let bounds = &run.bounds_ns;
        let (links, wrong_ns) = links::of_chain(run, chain);
        let output_age = chain.output_age_bound_over_links_ns(&run.task_set, bounds, &links);
        let reaction = match links.first() {
            None => chain.reaction_bound_ns(&run.task_set, bounds),
            // Messages may be lost.
            Some((link, _)) => Err(link.reader.0),
        };
        let names = chain.names(&run.task_set).map(|name| name.to_string());
        let judged = [judged.output_age_ns, judged.data_age_ns, judged.reaction_ns];
        let longest_ns = judged.map(|times_ns| times_ns.into_iter().max().unwrap_or(0));
        // Reaction time and data age have the same bound.
        MeasuredChain {
            names: names.collect(),
            times: [
                (Distribution::new(times.output_age_ns), output_age),
                (Distribution::new(times.data_age_ns), reaction),
                (Distribution::new(times.reaction_ns), reaction),
            ],
            longest_ns: longest_ns.map(|ns| ns.saturating_sub(wrong_ns)),
            stated_ns: links.iter().map(|link| link.1).reduce(u64::saturating_add),
        }
    };
    chains.iter().map(measured).collect()
}
