//! Lending: divides the cores of a commit among DAGs. Some DAGs get a table on cores of their own;
//! the others share the time left.
//!
//! A DAG is *heavy* if its volume exceeds the time until its deadline or the next release, too much
//! for a single core; otherwise it is *light*. There are seven [attempts](LendingAttempt), and the
//! first attempt to prove a bound for every DAG wins. In the first attempt all DAGs share all
//! cores. The first five attempts fail at once if a DAG cannot be a member or has `D > T`, or if
//! the policy looks at releases, as EDF does. In the second to the fifth:
//!
//! - *Owners*: heavy DAGs take the first free cores, in order of ascending slack `D - length`. Each
//!   gets a table of one DAG, on the fewest cores on which its [list schedule](ListSchedule) ends
//!   by its deadline. A DAG left with too few cores is *late*.
//! - *Members*: the late DAGs and then the light DAGs are placed one by one. A DAG goes to the
//!   first core on which it is proven together with all DAGs already there; otherwise to the first
//!   such group of several cores; otherwise to the fewest cores that are enough for a proof, taken
//!   from those in no group yet, the least busy first.
//!
//! Two of the four squeeze the owners' lists before placing members. In the last two attempts as
//! many periodic DAGs as fit into a lap form a *family*, with one table (`table_making`). Heavy
//! DAGs outside the family are owners, on the last cores, and all others are members. The family
//! keeps all cores left by the owners if every member then finds a place. Otherwise the family gets
//! the fewest cores on which its table can be made and every member finds a place.
//!
//! A new member lengthens no bound outside its own group. Bounds in a group depend only on its
//! members and on the supplies of its cores ([`CoreSupply`]).
//!
//! Guaranteed: every job of every DAG responds within its bound if the plan is enforced, with
//! tables by rules T1 to T3, and members on the cores of their group by deadline (ties by
//! position), below the entries of tables. See `docs/bounds.md`, "Tables".
//!
//! Not guaranteed: that an unproven set misses a deadline, or that no other division would prove
//! it. DAGs with waits are not covered.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::lent_cores::{CoreSupply, MemberTask, STEP_LIMIT, parts_per_million};
use super::list_schedule::ListSchedule;
use super::ratio::sort_largest_first;
use super::set::constrained;
use super::table_making::{TableFamily, may_be_member};
use super::task::Task;
use super::workload::WorkloadBursts;
use crate::ids::{ClusterId, DagId, to_u32};
use crate::order::{sort_by_key, sorted_by_key};
use crate::policy::{AssignmentReason, AttemptFailure, LendingAttempt};
use crate::table::{Table, TableEntry};
use crate::task_set::TaskSet;

/// DAGs with a table on cores of their own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoreOwner {
    /// The positions of the DAGs: a single heavy DAG, or a family.
    pub dags: Vec<usize>,
    /// The first of the owner's consecutive cores.
    pub first_core: usize,
    /// The number of cores. Some of them may have no list.
    pub cores: usize,
    /// The table. Its cores are numbered from 0 among all cores.
    pub table: Table,
    /// The number of tries needed to make the table.
    pub tries: u32,
}

/// Cores shared by DAGs, in the time that owners leave there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LentGroup {
    /// The cores; a group of several but not all cores lists the least busy core first.
    pub cores: Vec<usize>,
    /// The positions of the DAGs with their response-time bounds in nanoseconds, the most urgent
    /// first: by deadline, ties by position.
    pub members: Vec<(usize, u64)>,
}

/// A division of cores under which every DAG has a bound.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LendingPlan {
    /// The successful attempt.
    pub attempt: LendingAttempt,
    /// The owners, in the order of their cores.
    pub owners: Vec<CoreOwner>,
    /// The groups, in the order in which they were made; each DAG is an owner or in one of the
    /// groups.
    pub groups: Vec<LentGroup>,
}

/// The outcome of all attempts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LendingAnswer {
    /// The plan; `None`: no attempt proved all DAGs.
    pub plan: Option<LendingPlan>,
    /// For each failed attempt, the reason, and the position of the first DAG to fail, if any.
    pub failed: Vec<(Option<usize>, AttemptFailure)>,
}

