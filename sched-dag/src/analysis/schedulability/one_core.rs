//! Response times on one core, under static priorities and under EDF.
//!
//! On one core the subtasks of a job start in an order that nothing else changes: of those that are
//! ready by edges the most urgent one first. So a DAG is as several sequential tasks that are
//! released together, one for each deadline among its sinks, and one alone under static
//! priorities. `docs/bounds.md` has the proof; in short: let S be a subtask, what is before it
//! in its job, and all of other jobs that goes before it. Look at a longest stretch in which work
//! of
//! S is pending. Only S executes in it, but for one subtask that keeps its core and started before.
//! So a job that is released `a` after the stretch's begin completes the subtask within the least
//! `X > 0` with
//!
//! `X = blocking + own(a) + sum over S of min(ceil(max(0, X - first) / T), most) work`
//!
//! and `R = max over a of X - a`, where `a` is a multiple of the own period or, under EDF, an
//! instant at which another job joins S. A subtask that keeps its core has to *start*: its
//! equation is without its own WCET, and also counts what is released at its start, if nothing
//! blocks. What blocks has started before the stretch, so it ends before its WCET has passed.
//!
//! M. Joseph, P. Pandya, The Computer Journal 29(5), 1986; J. P. Lehoczky, RTSS 1990; L. George,
//! N. Rivierre, M. Spuri, INRIA RR-2966, 1996; R. Davis et al., Real-Time Systems 35, 2007;
//! N. Guan, W. Yi, IEEE Trans. Industrial Informatics 10(2), 2014. Ties, DAGs, sinks and younger
//! jobs were derived here.
//!
//! Where static priorities interleave, S is the DAG and all that may outrank it, or outrank one of
//! these, and so on; where they differ within the DAG, its younger jobs count, too. That is a
//! bound,
//! but none that some run attains. The time for which long steps and a device's interrupts keep the
//! core in the
//! stretch (bursts, in `workload`) is added; then all subtasks count as if they could be preempted.
//!
//! Assumes: releases at least `T` apart; WCETs above 0; no job waits for room, so under EDF all
//! DAGs must have their bounds.

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

/// The most evaluations of sums under EDF, for the jobs of all DAGs and for the sinks of all.
const STEP_LIMIT: u64 = 1 << 20;

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    let (core, count) = (CoreDemand::of(case), case.members.len());
    let mut solved = vec![None; count];
    let (mut shares, mut steps) = (EvaluationBudget::of(count), STEP_LIMIT);
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
    let (core, mut steps) = (CoreDemand::of(case), STEP_LIMIT);
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
    for target in core.last(dag) {
        core.write(&target, bound_ns, busy, text);
    }
}

fn write_sinks(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    whole_ns: u64,
    text: &mut WitnessText,
) {
    let (id, core, steps) = (case.members[dag], CoreDemand::of(case), &mut { STEP_LIMIT });
    for (target, bound) in core.of_sinks(dag, responses, steps) {
        if let Some(bound_ns) = bound.filter(|&bound_ns| bound_ns < whole_ns)
            && let Some(busy) = core.busy(dag, &mut { u64::MAX })
        {
            text.line(format_args!("sooner {id} {bound_ns} {busy}"));
            core.write(&target, bound_ns, busy, text);
        }
    }
}

/// The part of each job of a DAG that is due at the same time; under static priorities all of it.
struct LevelDemand {
    dag: usize,
    due_ns: i128,
    work_ns: u64,
    /// The largest WCET of those that keep the core, or 0.
    keeps_ns: u64,
}

/// A subtask whose response time is asked for.
#[derive(Clone, Copy)]
struct TargetSubtask {
    dag: usize,
    subtask: usize,
    due_ns: i128,
    /// The work of its job that is before it.
    before_ns: u64,
    wcet_ns: u64,
    keeps_core: bool,
}

/// Work that is released within a stretch, at the same distances.
struct ReleasedWork {
    first_ns: u64,
    period_ns: u64,
    most: u64,
    work_ns: u64,
}

/// What keeps the core as a stretch begins, and the first release in it of a DAG that is late.
type CoreBlocker = (u64, Option<(usize, u64)>);

