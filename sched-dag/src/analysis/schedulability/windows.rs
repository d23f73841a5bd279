//! Waiting subtasks on one core under static priorities: splits a job into windows of segments.
//!
//! A *window* is the time from the instant when a segment becomes eligible to the end of the same
//! or a later segment. Say all subtasks of a job are on one path: then its segments follow one
//! another, with or without a wait in between, and windows of consecutive segments, with the waits
//! between them, make up the response. `docs/bounds.md` has the proof. In short: go back from the
//! window's begin to the last instant at which no DAG above *without waits* is pending. From there
//! on, either the window waits, or the core executes one of the following:
//!
//! - DAGs above without waits, released from there on;
//! - DAGs above with waits (`workload`);
//! - the segments of the window;
//! - a segment of a DAG below that keeps the core, started before or while the window waits.
//!
//! So the time is at most the least
//!
//! `x = segments + waits + blocking + sum of ceil(x / T) volume + sum of W(x)`
//!
//! If the last segment keeps its core, the equation bounds its *start*, and its WCET is added. The
//! blocking is by a DAG below; or a segment of the own DAG has kept more urgent work waiting, but
//! that segment has ended by the window's begin and is subtracted again. The best of all groupings
//! into windows counts. A job with any other graph is one window, with the waits of a path.
//!
//! DAGs above without waits thus need no jitter, unlike in `multiple_paths`, where they count as
//! carried-in work. The bound by `multiple_paths` may still be smaller, if a long segment of the
//! own DAG keeps the core, or many waits meet short DAGs below, and then counts.
//!
//! Assumes: each other DAG is wholly above or wholly below; `R <= T` for the DAG and for DAGs
//! above, where subtasks wait; no job of a DAG above waits for room, so each has a bound. No locks:
//! the wait for a lock is charged to the first segment, but may happen in any. Long steps and a
//! device's interrupts are added to each window, and then no segment gains by keeping its core.

use alloc::vec;
use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds, Responses};
use crate::analysis::SchedulabilityTest;
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::witness_text::WitnessText;
use crate::analysis::workload::InterferingWorkload;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Windows],
    // All DAGs count as interleaved if only some subtasks keep their cores; `of` looks at the
    // priorities.
    covers: covers!(
        RANKED ONE_CORE PREEMPTION ALL_KEEP SOME_KEEP INTERLEAVED WAITS LATE_DEADLINES FEW_IN_FLIGHT
        OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: write,
    ..BoundWitness::NONE
};

/// The maximum number of evaluations of a DAG's equations.
const STEP_LIMIT: u64 = 1 << 14;

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    let known = found.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
    let mut known: Vec<Option<u64>> = known.collect();
    let asked = case.order.iter().filter(|&&dag| TEST.is_for(case, dag));
    for &dag in asked.filter(|_| case.set.has_waits()) {
        let Some((bound_ns, _)) = best(case, dag, &known) else {
            continue;
        };
        if !case.is_alone(dag) {
            found.offer(dag, bound_ns, SchedulabilityTest::Windows);
        }
        known[dag] = known[dag].into_iter().chain([bound_ns]).min();
    }
}

fn write(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    bound_ns: u64,
    text: &mut WitnessText,
) {
    text.line(format_args!("bound {} {bound_ns} windows", case.members[dag]));
    let groups = best(case, dag, responses).into_iter().flat_map(|of| of.1);
    groups.for_each(|(count, [below_ns, own_ns])| {
        text.line(format_args!("group {count} {below_ns} {own_ns}"));
    });
}

/// Consecutive segments: their number, or 0 for the whole job, and their end if a DAG below has
/// kept the core, and if the own DAG has.
type SegmentGroup = (usize, [u64; 2]);

/// A bound, with the windows adding up to the bound.
type GroupedBound = (u64, Vec<SegmentGroup>);

/// Returns the least bound found for a DAG, given the responses of the DAGs above.
fn best(case: &AnalysisInput<'_>, dag: usize, responses: Responses<'_>) -> Option<GroupedBound> {
    let (windows, mut steps) = (JobWindows::of(case, dag, responses)?, STEP_LIMIT);
    let whole = windows.whole(&mut steps);
    let whole = whole.map(|ends| (windows.length(ends), vec![(0, ends)]));
    let grouped = windows.chain().and_then(|chain| windows.grouped(&chain, &mut steps));
    let found = whole.into_iter().chain(grouped);
    let found = found.filter(|(bound_ns, _)| *bound_ns <= windows.limit_ns);
    found.min_by_key(|of| of.0)
}

