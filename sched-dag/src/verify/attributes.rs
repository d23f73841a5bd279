//! The checks of numbers: periods, deadlines, WCETs, counts, priorities.
//!
//! Every sum and product is checked, so that a time or a count that does not
//! fit is a fault and never wraps.

use alloc::vec::Vec;

use super::MAX_ARITY;
use super::fault::{Direction, Fault, Time};
use super::findings::Findings;
use super::label::{DagLabel, SubtaskLabel};
use super::options::CommitOptions;
use super::states::is_shared;
use super::warning::Warning;
use crate::order::sorted;
use crate::policy::{OnFault, Policy, Priority};
use crate::spec::{DagSpec, STACK_BYTES};

/// Checks the numbers of the whole commit.
pub(super) fn check(specs: &[&DagSpec], options: &CommitOptions, findings: &mut Findings) {
    if specs.is_empty() {
        findings.fault(0, Fault::NoDags);
    }
    if options.cores == 0 {
        findings.fault(0, Fault::NoCores);
    }
    if u32::try_from(specs.len()).is_err() {
        findings.fault(0, Fault::TooManyDags { count: specs.len() });
    }
    check_instances(specs, options, findings);
    for dag in 0..specs.len() {
        check_counts(specs, dag, findings);
        check_times(specs, dag, findings);
        check_subtasks(specs, dag, findings);
        if options.policy == Policy::StaticPriority {
            check_priorities_given(specs, dag, findings);
        }
    }
    if options.policy == Policy::StaticPriority {
        warn_of_equal_priorities(specs, findings);
    }
}

/// Returns the most jobs in flight of a DAG, given or enough for its deadline.
///
/// A job that meets its deadline is in flight for at most D, so at most
/// ceil(D / T) of them are at any time; with one more a late job can end while
/// the next one is released. Where subtasks share a state, jobs take turns.
pub(super) fn in_flight(spec: &DagSpec) -> u64 {
    if let Some(given) = spec.in_flight {
        return u64::from(given);
    }
    if spec.states.iter().any(is_shared) {
        return 1;
    }
    let (Some(period_ns), Some(deadline_ns)) = (spec.period_ns, spec.relative_deadline_ns) else {
        return 1;
    };
    if period_ns == 0 {
        return 1;
    }
    let enough = deadline_ns.div_ceil(period_ns).saturating_add(1);
    enough.min(spec.jobs.unwrap_or(u64::MAX))
}

fn check_instances(specs: &[&DagSpec], options: &CommitOptions, findings: &mut Findings) {
    let of = |spec: &&DagSpec| u128::from(in_flight(spec)) * spec.subtasks.len() as u128;
    let instances: u128 = specs.iter().map(of).sum();
    if instances <= u128::from(options.instance_limit) {
        return;
    }
    if let Some(most) = (0..specs.len()).max_by_key(|&dag| of(&specs[dag])) {
        findings.fault(
            most,
            Fault::TooManyInstances {
                dag: DagLabel::new(specs, most),
                in_flight: in_flight(specs[most]),
                instances,
                limit: options.instance_limit,
            },
        );
    }
}

#[inline(never)]
fn check_counts(specs: &[&DagSpec], dag: usize, findings: &mut Findings) {
    let spec = &specs[dag];
    let label = || DagLabel::new(specs, dag);
    let count = spec.subtasks.len();
    if count == 0 {
        findings.fault(dag, Fault::NoSubtasks { dag: label() });
    }
    if u32::try_from(count).is_err() {
        findings.fault(
            dag,
            Fault::TooManySubtasks {
                dag: label(),
                count,
            },
        );
    }
    if spec.jobs == Some(0) {
        findings.fault(dag, Fault::ZeroJobs { dag: label() });
    }
    if spec.in_flight == Some(0) {
        findings.fault(dag, Fault::ZeroInFlight { dag: label() });
    }
    if let OnFault::DropJob(limit) = spec.on_fault {
        if limit.faults == 0 || limit.in_all == 0 {
            findings.fault(dag, Fault::ZeroFaults { dag: label() });
        }
        if limit.window == 0 {
            findings.fault(dag, Fault::ZeroWindow { dag: label() });
        }
    }
}

#[inline(never)]
fn check_times(specs: &[&DagSpec], dag: usize, findings: &mut Findings) {
    let spec = &specs[dag];
    let label = || DagLabel::new(specs, dag);
    // An app that registers subtasks states both with them.
    let has_subtasks = !spec.subtasks.is_empty();
    match spec.period_ns {
        None if has_subtasks => findings.fault(dag, Fault::MissingPeriod { dag: label() }),
        Some(0) => findings.fault(dag, Fault::ZeroPeriod { dag: label() }),
        _ => {}
    }
    match spec.relative_deadline_ns {
        None if has_subtasks => findings.fault(dag, Fault::MissingDeadline { dag: label() }),
        Some(0) => findings.fault(dag, Fault::ZeroDeadline { dag: label() }),
        _ => {}
    }
    if deadline_of(spec, 0).is_none() {
        let time = Time::FirstDeadline;
        findings.fault(dag, Fault::TimeOverflow { dag: label(), time });
    } else if spec
        .jobs
        .is_some_and(|jobs| deadline_of(spec, jobs.saturating_sub(1)).is_none())
    {
        let time = Time::LastDeadline;
        findings.fault(dag, Fault::TimeOverflow { dag: label(), time });
    }
    let mut wcets_ns = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    if wcets_ns.try_fold(0_u64, u64::checked_add).is_none() {
        let time = Time::Volume;
        findings.fault(dag, Fault::TimeOverflow { dag: label(), time });
    }
}

