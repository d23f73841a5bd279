//! Subtasks that wait: bounds of DAGs that suspend themselves.
//!
//! A subtask with waits is segments with a wait between any two: each wait has a limit, after
//! which it ends whatever a device does, and no core is held meanwhile. Such subtasks are
//! *self-suspending*, and most tests of the literature are wrong for them. These forms are
//! proven in `docs/analysis.md`, "Subtasks that wait"; here in short.
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

use super::NotProvenReason;
use super::cover::{CoverChain, STEPS, covers};
use super::interference::InterferenceBound;
use super::multi_path::multi_path;
use super::one_core::{Blocking, largest};
use super::ranks::RankRelation;
use super::set::EquationSet;
use super::task::{SubtaskWaits, Task, TaskError};
use crate::task_set::Dag;

/// The parts of the analysis that only DAGs that wait ask for, as functions that waits bring with
/// them: no other program links them.
#[derive(Debug)]
pub(crate) struct WaitAnalysis {
    /// Adds the waits of a verified DAG, and overheads for each segment but the first.
    pub(super) charge: fn(Task, &Dag, u64) -> Result<Task, TaskError>,
    /// Replaces covers and largest executions by those of a task that waits.
    pub(super) summarise: fn(&Task, u32, &mut Vec<u64>, &mut Vec<u64>),
    /// Lowers what is left beside the span to what reserved chains give.
    pub(super) reserve: fn(&mut Vec<u64>, &Task, u32),
    /// Returns what is left on all cores beside the span of a job that is blocked.
    pub(super) with_blocking: fn(&Task, u32, &Blocking) -> u128,
    /// Accepts no overlapping jobs of DAGs that waits enter.
    pub(super) forbid_overlap: fn(&mut EquationSet<'_>, &RankRelation),
    /// Says why a DAG that waits enter has no bound within a limit.
    pub(super) reason: fn(&Task, u64) -> NotProvenReason,
}

/// The analysis of waits.
pub(crate) static ANALYSIS: WaitAnalysis = WaitAnalysis {
    charge: Task::charge_segments,
    summarise,
    reserve: |left, task, cores| lower(left, &reserved(task, cores)),
    with_blocking,
    forbid_overlap: |set, relation| {
        let tasks = set.tasks;
        set.forbid_overlap(relation.closure(&|dag| tasks[dag].has_waits()));
    },
    reason,
};

fn summarise(task: &Task, cores: u32, covered: &mut Vec<u64>, largest_ns: &mut Vec<u64>) {
    *covered = covers(task.oblivious(), covered.len());
    let segments_ns = task.waits().iter().map(|waits| waits.longest_segment_ns);
    *largest_ns = largest(&segments_ns.collect::<Vec<u64>>(), cores);
}

fn reason(task: &Task, limit_ns: u64) -> NotProvenReason {
    let span_ns = task.span_ns();
    match (span_ns > limit_ns, limit_ns < task.relative_deadline_ns()) {
        (true, _) => NotProvenReason::SpanBeyondLimit { span_ns, limit_ns },
        (false, true) => NotProvenReason::NoBoundByPeriod,
        (false, false) => NotProvenReason::NoBound,
    }
}

/// The bounds of one job alone by each form, in whole units of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AloneBounds {
    /// By one path.
    pub one_path_ns: u64,
    /// By the best number of reserved chains, none among them.
    pub reserved_ns: u64,
    /// By several paths, with waits that are executed.
    pub oblivious_ns: u64,
}

/// Bounds the response time of one job alone by each form; `None` without cores.
#[must_use]
pub fn alone_forms(task: &Task, cores: u32) -> Option<AloneBounds> {
    let waiting = |with: &ReservedChains| with.left / with.free;
    let reserved = reserved(task, cores);
    let bound = |waiting: u128| task.span_ns().checked_add(u64::try_from(waiting).ok()?);
    Some(AloneBounds {
        one_path_ns: bound(reserved.first().map(waiting)?)?,
        reserved_ns: bound(reserved.iter().map(waiting).min()?)?,
        oblivious_ns: multi_path(task.oblivious(), cores)?,
    })
}

/// Which forms bound the response times of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitingForm {
    /// One path, preemptive.
    OnePath,
    /// Any of the three forms, preemptive.
    Best,
    /// One path, with segments that keep their cores.
    NonPreemptive,
}

/// Bounds the response times under global fixed priorities, in whole units of time, the DAGs given
/// from the highest priority to the lowest. `None` if there is no core, or a DAG has no bound
/// within its deadline and its period.
#[must_use]
pub fn waiting_fp(tasks: &[&Task], cores: u32, form: WaitingForm) -> Option<Vec<u64>> {
    let set = in_units(tasks, cores, form)?;
    let order: Vec<usize> = (0..tasks.len()).collect();
    let solution = set.solve(&order, |other, dag| other < dag);
    solution.responses.into_iter().collect()
}

/// Bounds the response times under global EDF, in whole units of time and in the order given: down
/// from deadlines and periods. `None` as [`waiting_fp`].
#[must_use]
pub fn waiting_edf(tasks: &[&Task], cores: u32, form: WaitingForm) -> Option<Vec<u64>> {
    let mut set = in_units(tasks, cores, form)?;
    set.deadlines_limit = true;
    set.down_from_deadlines(|_, _| true)
}

