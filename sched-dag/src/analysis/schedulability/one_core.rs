//! Response times on one core, under static priorities and under EDF.
//!
//! On one core, the subtasks of a job start in an order that nothing else changes: among the
//! subtasks ready by edges, the most urgent first. So a DAG behaves like several sequential tasks
//! released together: one for each deadline among its sinks, or only one under static priorities.
//! `docs/bounds.md` has the proof. In short: let S be a subtask, all work before the subtask in its
//! job, and all work of other jobs that goes before. Look at a longest stretch in which work of S
//! is pending. Only S executes in the stretch, except for one subtask that keeps its core and
//! started before. So a job released `a` after the stretch's begin completes the subtask within the
//! least `X > 0` with
//!
//! `X = blocking + own(a) + C + sum over S of min(ceil(max(0, X - first) / T), most) work`
//!
//! with own(a) the DAG's earlier work and C the job's work up to the subtask. The response time is
//! `R = max over a of X - a`. Candidates for `a` are the multiples of the own period and, under
//! EDF, the instants at which another job joins S. A subtask that keeps its core only has to
//! *start*: its equation leaves out its own WCET, and also counts work released at its start, if
//! nothing blocks. A blocking subtask has started before the stretch, so it ends before its WCET
//! has passed.
//!
//! M. Joseph, P. Pandya, The Computer Journal 29(5), 1986; J. P. Lehoczky, RTSS 1990; L. George,
//! N. Rivierre, M. Spuri, INRIA RR-2966, 1996; R. Davis et al., Real-Time Systems 35, 2007;
//! N. Guan, W. Yi, IEEE Trans. Industrial Informatics 10(2), 2014. Ties, DAGs, sinks and younger
//! jobs were derived here.
//!
//! Where static priorities interleave, S is the DAG and all DAGs that may outrank it, directly or
//! through others; where priorities differ within the DAG, its younger jobs count, too. Then the
//! result is a bound, but perhaps attained by no run. The time taken from the core in the stretch
//! by long steps and by a device's interrupts (bursts, in `workload`) is added; then all subtasks
//! count as if they could be preempted.
//!
//! Assumes: releases at least `T` apart; WCETs above 0; no job waits for room, so under EDF all
//! DAGs must have their bounds. Beyond its limits the test has no bound, and the next test is
//! asked.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::{BoundTest, BoundWitness, JobBounds, Responses, SinkBounds};
use crate::analysis::SchedulabilityTest;
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::ranks::InstanceOrder;
use crate::analysis::ratio::Ratio;
use crate::analysis::set::EvaluationBudget;
use crate::analysis::witness_text::WitnessText;
use crate::order::sorted_by_key;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::OneCore, SchedulabilityTest::OneCoreEdf],
    covers: covers!(
        RANKED BY_DEADLINE ONE_CORE PREEMPTION ALL_KEEP SOME_KEEP SINK_DEADLINES INTERLEAVED
        LATE_DEADLINES FEW_IN_FLIGHT OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    sinks,
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: write,
    sinks: write_sinks,
    ..BoundWitness::NONE
};

/// The maximum number of terms of sums under EDF, for the jobs of all DAGs and for the sinks of
/// all.
const TERM_LIMIT: u64 = 1 << 17;

/// The maximum number of releases considered for a bound: a witness has a line for each.
const RELEASE_LIMIT: u32 = 4096;

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    let (core, count) = (CoreDemand::of(case), case.members.len());
    let mut solved = vec![None; count];
    let (mut shares, mut steps) = (EvaluationBudget::of(count), TERM_LIMIT);
    for &dag in &case.order {
        solved[dag] = match core.by_deadline {
            false => shares.spend(dag, |steps| core.response(dag, steps)),
            true => core.response(dag, &mut steps),
        };
        if core.by_deadline && solved[dag].is_none() {
            return;
        }
    }
    let test = match core.by_deadline {
        false => SchedulabilityTest::OneCore,
        true => SchedulabilityTest::OneCoreEdf,
    };
    for dag in 0..count {
        let mut others = (0..count).filter(|&other| core.counts(other, dag));
        let are_known = others.all(|other| solved[other].is_some());
        if let Some(bound_ns) = solved[dag].filter(|_| are_known && !case.is_alone(dag)) {
            found.offer(dag, bound_ns, test);
        }
    }
}