/// The windows of a job.
struct JobWindows<'a> {
    case: &'a AnalysisInput<'a>,
    dag: usize,
    /// The volumes and periods of the DAGs above without waits.
    released: Vec<[u64; 2]>,
    /// The workloads of the DAGs above with waits.
    waiting: Vec<InterferingWorkload>,
    /// The longest segment that keeps the core, of DAGs below and of the own DAG.
    kept_ns: [u64; 2],
    limit_ns: u64,
}

impl<'a> JobWindows<'a> {
    /// Describes the windows of a DAG, if each other DAG is above or below, and all DAGs above have
    /// bounds.
    fn of(case: &'a AnalysisInput<'a>, dag: usize, responses: Responses<'_>) -> Option<Self> {
        let limit_ns = case.set.figures[dag].limit_ns();
        let mut windows = Self {
            case,
            dag,
            released: Vec::new(),
            waiting: Vec::new(),
            kept_ns: [0; 2],
            limit_ns: limit_ns.min(case.tasks[dag].period_ns()),
        };
        let [most, least] = case.relation.ranks(dag);
        for (other, task) in case.tasks.iter().enumerate() {
            let (volume_ns, period_ns) = (task.volume_ns(), task.period_ns());
            let ranks = case.relation.ranks(other);
            if other == dag || ranks[0] > least {
                let kept_ns = &mut windows.kept_ns[usize::from(other == dag)];
                *kept_ns = longest_kept(case, other).max(*kept_ns);
            } else if ranks[1] > most {
                // The DAG is neither wholly above nor wholly below.
                return None;
            } else if task.has_waits() {
                let bound_ns = responses[other].filter(|&bound_ns| bound_ns <= period_ns)?;
                let workload = InterferingWorkload::new(task, volume_ns, bound_ns, 1, 1);
                windows.waiting.push(workload);
            } else {
                responses[other]?;
                windows.released.push([volume_ns, period_ns]);
            }
        }
        (!case.has_locks()).then_some(windows)
    }

    /// Returns the ends of the window of a whole job.
    fn whole(&self, steps: &mut u64) -> Option<[u64; 2]> {
        let task = self.case.tasks[self.dag];
        let stops = self.case.dag(self.dag).subtasks().iter().map(|subtask| {
            let waits = subtask.waits().iter();
            waits.map(|wait| self.stop(wait.limit_ns)).sum()
        });
        let stops: Vec<u128> = stops.collect();
        let path = task.longest_complete_path(&stops).into_iter();
        let longest = path.map(|subtask| stops[subtask]).sum();
        // The job ends with the last segment of a subtask without successors.
        let last = task.topological_order();
        let last = last.filter(|&subtask| task.successors(subtask).next().is_none());
        let last = last.map(|subtask| self.segments(subtask).map_or(0, |of| of[of.len() - 1][2]));
        let last_ns = last.min().unwrap_or(0);
        self.window([task.volume_ns().into(), longest], last_ns, steps)
    }

    /// Returns a subtask's segments, if they are known: the limit of the wait before (or 0), the
    /// WCET with its charge, and the part of this WCET keeping the core.
    fn segments(&self, subtask: usize) -> Option<Vec<[u64; 3]>> {
        let (case, settings) = (self.case, self.case.settings);
        let charge_ns = settings.overheads.of_an_instance_ns(settings.preemption)?;
        let subtask = &case.dag(self.dag).subtasks()[subtask];
        let keeps_core = case.set.bursts.during(0) == 0 && case.keeps_core(subtask);
        let waits_ns = subtask.waits().iter().map(|wait| wait.limit_ns);
        let rows = core::iter::once(0).chain(waits_ns).zip(subtask.segments_ns()?);
        let rows = rows.map(|(wait_ns, segment_ns)| {
            let wcet_ns = segment_ns + charge_ns;
            [wait_ns, wcet_ns, wcet_ns * u64::from(keeps_core)]
        });
        Some(rows.collect())
    }

    /// Returns the time for a wait, and for a segment of a DAG below starting in the wait.
    fn stop(&self, limit_ns: u64) -> u128 {
        // Nothing starts in a wait of no time.
        let kept_ns = self.kept_ns[0] * u64::from(limit_ns > 0);
        u128::from(limit_ns) + u128::from(kept_ns)
    }