impl LendingPlan {
    /// Returns the plan of the first attempt, for DAGs that another analysis has to prove.
    pub(super) fn whole(dags: usize, cores: usize) -> Self {
        let mut group = LentGroup::of((0..cores).collect());
        group.members = (0..dags).map(|dag| (dag, u64::MAX)).collect();
        Self {
            attempt: LendingAttempt::Whole,
            owners: Vec::new(),
            groups: vec![group],
        }
    }

    /// Divides the cores of a task set as planned. Cores connected by owners and groups become a
    /// cluster.
    ///
    /// Cores are renumbered, those of a cluster in a row; unused cores come last.
    pub(super) fn divide(&self, task_set: &mut TaskSet, tasks: &[&Task]) {
        let clusters = self.clusters();
        let place = |core: usize| {
            let mut clusters = clusters.iter().enumerate();
            let found = clusters.find_map(|(cluster, cores)| {
                let within = cores.iter().position(|&of| of == core)?;
                Some((ClusterId(to_u32(cluster)), to_u32(within)))
            });
            found.expect("owners and groups make the clusters")
        };
        let mut of_dags = vec![(ClusterId(0), AssignmentReason::Light); tasks.len()];
        let mut tables = Vec::new();
        for owner in &self.owners {
            let (cluster, first) = place(owner.first_core);
            let mut table = owner.table.clone();
            table.cluster = cluster;
            for list in &mut table.lists {
                list.core = list.core - to_u32(owner.first_core) + first;
            }
            tables.push(table);
            let left_percent = self.left_percent(&owner.own_cores(), tasks);
            for &dag in &owner.dags {
                let (attempt, task) = (self.attempt, tasks[dag]);
                let why = match attempt {
                    LendingAttempt::Nest | LendingAttempt::Lazy => AssignmentReason::Table {
                        attempt,
                        left_percent,
                    },
                    _ => AssignmentReason::Owner {
                        attempt,
                        volume_ns: task.volume_ns(),
                        within_ns: task.within_ns(),
                        left_percent,
                    },
                };
                of_dags[dag] = (cluster, why);
            }
        }
        for group in &self.groups {
            let (cluster, _) = place(group.cores[0]);
            let left_percent = self.left_percent(&group.cores, tasks);
            let attempt = self.attempt;
            let why = match attempt {
                LendingAttempt::Whole => AssignmentReason::Whole { left_percent },
                _ => AssignmentReason::Member {
                    attempt,
                    left_percent,
                },
            };
            let mut cores: Vec<u32> = group.cores.iter().map(|&core| place(core).1).collect();
            cores.sort_unstable();
            for &(dag, _) in &group.members {
                of_dags[dag] = (cluster, why);
                if cores.len() < clusters[cluster.index()].len() {
                    task_set.confine(DagId(to_u32(dag)), cores.clone());
                }
            }
        }
        let sizes: Vec<u32> = clusters.iter().map(|cores| to_u32(cores.len())).collect();
        task_set.divide(&sizes, &of_dags);
        task_set.set_tables(tables);
    }

    /// Returns the cores of each cluster, ascending.
    fn clusters(&self) -> Vec<Vec<usize>> {
        let mut clusters: Vec<Vec<usize>> = Vec::new();
        let own = self.owners.iter().map(CoreOwner::own_cores);
        for cores in own.chain(self.groups.iter().map(|group| group.cores.clone())) {
            let (met, mut apart): (Vec<_>, Vec<_>) = (clusters.into_iter())
                .partition(|cluster| cluster.iter().any(|core| cores.contains(core)));
            let mut all: Vec<usize> = met.concat();
            all.extend(cores);
            all.sort_unstable();
            all.dedup();
            apart.push(all);
            clusters = apart;
        }
        clusters.sort_unstable();
        clusters
    }

