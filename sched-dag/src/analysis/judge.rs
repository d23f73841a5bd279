//! The verdict at commit: from cheap to costly, the first test that is sound.
//!
//! [`answer`] looks at what is certain (missing WCETs, a path longer than the
//! deadline, a subtask longer than the period, more work than cores), then
//! solves the response-time equations of the set, and finally lets the
//! capacity tests vouch for what those leave open; these give only the
//! deadline as the bound, so they come last although they are the cheapest.
//!
//! What interferes with DAG `k` is decided for each pair of DAGs:
//!
//! - *Static priorities.* DAG `i` may outrank `k` if its most urgent subtask
//!   wins over `k`'s least urgent one (equal priorities: the DAG committed
//!   first wins). Priorities may thus interleave: then two DAGs may outrank
//!   each other and each counts in full for the other. That is safe: while a
//!   subtask of `k` waits, whatever runs on the cores belongs to `k` or wins
//!   over that subtask, so its DAG is among those counted.
//! - *EDF.* Every DAG may outrank every other. If `D <= T` for all DAGs, only
//!   jobs with a deadline no later are counted.
//! - *No preemption at all.* Lower-ranked subtasks block besides; those of
//!   DAGs that count in full are counted already.
//! - *Preemption for some subtasks and not for others.* A subtask preempted
//!   again and again may find other non-preemptible ones each time, which the
//!   blocking term does not cover. Then every other DAG counts in full, in
//!   whatever order: true of any work-conserving scheduler.
//! - *Alone.* A DAG that nothing may outrank or block, and whose bound is
//!   within its period, has the bounds for one job alone.
//!
//! If a younger job may win over an older one of the same DAG (unequal
//! priorities inside, or no preemption), the equation counts younger jobs too.
//! A response time beyond `in_flight` periods would meet the overrun policy;
//! it does not count as proven.

use alloc::vec::Vec;

use super::answer::{Answer, DagBound, NotProven, Reason, Settings, Test};
use super::bonifaci::{bonifaci_dm, bonifaci_edf};
use super::capacity::{gedf_capacity, grm_capacity};
use super::intra_task::intra_task;
use super::long_paths::long_paths_among;
use super::melani::{constrained, widths};
use super::ratio::Ratio;
use super::response::{Blocking, Unsolved};
use super::set::{Set, Solution};
use super::task::{Task, TaskError};
use crate::ids::{DagId, SubtaskId};
use crate::policy::{Policy, Preemption};
use crate::task_set::{Dag, TaskSet};

/// The walks' total of subtasks and edges after which no further long paths
/// are looked for (the first two always are).
const LONG_PATHS_STEPS: usize = 1 << 17;

/// Bounds the response time of every DAG, as far as a test proves it.
#[must_use]
pub fn answer(task_set: &TaskSet, settings: &Settings) -> Answer {
    let dags = task_set.dags();
    let nothing = |dag: usize, reason: Reason| Answer {
        bounds: dags.iter().map(|_| None).collect(),
        first_failing: Some(NotProven {
            dag: dag_id(dag),
            reason,
        }),
    };
    if settings.cores == 0 && !dags.is_empty() {
        return nothing(0, Reason::NoCores);
    }
    let overhead = settings.overheads.of_an_instance_ns(settings.preemption);
    let mut tasks = Vec::with_capacity(dags.len());
    for (index, dag) in dags.iter().enumerate() {
        let task = overhead
            .ok_or(TaskError::VolumeOverflow)
            .and_then(|overhead_ns| Task::from_dag(dag, overhead_ns));
        match task {
            Ok(task) => tasks.push(task),
            Err(error) => return nothing(index, Reason::Unknown(error)),
        }
    }
    let tasks: Vec<&Task> = tasks.iter().collect();
    let case = Case::new(dags, &tasks, settings);
    let solution = case.solve();
    let mut bounds: Vec<Option<DagBound>> = (0..dags.len())
        .map(|dag| solution.responses[dag].map(|bound_ns| case.bound(dag, bound_ns)))
        .collect();
    if let Some(test) = case.vouching_test() {
        for (bound, task) in bounds.iter_mut().zip(&tasks) {
            bound.get_or_insert(DagBound {
                bound_ns: task.relative_deadline_ns(),
                test,
            });
        }
    }
    let first_failing = case.first_failing(&bounds, &solution);
    Answer {
        bounds,
        first_failing,
    }
}

/// The DAGs of a commit and what follows from their attributes.
struct Case<'a> {
    dags: &'a [Dag],
    tasks: &'a [&'a Task],
    settings: &'a Settings,
    /// The most urgent DAG first.
    order: Vec<usize>,
    /// Per DAG the most and the least urgent priority, as numbers.
    priorities: Vec<(u32, u32)>,
    preemption: Mixture,
    /// Bounds of DAGs that nothing can delay.
    alone: Vec<Option<DagBound>>,
}