fn sinks(case: &AnalysisInput<'_>, responses: Responses<'_>, found: &mut SinkBounds) {
    let (core, mut steps) = (CoreDemand::of(case), TERM_LIMIT);
    for dag in (0..case.members.len()).filter(|&dag| TEST.is_for(case, dag)) {
        let bounds = core.of_sinks(dag, responses, &mut steps);
        found.offer(dag, bounds.into_iter().map(|(_, bound)| bound));
    }
}

fn write(
    case: &AnalysisInput<'_>,
    _: Responses<'_>,
    dag: usize,
    bound_ns: u64,
    text: &mut WitnessText,
) {
    let (id, core) = (case.members[dag], CoreDemand::of(case));
    let busy = core.busy(dag, &mut { u64::MAX }).unwrap_or(0);
    text.line(format_args!("bound {id} {bound_ns} core {busy}"));
    for target in core.last_of_levels(dag) {
        core.write_points(&target, bound_ns, busy, text);
    }
}

fn write_sinks(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    whole_ns: u64,
    text: &mut WitnessText,
) {
    let (id, core, steps) = (case.members[dag], CoreDemand::of(case), &mut { TERM_LIMIT });
    for (target, bound) in core.of_sinks(dag, responses, steps) {
        if let Some(bound_ns) = bound.filter(|&bound_ns| bound_ns < whole_ns)
            && let Some(busy) = core.busy(dag, &mut { u64::MAX })
        {
            text.line(format_args!("sooner {id} {bound_ns} {busy}"));
            core.write_points(&target, bound_ns, busy, text);
        }
    }
}

/// The part of each job of a DAG with the same relative deadline; under static priorities the whole
/// job.
struct LevelDemand {
    dag: usize,
    due_ns: i128,
    work_ns: u64,
    /// The largest WCET of a subtask in this part that keeps the core, or 0.
    keeps_ns: u64,
}

/// A subtask whose response time is wanted.
#[derive(Clone, Copy)]
struct TargetSubtask {
    dag: usize,
    subtask: usize,
    due_ns: i128,
    /// The work of its job that comes before the subtask.
    before_ns: u64,
    wcet_ns: u64,
    keeps_core: bool,
}

/// Work released within a stretch, at equal distances.
struct ReleasedWork {
    first_ns: u64,
    period_ns: u64,
    most: u64,
    work_ns: u64,
}

/// The WCET that keeps the core as a stretch begins, and the first release in the stretch of a late
/// DAG.
type CoreBlocker = (u64, Option<(usize, u64)>);

struct CoreDemand<'a> {
    case: &'a AnalysisInput<'a>,
    levels: Vec<LevelDemand>,
    by_deadline: bool,
    /// By DAG, under static priorities: the least urgent rank that counts, and whether the DAG is
    /// in a band.
    least_counting: Vec<((u64, usize), bool)>,
}

impl<'a> CoreDemand<'a> {
    fn of(case: &'a AnalysisInput<'a>) -> Self {
        let by_deadline = case.relation.order == InstanceOrder::ByDeadline;
        let mut levels: Vec<LevelDemand> = Vec::new();
        for (dag, task) in case.tasks.iter().enumerate() {
            let first = levels.len();
            for (subtask, &wcet_ns) in case.dag(dag).subtasks().iter().zip(task.wcets_ns()) {
                let due_ns = i128::from(subtask.relative_deadline_ns()) * i128::from(by_deadline);
                let known = levels[first..].iter().position(|level| level.due_ns == due_ns);
                let place = known.map_or(levels.len(), |place| first + place);
                if known.is_none() {
                    levels.push(LevelDemand { dag, due_ns, work_ns: 0, keeps_ns: 0 });
                }
                let level = &mut levels[place];
                level.work_ns += wcet_ns;
                if case.keeps_core(subtask) {
                    level.keeps_ns = level.keeps_ns.max(wcet_ns);
                }
            }
        }
        let members = 0..if by_deadline { 0 } else { case.members.len() };
        let ranks: Vec<_> = members.map(|dag| case.relation.ranks(dag)).collect();
        let by_most = sorted_by_key(ranks.len(), |dag| ranks[dag][0]);
        let by_most: Vec<_> = by_most.into_iter().map(|dag| ranks[dag]).collect();
        let least_counting = ranks.iter().map(|own| Self::least_of(&by_most, *own));
        let least_counting = least_counting.collect();
        Self { case, levels, by_deadline, least_counting }
    }

