//! Response times of members: DAGs that run in the time tables leave on their cores.
//!
//! A DAG without a table is a *member* of the group of its cores, with all other DAGs on the same
//! cores. It executes while no entry of a core's table has begun
//! ([`lent_cores`](crate::analysis::lent_cores) has the proofs behind these bounds). The proofs
//! need no more of a table than that it keeps its times.
//!
//! Assumes preemptible subtasks that do not wait, and, if a group has several members, static
//! priorities that rank them DAG by DAG. A bound is at most `T`, so jobs do not overlap.

use alloc::vec::Vec;

use super::tables::{TableFinishes, finishes_ns};
use super::{BoundTest, BoundWitness, JobBounds, Responses};
use crate::analysis::case::{AnalysisInput, CaseTable};
use crate::analysis::cover::covering;
use crate::analysis::features::covers;
use crate::analysis::lent_cores::{CoreSupply, LentForm, MemberTask, STEP_LIMIT};
use crate::analysis::witness_text::WitnessText;
use crate::analysis::{NotProvenReason, SchedulabilityTest};
use crate::ids::to_u32;
use crate::table::CoreList;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Member],
    covers: covers!(
        RANKED BY_DEADLINE ANY_ORDER ONE_CORE CORES PREEMPTION SINK_DEADLINES INTERLEAVED GROUPS TABLE
        LATE_DEADLINES FEW_IN_FLIGHT OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: write,
    ..BoundWitness::NONE
};

/// Bounds the responses of members, the most urgent first.
fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    if !case.tells_cores() {
        return;
    }
    let supplies = supplies(case);
    let mut bounds = alloc::vec![None; case.members.len()];
    let mut steps = STEP_LIMIT;
    let members = case.order.iter().copied();
    for dag in members.filter(|&dag| case.table_of(dag).is_none() && TEST.is_for(case, dag)) {
        let terms = match MemberTerms::of(case, dag, &supplies, &bounds) {
            Ok(terms) => terms,
            Err(reason) => {
                found.reasons[dag] = Some(reason);
                continue;
            }
        };
        bounds[dag] = (terms.own).respond(&terms.cores, &terms.above(), &mut steps);
        match bounds[dag] {
            Some(bound_ns) => found.offer(dag, bound_ns, SchedulabilityTest::Member),
            // On cores without a table, the next test gives the reason.
            None => found.reasons[dag] = Some(NotProvenReason::NoBound),
        }
    }
}

/// The supply left by a core's table, or the reason for none.
type Supply = Result<CoreSupply, NotProvenReason>;

/// Returns the supply of each core, as far as members need it.
fn supplies(case: &AnalysisInput<'_>) -> Vec<Supply> {
    let mut supplies = alloc::vec![Ok(CoreSupply::FREE); case.settings.cores as usize];
    for table in &case.tables {
        let finishes_ns = finishes_ns(case, table);
        let members = (0..case.members.len()).filter(|&dag| case.table_of(dag).is_none());
        let groups: Vec<u32> = members.flat_map(|dag| case.group(dag)).collect();
        for list in table.table.lists.iter().filter(|list| groups.contains(&list.core)) {
            supplies[list.core as usize] = supply(case, table, list, &finishes_ns);
        }
    }
    supplies
}

fn supply(
    case: &AnalysisInput<'_>,
    table: &CaseTable<'_>,
    list: &CoreList,
    finishes_ns: &TableFinishes,
) -> Supply {
    let finishes_ns = finishes_ns.as_ref().map_err(|(failing, reason)| {
        let dag = failing.or(table.dags.first().copied());
        dag.map_or(*reason, |dag| NotProvenReason::DelayedBy { dag: case.id(dag) })
    })?;
    // A length with slack says nothing about the work left of a family at an instant.
    let times = table.times.as_ref().ok().filter(|times| times.is_exact);
    let times = times.ok_or(NotProvenReason::BesideTable)?;
    // Long steps make all entries equally late.
    let latest_ns = |of: &[Vec<u64>]| of.iter().flatten().copied().max().unwrap_or(0);
    let late_ns = latest_ns(finishes_ns) - latest_ns(&times.latest_ns);
    let task = |id| {
        let dag = table.dags.iter().find(|&&dag| case.id(dag) == id);
        dag.map_or(case.tasks[table.dags[0]], |&dag| case.tasks[dag])
    };
    Ok(CoreSupply::of_list(table.table, list, task, late_ns))
}

/// A member's equation.
struct MemberTerms<'a> {
    own: MemberTask<'a>,
    cores: Vec<&'a CoreSupply>,
    /// The more urgent members, by their positions in the case, with their bounds.
    above: Vec<(usize, MemberTask<'a>, u64)>,
}

impl<'a> MemberTerms<'a> {
    /// Returns the terms of a member; an error gives the reason for having no equation.
    fn of(
        case: &'a AnalysisInput<'_>,
        dag: usize,
        supplies: &'a [Supply],
        responses: Responses<'_>,
    ) -> Result<Self, NotProvenReason> {
        let group = case.group(dag);
        let cores = group.iter().map(|&core| supplies[core as usize].as_ref());
        let cores: Vec<&CoreSupply> = cores.collect::<Result<_, _>>().map_err(|reason| *reason)?;
        let of = |dag| MemberTask::of(case.tasks[dag], to_u32(cores.len()), &case.set.bursts);
        let mut above = Vec::new();
        for (other, &response_ns) in responses.iter().enumerate() {
            if !case.may_outrank(other, dag) {
                continue;
            }
            if case.may_outrank(dag, other) {
                return Err(NotProvenReason::BesideTable);
            }
            let delayed = NotProvenReason::DelayedBy { dag: case.id(other) };
            above.push((other, of(other), response_ns.ok_or(delayed)?));
        }
        let own = of(dag);
        Ok(Self { own, cores, above })
    }

    fn above(&self) -> Vec<(&MemberTask<'a>, u64)> {
        let above = self.above.iter();
        above.map(|(_, of, bound_ns)| (of, *bound_ns)).collect()
    }
}

fn write(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    bound_ns: u64,
    text: &mut WitnessText,
) {
    let (id, task) = (case.members[dag], case.tasks[dag]);
    let supplies = supplies(case);
    let Ok(terms) = MemberTerms::of(case, dag, &supplies, responses) else {
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