struct CoreDemand<'a> {
    case: &'a AnalysisInput<'a>,
    levels: Vec<LevelDemand>,
    by_deadline: bool,
    /// By DAG, under static priorities.
    least: Vec<((u64, usize), bool)>,
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
        let least = members.map(|dag| Self::least_of(case, dag)).collect();
        Self { case, levels, by_deadline, least }
    }

    fn period_ns(&self, dag: usize) -> u64 {
        self.case.tasks[dag].period_ns()
    }

    /// Returns the least urgent rank of all that counts for a DAG under static priorities, and
    /// whether it is in a band: nothing of these is less urgent than anything of it.
    fn least_of(case: &AnalysisInput<'_>, dag: usize) -> ((u64, usize), bool) {
        let own = case.relation.ranks(dag);
        let mut least = own[1];
        loop {
            // Until nothing more comes in: what may delay one of these may delay the job through
            // it.
            let ranks = (0..case.members.len()).map(|other| case.relation.ranks(other));
            let outrank = ranks.filter(|&[most, _]| most < least);
            match outrank.map(|[_, lower]| lower).max() {
                Some(lower) if lower > least => least = lower,
                _ => return (least, own[0] == own[1] && least == own[1]),
            }
        }
    }

    /// Reports whether long steps or a device take time from the core.
    fn has_losses(&self) -> bool {
        self.case.set.bursts.during(0) > 0
    }

    fn is_band(&self, dag: usize) -> bool {
        self.by_deadline || self.least[dag].1
    }

    /// Reports whether work of a DAG counts for another one, or for itself.
    fn counts(&self, other: usize, dag: usize) -> bool {
        let most = || self.case.relation.ranks(other)[0];
        other == dag || self.by_deadline || most() < self.least[dag].0
    }

    /// Returns the subtasks of a DAG in the order in which each of its jobs starts them; in their
    /// place the whole job, if the DAG is in no band.
    fn order(&self, dag: usize) -> Vec<TargetSubtask> {
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

    /// Returns those of a DAG's subtasks whose responses are the longest: the last of each level.
    fn last(&self, dag: usize) -> Vec<TargetSubtask> {
        let order = self.order(dag);
        let is_last = |&place: &usize| {
            let mut later = order[place + 1..].iter();
            later.all(|of| of.due_ns != order[place].due_ns)
        };
        (0..order.len()).filter(is_last).map(|place| order[place]).collect()
    }

    /// Returns the response time of a DAG's jobs if it is of use, found within so many steps.
    fn response(&self, dag: usize, steps: &mut u64) -> Option<u64> {
        let (busy, limit_ns) = (self.busy(dag, steps)?, self.case.set.figures[dag].limit_ns());
        let mut most = 0;
        for target in self.last(dag) {
            most = self.solve(&target, most, (busy, limit_ns), steps)?;
        }
        Some(most)
    }

    /// Returns the response times of a DAG's sinks, as far as they are known, in their order.
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
        let order = self.order(dag);
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
                self.solve(&target, 0, (busy, u64::MAX), steps)
            });
            (target, bound)
        });
        bounds.collect()
    }

    /// Returns the longest stretch in which the core executes a DAG and what counts for it.
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
        self.fixed_point(blocking_ns.max(1), blocking_ns, &released, false, steps)
    }

    /// Returns the longest WCET of those that keep the core and do not count for a DAG.
    fn blocked_below(&self, dag: usize) -> u64 {
        let below = self.levels.iter().filter(|level| !self.counts(level.dag, dag));
        below.map(|level| level.keeps_ns).max().unwrap_or(0)
    }

    /// Returns the response time of a subtask, or `most` if that is more; `None` if it is beyond
    /// the
    /// limit.
    fn solve(
        &self,
        target: &TargetSubtask,
        mut most: u64,
        (busy, limit_ns): (u64, u64),
        steps: &mut u64,
    ) -> Option<u64> {
        let mut after = 0_u64;
        while after.saturating_add(most) <= busy {
            for blocker in self.blockers(target, after) {
                let finish_ns = self.finish(target, after, blocker, steps)?;
                most = most.max(finish_ns.saturating_sub(after));
            }
            if most > limit_ns {
                return None;
            }
            *steps = steps.checked_sub(1)?;
            after = self.next(target, after);
        }
        Some(most)
    }

    /// Writes the points of that.
    fn write(&self, target: &TargetSubtask, bound_ns: u64, busy: u64, text: &mut WitnessText) {
        if target.subtask != usize::MAX {
            text.line(format_args!("target {}", target.subtask));
        }
        let mut after = 0_u64;
        while after.saturating_add(bound_ns) <= busy {
            let finish = |blocker| self.finish(target, after, blocker, &mut { u64::MAX });
            let finishes = self.blockers(target, after).into_iter().map(finish);
            let finishes = finishes.map(|finish_ns| finish_ns.unwrap_or(u64::MAX));
            let numbers = core::iter::once(after).chain(finishes);
            text.list("at", numbers.map(i128::from));
            after = self.next(target, after);
        }
    }

    /// Returns what may keep the core as a stretch begins, by how long after it the job is
    /// released.
    fn blockers(&self, target: &TargetSubtask, after: u64) -> Vec<CoreBlocker> {
        if !self.by_deadline {
            return vec![(self.blocked_below(target.dag), None)];
        }
        let period = i128::from(self.period_ns(target.dag));
        let due = i128::from(after) + target.due_ns;
        let next = target.due_ns + (i128::from(after) / period + 1) * period;
        let mut found = vec![(0, None)];
        for level in self.levels.iter().filter(|level| level.keeps_ns > 0) {
            let since = due + i128::from(level.dag < target.dag) - level.due_ns;
            if level.dag == target.dag && level.due_ns > next {
                found.push((level.keeps_ns, None));
            } else if level.dag != target.dag && since < 0 {
                let first = since + i128::from(self.period_ns(level.dag));
                let first_ns = u64::try_from(first).unwrap_or(0);
                found.push((level.keeps_ns, Some((level.dag, first_ns))));
            }
        }
        found
    }

    /// Returns the next instant at which more counts for a subtask.
    fn next(&self, target: &TargetSubtask, after: u64) -> u64 {
        let now = i128::from(after);
        let next = self.levels.iter().filter_map(|level| {
            let period = i128::from(self.period_ns(level.dag));
            let from = match level.dag == target.dag {
                true => 0,
                false if !self.by_deadline => return None,
                false => level.due_ns - target.due_ns + i128::from(level.dag > target.dag),
            };
            let passed = now - from;
            Some(if passed < 0 { from } else { from + (passed / period + 1) * period })
        });
        next.min().and_then(|next| u64::try_from(next).ok()).unwrap_or(u64::MAX)
    }

    /// Returns when a subtask is complete whose job is released so long after the stretch's begin.
    fn finish(
        &self,
        target: &TargetSubtask,
        after: u64,
        (blocking_ns, late): CoreBlocker,
        steps: &mut u64,
    ) -> Option<u64> {
        let (mut released, earlier_ns) = self.released(target, after, late);
        released.retain(|work| work.most > 0);
        let base_ns = blocking_ns.checked_add(earlier_ns)?.checked_add(target.before_ns)?;
        match target.keeps_core {
            true => {
                let is_closed = blocking_ns == 0;
                let start_ns = self.fixed_point(base_ns, base_ns, &released, is_closed, steps)?;
                start_ns.checked_add(target.wcet_ns)
            }
            false => {
                let base_ns = base_ns.checked_add(target.wcet_ns)?;
                self.fixed_point(base_ns, base_ns, &released, false, steps)
            }
        }
    }

    /// Returns what counts for a subtask, and the work of its DAG's earlier jobs in the stretch.
    fn released(
        &self,
        target: &TargetSubtask,
        after: u64,
        late: Option<(usize, u64)>,
    ) -> (Vec<ReleasedWork>, u64) {
        let own_ns = self.period_ns(target.dag);
        let jobs = i128::from(after / own_ns);
        let [high, low] = self.case.relation.ranks(target.dag);
        let younger_may_win = !self.by_deadline && high.0 != low.0;
        let (mut released, mut earlier_ns) = (Vec::new(), 0_u64);
        for level in &self.levels {
            let (work_ns, period_ns) = (level.work_ns, self.period_ns(level.dag));
            let period = i128::from(period_ns);
            let sooner = target.due_ns - level.due_ns;
            let (first_ns, most) = if level.dag == target.dag {
                let skipped = (-sooner + period - 1).div_euclid(period).max(1) - 1;
                let count = u64::try_from(jobs - skipped).unwrap_or(0);
                earlier_ns = earlier_ns.saturating_add(count.saturating_mul(work_ns));
                // Younger jobs win by a sooner deadline, or by priorities that differ.
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
            released.push(ReleasedWork { first_ns, period_ns, most, work_ns });
        }
        (released, earlier_ns)
    }

    /// Returns the least time from one on that equals a base and all work that is released before
    /// it, or until it if that is closed.
    fn fixed_point(
        &self,
        mut time_ns: u64,
        base_ns: u64,
        released: &[ReleasedWork],
        is_closed: bool,
        steps: &mut u64,
    ) -> Option<u64> {
        loop {
            *steps = steps.checked_sub(1)?;
            let end_ns = time_ns.checked_add(is_closed.into())?;
            let bursts = self.case.set.bursts.during(time_ns.into());
            let mut after = u64::try_from(bursts).ok()?.checked_add(base_ns)?;
            for work in released {
                let jobs = end_ns.saturating_sub(work.first_ns).div_ceil(work.period_ns);
                after = after.checked_add(jobs.min(work.most).checked_mul(work.work_ns)?)?;
            }
            if after == time_ns {
                return Some(after);
            }
            time_ns = after;
        }
    }
}