    fn period_ns(&self, dag: usize) -> u64 {
        self.case.tasks[dag].period_ns()
    }

    /// Returns the least urgent rank of all DAGs that count for a DAG under static priorities, and
    /// whether the DAG is in a band: no counting work is less urgent than any work of the DAG.
    fn least_of(by_most: &[[(u64, usize); 2]], own: [(u64, usize); 2]) -> ((u64, usize), bool) {
        let mut least = own[1];
        // A DAG that delays a counting DAG delays the job, too. The DAGs after the first that
        // delays none are less urgent still.
        for &[most, lower] in by_most {
            if most >= least {
                break;
            }
            least = least.max(lower);
        }
        (least, own[0] == own[1] && least == own[1])
    }

    /// Returns the cost of a sum in steps: under EDF the number of its terms.
    fn step(&self) -> u64 {
        if self.by_deadline { self.levels.len() as u64 } else { 1 }
    }

    /// Reports whether long steps or a device take time from the core.
    fn has_losses(&self) -> bool {
        self.case.set.bursts.during(0) > 0
    }

    fn is_band(&self, dag: usize) -> bool {
        self.by_deadline || self.least_counting[dag].1
    }

    /// Reports whether work of a DAG counts for another DAG, or for itself.
    fn counts(&self, other: usize, dag: usize) -> bool {
        let most = || self.case.relation.ranks(other)[0];
        other == dag || self.by_deadline || most() < self.least_counting[dag].0
    }

    /// Returns the subtasks of a DAG in the order in which each job starts them. Returns the whole
    /// job as a single target if the DAG is in no band.
    fn start_order(&self, dag: usize) -> Vec<TargetSubtask> {
        let (task, subtasks) = (self.case.tasks[dag], self.case.dag(dag).subtasks());
        if !self.is_band(dag) {
            return vec![TargetSubtask {
                dag,
                subtask: usize::MAX,
                due_ns: 0,
                before_ns: 0,
                wcet_ns: task.volume_ns(),
                keeps_core: false,
            }];
        }
        let due_ns = |subtask: usize| {
            subtasks[subtask].relative_deadline_ns() * u64::from(self.by_deadline)
        };
        let key = |subtask: usize| (u64::MAX - due_ns(subtask), Reverse(subtask));
        let mut missing = task.graph.predecessor_counts();
        let mut ready: BinaryHeap<(u64, Reverse<usize>)> = BinaryHeap::new();
        ready.extend(task.sources().map(key));
        let (mut order, mut before_ns) = (Vec::new(), 0);
        while let Some((_, Reverse(subtask))) = ready.pop() {
            let keeps_core = self.case.keeps_core(&subtasks[subtask]);
            order.push(TargetSubtask {
                dag,
                subtask,
                due_ns: due_ns(subtask).into(),
                before_ns,
                wcet_ns: task.wcets_ns()[subtask],
                keeps_core: keeps_core && !self.has_losses(),
            });
            before_ns += task.wcets_ns()[subtask];
            for next in task.successors(subtask) {
                missing[next] -= 1;
                if missing[next] == 0 {
                    ready.push(key(next));
                }
            }
        }
        order
    }

    /// Returns the subtasks of a DAG with the longest responses: the last of each level.
    fn last_of_levels(&self, dag: usize) -> Vec<TargetSubtask> {
        let order = self.start_order(dag);
        let is_last = |&place: &usize| {
            let mut later = order[place + 1..].iter();
            later.all(|of| of.due_ns != order[place].due_ns)
        };
        (0..order.len()).filter(is_last).map(|place| order[place]).collect()
    }

