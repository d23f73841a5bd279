//! The cases of a commit: the DAGs of a cluster that can be analysed, and what follows from their
//! attributes.
//!
//! A DAG that cannot be analysed, because it lacks a WCET for example, takes
//! those with it that it may delay, directly or through others. What is left
//! is analysed without it: whatever it does, it cannot delay these.

use alloc::vec;
use alloc::vec::Vec;

use super::intra_task::{SUBTASK_LIMIT, intra_task};
use super::one_core::{DagDemand, DueDemand, ResponseEquation, demand};
use super::ranks::{PreemptionMix, RankRelation};
use super::set::{EquationSet, EvaluationBudget, constrained};
use super::task::{Task, TaskError};
use super::waiting::Rounding;
use super::workload::WorkloadBursts;
use super::{AnalysisSettings, DagBound, NotProvenReason, multi_path};
use crate::ids::DagId;
use crate::order::sorted_by_key;
use crate::policy::{Policy, Preemption};
use crate::spec::PINS;
use crate::task_set::Dag;

/// Makes the case of those DAGs at the positions `own` that can be analysed, and notes why
/// others of these cannot be. There are no other DAGs on the cores of the settings.
pub(super) fn with_case(
    dags: &[Dag],
    own: &[usize],
    settings: &AnalysisSettings,
    reasons: &mut [Option<NotProvenReason>],
    work: impl FnOnce(&AnalysisInput<'_>, &mut [Option<NotProvenReason>]),
) {
    let relation = RankRelation::new(dags, own, settings.policy, settings.preemption);
    let tasks = analysable(dags, own, &relation, settings, reasons);
    let can_be = |dag: &usize| reasons[*dag].is_none();
    let members: Vec<usize> = own.iter().copied().filter(can_be).collect();
    let tasks: Vec<&Task> = members
        .iter()
        .filter_map(|&dag| tasks[dag].as_ref())
        .collect();
    let relation = relation.among(&members);
    let case = AnalysisInput::new(dags, own, (&members, &tasks), relation, settings);
    work(&case, reasons);
}

/// Reports whether cores of a cluster with these DAGs are told apart.
fn is_pinned<'a>(mut dags: impl Iterator<Item = &'a Dag>) -> bool {
    PINS && dags.any(Dag::is_confined)
}

/// Returns the settings for a cluster of so many cores, with these DAGs.
pub(super) fn of_cluster<'a>(
    settings: &AnalysisSettings,
    cores: u32,
    dags: impl Iterator<Item = &'a Dag>,
) -> AnalysisSettings {
    AnalysisSettings {
        cores,
        overheads: settings.overheads.among(dags),
        ..*settings
    }
}

/// By DAG of a case, its bound or why it has none; and the first that has none for a reason of its
/// own.
pub(super) type CaseBounds = (
    Vec<Option<DagBound>>,
    Vec<Option<NotProvenReason>>,
    Option<usize>,
);

/// The DAGs that can be analysed, and what follows from their attributes.
pub(super) struct AnalysisInput<'a> {
    /// All DAGs of the commit.
    all: &'a [Dag],
    /// Whether no other DAG is on these cores, one that cannot be analysed either.
    is_only_one: bool,
    /// Those of this case; elsewhere a DAG is a position in this list.
    pub(super) members: &'a [usize],
    pub(super) tasks: &'a [&'a Task],
    pub(super) settings: &'a AnalysisSettings,
    pub(super) relation: RankRelation,
    /// The most urgent DAG first.
    pub(super) order: Vec<usize>,
    pub(super) set: EquationSet<'a>,
    is_pinned: bool,
}

impl<'a> AnalysisInput<'a> {
    fn new(
        all: &'a [Dag],
        own: &[usize],
        (members, tasks): (&'a [usize], &'a [&'a Task]),
        relation: RankRelation,
        settings: &'a AnalysisSettings,
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
            set: EquationSet::new(tasks, settings.cores),
            is_pinned: is_pinned(own.iter().map(|&dag| &all[dag])),
        };
        let own = own.iter().map(|&dag| &all[dag]);
        case.set.bursts = WorkloadBursts::of(own, settings);
        if !case.is_pinned() {
            case.complete();
        }
        case
    }

    /// Reports whether cores of the cluster are told apart; then no equation of the set is asked.
    pub(super) const fn is_pinned(&self) -> bool {
        PINS && self.is_pinned
    }

    pub(super) fn dag(&self, dag: usize) -> &'a Dag {
        &self.all[self.members[dag]]
    }