fn in_units<'a>(tasks: &'a [&Task], cores: u32, form: WaitingForm) -> Option<EquationSet<'a>> {
    let mut set = (cores > 0).then(|| EquationSet::new(tasks, cores))?;
    (set.rounding, set.waits) = (Rounding::Down, Some(&ANALYSIS));
    set.keep_cores = form == WaitingForm::NonPreemptive;
    set.clip = match form {
        WaitingForm::Best => InterferenceBound::Waiting,
        WaitingForm::OnePath | WaitingForm::NonPreemptive => InterferenceBound::Window,
    };
    for ((task, shape), figures) in (tasks.iter()).zip(&mut set.shapes).zip(&mut set.figures) {
        figures.allow_in_flight(1);
        // Only covers round up, so that they count as less than a core more.
        let by_covers = shape.left.iter_mut();
        (1..=u64::from(cores))
            .rev()
            .zip(by_covers)
            .for_each(|(free, left)| *left = left.saturating_add(free - 1));
        lower(&mut shape.left, &reserved(task, cores));
        if form != WaitingForm::Best {
            shape.left.truncate(1);
        }
    }
    Some(set)
}

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
            Self::Up => sum,
            Self::Down => sum.saturating_sub(cores - 1),
        }
    }

    /// Divides what so many cores are to execute.
    pub(super) const fn divide(self, left: u64, cores: u64) -> u64 {
        match self {
            Self::Up => left.div_ceil(cores),
            Self::Down => left / cores,
        }
    }
}

/// Returns what is left of a job for `m`, `m - 1`, .. cores while its path is ready and does not
/// execute, by the best form for each; the covers are those of the oblivious task.
pub(super) fn beside_span(task: &Task, covers: &[u64], cores: u32) -> Vec<u64> {
    let volume_ns = task.oblivious().volume_ns();
    let mut left: Vec<u64> = covers.iter().map(|cover| volume_ns - cover).collect();
    // Without waits the others are no better.
    if let Some(analysis) = task.analysis() {
        (analysis.reserve)(&mut left, task, cores);
    }
    left
}

/// Lowers what is left to what reserved chains give.
fn lower(left: &mut Vec<u64>, reserved: &[ReservedChains]) {
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
    free: u128,
    /// The most of `volume - c(P or U)`, and the excess of `P` over the span on each free core,
    /// over all paths `P`.
    left: u128,
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
fn with_blocking(task: &Task, cores: u32, blocking: &Blocking) -> u128 {
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

#[cfg(test)]
mod tests {
    use super::{AloneBounds, WaitingForm, alone_forms, waiting_edf, waiting_fp};
    use crate::analysis::{SubtaskWaits, Task, multi_path};

    /// A task of subtasks with segments and the limits between them, in turn.
    fn task(period: u64, deadline: u64, subtasks: &[&[u64]], edges: &[(usize, usize)]) -> Task {
        let segments = |times: &'_ &[u64]| times.iter().copied().step_by(2).collect::<Vec<_>>();
        let waits = subtasks.iter().map(|times| SubtaskWaits {
            count: u32::try_from(times.len() / 2).unwrap(),
            limits_ns: times.iter().skip(1).step_by(2).sum(),
            longest_segment_ns: segments(times).into_iter().max().unwrap(),
        });
        let wcets = subtasks.iter().map(|times| segments(times).iter().sum());
        let task = Task::new(period, deadline, wcets.collect(), edges).unwrap();
        task.with_waits(waits.collect()).unwrap()
    }

    #[test]
    fn each_form_has_its_own_bound_of_a_job_alone() {
        let edges = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let one = task(99, 99, &[&[1], &[3, 4, 1], &[5], &[1]], &edges);
        let bounds = AloneBounds {
            one_path_ns: 12,
            reserved_ns: 11,
            oblivious_ns: 10,
        };
        assert_eq!((one.span_ns(), one.length_ns()), (10, 7));
        assert_eq!(alone_forms(&one, 2), Some(bounds));
        // At any instant of real time: the least of 12.5, 11 and 10, rounded up.
        assert_eq!(multi_path(&one, 2), Some(10));
        assert_eq!((alone_forms(&one, 0), multi_path(&one, 0)), (None, None));
    }

    #[test]
    fn real_time_rounds_up() {
        let one = task(99, 99, &[&[1, 9, 1], &[2], &[3]], &[]);
        // Two cores: max_P of 11 + (7 - 2) / 2, and 11 + (7 - 5) / 1 with one chain reserved.
        assert_eq!(alone_forms(&one, 2).unwrap().one_path_ns, 13);
        assert_eq!(alone_forms(&one, 2).unwrap().reserved_ns, 13);
        assert_eq!(multi_path(&one, 2), Some(13));
    }

    #[test]
    fn each_wait_may_be_blocked_again() {
        // E4: two cores, no wait; blocked at the release by two and at each end by one.
        let high = task(100, 100, &[&[1], &[1], &[1]], &[(0, 1), (1, 2)]);
        let low = task(100, 100, &[&[3], &[3], &[2]], &[]);
        let bounds = |high: &Task| waiting_fp(&[high, &low], 2, WaitingForm::NonPreemptive);
        let of_e4 = bounds(&high).unwrap()[0];
        let waiting = task(100, 100, &[&[1], &[1, 0, 1], &[1]], &[(0, 1), (1, 2)]);
        // One more unit of execution, and two lower ones after the wait.
        let with_wait = bounds(&waiting).unwrap()[0];
        assert_eq!((of_e4, with_wait), (9, 13));
    }

    #[test]
    fn later_deadlines_alone_do_not_bound_the_blocking_under_edf() {
        let waiting = task(40, 21, &[&[1, 8, 1], &[1]], &[(1, 0)]);
        let short = task(12, 20, &[&[3]], &[]);
        let bounds = waiting_edf(&[&waiting, &short], 1, WaitingForm::NonPreemptive);
        assert_eq!(bounds.unwrap()[0], 20);
    }
}
