//! The verdict at commit: from cheap to costly, the first test that is sound.
//!
//! [`answer`] looks at what is certain (missing WCETs, a path longer than the
//! deadline, a subtask longer than the period, more work than cores), then
//! solves the response-time equations of the set, and finally asks the
//! capacity tests about what those leave open; these give only the
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
//!   jobs with a deadline no later are counted: a subtask that waits is due no later than
//!   its job, so what wins over it is, too. Where sinks have deadlines of their own, a job
//!   counts as soon as the first of its deadlines is no later.
//! - *No preemption at all.* Lower-ranked subtasks block besides; those of
//!   DAGs that count in full are counted already.
//! - *Preemption for some subtasks and not for others.* A subtask preempted
//!   again and again may find other non-preemptible ones each time, which the
//!   blocking term does not cover. Then every other DAG counts in full, in
//!   whatever order: true of any work-conserving scheduler.
//! - *One core.* There are exact tests, with what keeps the core as blocking (see `one_core`).
//!   Under static priorities they come first, under EDF last, as they give only the deadline.
//! - *Alone.* A DAG that nothing may outrank or block, and whose bound is
//!   within its period, may have a shorter one by its subtasks' priorities.
//!
//! If a younger job may win over an older one of the same DAG (unequal
//! priorities inside, or no preemption), the equation counts younger jobs too.
//! A response time beyond `in_flight` periods would meet the overrun policy;
//! it does not count as proven.
//!
//! A DAG that cannot be analysed, because it lacks a WCET for example, takes
//! those with it that it may delay, directly or through others. What is left
//! is analysed without it: whatever it does, it cannot delay these.

mod analysable;
pub(super) mod one_core;
pub(super) mod sinks;

use alloc::vec;
use alloc::vec::Vec;

use analysable::{analysable, first_unknown};

use super::answer::{Answer, DagBound, NotProven, Reason, Settings, Test};
use super::bursts::Bursts;
use super::intra_task::intra_task;
use super::multi_path;
use super::pipelined::Unsolved;
use super::ratio::Ratio;
use super::relation::{Mixture, Relation};
use super::set::{Failure, Set, constrained};
use super::task::Task;
use super::utilisation::{bonifaci_dm, bonifaci_edf, gedf_capacity, grm_capacity};
use super::width::SUBTASK_LIMIT;
use crate::ids::{DagId, SubtaskId, to_u32};
use crate::order::sorted_by_key;
use crate::policy::Policy;
use crate::task_set::{Dag, TaskSet};

/// Bounds the response time of every DAG, as far as a test proves it.
///
/// Clusters share no core, so each is a case of its own. A signal from one to another needs
/// no term: a sporadic DAG counts as if signals came as fast as they may.
#[must_use]
pub fn answer(task_set: &TaskSet, settings: &Settings) -> Answer {
    let dags = task_set.dags();
    let unknown = dags.iter().map(|dag| vec![None; dag.sinks().len()]);
    let mut answer = Answer {
        bounds: vec![None; dags.len()],
        sinks_ns: unknown.collect(),
        reasons: vec![None; dags.len()],
        first_failing: None,
    };
    for cluster in task_set.clusters() {
        let own = (0..dags.len()).filter(|&dag| dags[dag].cluster() == cluster);
        let own: Vec<usize> = own.collect();
        let settings = Settings {
            cores: to_u32(task_set.cores_of(cluster, settings.cores).len()),
            ..*settings
        };
        let first_failing = &mut answer.first_failing;
        with_case(
            dags,
            &own,
            &settings,
            &mut answer.reasons,
            |case, reasons| {
                let mut verdict = case.verdict();
                sinks::bound(case, &mut verdict, &mut answer.sinks_ns);
                let first = first_unknown(&own, reasons).or(verdict.first_failing);
                *first_failing = first_failing.or(first);
                for (position, &dag) in case.members.iter().enumerate() {
                    answer.bounds[dag] = verdict.bounds[position];
                    reasons[dag] = verdict.reasons[position];
                }
            },
        );
    }
    answer
}

