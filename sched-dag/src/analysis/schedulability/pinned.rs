//! Response times where subtasks are pinned: owners by their orders, others in what these leave.
//!
//! A DAG whose subtasks are all pinned, no other's to the same cores, is an *owner* of these
//! cores. If those on one core follow one another by edges, nothing ever delays it: each
//! subtask finishes at the length of the longest path to it, or earlier. A DAG without pinned
//! subtasks is a *member* of the group of its cores, with all that have the same ones, and executes
//! in what the owners leave ([`lent_cores`](crate::analysis::lent_cores), whose proofs these bounds rest on).
//!
//! This is how a commit reads what [`lend`](crate::analysis::lend()) has divided, and also what a person has
//! pinned: nothing is taken over from the division but cores and edges.
//!
//! Assumes subtasks of the cluster that can be preempted; of an owner, and of all that may delay a
//! member: `D <= T`, and subtasks that do not wait. Of the members of a group that are several: a static priority that outranks DAG by DAG.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds, Responses, SinkBounds};
use crate::analysis::case::AnalysisInput;
use crate::analysis::cover::covering;
use crate::analysis::features::covers;
use crate::analysis::lent_cores::{CoreSupply, LentForm, MemberTask, STEP_LIMIT};
use crate::analysis::list_schedule::ScheduledSubtask;
use crate::analysis::witness_text::WitnessText;
use crate::analysis::{NotProvenReason, SchedulabilityTest};
use crate::ids::{SubtaskId, to_u32};
use crate::order::sort_by_key;
use crate::task_set::Subtask;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Owner, SchedulabilityTest::Member],
    covers: covers!(
        RANKED BY_DEADLINE ANY_ORDER ONE_CORE CORES PREEMPTION SINK_DEADLINES INTERLEAVED PINS
        OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    sinks,
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: |case, responses, dag, bound_ns, text| match is_member(case, dag) {
        true => write_member(case, responses, dag, bound_ns, text),
        false => write_owner(case, dag, bound_ns, text),
    },
    sinks: |case, _, dag, bound_ns, text| {
        let cluster = case.is_pinned().then(|| PinnedCluster::of(case));
        for &sink in case.dag(dag).sinks() {
            let finish_ns = (cluster.as_ref()).and_then(|of| of.finish_ns(case, dag, sink));
            if let Some(finish_ns) = finish_ns.filter(|&finish_ns| finish_ns < bound_ns) {
                let id = case.members[dag];
                text.line(format_args!("sink {id} {} {finish_ns} 0", sink.0));
            }
        }
    },
    ..BoundWitness::NONE
};

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    if case.is_pinned() {
        PinnedCluster::of(case).bound(case, found);
    }
}

fn sinks(case: &AnalysisInput<'_>, _: Responses<'_>, found: &mut SinkBounds) {
    if case.is_pinned() {
        let cluster = PinnedCluster::of(case);
        for dag in 0..case.members.len() {
            let sinks = case.dag(dag).sinks().iter();
            found.offer(dag, sinks.map(|&sink| cluster.finish_ns(case, dag, sink)));
        }
    }
}

/// The owners and groups of a cluster.
struct PinnedCluster {
    /// By core, what its owner leaves.
    supplies: Vec<CoreSupply>,
    /// By core, its list: subtasks of one DAG of the case.
    lists: Vec<Vec<ScheduledSubtask>>,
    /// By core, the first DAG of the case that is pinned to it.
    owners: Vec<Option<usize>>,
    /// By core, whether another DAG of the case is pinned to it, too.
    is_shared: Vec<bool>,
    /// By DAG of the case, why it can be neither an owner nor a member.
    refusals: Vec<Option<NotProvenReason>>,
}