    /// Returns the share of time on some cores, in hundredths, left by their owners and by the
    /// members of groups on them.
    fn left_percent(&self, cores: &[usize], tasks: &[&Task]) -> u32 {
        let of_list = |core: &usize| {
            let owns = |owner: &&CoreOwner| owner.own_cores().contains(core);
            let table = &self.owners.iter().find(owns)?.table;
            let work_ns =
                |entry: &TableEntry| tasks[entry.dag.index()].wcets_ns()[entry.subtask.index()];
            let entries = table.list(to_u32(*core))?.entries.iter();
            Some(parts_per_million(entries.map(work_ns).sum(), table.lap_ns))
        };
        let mut taken: u64 = cores.iter().filter_map(of_list).sum();
        for group in &self.groups {
            let own = group.cores.iter();
            let shared = own.filter(|core| cores.contains(core)).count() as u64;
            let members = group.members.iter().map(|&(dag, _)| tasks[dag]);
            let load = members.map(|task| parts_per_million(task.volume_ns(), task.period_ns()));
            // Members load all cores of their group alike.
            let load = load.fold(0, u64::saturating_add).saturating_mul(shared);
            taken = taken.saturating_add(load.div_ceil(group.cores.len() as u64));
        }
        let all = 1_000_000 * cores.len() as u64;
        let left = all.saturating_sub(taken) / (10_000 * cores.len() as u64);
        u32::try_from(left).unwrap_or(100)
    }
}

/// The conditions of a division, besides the DAGs.
pub(super) struct LendingTerms<'b> {
    pub(super) bursts: &'b WorkloadBursts,
    /// The most entries in a lap; 0: no table of several DAGs is allowed.
    pub(super) entry_limit: usize,
    /// Whether DAGs may share cores, by static priorities.
    pub(super) has_members: bool,
}

/// Divides cores among DAGs by the analysis of tables in `docs/bounds.md`. A table of several DAGs
/// has at most `entry_limit` entries. A commit allows [`ENTRY_LIMIT`](crate::ENTRY_LIMIT), or none
/// if something may delay all entries of a table at once: long steps, device interrupts or locks.
///
/// Returns `None` if the analysis does not apply: there are no cores, or a subtask waits.
#[must_use]
pub fn lend(tasks: &[&Task], cores: u32, entry_limit: usize) -> Option<LendingAnswer> {
    let terms = LendingTerms {
        bursts: &WorkloadBursts::default(),
        entry_limit,
        has_members: true,
    };
    terms.lend(tasks, cores)
}

/// Why an attempt failed, and for which DAG.
type Failed = (Option<usize>, AttemptFailure);