/// Makes the case of those DAGs at the positions `own` that can be analysed, and notes why
/// others of these cannot be. There are no other DAGs on the cores of the settings.
pub(super) fn with_case(
    dags: &[Dag],
    own: &[usize],
    settings: &Settings,
    reasons: &mut [Option<Reason>],
    work: impl FnOnce(&Case<'_>, &mut [Option<Reason>]),
) {
    let relation = Relation::new(dags, own, settings.policy, settings.preemption);
    let tasks = analysable(dags, own, &relation, settings, reasons);
    let can_be = |dag: &usize| reasons[*dag].is_none();
    let members: Vec<usize> = own.iter().copied().filter(can_be).collect();
    let tasks: Vec<&Task> = members
        .iter()
        .filter_map(|&dag| tasks[dag].as_ref())
        .collect();
    let relation = relation.among(&members);
    let case = Case::new(dags, own, (&members, &tasks), relation, settings);
    work(&case, reasons);
}

/// The DAGs that can be analysed, and what follows from their attributes.
pub(super) struct Case<'a> {
    /// All DAGs of the commit.
    all: &'a [Dag],
    /// Whether no other DAG is on these cores, one that cannot be analysed either.
    is_only_one: bool,
    /// Those of this case; elsewhere a DAG is a position in this list.
    pub(super) members: &'a [usize],
    pub(super) tasks: &'a [&'a Task],
    pub(super) settings: &'a Settings,
    pub(super) relation: Relation,
    /// The most urgent DAG first.
    order: Vec<usize>,
    pub(super) set: Set<'a>,
}