/// Returns the absolute deadline of a job, or `None` if not even the instant
/// after it, at which a miss is noticed, is a time.
fn deadline_of(spec: &DagSpec, job: u64) -> Option<u64> {
    let since_offset_ns = spec.period_ns.unwrap_or(0).checked_mul(job)?;
    let release_ns = spec.offset_ns.checked_add(since_offset_ns)?;
    let deadline_ns = release_ns.checked_add(spec.relative_deadline_ns.unwrap_or(0))?;
    (deadline_ns < u64::MAX).then_some(deadline_ns)
}

#[inline(never)]
fn check_subtasks(specs: &[&DagSpec], dag: usize, findings: &mut Findings) {
    let spec = &specs[dag];
    for (index, subtask) in spec.subtasks.iter().enumerate() {
        let label = || (DagLabel::new(specs, dag), SubtaskLabel::new(spec, index));
        check_sink_deadline(specs, dag, index, findings);
        let deadlines_ns = [subtask.relative_deadline_ns, spec.relative_deadline_ns];
        match (subtask.wcet_ns, deadlines_ns.into_iter().flatten().min()) {
            (Some(0), _) => {
                let (dag, subtask) = label();
                findings.warnings.push(Warning::ZeroWcet { dag, subtask });
            }
            (Some(wcet_ns), Some(relative_deadline_ns)) if wcet_ns > relative_deadline_ns => {
                let (label, subtask) = label();
                findings.fault(
                    dag,
                    Fault::WcetExceedsDeadline {
                        dag: label,
                        subtask,
                        wcet_ns,
                        relative_deadline_ns,
                    },
                );
            }
            _ => {}
        }
        if let Some(bytes) = subtask.stack_bytes
            && !STACK_BYTES.contains(&bytes)
        {
            let (label, subtask) = label();
            findings.fault(
                dag,
                Fault::StackOutOfRange {
                    dag: label,
                    subtask,
                    bytes,
                },
            );
        }
        for (direction, arity) in [
            (Direction::Input, subtask.inputs.len()),
            (Direction::Output, subtask.outputs.len()),
        ] {
            if arity > MAX_ARITY {
                let (label, subtask) = label();
                findings.fault(
                    dag,
                    Fault::ArityTooLarge {
                        dag: label,
                        subtask,
                        direction,
                        arity,
                    },
                );
            }
        }
    }
}

/// Checks what a subtask states of its own deadline. That it is a sink's is checked with
/// the graph.
fn check_sink_deadline(specs: &[&DagSpec], dag: usize, index: usize, findings: &mut Findings) {
    let spec = &specs[dag];
    let Some(relative_deadline_ns) = spec.subtasks[index].relative_deadline_ns else {
        return;
    };
    let (label, sink) = (DagLabel::new(specs, dag), SubtaskLabel::new(spec, index));
    if relative_deadline_ns == 0 && spec.relative_deadline_ns != Some(0) {
        findings.fault(dag, Fault::ZeroSinkDeadline { dag: label, sink });
    } else if let Some(of_dag_ns) = spec.relative_deadline_ns
        && of_dag_ns > 0
        && relative_deadline_ns > of_dag_ns
    {
        findings.fault(
            dag,
            Fault::SinkDeadlineBeyondDag {
                dag: label,
                sink,
                relative_deadline_ns,
                of_dag_ns,
            },
        );
    }
}

fn check_priorities_given(specs: &[&DagSpec], dag: usize, findings: &mut Findings) {
    let subtasks = &specs[dag].subtasks;
    let missing = subtasks
        .iter()
        .filter(|subtask| subtask.priority.is_none())
        .count();
    if missing == 0 || missing == subtasks.len() {
        return;
    }
    let without = (0..subtasks.len())
        .filter(|&index| subtasks[index].priority.is_none())
        .map(|index| SubtaskLabel::new(specs[dag], index))
        .collect();
    let label = DagLabel::new(specs, dag);
    findings.fault(
        dag,
        Fault::PrioritiesPartlyGiven {
            dag: label,
            without,
        },
    );
}

fn warn_of_equal_priorities(specs: &[&DagSpec], findings: &mut Findings) {
    let mut given: Vec<(u32, usize, usize)> = Vec::new();
    for (dag, spec) in specs.iter().enumerate() {
        for (index, subtask) in spec.subtasks.iter().enumerate() {
            given.extend(
                subtask
                    .priority
                    .map(|Priority(number)| (number, dag, index)),
            );
        }
    }
    for group in sorted(&given).chunk_by(|one, other| one.0 == other.0) {
        if group.len() > 1 {
            let label = |&(_, dag, index): &_| {
                (
                    DagLabel::new(specs, dag),
                    SubtaskLabel::new(specs[dag], index),
                )
            };
            findings.warnings.push(Warning::EqualPriorities {
                priority: Priority(group[0].0),
                subtasks: group.iter().map(label).collect(),
            });
        }
    }
}