impl LendingTerms<'_> {
    /// Does the same as the function [`lend`].
    pub(super) fn lend(&self, tasks: &[&Task], cores: u32) -> Option<LendingAnswer> {
        if cores == 0 || tasks.iter().any(|task| task.has_waits()) {
            return None;
        }
        let members = tasks.iter();
        let members = members.map(|task| MemberTask::of(task, cores, self.bursts));
        let members: Vec<MemberTask<'_>> = members.collect();
        let are_plain = self.has_members
            && constrained(tasks, cores)
            && tasks.iter().all(|task| may_be_member(task));
        let all: Vec<usize> = (0..tasks.len()).collect();
        let count = cores as usize;
        let (mut owners, mut late, mut failed) = (Vec::new(), Vec::new(), Vec::new());
        let mut family = None;
        for attempt in LendingAttempt::ALL {
            match attempt {
                LendingAttempt::ByDensity if are_plain => {
                    (owners, late) = self.own_cores(tasks, &all, 0..count)
                }
                LendingAttempt::SqueezedByDensity => self.squeeze(tasks, &mut owners),
                // Otherwise keep the owners of the attempt before; the first attempt has none.
                _ => {}
            }
            let placed = match attempt {
                LendingAttempt::Nest | LendingAttempt::Lazy => {
                    let make = || TableFamily::of(tasks, self.entry_limit);
                    let family = family.get_or_insert_with(make);
                    self.with_family(family, &members, count, attempt)
                }
                _ if !are_plain => Err((None, AttemptFailure::Excluded)),
                _ => {
                    let owners: Vec<_> = owners.iter().map(HeavyOwner::with_table).collect();
                    let mut placement = MemberPlacing::of(self.bursts, &members, &owners, count);
                    let placed = match attempt {
                        LendingAttempt::Whole => placement.share_all(),
                        _ => placement
                            .place_all(late.iter().copied().chain(attempt.light(tasks, &all))),
                    };
                    placed
                        .map(|()| (owners, placement.groups))
                        .map_err(|dag| (Some(dag), AttemptFailure::Lent))
                }
            };
            match placed {
                Err(of) => failed.push(of),
                Ok((owners, groups)) => {
                    let plan = Some(LendingPlan {
                        attempt,
                        owners,
                        groups,
                    });
                    return Some(LendingAnswer { plan, failed });
                }
            }
        }
        Some(LendingAnswer { plan: None, failed })
    }

    /// Makes the table of a family, and places the DAGs outside the family.
    fn with_family(
        &self,
        family: &mut TableFamily<'_>,
        members: &[MemberTask<'_>],
        cores: usize,
        method: LendingAttempt,
    ) -> Result<(Vec<CoreOwner>, Vec<LentGroup>), Failed> {
        let tasks: Vec<&Task> = members.iter().map(|of| of.task).collect();
        if family.dags.is_empty() {
            return Err((None, AttemptFailure::Nothing));
        }
        let is_left = |dag: &usize| !family.dags.contains(dag);
        let mut rest: Vec<usize> = (0..tasks.len()).filter(is_left).collect();
        if let Some(&dag) = rest.iter().find(|&&dag| !may_be_member(tasks[dag])) {
            return Err((Some(dag), AttemptFailure::Member));
        }
        // The family needs at least one core, so the heavy DAGs may not take the last.
        let (mut heavy, late) = self.own_cores(&tasks, &rest, 0..cores - 1);
        rest.retain(|&dag| heavy.iter().all(|owner| owner.dag != dag));
        if let Some(&dag) = rest.first().filter(|_| !self.has_members) {
            return Err((Some(dag), AttemptFailure::Member));
        }
        // The table gets the first cores.
        let owned = heavy.iter().map(|owner| owner.schedule.cores.len());
        let left = cores - owned.sum::<usize>();
        heavy.iter_mut().for_each(|owner| owner.first_core += left);
        let light = LendingAttempt::Nest.light(&tasks, &rest);
        let order: Vec<usize> = late.into_iter().chain(light).collect();
        let (mut first_failure, fewer) = (None, family.least_cores()..left);
        for count in core::iter::once(left).chain(fewer) {
            let (table, tries) = match family.make(count, method) {
                Ok(made) => made,
                Err(late) if count == left => return Err((late, AttemptFailure::Late)),
                Err(_) => continue,
            };
            let mut owners = vec![CoreOwner {
                dags: family.dags.clone(),
                first_core: 0,
                cores: count,
                table,
                tries,
            }];
            owners.extend(heavy.iter().map(HeavyOwner::with_table));
            let mut placement = MemberPlacing::of(self.bursts, members, &owners, cores);
            match placement.place_all(order.iter().copied()) {
                Ok(()) => return Ok((owners, placement.groups)),
                Err(dag) => first_failure = first_failure.or(Some(dag)),
            }
        }
        Err((first_failure, AttemptFailure::Place))
    }

    /// Gives heavy DAGs of these cores of their own, and returns the DAGs for which too few cores
    /// are left.
    fn own_cores<'t>(
        &self,
        tasks: &[&'t Task],
        dags: &[usize],
        cores: Range<usize>,
    ) -> (Vec<HeavyOwner<'t>>, Vec<usize>) {
        let heavy = dags.iter().copied().filter(|&dag| is_heavy(tasks[dag]));
        let mut heavy: Vec<usize> = heavy.collect();
        sort_by_key(&mut heavy, |dag| {
            i128::from(tasks[dag].within_ns()) - i128::from(tasks[dag].length_ns())
        });
        let (mut owners, mut late, mut first_core) = (Vec::new(), Vec::new(), cores.start);
        for dag in heavy {
            let (task, (_, limit_ns)) = (tasks[dag], late_and_limit_ns(self.bursts, tasks[dag]));
            // Fewer cores cannot execute the volume within the limit.
            let least = task.volume_ns().div_ceil(limit_ns.max(1));
            let least = usize::try_from(least).unwrap_or(usize::MAX);
            let most = task.subtask_count().min(cores.end - first_core);
            let on = |count| ListSchedule::within(task, &vec![limit_ns; count]);
            match (least..=most).find_map(on) {
                Some(schedule) => {
                    let count = schedule.cores.len();
                    owners.push(HeavyOwner {
                        dag,
                        task,
                        first_core,
                        schedule,
                    });
                    first_core += count;
                }
                None => late.push(dag),
            }
        }
        (owners, late)
    }

    fn squeeze(&self, tasks: &[&Task], owners: &mut [HeavyOwner<'_>]) {
        for HeavyOwner { dag, schedule, .. } in owners {
            let (_, limit_ns) = late_and_limit_ns(self.bursts, tasks[*dag]);
            *schedule = schedule.squeezed(tasks[*dag], limit_ns);
        }
    }
}

/// A heavy DAG on cores of its own.
struct HeavyOwner<'t> {
    dag: usize,
    task: &'t Task,
    first_core: usize,
    schedule: ListSchedule,
}