impl PinnedCluster {
    fn of(case: &AnalysisInput<'_>) -> Self {
        let cores = case.settings.cores as usize;
        let mut cluster = Self {
            supplies: vec![CoreSupply::UNOWNED; cores],
            lists: vec![Vec::new(); cores],
            owners: vec![None; cores],
            is_shared: vec![false; cores],
            refusals: vec![None; case.members.len()],
        };
        // All at first: a DAG that can have no bound delays the others on its cores, too.
        for dag in 0..case.members.len() {
            for core in case.dag(dag).subtasks().iter().filter_map(Subtask::core) {
                let owner = cluster.owners[core as usize].get_or_insert(dag);
                cluster.is_shared[core as usize] |= *owner != dag;
            }
        }
        for dag in 0..case.members.len() {
            cluster.refusals[dag] = cluster.enter(case, dag).err();
        }
        for core in 0..cores {
            if let Some(owner) = cluster.owners[core]
                && cluster.refusals[owner].is_none()
                && let Some(bound_ns) = owner_bound_ns(case, owner)
            {
                let task = case.tasks[owner];
                let length_ns = task.length_ns();
                let times_ns = (length_ns, bound_ns - length_ns);
                let supply = CoreSupply::of(task.period_ns(), &cluster.lists[core], times_ns);
                cluster.supplies[core] = supply;
            }
        }
        cluster
    }

    /// Enters the lists of an owner; an error says why a DAG is neither that nor a member.
    fn enter(&mut self, case: &AnalysisInput<'_>, dag: usize) -> Result<(), NotProvenReason> {
        let (subtasks, task) = (case.dag(dag).subtasks(), case.tasks[dag]);
        let is_pinned = |subtask: &usize| subtasks[*subtask].core().is_some();
        let mut pinned: Vec<usize> = (0..subtasks.len()).filter(is_pinned).collect();
        let finishes_ns = task.finishes_ns();
        // No WCET is 0, so an edge leads to a later finish.
        sort_by_key(&mut pinned, |subtask| finishes_ns[subtask]);
        let is_whole = pinned.is_empty() || pinned.len() == subtasks.len();
        for subtask in pinned {
            let core = subtasks[subtask].core().map_or(0, |core| core as usize);
            let list = &mut self.lists[core];
            let follows =
                |last: &ScheduledSubtask| task.successors(last.subtask).any(|next| next == subtask);
            if !is_whole || self.is_shared[core] || !list.last().is_none_or(follows) {
                let subtask = SubtaskId(to_u32(subtask));
                return Err(NotProvenReason::Pinned { subtask });
            }
            list.push(ScheduledSubtask {
                subtask,
                start_ns: finishes_ns[subtask] - task.wcets_ns()[subtask],
                finish_ns: finishes_ns[subtask],
            });
        }
        Ok(())
    }

    /// Bounds the responses of owners, and then those of members, the most urgent first.
    fn bound(&self, case: &AnalysisInput<'_>, found: &mut JobBounds) {
        let count = case.members.len();
        let mut bounds = vec![None; count];
        let owned = (0..count).filter(|&dag| self.refusals[dag].is_none() && !is_member(case, dag));
        for dag in owned {
            bounds[dag] = owner_bound_ns(case, dag);
        }
        let mut steps = STEP_LIMIT;
        for &dag in case.order.iter().filter(|&&dag| is_member(case, dag)) {
            bounds[dag] = self.terms(case, dag, &bounds).and_then(|terms| {
                let above = terms.above();
                terms.own.respond(&terms.cores, &above, &mut steps)
            });
        }
        // Of all others the next test says why.
        found.reasons = self.refusals.clone();
        for (dag, bound_ns) in bounds.into_iter().enumerate() {
            let test = match is_member(case, dag) {
                true => SchedulabilityTest::Member,
                false => SchedulabilityTest::Owner,
            };
            if let Some(bound_ns) = bound_ns {
                found.offer(dag, bound_ns, test);
            }
        }
    }