/// Which subtasks can be preempted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mixture {
    All,
    None,
    Some,
}

impl<'a> Case<'a> {
    fn new(dags: &'a [Dag], tasks: &'a [&'a Task], settings: &'a Settings) -> Self {
        let priorities: Vec<(u32, u32)> = dags.iter().map(priority_range).collect();
        let mut order: Vec<usize> = (0..dags.len()).collect();
        match settings.policy {
            Policy::StaticPriority => order.sort_by_key(|&dag| (priorities[dag].0, dag)),
            Policy::Edf => order.sort_by_key(|&dag| (dags[dag].relative_deadline_ns(), dag)),
        }
        let mut case = Self {
            dags,
            tasks,
            settings,
            order,
            priorities,
            preemption: mixture(dags, settings.preemption),
            alone: Vec::new(),
        };
        case.alone = (0..dags.len()).map(|dag| case.alone(dag)).collect();
        case
    }

    /// Reports whether an instance of `other` may win a core that an instance
    /// of `dag` waits for.
    fn may_outrank(&self, other: usize, dag: usize) -> bool {
        other != dag
            && match (self.settings.policy, self.preemption) {
                (Policy::Edf, _) | (_, Mixture::Some) => true,
                (Policy::StaticPriority, _) => {
                    (self.priorities[other].0, other) < (self.priorities[dag].1, dag)
                }
            }
    }

    /// Bounds the response time of a DAG that nothing else can delay.
    fn alone(&self, dag: usize) -> Option<DagBound> {
        let count = self.dags.len();
        let undisturbed = self.preemption == Mixture::All
            && !(0..count).any(|other| self.may_outrank(other, dag));
        if count > 1 && !undisturbed {
            return None;
        }
        let (task, cores) = (self.tasks[dag], self.settings.cores);
        let steps = (task.subtask_count() + task.edge_count()).max(1);
        let paths = (LONG_PATHS_STEPS / steps).max(2);
        let mut best = DagBound {
            bound_ns: long_paths_among(task, cores, paths)?,
            test: Test::Alone,
        };
        if self.preemption == Mixture::All && self.settings.policy == Policy::StaticPriority {
            let subtasks = self.dags[dag].subtasks();
            let mut order: Vec<usize> = (0..subtasks.len()).collect();
            order.sort_by_key(|&subtask| (subtasks[subtask].priority().0, subtask));
            if let Some(bound_ns) = intra_task(task, &order, cores)
                && bound_ns < best.bound_ns
            {
                best = DagBound {
                    bound_ns,
                    test: Test::IntraTask,
                };
            }
        }
        let limit = task.relative_deadline_ns().min(task.period_ns());
        (best.bound_ns <= limit).then_some(best)
    }

    fn solve(&self) -> Solution {
        let cores = u64::from(self.settings.cores);
        let parallelism = widths(self.tasks, self.settings.cores);
        let mut set = Set::new(self.tasks, cores, &parallelism);
        set.known = self
            .alone
            .iter()
            .map(|bound| bound.map(|bound| bound.bound_ns))
            .collect();
        set.deadlines_limit = self.settings.policy == Policy::Edf
            && self.preemption != Mixture::Some
            && constrained(self.tasks, self.settings.cores);
        let counts_in_full = |other, dag| self.may_outrank(other, dag) && !set.deadlines_limit;
        for (dag, figures) in set.figures.iter_mut().enumerate() {
            let (most, least) = self.priorities[dag];
            let unequal = self.settings.policy == Policy::StaticPriority && most != least;
            figures.younger_may_win = unequal || self.preemption != Mixture::All;
            figures.allow_in_flight(self.dags[dag].in_flight());
            if self.preemption == Mixture::None {
                let others = (0..self.tasks.len()).filter(|&other| other != dag);
                let blocking = others.filter(|&other| !counts_in_full(other, dag));
                let wcets = blocking.flat_map(|other| self.tasks[other].wcets_ns().iter().copied());
                figures.blocking =
                    Blocking::by(wcets.collect(), self.settings.cores, self.tasks[dag]);
            }
        }
        set.solve(&self.order, |other, dag| self.may_outrank(other, dag))
    }

    /// Names the test behind a response time of the set's equations.
    fn bound(&self, dag: usize, bound_ns: u64) -> DagBound {
        if let Some(alone) = self.alone[dag] {
            return alone;
        }
        let test = if !constrained(self.tasks, self.settings.cores) {
            Test::Pipelined
        } else {
            match (self.preemption, self.settings.policy) {
                (Mixture::Some, _) => Test::AnyOrder,
                (Mixture::None, _) => Test::NonPreemptive,
                (Mixture::All, Policy::StaticPriority) => Test::FixedPriority,
                (Mixture::All, Policy::Edf) => Test::Edf,
            }
        };
        DagBound { bound_ns, test }
    }

    /// Returns the utilisation test that accepts the whole set, if one does.
    fn vouching_test(&self) -> Option<Test> {
        let (tasks, cores) = (self.tasks, self.settings.cores);
        if self.preemption != Mixture::All || !constrained(tasks, cores) {
            return None;
        }
        let (capacity, speed_up) = match self.settings.policy {
            Policy::Edf => (gedf_capacity(tasks, cores), bonifaci_edf(tasks, cores)),
            Policy::StaticPriority => {
                let pairs = || self.order.windows(2).map(|pair| (pair[0], pair[1]));
                if pairs().any(|(first, second)| self.may_outrank(second, first)) {
                    return None;
                }
                let by = |time: fn(&Task) -> u64| {
                    pairs().all(|(first, second)| time(tasks[first]) <= time(tasks[second]))
                };
                let monotonic = by(Task::period_ns).then(|| grm_capacity(tasks, cores));
                let speed_up = by(Task::relative_deadline_ns) && bonifaci_dm(tasks, cores);
                (monotonic.flatten(), speed_up)
            }
        };
        match (capacity, speed_up) {
            (Some(true), _) => Some(Test::Capacity),
            (_, true) => Some(Test::SpeedUp),
            _ => None,
        }
    }

    /// Finds the first DAG without a bound: one that is certain to miss, else
    /// the first at which the equations failed.
    fn first_failing(&self, bounds: &[Option<DagBound>], solution: &Solution) -> Option<NotProven> {
        let any_open = bounds.iter().any(Option::is_none);
        let (dag, reason) = match solution.first_failing {
            _ if !any_open => return None,
            Some((dag, why)) => (dag, self.reason(dag, why)),
            None => return None,
        };
        let (dag, reason) = self.certain().unwrap_or((dag, reason));
        Some(NotProven {
            dag: dag_id(dag),
            reason,
        })
    }

    fn reason(&self, dag: usize, why: Unsolved) -> Reason {
        let task = self.tasks[dag];
        let in_flight = self.dags[dag].in_flight();
        let room = u128::from(in_flight) * u128::from(task.period_ns());
        match why {
            Unsolved::Limit => Reason::Limit,
            Unsolved::BeyondDeadline if room < u128::from(task.relative_deadline_ns()) => {
                Reason::InFlightTooFew { in_flight }
            }
            Unsolved::BeyondDeadline => Reason::NoBound,
        }
    }

    /// Finds the first DAG, by urgency, that cannot keep up at WCETs.
    fn certain(&self) -> Option<(usize, Reason)> {
        for &dag in &self.order {
            let task = self.tasks[dag];
            let length_ns = task.length_ns();
            if length_ns > task.relative_deadline_ns() {
                return Some((dag, Reason::LengthBeyondDeadline { length_ns }));
            }
            let ids = (0_u32..).map(SubtaskId).zip(task.wcets_ns());
            let mut long = ids.filter(|&(_, &wcet)| wcet > task.period_ns());
            if let Some((subtask, _)) = long.next() {
                return Some((dag, Reason::SubtaskBeyondPeriod { subtask }));
            }
        }
        let cores = u128::from(self.settings.cores);
        let mut used = Vec::new();
        for &dag in &self.order {
            used.push((self.tasks[dag].volume_ns(), self.tasks[dag].period_ns()));
            let sum = Ratio::sum(used.iter().copied())?;
            if !sum.at_most(cores, 1) {
                return Some((dag, Reason::Overload));
            }
        }
        None
    }
}

fn priority_range(dag: &Dag) -> (u32, u32) {
    let numbers = || dag.subtasks().iter().map(|subtask| subtask.priority().0);
    (numbers().min().unwrap_or(0), numbers().max().unwrap_or(0))
}

fn mixture(dags: &[Dag], preemption: Preemption) -> Mixture {
    let mut subtasks = dags.iter().flat_map(Dag::subtasks);
    let keeps = |non_preemptive: bool| non_preemptive || preemption == Preemption::Disabled;
    let Some(first) = subtasks
        .next()
        .map(|first| keeps(first.is_non_preemptive()))
    else {
        return Mixture::All;
    };
    if subtasks.any(|other| keeps(other.is_non_preemptive()) != first) {
        Mixture::Some
    } else if first {
        Mixture::None
    } else {
        Mixture::All
    }
}

fn dag_id(dag: usize) -> DagId {
    // A task set cannot have more DAGs than ids; this only spells it out.
    DagId(u32::try_from(dag).unwrap_or(u32::MAX))
}