    /// Returns the segments of a DAG whose subtasks are all on one path, if the segments are known.
    fn chain(&self) -> Option<Vec<[u64; 3]>> {
        let task = self.case.tasks[self.dag];
        let is_path = task.most_subtasks_on_a_path() == task.subtask_count() as u64;
        let order = task.topological_order().filter(|_| is_path);
        let segments: Option<Vec<_>> = order.map(|subtask| self.segments(subtask)).collect();
        Some(segments?.concat())
    }

    /// Returns the best grouping of a chain's segments into windows, within the remaining steps.
    fn grouped(&self, chain: &[[u64; 3]], steps: &mut u64) -> Option<GroupedBound> {
        // The best grouping of the first 0, 1, .. segments.
        let mut best = vec![Some((0, Vec::new()))];
        for (last, &[.., last_ns]) in chain.iter().enumerate() {
            let (mut least, mut work, mut stops): (Option<GroupedBound>, u128, u128) = (None, 0, 0);
            for first in (0..=last).rev() {
                let [wait_ns, wcet_ns, _] = chain[first];
                work += u128::from(wcet_ns);
                let window = self.window([work, stops], last_ns, steps);
                // The steps do not suffice for any grouping of the whole chain, so the search ends.
                if *steps == 0 {
                    return None;
                }
                if let (Some((before_ns, groups)), Some(ends)) = (&best[first], window) {
                    let begin_ns = wait_ns.saturating_add(*before_ns);
                    let end_ns = begin_ns.saturating_add(self.length(ends));
                    if least.as_ref().is_none_or(|of| end_ns < of.0) {
                        let group = [(last + 1 - first, ends)];
                        least = Some((end_ns, [&groups[..], &group].concat()));
                    }
                }
                stops += self.stop(wait_ns);
            }
            best.push(least);
        }
        best.pop()?.filter(|_| !chain.is_empty())
    }

    /// Returns the length of a window with the given ends.
    fn length(&self, [below_ns, own_ns]: [u64; 2]) -> u64 {
        below_ns.max(own_ns - self.kept_ns[1])
    }

    /// Returns two ends of a window with given work and stops, and with a last segment that keeps
    /// the core for `last_ns`: if a DAG below has kept the core, and if the own DAG has.
    fn window(
        &self,
        [work, stops]: [u128; 2],
        last_ns: u64,
        steps: &mut u64,
    ) -> Option<[u64; 2]> {
        let mut ends = [0; 2];
        for (end_ns, kept_ns) in ends.iter_mut().zip(self.kept_ns) {
            let base = work - u128::from(last_ns) + stops + u128::from(kept_ns);
            // Work released as the last segment starts goes first; but a blocking segment has
            // started before, so less than its WCET is left of it.
            let is_blocked = kept_ns > 0 || (stops > 0 && self.kept_ns[0] > 0);
            let start_ns = self.fixed_point(base, last_ns > 0 && !is_blocked, steps)?;
            *end_ns = start_ns.checked_add(last_ns)?;
        }
        Some(ends)
    }

    /// Returns the least time equal to a base plus all more urgent work released before that time,
    /// or at that time, too, if `is_closed`.
    fn fixed_point(&self, base: u128, is_closed: bool, steps: &mut u64) -> Option<u64> {
        let (mut time, mut sum) = (u128::MAX, base);
        let latest = u128::from(self.limit_ns) + u128::from(self.kept_ns[1]);
        while time != sum {
            *steps = steps.checked_sub(1)?;
            time = Some(sum).filter(|&sum| sum <= latest)?;
            let end_ns = u64::try_from(time).ok()?.checked_add(is_closed.into())?;
            let released = self.released.iter().map(|&[volume_ns, period_ns]| {
                u128::from(end_ns.div_ceil(period_ns)) * u128::from(volume_ns)
            });
            let waiting = self.waiting.iter().map(|workload| workload.at(end_ns).value);
            sum = base + released.chain(waiting).sum::<u128>();
            sum = sum.saturating_add(self.case.set.bursts.during(time));
        }
        u64::try_from(time).ok()
    }
}

/// Returns the longest segment of a DAG that keeps the core, or 0.
fn longest_kept(case: &AnalysisInput<'_>, dag: usize) -> u64 {
    let (task, subtasks) = (case.tasks[dag], case.dag(dag).subtasks().iter());
    let keeping = (0..).zip(subtasks).filter(|(_, subtask)| case.keeps_core(subtask));
    let longest = keeping.map(|(subtask, _): (usize, _)| {
        let waits = task.waits().get(subtask);
        waits.map_or(task.wcets_ns()[subtask], |waits| waits.longest_segment_ns)
    });
    longest.max().unwrap_or(0)
}