    pub(super) fn id(&self, dag: usize) -> DagId {
        dag_id(self.members[dag])
    }

    /// Reports whether a DAG has all cores whenever it needs them.
    pub(super) fn is_alone(&self, dag: usize) -> bool {
        let blocked = self.relation.preemption != PreemptionMix::All && !self.is_only_one;
        let mut others = 0..self.members.len();
        !blocked && !others.any(|other| self.relation.may_outrank(other, dag))
    }

    /// Bounds the response time of a DAG by its subtasks' priorities, if nothing can delay it
    /// and that is the shortest bound.
    fn by_priorities(&self, dag: usize) -> Option<u64> {
        let (task, cores) = (self.tasks[dag], self.settings.cores);
        let subtasks = self.dag(dag).subtasks();
        if self.set.waits_enter(dag)
            || self.relation.preemption != PreemptionMix::All
            || self.settings.policy != Policy::StaticPriority
            || subtasks.len() > SUBTASK_LIMIT
            || !self.is_alone(dag)
        {
            return None;
        }
        let order = sorted_by_key(subtasks.len(), |subtask| subtasks[subtask].priority().0);
        let others = multi_path::alone(task, &self.set.shapes[dag].left, cores, Rounding::Up)?;
        let limit = task.relative_deadline_ns().min(task.period_ns());
        let bound = intra_task(task, &order, cores).filter(|&bound_ns| bound_ns < others);
        // Long steps of the scheduler are in no equation of this test, so they are added to it.
        let bound = bound.and_then(|bound_ns| self.set.bursts.after(bound_ns));
        bound.filter(|&bound_ns| bound_ns <= limit)
    }

    /// Tells the equations what follows from the attributes.
    fn complete(&mut self) {
        self.set.keep_cores = self.relation.preemption == PreemptionMix::None;
        self.set.deadlines_limit = self.settings.policy == Policy::Edf
            && self.relation.preemption != PreemptionMix::Some
            && constrained(self.tasks, self.settings.cores);
        for (dag, figures) in self.set.figures.iter_mut().enumerate() {
            figures.younger_may_win = self.relation.younger_may_win(dag);
            figures.allow_in_flight(self.all[self.members[dag]].in_flight());
        }
        if self.set.has_waits() {
            let tasks = self.tasks;
            let with_waits = self.relation.closure(&|dag| tasks[dag].has_waits());
            self.set.forbid_overlap(with_waits);
        }
        self.set.known = match (self.settings.cores, self.settings.policy) {
            (1, Policy::StaticPriority) => responses(self),
            _ => {
                let dags = 0..self.members.len();
                dags.map(|dag| self.by_priorities(dag)).collect()
            }
        };
    }
}

pub(super) fn dag_id(dag: usize) -> DagId {
    // A task set cannot have more DAGs than ids; this only spells it out.
    DagId(u32::try_from(dag).unwrap_or(u32::MAX))
}

/// Returns the DAGs at the positions `own` as the analysis sees them, and notes for each that
/// cannot be analysed the reason: its own, or that it may have to wait for such a one.
fn analysable(
    dags: &[Dag],
    own: &[usize],
    relation: &RankRelation,
    settings: &AnalysisSettings,
    reasons: &mut [Option<NotProvenReason>],
) -> Vec<Option<Task>> {
    let overhead = settings.overheads.of_an_instance_ns(settings.preemption);
    let mut tasks: Vec<Option<Task>> = dags.iter().map(|_| None).collect();
    for &dag in own {
        let task = overhead
            .ok_or(TaskError::VolumeOverflow)
            .and_then(|overhead_ns| Task::from_dag(&dags[dag], overhead_ns));
        reasons[dag] = match &task {
            _ if settings.cores == 0 => Some(NotProvenReason::NoCores),
            Ok(_) => None,
            Err(error) => Some(NotProvenReason::Unknown(*error)),
        };
        tasks[dag] = task.ok();
    }
    let (mut known, mut unknown): (Vec<usize>, Vec<usize>) =
        own.iter().partition(|&&dag| reasons[dag].is_none());
    let mut seen = 0;
    // Until nothing more follows: what is delayed by an unknown DAG is unknown, too.
    while let Some(&other) = unknown.get(seen) {
        seen += 1;
        known.retain(|&dag| {
            // What is pinned goes before all that is not.
            let is_pinned = dags[other].is_pinned();
            let is_delayed = is_pinned || relation.may_delay(other, dag);
            if is_delayed {
                reasons[dag] = Some(NotProvenReason::DelayedBy { dag: dag_id(other) });
                unknown.push(dag);
            }
            !is_delayed
        });
    }
    tasks
}

