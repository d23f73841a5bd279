//! Every bound against virtual time, in sets of every kind.
//!
//! A kind is a policy, which subtasks keep their cores, whether these are divided, whether
//! sinks have deadlines of their own, and whether orders are fixed: 48 together. Of each,
//! random sets are drawn until 110 are proven whole. Whatever job or sink of a set has a
//! bound must keep it, with full and with shortened execution times, to which the platform's
//! overheads add. The analysis takes a sporadic DAG for a periodic one: bounds hold for any
//! signals.
//!
//! A failure prints seeds; run one alone with `ANALYSIS_SEED=n ANALYSIS_SETS=1`, and any
//! number of sets with `ANALYSIS_SETS`.

use std::collections::BTreeMap;

use common::random::Random;
use sched_dag::analysis::{AnalysisResult, AnalysisSettings, answer, fix_orders};
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Instance, TaskSet};

use super::random::{Kind, sample_of};
use super::simulate::observe;
use crate::support::{Script, number};

/// How many sets of each kind are to be proven whole, where no number of sets is wanted.
const WHOLE: u64 = 110;

#[test]
#[allow(
    clippy::too_many_lines,
    reason = "one walk over the seeds, with all that is counted on it"
)]
fn accepted_sets_keep_their_bounds() {
    let first = number("ANALYSIS_SEED", 1);
    let wanted = number("ANALYSIS_SETS", 0);
    let most = if wanted == 0 { 60_000 } else { wanted };
    let mut whole = [0; Kind::COUNT];
    let mut by_test: BTreeMap<String, u64> = BTreeMap::new();
    let (mut tighter_sinks, mut fixed) = (0_u64, 0_u64);
    let mut breaches = Vec::new();
    for seed in first..first + most {
        let number = usize::try_from(seed % Kind::COUNT as u64).expect("below the count");
        if wanted == 0 && whole[number] == WHOLE {
            continue;
        }
        let mut random = Random::new(seed);
        let sample = sample_of(Kind::number(number), &mut random);
        let Some(mut task_set) = sample.task_set() else {
            continue;
        };
        let mut settings = sample.settings();
        settings.overheads.dispatch_ns = random.within(0..=5_u64).saturating_sub(3);
        let free = answer(&task_set, &settings);
        fix_orders(&mut task_set, &settings);
        let answer = answer(&task_set, &settings);
        let order = is_no_longer(&answer, &free);
        assert!(order.is_some(), "seed {seed}: {free:?} {answer:?}");
        fixed += u64::from(order == Some(true));
        assert_eq!(
            answer.is_proven(),
            answer.bounds.iter().all(Option::is_some),
            "seed {seed}"
        );
        if answer.bounds.iter().all(Option::is_none) {
            continue;
        }
        whole[number] += u64::from(answer.is_proven());
        for bound in answer.bounds.iter().flatten() {
            *by_test.entry(bound.test.to_string()).or_default() += 1;
        }
        tighter_sinks += tighter(&answer);
        let breach = breach(&task_set, &settings, &answer, &mut random);
        breaches.extend(breach.map(|breach| format!("seed {seed}: {breach}, {sample:#?}")));
    }
    println!(
        "seeds {first}..{}: sets proven whole by kind: {whole:?}; bounds: {by_test:?}; \
         {tighter_sinks} times a sink with a smaller one than its job, {fixed} sets that a fixed \
         order shortens",
        first + most
    );
    assert!(
        breaches.is_empty(),
        "{} breaches, the first: {}",
        breaches.len(),
        breaches[0]
    );
    if wanted == 0 {
        let lacking = |&number: &usize| whole[number] < WHOLE;
        let lacking = (0..Kind::COUNT).filter(lacking).map(Kind::number);
        assert_eq!(lacking.collect::<Vec<_>>(), [], "too few are proven");
        assert!(by_test.len() >= 7, "some test was never used: {by_test:?}");
        assert!(tighter_sinks > 1000, "too few sinks: {tighter_sinks}");
        assert!(fixed > 100, "too few orders: {fixed}");
    }
}

/// Returns the first job or sink that does not keep its bound, in a run with full execution
/// times and one with shortened ones.
pub(crate) fn breach(
    task_set: &TaskSet,
    settings: &AnalysisSettings,
    answer: &AnalysisResult,
    random: &mut Random,
) -> Option<String> {
    let longest = task_set.dags().iter().map(|dag| dag.period_ns()).max();
    let until = 12 * longest.expect("there is a DAG");
    let platform = (settings.policy, settings.preemption, settings.cores);
    let mut signals = Vec::new();
    for (dag, model) in (0..).map(DagId).zip(task_set.dags()) {
        if model.is_sporadic() {
            let times_ns = [(); 20].map(|()| random.within(0..=until));
            signals.extend(times_ns.map(|at_ns| (at_ns, Request::Signal(dag))));
        }
    }
    signals.sort_by_key(|&(at_ns, _)| at_ns);
    for shorten in [false, true] {
        let script = Script::new(|instance: Instance| {
            let subtask = task_set.dag(instance.dag).subtask(instance.subtask);
            // One that is not known is long.
            let full = subtask.wcet_ns().unwrap_or(50) + settings.overheads.dispatch_ns;
            random.within(if shorten { 0 } else { full }..=full)
        });
        let script = script.asking(signals.iter().copied());
        let observed = observe(task_set, platform, until, script);
        for (dag, model) in task_set.dags().iter().enumerate() {
            let Some(whole) = answer.bounds[dag] else {
                continue;
            };
            let whole_ns = whole.bound_ns;
            let job = (observed.dags[dag], whole_ns, model.relative_deadline_ns());
            let sinks = model.sinks().iter().zip(&answer.sinks_ns[dag]);
            let sinks = sinks.map(|(&sink, &bound_ns)| {
                let seen_ns = observed.subtasks[dag][sink.index()];
                let deadline_ns = model.subtask(sink).relative_deadline_ns();
                (seen_ns, bound_ns.expect("as its job has one"), deadline_ns)
            });
            for (seen_ns, bound_ns, deadline_ns) in [job].into_iter().chain(sinks) {
                if seen_ns > bound_ns || bound_ns > deadline_ns.min(whole_ns) {
                    return Some(format!(
                        "dag {dag}: observed {seen_ns}, bound {bound_ns}, deadline \
                         {deadline_ns}, {whole:?}, {settings:?}"
                    ));
                }
            }
        }
    }
    None
}

/// Counts the sinks with a smaller bound than their job.
pub(crate) fn tighter(answer: &AnalysisResult) -> u64 {
    let pairs = answer.bounds.iter().zip(&answer.sinks_ns);
    let counts = pairs.map(|(whole, sinks_ns)| {
        let whole_ns = whole.map(|whole| whole.bound_ns);
        sinks_ns.iter().filter(|&&ns| ns < whole_ns).count() as u64
    });
    counts.sum()
}

/// Reports whether bounds are shorter than others; `None`: one is longer.
fn is_no_longer(fixed: &AnalysisResult, free: &AnalysisResult) -> Option<bool> {
    // None is longer than all.
    let [fixed, free] = [fixed, free].map(|answer| {
        let bounds = answer
            .bounds
            .iter()
            .map(|bound| bound.map(|bound| bound.bound_ns));
        bounds
            .map(|bound| bound.unwrap_or(u64::MAX))
            .collect::<Vec<_>>()
    });
    let is_longer = fixed.iter().zip(&free).any(|(fixed, free)| fixed > free);
    (!is_longer).then_some(fixed != free)
}
