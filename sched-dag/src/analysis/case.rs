//! The cases of a commit: the analysable DAGs of a cluster, and the consequences of their
//! attributes.
//!
//! A DAG may be unanalysable, for example for lack of a WCET. Then every DAG that it may delay,
//! directly or through others, is unanalysable, too. The remaining DAGs are analysed without it,
//! because it cannot delay them, whatever it does.

use alloc::vec;
use alloc::vec::Vec;

use super::abstraction::{AbstractionSet, NotClosed};
use super::certificate::{check_certificate, graph_of};
use super::features::Features;
use super::ranks::{InstanceOrder, PreemptionMix, RankRelation};
use super::set::{EquationSet, constrained};
use super::table_check::{TableDag, TableTimes, check_table};
use super::task::{Task, TaskError};
use super::workload::WorkloadBursts;
use super::{AnalysisResult, AnalysisSettings, NotProvenReason};
use crate::ids::{DagId, SubtaskId, to_u32};
use crate::order::sorted_by_key;
use crate::policy::Preemption;
use crate::table::Table;
use crate::task_set::{Dag, Subtask};

/// Makes the case of the analysable DAGs among the positions `own`, passes the case to `work`, and
/// notes why others of `own` are not analysable. The cores of the settings have no other DAGs and
/// no other tables.
pub(super) fn with_case(
    (dags, tables, certificate): (&[Dag], &[&Table], Option<&str>),
    own: &[usize],
    settings: &AnalysisSettings,
    reasons: &mut [Option<NotProvenReason>],
    work: impl FnOnce(&AnalysisInput<'_>, AnalysisResult, &mut [Option<NotProvenReason>]),
) {
    let places = CorePlaces::of(dags, tables, own);
    let is_free = |dag: &usize| places.table_of[*dag].is_none();
    let free: Vec<usize> = own.iter().copied().filter(is_free).collect();
    let relation = RankRelation::new(dags, &free, settings.policy, settings.preemption);
    let tasks = analysable(&places, own, &relation, settings, reasons);
    let can_be = |dag: &usize| reasons[*dag].is_none();
    let members: Vec<usize> = own.iter().copied().filter(can_be).collect();
    let known = members.iter().filter_map(|&dag| tasks[dag].as_ref());
    let tasks: Vec<&Task> = known.collect();
    let relation = relation.among(&members);
    let mut case = AnalysisInput::new(places, own, (&members, &tasks), relation, settings);
    case.certificate = certificate;
    case.closed = certificate.map(|text| check_certificate(&case.graph()?, text));
    let verdict = case.settle();
    work(&case, verdict, reasons);
}

/// Where the DAGs of a commit execute, as far as they are in one cluster.
struct CorePlaces<'a> {
    all: &'a [Dag],
    tables: &'a [&'a Table],
    /// By DAG, the position of its table.
    table_of: Vec<Option<usize>>,
    /// Whether cores of the cluster are told apart.
    are_told: bool,
}

impl<'a> CorePlaces<'a> {
    fn of(all: &'a [Dag], tables: &'a [&'a Table], own: &[usize]) -> Self {
        let mut table_of = vec![None; all.len()];
        for (position, table) in tables.iter().enumerate() {
            for dag in table.dags() {
                table_of[dag.index()] = Some(position);
            }
        }
        let mut own = own.iter();
        let are_told = !tables.is_empty() || own.any(|&dag| !all[dag].affinity().is_empty());
        Self {
            all,
            tables,
            table_of,
            are_told,
        }
    }

    /// Reports whether two DAGs without tables are members of the same group.
    fn share(&self, one: usize, other: usize) -> bool {
        let is_free = |dag: usize| self.table_of[dag].is_none();
        let same = self.all[one].affinity() == self.all[other].affinity();
        is_free(one) && is_free(other) && same
    }

    /// Reports whether a member's group includes a core of a table.
    fn meets(&self, member: usize, table: usize) -> bool {
        let affinity = self.all[member].affinity();
        let mut lists = self.tables[table].lists.iter();
        affinity.is_empty() || lists.any(|list| affinity.contains(&list.core))
    }

    /// Reports whether a DAG may delay another DAG; `in_group` says whether it may in a group of
    /// both. A DAG with subtasks that keep their cores may delay a table as well.
    fn delays(&self, other: usize, dag: usize, in_group: bool, keep_cores: bool) -> bool {
        match (self.table_of[other], self.table_of[dag]) {
            (Some(one), Some(two)) => one == two,
            (Some(table), None) => self.meets(dag, table),
            (None, Some(table)) => keep_cores && self.meets(other, table),
            (None, None) => in_group && self.share(other, dag),
        }
    }
}

/// A table of a case.
pub(super) struct CaseTable<'a> {
    pub(super) table: &'a Table,
    /// The table's analysable DAGs, ascending by position in the case.
    pub(super) dags: Vec<usize>,
    /// The table's times, or the fault that makes it wrong.
    pub(super) times: Result<TableTimes, NotProvenReason>,
}