    /// Returns the response time of a DAG's jobs, if it is within the limit and found within
    /// `steps`.
    fn response(&self, dag: usize, steps: &mut u64) -> Option<u64> {
        let (busy, limit_ns) = (self.busy(dag, steps)?, self.case.set.figures[dag].limit_ns());
        let (mut most, mut left) = (0, RELEASE_LIMIT);
        for target in self.last_of_levels(dag) {
            most = self.solve(&target, most, [busy, limit_ns], (&mut left, steps))?;
        }
        Some(most)
    }

    /// Returns the response times of a DAG's sinks, as far as they are known, in the order of the
    /// sinks.
    fn of_sinks(
        &self,
        dag: usize,
        responses: Responses<'_>,
        steps: &mut u64,
    ) -> Vec<(TargetSubtask, Option<u64>)> {
        // Under EDF no job may wait for room.
        let is_known = match self.by_deadline {
            true => responses.iter().all(Option::is_some),
            false => responses[dag].is_some(),
        };
        let busy = is_known.then(|| self.busy(dag, steps)).flatten();
        let order = self.start_order(dag);
        let mut places = vec![0; self.case.dag(dag).subtasks().len()];
        for (place, target) in order.iter().enumerate() {
            if let Some(of) = places.get_mut(target.subtask) {
                *of = place;
            }
        }
        let sinks = self.case.dag(dag).sinks().iter();
        let targets = sinks.map(|sink| order[places[sink.index()]]);
        let bounds = targets.map(|target| {
            let is_band = target.subtask != usize::MAX;
            let bound = busy.filter(|_| is_band).and_then(|busy| {
                self.solve(&target, 0, [busy, u64::MAX], (&mut { RELEASE_LIMIT }, steps))
            });
            (target, bound)
        });
        bounds.collect()
    }

    /// Returns the longest stretch in which the core executes a DAG and all work counting for it.
    fn busy(&self, dag: usize, steps: &mut u64) -> Option<u64> {
        let all = (0..self.case.members.len()).filter(|&other| self.counts(other, dag));
        let figures = |dag: usize| {
            let task = self.case.tasks[dag];
            (task.volume_ns(), task.period_ns())
        };
        let blocking_ns = match self.by_deadline {
            true => self.levels.iter().map(|level| level.keeps_ns).max(),
            false => Some(self.blocked_below(dag)),
        };
        let blocking_ns = blocking_ns.unwrap_or(0);
        let sum = Ratio::sum(all.clone().map(figures))?;
        let is_endless = blocking_ns > 0 || self.has_losses();
        if !sum.at_most(1, 1) || (is_endless && sum.numerator >= sum.denominator) {
            return None;
        }
        let release = |dag| {
            let (work_ns, period_ns) = figures(dag);
            ReleasedWork { first_ns: 0, period_ns, most: u64::MAX, work_ns }
        };
        let released: Vec<ReleasedWork> = all.map(release).collect();
        self.fixed_point([blocking_ns.max(1), u64::MAX], (blocking_ns, &released, false), steps)
    }

    /// Returns the longest WCET that keeps the core, among the DAGs that do not count for a DAG.
    fn blocked_below(&self, dag: usize) -> u64 {
        let below = self.levels.iter().filter(|level| !self.counts(level.dag, dag));
        below.map(|level| level.keeps_ns).max().unwrap_or(0)
    }

    /// Returns the response time of a subtask, or `most` if that is longer. Returns `None` if the
    /// time exceeds the limit, or is not found within so many releases and steps.
    fn solve(
        &self,
        target: &TargetSubtask,
        mut most: u64,
        [busy, limit_ns]: [u64; 2],
        (left, steps): (&mut u32, &mut u64),
    ) -> Option<u64> {
        let (mut after, mut released, mut known_ns) = (0_u64, Vec::new(), 0);
        while after.saturating_add(most) <= busy {
            *left = left.checked_sub(1)?;
            *steps = steps.checked_sub(self.step())?;
            for blocker in self.blockers(target, after) {
                let latest_ns = after.saturating_add(limit_ns);
                // Under EDF most blockers lengthen nothing; a single sum shows this.
                let enough_ns = if self.by_deadline { after.saturating_add(most) } else { 0 };
                let range_ns = [enough_ns, known_ns, latest_ns];
                let of = (target, after, blocker);
                let finish_ns = self.finish(of, range_ns, &mut released, steps)?;
                most = most.max(finish_ns.saturating_sub(after));
                // For a later job no less work counts, except for a blocking subtask under EDF.
                if !self.by_deadline {
                    known_ns = finish_ns - target.wcet_ns;
                }
            }
            if most > limit_ns {
                return None;
            }
            after = self.next_candidate(target, after);
        }
        Some(most)
    }