    /// Returns the terms of a member's equation.
    fn terms<'a>(
        &'a self,
        case: &'a AnalysisInput<'_>,
        dag: usize,
        responses: &[Option<u64>],
    ) -> Option<MemberTerms<'a>> {
        let cores = case.group(dag);
        for owner in cores.iter().filter_map(|&core| self.owners[core as usize]) {
            responses[owner]?;
        }
        let of = |dag| MemberTask::of(case.tasks[dag], to_u32(cores.len()), &case.set.bursts);
        let mut above = Vec::new();
        let affinity = case.dag(dag).affinity();
        for (other, &response_ns) in responses.iter().enumerate() {
            // Of a DAG that is pinned in part, which has no bound, the rest is in a group as well.
            let mut subtasks = case.dag(other).subtasks().iter();
            let is_in_group = subtasks.any(|subtask| subtask.core().is_none());
            let shares = is_in_group && case.dag(other).affinity() == affinity;
            if !shares || !case.relation.may_outrank(other, dag) {
                continue;
            }
            if case.relation.may_outrank(dag, other) {
                return None;
            }
            above.push((other, of(other), response_ns?));
        }
        Some(MemberTerms {
            own: of(dag),
            cores: (cores.iter())
                .map(|&core| &self.supplies[core as usize])
                .collect(),
            above,
        })
    }

    /// Returns when an owner's subtask finishes after the release, at the latest.
    fn finish_ns(
        &self,
        case: &AnalysisInput<'_>,
        dag: usize,
        subtask: SubtaskId,
    ) -> Option<u64> {
        // Of one that is no owner the lists are in part.
        self.refusals[dag].is_none().then_some(())?;
        let core = case.dag(dag).subtask(subtask).core()?;
        let mut list = self.lists[core as usize].iter();
        let found = list.find(|of| of.subtask == subtask.index());
        case.set.bursts.after(found?.finish_ns)
    }
}

/// A member's equation.
struct MemberTerms<'a> {
    own: MemberTask<'a>,
    cores: Vec<&'a CoreSupply>,
    /// The more urgent members, by their positions in the case, with their bounds.
    above: Vec<(usize, MemberTask<'a>, u64)>,
}

impl<'a> MemberTerms<'a> {
    fn above(&self) -> Vec<(&MemberTask<'a>, u64)> {
        let above = self.above.iter();
        above.map(|(_, of, bound_ns)| (of, *bound_ns)).collect()
    }
}

/// Returns when the last of an owner's subtasks finishes, if that is in time.
fn owner_bound_ns(case: &AnalysisInput<'_>, dag: usize) -> Option<u64> {
    let task = case.tasks[dag];
    let bound_ns = case.set.bursts.after(task.length_ns());
    bound_ns.filter(|&bound_ns| bound_ns <= task.relative_deadline_ns())
}

fn is_member(case: &AnalysisInput<'_>, dag: usize) -> bool {
    !case.dag(dag).is_pinned()
}

fn write_owner(case: &AnalysisInput<'_>, dag: usize, bound_ns: u64, text: &mut WitnessText) {
    let id = case.members[dag];
    let finishes_ns = case.tasks[dag].finishes_ns();
    let finishes = finishes_ns.iter().map(|&ns| i128::from(ns));
    text.list(&format!("bound {id} {bound_ns} owner"), finishes);
}

fn write_member(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    bound_ns: u64,
    text: &mut WitnessText,
) {
    let (id, task) = (case.members[dag], case.tasks[dag]);
    let cluster = PinnedCluster::of(case);
    let Some(terms) = cluster.terms(case, dag, responses) else {
        return;
    };
    if let [core] = terms.cores[..] {
        let owned = core.busy_ns(bound_ns);
        return text.line(format_args!("bound {id} {bound_ns} sequence {owned}"));
    }
    let waiting = u128::from(bound_ns - task.length_ns());
    let above = terms.above();
    let mut forms = terms.own.forms(&terms.cores, &above, bound_ns);
    let all = |form: &LentForm| form.works.iter().map(|work| work.value).sum::<u128>();
    let Some(form) = forms.find(|form| all(form) <= form.free as u128 * waiting) else {
        return;
    };
    let (chains, clipped) = (terms.cores.len() + 1 - form.free, u8::from(form.is_clipped));
    let [left, owned, others @ ..] = &form.works[..] else {
        return;
    };
    let (left, owned) = (left.value, owned.value);
    text.line(format_args!(
        "bound {id} {bound_ns} lent {chains} {clipped} {left} {owned}"
    ));
    text.chains("chain", &covering(task, terms.own.covers.len(), chains));
    for ((other, _, response_ns), work) in terms.above.iter().zip(others) {
        let id = case.members[*other];
        text.line(format_args!("other {id} {response_ns} {}", work.value));
    }
}