impl HeavyOwner<'_> {
    fn with_table(&self) -> CoreOwner {
        CoreOwner {
            dags: vec![self.dag],
            first_core: self.first_core,
            cores: self.schedule.cores.len(),
            table: self
                .schedule
                .table(self.dag, self.task.period_ns(), self.first_core),
            tries: 1,
        }
    }
}

impl CoreOwner {
    fn own_cores(&self) -> Vec<usize> {
        (self.first_core..self.first_core + self.cores).collect()
    }
}

impl LendingAttempt {
    /// All attempts, in order.
    pub const ALL: [Self; 7] = [
        Self::Whole,
        Self::ByDensity,
        Self::ByDeadline,
        Self::SqueezedByDensity,
        Self::SqueezedByDeadline,
        Self::Nest,
        Self::Lazy,
    ];

    /// Returns the light DAGs among some DAGs, in the order of placement.
    fn light(self, tasks: &[&Task], dags: &[usize]) -> Vec<usize> {
        let light = dags.iter().copied().filter(|&dag| !is_heavy(tasks[dag]));
        let mut light: Vec<usize> = light.collect();
        let within_ns = |dag: usize| tasks[dag].within_ns();
        match self {
            Self::ByDeadline | Self::SqueezedByDeadline => sort_by_key(&mut light, within_ns),
            _ => sort_largest_first(&mut light, |dag| (tasks[dag].volume_ns(), within_ns(dag))),
        }
        light
    }
}

fn is_heavy(task: &Task) -> bool {
    task.volume_ns() > task.within_ns()
}

/// Returns how late an owner's subtasks are at most, and the latest end of its lists to make up for
/// the lateness; both in nanoseconds.
pub(super) fn late_and_limit_ns(bursts: &WorkloadBursts, task: &Task) -> (u64, u64) {
    let within_ns = task.within_ns();
    let late_ns = u64::try_from(bursts.during(within_ns.into())).unwrap_or(u64::MAX);
    (late_ns, within_ns.saturating_sub(late_ns))
}

/// Members placed so far, on the time left by tables.
struct MemberPlacing<'a> {
    members: &'a [MemberTask<'a>],
    supplies: Vec<CoreSupply>,
    groups: Vec<LentGroup>,
    /// The number of evaluations of equations left.
    steps: u32,
}

