//! The cases of a commit: the DAGs of a cluster that can be analysed, and what follows from their
//! attributes.
//!
//! A DAG that cannot be analysed, because it lacks a WCET for example, takes
//! those with it that it may delay, directly or through others. What is left
//! is analysed without it: whatever it does, it cannot delay these.

use alloc::vec;
use alloc::vec::Vec;

use super::features::Features;
use super::ranks::{InstanceOrder, PreemptionMix, RankRelation};
use super::set::{EquationSet, constrained};
use super::task::{Task, TaskError};
use super::workload::WorkloadBursts;
use super::{AnalysisResult, AnalysisSettings, NotProvenReason};
use crate::ids::{DagId, SubtaskId, to_u32};
use crate::order::sorted_by_key;
use crate::policy::Preemption;
use crate::task_set::{Dag, Subtask};

/// Makes the case of those DAGs at the positions `own` that can be analysed, and notes why
/// others of these cannot be. There are no other DAGs on the cores of the settings.
pub(super) fn with_case(
    dags: &[Dag],
    own: &[usize],
    settings: &AnalysisSettings,
    reasons: &mut [Option<NotProvenReason>],
    work: impl FnOnce(&AnalysisInput<'_>, AnalysisResult, &mut [Option<NotProvenReason>]),
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
    let mut case = AnalysisInput::new(dags, own, (&members, &tasks), relation, settings);
    let verdict = case.settle();
    work(&case, verdict, reasons);
}

/// Reports whether cores of a cluster with these DAGs are told apart.
fn is_pinned<'a>(mut dags: impl Iterator<Item = &'a Dag>) -> bool {
    dags.any(Dag::is_confined)
}

/// Returns the settings for a cluster of so many cores, with these DAGs.
pub(super) fn of_cluster(
    settings: &AnalysisSettings,
    cores: u32,
    dags: &mut dyn Iterator<Item = &Dag>,
) -> AnalysisSettings {
    AnalysisSettings {
        cores,
        overheads: settings.overheads.among(dags, settings.cores),
        ..*settings
    }
}

/// The DAGs that can be analysed, and what follows from their attributes.
pub(super) struct AnalysisInput<'a> {
    /// All DAGs of the commit.
    all: &'a [Dag],
    /// The positions of those on these cores, also of those that cannot be analysed.
    own: &'a [usize],
    /// Those of this case; elsewhere a DAG is a position in this list.
    pub(super) members: &'a [usize],
    pub(super) tasks: &'a [&'a Task],
    pub(super) settings: &'a AnalysisSettings,
    pub(super) relation: RankRelation,
    /// The most urgent DAG first.
    pub(super) order: Vec<usize>,
    pub(super) set: EquationSet<'a>,
    is_pinned: bool,
    /// By DAG, the features that enter it: its own, and those of all that may delay it.
    pub(super) entering: Vec<Features>,
}