/// Returns the DAGs of a case as their response times on one core need them.
pub(super) fn loads(case: &AnalysisInput<'_>) -> Vec<DagDemand> {
    let loads = case.tasks.iter().enumerate().map(|(dag, task)| DagDemand {
        volume_ns: task.volume_ns(),
        period_ns: task.period_ns(),
        limit_ns: case.set.figures[dag].limit_ns(),
        priorities: case.relation.ranks(dag),
        keeps_ns: dues(case, dag)
            .iter()
            .map(|due| due.keeps_ns)
            .max()
            .unwrap_or(0),
    });
    loads.collect()
}

/// Bounds the response times of DAGs that something may delay, where all that may delay them
/// keep their own.
fn responses(case: &AnalysisInput<'_>) -> Vec<Option<u64>> {
    let loads = loads(case);
    let (loads, bursts) = (&loads, &case.set.bursts);
    let (mut steps, mut found) = (EvaluationBudget::of(loads.len()), vec![None; loads.len()]);
    for &dag in &case.order {
        found[dag] = steps.spend(dag, |steps| {
            ResponseEquation::of(loads, bursts, dag).solve(steps)
        });
    }
    let known = (0..loads.len()).map(|dag| {
        if case.set.waits_enter(dag) {
            return None;
        }
        let others = ResponseEquation::of(loads, bursts, dag).others;
        let are_known = others.iter().all(|&other| found[other].is_some());
        found[dag].filter(|_| are_known && !case.is_alone(dag))
    });
    known.collect()
}

/// Reports whether each subtask is finished by its deadline, under EDF.
pub(super) fn are_in_time(case: &AnalysisInput<'_>) -> bool {
    let fit =
        |dag: usize| case.set.figures[dag].limit_ns() == case.tasks[dag].relative_deadline_ns();
    let applies = case.settings.cores == 1 && case.settings.policy == Policy::Edf;
    applies
        && !case.set.has_waits()
        && (0..case.tasks.len()).all(fit)
        && demand(&all_dues(case), &case.set.bursts).is_some()
}

/// Returns the demands of all DAGs.
pub(super) fn all_dues(case: &AnalysisInput<'_>) -> Vec<DueDemand> {
    (0..case.tasks.len())
        .flat_map(|dag| dues(case, dag))
        .collect()
}

/// Returns the demands of a DAG, by deadlines.
fn dues(case: &AnalysisInput<'_>, dag: usize) -> Vec<DueDemand> {
    let (task, subtasks) = (case.tasks[dag], case.dag(dag).subtasks());
    let mut dues: Vec<DueDemand> = Vec::new();
    for (subtask, &wcet_ns) in subtasks.iter().zip(task.wcets_ns()) {
        let deadline_ns = subtask.relative_deadline_ns();
        let known = dues.iter().position(|due| due.deadline_ns == deadline_ns);
        let place = known.unwrap_or(dues.len());
        if known.is_none() {
            dues.push(DueDemand {
                deadline_ns,
                period_ns: task.period_ns(),
                volume_ns: 0,
                keeps_ns: 0,
            });
        }
        let due = &mut dues[place];
        due.volume_ns += wcet_ns;
        if subtask.is_non_preemptive() || case.settings.preemption == Preemption::Disabled {
            due.keeps_ns = due.keeps_ns.max(wcet_ns);
        }
    }
    dues
}