/// Returns the settings for a cluster of `cores` cores with these DAGs.
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

/// The analysable DAGs of a cluster, and the consequences of their attributes.
pub(super) struct AnalysisInput<'a> {
    places: CorePlaces<'a>,
    /// The positions of all DAGs on these cores, analysable or not.
    own: &'a [usize],
    /// The positions of this case's DAGs in the commit. In the fields below, a DAG is a position in
    /// this list.
    pub(super) members: &'a [usize],
    pub(super) tasks: &'a [&'a Task],
    pub(super) settings: &'a AnalysisSettings,
    pub(super) relation: RankRelation,
    /// The DAGs, the most urgent first.
    pub(super) order: Vec<usize>,
    pub(super) set: EquationSet<'a>,
    pub(super) tables: Vec<CaseTable<'a>>,
    /// By DAG, the features entering it: its own, and those of all DAGs that may delay it.
    pub(super) entering: Vec<Features>,
    pub(super) certificate: Option<&'a str>,
    /// By DAG and subtask, the bounds of sinks by a certificate, if the commit has a certificate.
    pub(super) closed: Option<Result<Vec<Vec<u64>>, NotClosed>>,
}

impl<'a> AnalysisInput<'a> {
    fn new(
        places: CorePlaces<'a>,
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
            places,
            own,
            members,
            tasks,
            settings,
            relation,
            order,
            set: EquationSet::new(tasks, settings.cores),
            tables: Vec::new(),
            entering: Vec::new(),
            certificate: None,
            closed: None,
        };
        let tables = case.places.tables.iter();
        case.tables = tables.map(|table| case.checked(table)).collect();
        case.set.bursts = case.bursts(|_| false);
        case.entering = case.features();
        case.complete();
        case
    }

    /// Returns the bursts of the commit's DAGs on these cores; `fall_behind` marks the DAGs that
    /// may fall behind.
    fn bursts(&self, fall_behind: impl Fn(usize) -> bool) -> WorkloadBursts {
        let own = self.own.iter();
        let own = own.map(|&dag| (&self.places.all[dag], fall_behind(dag)));
        WorkloadBursts::of(own, self.settings)
    }

    /// Analyses the case repeatedly. Every DAG without a bound may fall behind in the next round,
    /// until no bound rests on a DAG without a bound.
    fn settle(&mut self) -> AnalysisResult {
        let mut has_bound = vec![false; self.places.all.len()];
        for &dag in self.members {
            has_bound[dag] = true;
        }
        loop {
            let mut verdict = self.verdict();
            for (&dag, bound) in self.members.iter().zip(&verdict.bounds) {
                has_bound[dag] &= bound.is_some();
            }
            let bursts = self.bursts(|dag| !has_bound[dag]);
            // From round to round bounds only disappear and never return, so the loop ends.
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

    /// Checks a table with the charged WCETs.
    fn checked(&self, table: &'a Table) -> CaseTable<'a> {
        let ids = table.dags();
        let place = |id: &DagId| self.members.iter().position(|&dag| dag == id.index());
        let dags: Vec<usize> = ids.iter().filter_map(place).collect();
        let of = |&dag: &usize| {
            let model = self.dag(dag);
            let subtasks = model.subtasks().iter();
            TableDag {
                id: self.id(dag),
                task: self.tasks[dag],
                // For a DAG alone in its table, laps begin with its jobs.
                offset_ns: model.offset_ns() * u64::from(ids.len() > 1),
                keeps_core: subtasks.map(|subtask| self.keeps_core(subtask)).collect(),
            }
        };
        let of_table: Vec<TableDag<'_>> = dags.iter().map(of).collect();
        CaseTable {
            table,
            times: check_table(table, &of_table).map_err(NotProvenReason::NotRight),
            dags,
        }
    }

    /// Returns the schedule-abstraction graph of all DAGs, or an error if the graph does not cover
    /// some DAG or exceeds a limit.
    pub(super) fn graph(&self) -> Result<AbstractionSet, NotClosed> {
        if self.members.len() < self.own.len() || self.tells_cores() {
            return Err(NotClosed::NotCovered);
        }
        let dags = (0..self.members.len()).map(|dag| (self.dag(dag), self.tasks[dag]));
        // Assumes that no DAG falls behind: if one does, no bound comes from the graph.
        graph_of(
            &mut dags.into_iter(),
            self.settings,
            &self.bursts(|_| false),
        )
    }

    /// Returns by DAG the features entering it.
    fn features(&self) -> Vec<Features> {
        let (settings, relation) = (self.settings, &self.relation);
        let all = Features::of_machine(settings, &self.set.bursts, self.tells_cores());
        let of_order = Features::of_order(relation);
        let own = (0..self.members.len()).map(|dag| {
            let own = Features::of_dag(self.dag(dag)).and(all);
            let member = self.members[dag];
            let mut tables = 0..self.places.tables.len();
            match self.table_of(dag) {
                Some(_) => own.and(Features::TABLE),
                None => own.and(of_order).and(
                    Features::TABLE.if_so(tables.any(|table| self.places.meets(member, table))),
                ),
            }
        });
        // The time left by a table depends on nothing but the table being right.
        let in_table = |dag: usize| self.table_of(dag).is_some();
        let keep_cores = relation.preemption != PreemptionMix::All;
        Features::spread(own.collect(), |other, dag| {
            let [one, two] = [other, dag].map(|dag| self.members[dag]);
            let in_group = relation.may_delay(other, dag);
            (in_table(dag) || !in_table(other))
                && self.places.delays(one, two, in_group, keep_cores)
        })
    }

    /// Reports whether an instance of `other` may go before an instance of `dag` on a core that
    /// counts for `dag`; both are members of groups.
    pub(super) fn may_outrank(&self, other: usize, dag: usize) -> bool {
        let is_kept = self.tells_cores() && self.relation.preemption != PreemptionMix::All;
        let [one, two] = [other, dag].map(|dag| self.members[dag]);
        let outranks = other != dag && (is_kept || self.relation.may_outrank(other, dag));
        outranks && self.places.share(one, two)
    }

    /// Returns the cores that execute a DAG without a table.
    pub(super) fn group(&self, dag: usize) -> Vec<u32> {
        match self.dag(dag).affinity() {
            [] => (0..self.settings.cores).collect(),
            cores => cores.to_vec(),
        }
    }

    /// Returns the table of a DAG.
    pub(super) fn table_of(&self, dag: usize) -> Option<&CaseTable<'a>> {
        let table = self.places.table_of[self.members[dag]]?;
        self.tables.get(table)
    }

    /// Reports whether cores of the cluster are told apart.
    pub(super) const fn tells_cores(&self) -> bool {
        self.places.are_told
    }

    /// Reports whether a DAG of the cluster enters sections of a lock.
    pub(super) fn has_locks(&self) -> bool {
        let mut own = self.own.iter();
        own.any(|&dag| !self.places.all[dag].locks().is_empty())
    }

    pub(super) fn dag(&self, dag: usize) -> &'a Dag {
        &self.places.all[self.members[dag]]
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

    /// Reports whether a subtask, once started, is not preempted.
    pub(super) fn keeps_core(&self, subtask: &Subtask) -> bool {
        subtask.is_non_preemptive() || self.settings.preemption == Preemption::Disabled
    }

    /// Passes the consequences of the attributes to the equations.
    fn complete(&mut self) {
        let tells_cores = self.tells_cores();
        self.set.keep_cores = !tells_cores && self.relation.preemption == PreemptionMix::None;
        self.set.deadlines_limit = !tells_cores
            && self.relation.order == InstanceOrder::ByDeadline
            && match self.relation.preemption {
                PreemptionMix::All => true,
                // Jobs counted in full would not block, so the equations would count too little
                // delay.
                PreemptionMix::None => constrained(self.tasks, self.settings.cores),
                PreemptionMix::Some => false,
            };
        for (dag, figures) in self.set.figures.iter_mut().enumerate() {
            figures.younger_may_win = self.relation.younger_may_win(dag);
            figures.allow_in_flight(self.places.all[self.members[dag]].in_flight());
        }
        if tells_cores {
            for dag in 0..self.members.len() {
                self.set.count_on(dag, to_u32(self.group(dag).len()));
            }
            self.set.forbid_overlap(vec![true; self.members.len()]);
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

/// Returns the tasks of the DAGs at the positions `own`, and notes for each unanalysable DAG the
/// reason: a reason of its own, any DAG's lock without a longest section, or the unanalysable DAG
/// it may have to wait for.
fn analysable(
    places: &CorePlaces<'_>,
    own: &[usize],
    relation: &RankRelation,
    settings: &AnalysisSettings,
    reasons: &mut [Option<NotProvenReason>],
) -> Vec<Option<Task>> {
    let dags = places.all;
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
    let keep_cores = relation.preemption != PreemptionMix::All;
    // Repeated until nothing changes: a DAG delayed by an unknown DAG becomes unknown, too.
    while let Some(&other) = unknown.get(seen) {
        seen += 1;
        known.retain(|&dag| {
            let in_group = relation.may_delay(other, dag);
            let is_delayed = places.delays(other, dag, in_group, keep_cores);
            if is_delayed {
                reasons[dag] = Some(NotProvenReason::DelayedBy { dag: dag_id(other) });
                unknown.push(dag);
            }
            !is_delayed
        });
    }
    tasks
}