impl<'a> AnalysisInput<'a> {
    fn new(
        all: &'a [Dag],
        own: &'a [usize],
        (members, tasks): (&'a [usize], &'a [&'a Task]),
        relation: RankRelation,
        settings: &'a AnalysisSettings,
    ) -> Self {
        let order = sorted_by_key(members.len(), |dag| match relation.order {
            InstanceOrder::Ranked => relation.ranks(dag)[0].0,
            _ => tasks[dag].relative_deadline_ns(),
        });
        let mut case = Self {
            all,
            own,
            members,
            tasks,
            settings,
            relation,
            order,
            set: EquationSet::new(tasks, settings.cores),
            is_pinned: is_pinned(own.iter().map(|&dag| &all[dag])),
            entering: Vec::new(),
        };
        case.set.bursts = case.bursts(|_| false);
        case.entering = case.features();
        case.complete();
        case
    }

    /// Returns the bursts of the DAGs of the commit on these cores, some of which may fall behind.
    fn bursts(&self, fall_behind: impl Fn(usize) -> bool) -> WorkloadBursts {
        let own = self.own.iter();
        let own = own.map(|&dag| (&self.all[dag], fall_behind(dag)));
        WorkloadBursts::of(own, self.settings)
    }

    /// Answers, and lets those fall behind that have no bound, until the bounds of the others rest on
    /// no such one.
    fn settle(&mut self) -> AnalysisResult {
        let mut has_bound = vec![false; self.all.len()];
        for &dag in self.members {
            has_bound[dag] = true;
        }
        loop {
            let mut verdict = self.verdict();
            for (&dag, bound) in self.members.iter().zip(&verdict.bounds) {
                has_bound[dag] &= bound.is_some();
            }
            let bursts = self.bursts(|dag| !has_bound[dag]);
            let is_settled = bursts == self.set.bursts;
            self.set.bursts = bursts;
            if let Some(place) = self.set.bursts.endless {
                let dag = dag_id(self.own[place]);
                verdict.refuse(NotProvenReason::BesideBacklog { dag });
                return verdict;
            }
            if is_settled {
                return verdict;
            }
        }
    }

    /// Returns by DAG the features that enter it.
    fn features(&self) -> Vec<Features> {
        let is_pinned = self.is_pinned();
        let (settings, relation) = (self.settings, &self.relation);
        let all = Features::of_case(settings, relation, &self.set.bursts, is_pinned);
        let own = (0..self.members.len()).map(|dag| Features::of_dag(self.dag(dag)).and(all));
        // What is pinned goes before all that is not.
        Features::spread(own.collect(), |other, dag| {
            self.has_pins(other) || relation.may_delay(other, dag)
        })
    }

    /// Reports whether a subtask of a DAG is pinned.
    fn has_pins(&self, dag: usize) -> bool {
        self.dag(dag).is_pinned()
    }

    /// Reports whether an instance of `other` may go before one of `dag` on a core that counts for
    /// that.
    pub(super) fn may_outrank(&self, other: usize, dag: usize) -> bool {
        let ranked = self.relation.may_outrank(other, dag);
        if !self.is_pinned() || other == dag {
            return ranked;
        }
        let shares = self.dag(other).affinity() == self.dag(dag).affinity();
        let is_kept = self.relation.preemption != PreemptionMix::All;
        self.has_pins(other) || is_kept || ranked && shares
    }

    /// Returns the cores that execute what of a DAG is not pinned.
    pub(super) fn group(&self, dag: usize) -> Vec<u32> {
        match self.dag(dag).affinity() {
            [] => (0..self.settings.cores).collect(),
            cores => cores.to_vec(),
        }
    }

    /// Returns the DAGs with subtasks that are pinned to cores of a DAG's group, and how long it takes
    /// to go on elsewhere with what a job of each finds there.
    fn moves(&self, dag: usize) -> Vec<(usize, u128)> {
        let group = self.group(dag);
        let is_free = |subtask: &Subtask| subtask.core().is_none();
        if group.len() == 1 || !self.dag(dag).subtasks().iter().any(is_free) {
            return Vec::new();
        }
        let takes = |other: usize| {
            let subtasks = self.dag(other).subtasks().iter();
            let starts = subtasks.filter(|of| of.core().is_some_and(|core| group.contains(&core)));
            let starts = starts.map(|of| 1 + of.waits().len() as u128);
            (
                other,
                starts.sum::<u128>() * u128::from(self.set.bursts.move_ns),
            )
        };
        let all = (0..self.members.len()).map(takes);
        all.filter(|(_, takes)| *takes > 0).collect()
    }

    /// Returns how many cores count for a DAG where cores are told apart.
    fn counted_cores(&self, dag: usize) -> u32 {
        match (self.has_pins(dag), self.dag(dag).affinity().len()) {
            (true, _) => 1,
            (false, 0) => self.settings.cores,
            (false, cores) => to_u32(cores),
        }
    }

    /// Reports whether cores of the cluster are told apart.
    pub(super) const fn is_pinned(&self) -> bool {
        self.is_pinned
    }

    pub(super) fn dag(&self, dag: usize) -> &'a Dag {
        &self.all[self.members[dag]]
    }

    pub(super) fn id(&self, dag: usize) -> DagId {
        dag_id(self.members[dag])
    }

    /// Reports whether a DAG has all cores whenever it needs them.
    pub(super) fn is_alone(&self, dag: usize) -> bool {
        let blocked = self.relation.preemption != PreemptionMix::All && self.own.len() > 1;
        let mut others = 0..self.members.len();
        !blocked && !others.any(|other| self.relation.may_outrank(other, dag))
    }

    /// Reports whether a subtask is not preempted once it has started.
    pub(super) fn keeps_core(&self, subtask: &Subtask) -> bool {
        subtask.is_non_preemptive() || self.settings.preemption == Preemption::Disabled
    }

    /// Tells the equations what follows from the attributes.
    fn complete(&mut self) {
        let is_pinned = self.is_pinned();
        self.set.keep_cores = !is_pinned && self.relation.preemption == PreemptionMix::None;
        self.set.deadlines_limit = !is_pinned
            && self.relation.order == InstanceOrder::ByDeadline
            && self.relation.preemption != PreemptionMix::Some
            && constrained(self.tasks, self.settings.cores);
        for (dag, figures) in self.set.figures.iter_mut().enumerate() {
            figures.younger_may_win = self.relation.younger_may_win(dag);
            figures.allow_in_flight(self.all[self.members[dag]].in_flight());
        }
        if is_pinned {
            for dag in 0..self.members.len() {
                self.set.count_on(dag, self.counted_cores(dag));
            }
            self.set.forbid_overlap(vec![true; self.members.len()]);
            self.set.moves = (0..self.members.len()).map(|dag| self.moves(dag)).collect();
        } else if self.set.has_waits() {
            let entering = self.entering.iter();
            let with_waits = entering.map(|features| features.cover(Features::WAITS));
            self.set.forbid_overlap(with_waits.collect());
        }
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
    let unbounded = own.iter().find_map(|&dag| {
        let of = dags[dag].unbounded_lock()?;
        let (dag, subtask) = (dag_id(dag), SubtaskId(to_u32(of.subtask)));
        Some(NotProvenReason::UnboundedLock { dag, subtask })
    });
    for &dag in own {
        let task = overhead
            .ok_or(TaskError::VolumeOverflow)
            .and_then(|overhead_ns| Task::from_dag(&dags[dag], overhead_ns));
        reasons[dag] = match &task {
            _ if settings.cores == 0 => Some(NotProvenReason::NoCores),
            _ if unbounded.is_some() => unbounded,
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