    /// Writes the considered releases, each with the finishes.
    fn write_points(&self, target: &TargetSubtask, bound_ns: u64, busy: u64, text: &mut WitnessText) {
        if target.subtask != usize::MAX {
            text.line(format_args!("target {}", target.subtask));
        }
        let mut after = 0_u64;
        while after.saturating_add(bound_ns) <= busy {
            let mut released = Vec::new();
            let finishes = self.blockers(target, after).map(|blocker| {
                let of = (target, after, blocker);
                self.finish(of, [0, 0, u64::MAX], &mut released, &mut { u64::MAX })
            });
            let finishes = finishes.map(|finish_ns| finish_ns.unwrap_or(u64::MAX));
            let numbers = core::iter::once(after).chain(finishes);
            text.list("at", numbers.map(i128::from));
            after = self.next_candidate(target, after);
        }
    }

    /// Returns the subtasks that may keep the core as a stretch begins, given the job's release
    /// time `after` the begin.
    fn blockers(&self, target: &TargetSubtask, after: u64) -> impl Iterator<Item = CoreBlocker> {
        let first_ns = match self.by_deadline {
            true => 0,
            false => self.blocked_below(target.dag),
        };
        let period = i128::from(self.period_ns(target.dag));
        let due = i128::from(after) + target.due_ns;
        let next = target.due_ns + period.max(i128::from(after) + 1);
        let dag = target.dag;
        let keeping = self.levels.iter();
        let keeping = keeping.filter(|level| self.by_deadline && level.keeps_ns > 0);
        let found = keeping.filter_map(move |level| {
            let since = due + i128::from(level.dag < dag) - level.due_ns;
            if level.dag == dag {
                return (level.due_ns > next).then_some((level.keeps_ns, None));
            }
            let first = since + i128::from(self.period_ns(level.dag));
            let late = (level.dag, u64::try_from(first).unwrap_or(0));
            (since < 0).then_some((level.keeps_ns, Some(late)))
        });
        core::iter::once((first_ns, None)).chain(found)
    }

    /// Returns the next instant at which more work counts for a subtask.
    fn next_candidate(&self, target: &TargetSubtask, after: u64) -> u64 {
        let now = i128::from(after);
        let next = self.levels.iter().filter_map(|level| {
            let period = i128::from(self.period_ns(level.dag));
            let from = match level.dag == target.dag {
                true => Some(level.due_ns - target.due_ns).filter(|&apart| apart > period).unwrap_or(0),
                false if !self.by_deadline => return None,
                false => level.due_ns - target.due_ns + i128::from(level.dag > target.dag),
            };
            let passed = now - from;
            Some(if passed < 0 { from } else { from + (passed / period + 1) * period })
        });
        next.min().and_then(|next| u64::try_from(next).ok()).unwrap_or(u64::MAX)
    }