impl<'a> MemberPlacing<'a> {
    fn of(
        bursts: &WorkloadBursts,
        members: &'a [MemberTask<'a>],
        owners: &[CoreOwner],
        cores: usize,
    ) -> Self {
        let mut supplies = vec![CoreSupply::FREE; cores];
        let of_tables: usize = owners.iter().map(|owner| owner.dags.len()).sum();
        // Without members nobody asks for supplies.
        for owner in owners.iter().filter(|_| of_tables < members.len()) {
            let (late_ns, _) = late_and_limit_ns(bursts, members[owner.dags[0]].task);
            for list in &owner.table.lists {
                let task = |dag: DagId| members[dag.index()].task;
                let supply = CoreSupply::of_list(&owner.table, list, task, late_ns);
                supplies[list.core as usize] = supply;
            }
        }
        Self {
            members,
            supplies,
            groups: Vec::new(),
            steps: STEP_LIMIT,
        }
    }

    /// Places all DAGs in one group of all cores, or returns the most urgent DAG without a bound.
    fn share_all(&mut self) -> Result<(), usize> {
        let mut group = LentGroup::of((0..self.supplies.len()).collect());
        let members = self.members;
        let deadline_ns = |dag: usize| members[dag].task.within_ns();
        for dag in sorted_by_key(members.len(), deadline_ns) {
            group = self.join(group, dag).ok_or(dag)?;
        }
        self.groups.push(group);
        Ok(())
    }

    /// Places DAGs one after the other, or returns the first DAG without a place.
    fn place_all(&mut self, mut dags: impl Iterator<Item = usize>) -> Result<(), usize> {
        dags.find(|&dag| !self.place(dag)).map_or(Ok(()), Err)
    }

    fn place(&mut self, dag: usize) -> bool {
        self.place_on_one(dag) || self.place_in_group(dag) || self.place_in_new_group(dag)
    }

    /// Places a DAG on the first core that is in no larger group and on which it is proven.
    fn place_on_one(&mut self, dag: usize) -> bool {
        (0..self.supplies.len()).any(|core| match self.group_of(core) {
            None => self.add_group(vec![core], dag),
            Some(place) => self.groups[place].cores.len() == 1 && self.extend_group(place, dag),
        })
    }

    /// Places a DAG in the first group of several cores in which it is proven.
    fn place_in_group(&mut self, dag: usize) -> bool {
        (0..self.groups.len()).any(|place| {
            // Groups of a single core were tried before.
            self.groups[place].cores.len() > 1 && self.extend_group(place, dag)
        })
    }

    /// Places a DAG on the fewest cores on which it is proven, taken from those in no group, the
    /// least busy first.
    fn place_in_new_group(&mut self, dag: usize) -> bool {
        let task = self.members[dag].task;
        let (deadline_ns, length_ns) = (task.within_ns(), task.length_ns());
        let busy_ns = |core: usize| self.supplies[core].busy_ns(deadline_ns);
        let mut free: Vec<usize> = (0..self.supplies.len())
            .filter(|&core| self.group_of(core).is_none())
            .collect();
        sort_by_key(&mut free, busy_ns);
        // A core with a supply no larger than the length adds as much interference as capacity.
        let adds = |&&core: &&usize| deadline_ns - busy_ns(core) > length_ns;
        let count = free.iter().take_while(adds).count();
        (2..=count).any(|count| self.add_group(free[..count].to_vec(), dag))
    }

    fn group_of(&self, core: usize) -> Option<usize> {
        let mut groups = self.groups.iter();
        groups.position(|group| group.cores.contains(&core))
    }

    /// Makes a group with one member, provided the member is proven there.
    fn add_group(&mut self, cores: Vec<usize>, dag: usize) -> bool {
        let group = self.join(LentGroup::of(cores), dag);
        group.map(|group| self.groups.push(group)).is_some()
    }

    /// Adds a member to a group if all members are still proven.
    fn extend_group(&mut self, place: usize, dag: usize) -> bool {
        let group = self.join(self.groups[place].clone(), dag);
        group.map(|group| self.groups[place] = group).is_some()
    }

    /// Returns the group with one more member if all members are proven then.
    fn join(&mut self, mut group: LentGroup, dag: usize) -> Option<LentGroup> {
        let members = self.members;
        let urgency = |dag: usize| (members[dag].task.within_ns(), dag);
        let is_above = |&(other, _): &(usize, u64)| urgency(other) < urgency(dag);
        let place = group.members.partition_point(is_above);
        group.members.insert(place, (dag, 0));
        let cores = group.cores.iter().map(|&core| &self.supplies[core]);
        let cores: Vec<&CoreSupply> = cores.collect();
        // More urgent members keep their bounds: the new member ranks below and cannot delay them.
        let (above, changed) = group.members.split_at_mut(place);
        let above = above.iter().map(|&(other, ns)| (&members[other], ns));
        let mut above: Vec<(&MemberTask<'_>, u64)> = above.collect();
        for (other, bound_ns) in changed {
            *bound_ns = members[*other].respond(&cores, &above, &mut self.steps)?;
            above.push((&members[*other], *bound_ns));
        }
        Some(group)
    }
}