impl<'a> Case<'a> {
    fn new(
        all: &'a [Dag],
        own: &[usize],
        (members, tasks): (&'a [usize], &'a [&'a Task]),
        relation: Relation,
        settings: &'a Settings,
    ) -> Self {
        let order = sorted_by_key(members.len(), |dag| match settings.policy {
            Policy::StaticPriority => u64::from(relation.ranks(dag)[0].0),
            Policy::Edf => tasks[dag].relative_deadline_ns(),
        });
        let mut case = Self {
            all,
            is_only_one: own.len() == 1,
            members,
            tasks,
            settings,
            relation,
            order,
            set: Set::new(tasks, settings.cores),
        };
        case.set.bursts = Bursts::of(own.iter().map(|&dag| &all[dag]), settings);
        case.complete();
        case
    }

    pub(super) fn dag(&self, dag: usize) -> &'a Dag {
        &self.all[self.members[dag]]
    }

    pub(super) fn id(&self, dag: usize) -> DagId {
        dag_id(self.members[dag])
    }

    /// Answers for the jobs of the DAGs of this case, by their positions in it; names
    /// them by their positions in the commit.
    pub(super) fn verdict(&self) -> Answer {
        let may_outrank = |other, dag| self.relation.may_outrank(other, dag);
        let solution = self.set.solve(&self.order, may_outrank);
        let mut bounds: Vec<Option<DagBound>> = (solution.responses.iter().enumerate())
            .map(|(dag, response)| response.map(|bound_ns| self.bound(dag, bound_ns)))
            .collect();
        let demand = || one_core::are_in_time(self).then_some(Test::Demand);
        if bounds.iter().any(Option::is_none)
            && let Some(test) = self.vouching_test().or_else(demand)
        {
            for (bound, task) in bounds.iter_mut().zip(self.tasks) {
                bound.get_or_insert(DagBound {
                    bound_ns: task.relative_deadline_ns(),
                    test,
                });
            }
        }
        let mut reasons: Vec<Option<Reason>> = (bounds.iter().enumerate())
            .map(|(dag, bound)| match bound {
                Some(_) => None,
                None => solution.failures[dag].map(|failure| self.reason(dag, failure)),
            })
            .collect();
        let mut first = solution.first_failing.map(|(dag, _)| dag);
        if reasons.iter().any(Option::is_some) {
            for (dag, reason) in self.certain().into_iter().rev() {
                if bounds[dag].is_none() {
                    reasons[dag] = Some(reason);
                    first = Some(dag);
                }
            }
        }
        let first_failing = first.and_then(|dag| {
            let reason = reasons[dag]?;
            let dag = self.id(dag);
            Some(NotProven { dag, reason })
        });
        Answer {
            bounds,
            sinks_ns: Vec::new(),
            reasons,
            first_failing,
        }
    }

    /// Reports whether a DAG has all cores whenever it needs them.
    fn is_alone(&self, dag: usize) -> bool {
        let blocked = self.relation.preemption != Mixture::All && !self.is_only_one;
        let mut others = 0..self.members.len();
        !blocked && !others.any(|other| self.relation.may_outrank(other, dag))
    }

    /// Bounds the response time of a DAG by its subtasks' priorities, if nothing can delay it
    /// and that is the shortest bound.
    fn by_priorities(&self, dag: usize) -> Option<u64> {
        let (task, cores) = (self.tasks[dag], self.settings.cores);
        let subtasks = self.dag(dag).subtasks();
        if self.relation.preemption != Mixture::All
            || self.settings.policy != Policy::StaticPriority
            || subtasks.len() > SUBTASK_LIMIT
            || !self.is_alone(dag)
        {
            return None;
        }
        let order = sorted_by_key(subtasks.len(), |subtask| subtasks[subtask].priority().0);
        let covers = &self.set.shapes[dag].covers;
        let others = multi_path::alone(task, covers, cores.into())?;
        let limit = task.relative_deadline_ns().min(task.period_ns());
        let bound = intra_task(task, &order, cores).filter(|&bound_ns| bound_ns < others);
        let bound = bound.and_then(|bound_ns| self.set.bursts.after(bound_ns));
        bound.filter(|&bound_ns| bound_ns <= limit)
    }

    /// Tells the equations what follows from the attributes.
    fn complete(&mut self) {
        self.set.keep_cores = self.relation.preemption == Mixture::None;
        self.set.deadlines_limit = self.settings.policy == Policy::Edf
            && self.relation.preemption != Mixture::Some
            && constrained(self.tasks, self.settings.cores);
        for (dag, figures) in self.set.figures.iter_mut().enumerate() {
            figures.younger_may_win = self.relation.younger_may_win(dag);
            figures.allow_in_flight(self.all[self.members[dag]].in_flight());
        }
        self.set.known = match (self.settings.cores, self.settings.policy) {
            (1, Policy::StaticPriority) => one_core::responses(self),
            _ => {
                let dags = 0..self.members.len();
                dags.map(|dag| self.by_priorities(dag)).collect()
            }
        };
    }

    /// Names the test behind a response time of the set's equations.
    fn bound(&self, dag: usize, bound_ns: u64) -> DagBound {
        let test = if self.set.known[dag].is_some() {
            match self.settings.cores {
                1 => Test::OneCore,
                _ => Test::IntraTask,
            }
        } else if bound_ns > self.tasks[dag].period_ns() {
            Test::Pipelined
        } else if self.is_alone(dag) {
            Test::Alone
        } else {
            match (self.relation.preemption, self.settings.policy) {
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
        let applies = self.relation.preemption == Mixture::All
            && !self.relation.ranks_sinks
            && self.set.bursts.are_none();
        if !applies || !constrained(tasks, cores) {
            return None;
        }
        let (capacity, speed_up) = match self.settings.policy {
            Policy::Edf => (gedf_capacity(tasks, cores), bonifaci_edf(tasks, cores)),
            Policy::StaticPriority => {
                let pairs = || self.order.windows(2).map(|pair| (pair[0], pair[1]));
                if pairs().any(|(first, second)| self.relation.may_outrank(second, first)) {
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

    fn reason(&self, dag: usize, failure: Failure) -> Reason {
        let task = self.tasks[dag];
        let in_flight = self.dag(dag).in_flight();
        let room = u128::from(in_flight) * u128::from(task.period_ns());
        match failure {
            Failure::Other(other) => Reason::DelayedBy {
                dag: self.id(other),
            },
            Failure::Own(Unsolved::Limit) => Reason::Limit,
            Failure::Own(Unsolved::BeyondDeadline)
                if room < u128::from(task.relative_deadline_ns()) =>
            {
                Reason::InFlightTooFew { in_flight }
            }
            Failure::Own(Unsolved::BeyondDeadline) => Reason::NoBound,
        }
    }

    /// Reports whether jobs are certain to come; a sporadic DAG's signals may not.
    fn must_keep_up(&self, dag: usize) -> bool {
        !self.dag(dag).is_sporadic()
    }

    /// Finds the DAGs that cannot keep up at WCETs: by urgency those that could
    /// not even alone, then the first at which the cores do not suffice.
    fn certain(&self) -> Vec<(usize, Reason)> {
        let hopeless = |&dag: &usize| {
            let task = self.tasks[dag];
            let length_ns = task.length_ns();
            if length_ns > task.relative_deadline_ns() {
                return Some((dag, Reason::LengthBeyondDeadline { length_ns }));
            }
            if !self.must_keep_up(dag) {
                return None;
            }
            let ids = (0_u32..).map(SubtaskId).zip(task.wcets_ns());
            let mut long = ids.filter(|&(_, &wcet)| wcet > task.period_ns());
            let (subtask, _) = long.next()?;
            Some((dag, Reason::SubtaskBeyondPeriod { subtask }))
        };
        let mut certain: Vec<(usize, Reason)> = self.order.iter().filter_map(hopeless).collect();
        let cores = u128::from(self.settings.cores);
        let mut used = Vec::new();
        for &dag in self.order.iter().filter(|&&dag| self.must_keep_up(dag)) {
            used.push((self.tasks[dag].volume_ns(), self.tasks[dag].period_ns()));
            let Some(sum) = Ratio::sum(used.iter().copied()) else {
                break;
            };
            if !sum.at_most(cores, 1) {
                if certain.iter().all(|&(hopeless, _)| hopeless != dag) {
                    certain.push((dag, Reason::Overload));
                }
                break;
            }
        }
        certain
    }
}

fn dag_id(dag: usize) -> DagId {
    // A task set cannot have more DAGs than ids; this only spells it out.
    DagId(u32::try_from(dag).unwrap_or(u32::MAX))
}