    /// Returns when a subtask completes, if its job is released `after` the stretch's begin.
    /// Returns `enough_ns` if the subtask completes by then. Its start is known to be no earlier
    /// than `known_ns`, and a time after `latest_ns` is of no use.
    fn finish(
        &self,
        (target, after, (blocking_ns, late)): (&TargetSubtask, u64, CoreBlocker),
        [enough_ns, known_ns, latest_ns]: [u64; 3],
        released: &mut Vec<ReleasedWork>,
        steps: &mut u64,
    ) -> Option<u64> {
        released.clear();
        let earlier_ns = self.released(target, after, late, released);
        let is_closed = target.keeps_core && blocking_ns == 0;
        let own_ns = target.wcet_ns * u64::from(!target.keeps_core);
        let base_ns = blocking_ns.checked_add(earlier_ns)?.checked_add(target.before_ns)?;
        let base_ns = base_ns.checked_add(own_ns)?;
        let rest_ns = target.wcet_ns - own_ns;
        let of = (base_ns, &released[..], is_closed);
        if let Some(end_ns) = enough_ns.checked_sub(rest_ns) {
            *steps = steps.checked_sub(self.step())?;
            // If a sum is no more than its time, so is the least time that equals its sum.
            if self.sum(end_ns, of)? <= end_ns {
                return Some(enough_ns);
            }
        }
        let range_ns = [base_ns.max(known_ns), latest_ns];
        self.fixed_point(range_ns, of, steps)?.checked_add(rest_ns)
    }

    /// Adds the work that counts for a subtask, and returns the work of the own DAG's earlier jobs
    /// in the stretch.
    fn released(
        &self,
        target: &TargetSubtask,
        after: u64,
        late: Option<(usize, u64)>,
        released: &mut Vec<ReleasedWork>,
    ) -> u64 {
        let own_ns = self.period_ns(target.dag);
        let [high, low] = self.case.relation.ranks(target.dag);
        let younger_may_win = !self.by_deadline && high.0 != low.0;
        let mut earlier_ns = 0_u64;
        for level in &self.levels {
            let (work_ns, period_ns) = (level.work_ns, self.period_ns(level.dag));
            let period = i128::from(period_ns);
            let sooner = target.due_ns - level.due_ns;
            let (first_ns, most) = if level.dag == target.dag {
                // For a job older by more than a period, this part may be due no later.
                let apart = period.max(-sooner);
                let count = (i128::from(after) - apart).div_euclid(period) + 1;
                let count = u64::try_from(count).unwrap_or(0);
                earlier_ns = earlier_ns.saturating_add(count.saturating_mul(work_ns));
                // Younger jobs win by a sooner deadline, or by priorities that differ within the
                // DAG.
                let most = (sooner - 1).div_euclid(period);
                let most = if younger_may_win { i128::MAX } else { most };
                (after.saturating_add(own_ns), most)
            } else if self.by_deadline {
                let late = late.filter(|&(dag, _)| dag == level.dag);
                let first_ns = late.map_or(0, |(_, first_ns)| first_ns);
                let tie = i128::from(level.dag > target.dag);
                let time = i128::from(after) + sooner - tie - i128::from(first_ns);
                (first_ns, time.div_euclid(period) + 1)
            } else {
                (0, i128::MAX * i128::from(self.counts(level.dag, target.dag)))
            };
            let most = u64::try_from(most.max(0)).unwrap_or(u64::MAX);
            if most > 0 {
                released.push(ReleasedWork { first_ns, period_ns, most, work_ns });
            }
        }
        earlier_ns
    }

    /// Returns the least time in a range that equals its sum.
    fn fixed_point(
        &self,
        [mut time_ns, latest_ns]: [u64; 2],
        of: (u64, &[ReleasedWork], bool),
        steps: &mut u64,
    ) -> Option<u64> {
        loop {
            *steps = steps.checked_sub(self.step()).filter(|_| time_ns <= latest_ns)?;
            match self.sum(time_ns, of)? {
                same if same == time_ns => return Some(same),
                after => time_ns = after,
            }
        }
    }

    /// Returns a base plus all work released before a time, or also at that time if `is_closed`.
    fn sum(
        &self,
        time_ns: u64,
        (base_ns, released, is_closed): (u64, &[ReleasedWork], bool),
    ) -> Option<u64> {
        let end_ns = time_ns.checked_add(is_closed.into())?;
        let bursts = self.case.set.bursts.during(time_ns.into());
        let mut sum = u64::try_from(bursts).ok()?.checked_add(base_ns)?;
        for work in released {
            let jobs = end_ns.saturating_sub(work.first_ns).div_ceil(work.period_ns);
            sum = sum.checked_add(jobs.min(work.most).checked_mul(work.work_ns)?)?;
        }
        Some(sum)
    }
}