impl LentGroup {
    const fn of(cores: Vec<usize>) -> Self {
        let members = Vec::new();
        Self { cores, members }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{InterferenceBound, SubtaskWaits, multi_path_fp};
    use random::Random;

    fn lent(tasks: &[Task], cores: u32) -> LendingAnswer {
        lend(&tasks.iter().collect::<Vec<_>>(), cores, 0).expect("it applies")
    }

    #[test]
    fn all_on_all_cores_is_the_multi_path_bound() {
        let mut random = Random::new(3);
        let mut proven = 0;
        for _ in 0..400 {
            let tasks: Vec<Task> = (0..2 + random.index(3))
                .map(|_| {
                    let count = 1 + random.index(6);
                    let edges: Vec<_> = random.edges(count, 30).collect();
                    let wcets = (0..count).map(|_| random.within(1..=9)).collect();
                    let period = random.within(20..=90);
                    Task::new(period, random.within(10..=period), wcets, &edges).unwrap()
                })
                .collect();
            let mut order: Vec<usize> = (0..tasks.len()).collect();
            order.sort_by_key(|&dag| tasks[dag].relative_deadline_ns());
            let by_deadline: Vec<&Task> = order.iter().map(|&dag| &tasks[dag]).collect();
            let bounds = multi_path_fp(&by_deadline, 3, InterferenceBound::Waiting);
            let answer = lent(&tasks, 3);
            let whole = answer
                .plan
                .filter(|plan| plan.attempt == LendingAttempt::Whole);
            let members = bounds.map(|bounds| order.into_iter().zip(bounds).collect());
            proven += u32::from(members.is_some());
            assert_eq!(whole.map(|plan| plan.groups[0].members.clone()), members);
        }
        assert!((50..350).contains(&proven), "{proven}");
    }

    #[test]
    fn what_is_not_covered_gets_no_answer() {
        let task = |deadline_ns| Task::new(10, deadline_ns, vec![2, 3], &[]).unwrap();
        assert!(lend(&[&task(10)], 1, 0).is_some());
        assert_eq!(lend(&[&task(10)], 0, 0), None);
        // A job that may overlap the next one is for a table only.
        let excluded = [(None, AttemptFailure::Excluded); 5];
        assert_eq!(lent(&[task(10), task(11)], 2).failed[..5], excluded);
        let waits = |&wcet_ns: &u64| SubtaskWaits {
            count: 1,
            limits_ns: 1,
            longest_segment_ns: wcet_ns,
        };
        let waiting = task(10).with_waits([2, 3].iter().map(waits).collect());
        assert_eq!(lend(&[&waiting.unwrap()], 2, 0), None);
        // Nothing has to be proven of no DAG.
        assert_eq!(lent(&[], 2).failed, []);
    }

    #[test]
    fn large_numbers_are_not_proven_rather_than_wrong() {
        let large = Task::new(u64::MAX, u64::MAX - 1, vec![u64::MAX], &[]).unwrap();
        let half = || Task::new(u64::MAX, u64::MAX, vec![u64::MAX / 2 + 1], &[]).unwrap();
        let failed = |dag| [(Some(dag), AttemptFailure::Lent); 5];
        assert_eq!(lent(&[half(), large], 4).failed[..5], failed(1));
        assert_eq!(lent(&[half(), half(), half()], 2).failed[..5], failed(2));
    }
}
