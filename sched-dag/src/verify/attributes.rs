//! Checks the attributes of DAGs and subtasks one by one: periods, deadlines, WCETs, counts,
//! priorities, clusters, names.
//!
//! Every sum and product is checked, so that an overflowing time or count is a fault and never
//! wraps. Names are for people, so a name may be left out. Given twice within one DAG, a name would
//! make every message about its subtask ambiguous.

use alloc::vec::Vec;

use super::fault::{DagFault, OverflowingTime, TopicSide, Warning};
use super::label::SubtaskLabel;
use super::names::Interner;
use super::{CommitOptions, DagFindings, MAX_ARITY, VerifyFindings};
use crate::ids::ClusterId;
use crate::order::sorted;
use crate::policy::{OnFault, Priority};
use crate::spec::{DagSpec, MOST_WAITS, STACK_BYTES};

/// Checks the attributes of the whole commit; `tables` has each DAG's table.
pub(super) fn check(
    options: &CommitOptions,
    tables: &[Option<usize>],
    findings: &mut VerifyFindings<'_>,
) {
    let count = findings.specs.len();
    if count == 0 {
        findings.fault(DagFault::NoDags);
    }
    if options.cores == 0 {
        findings.fault(DagFault::NoCores);
    }
    if u32::try_from(count).is_err() {
        findings.fault(DagFault::TooManyDags { count });
    }
    check_instances(options, findings);
    for dag in 0..count {
        let page = &mut findings.findings_of(dag);
        check_counts(page);
        check_times(page);
        check_subtasks(page);
        if options.policy.reads_priorities() {
            check_priorities_given(page);
        }
    }
    if options.policy.reads_priorities() {
        warn_of_equal_priorities(findings);
    }
    check_clusters(options, findings);
    check_affinities(options, tables, findings);
    check_names(findings);
}

fn check_instances(options: &CommitOptions, findings: &mut VerifyFindings<'_>) {
    let of = |spec: &DagSpec| u128::from(spec.most_in_flight()) * spec.subtasks.len() as u128;
    let specs = findings.specs;
    let instances: u128 = specs.iter().map(|spec| of(spec)).sum();
    if instances <= u128::from(options.instance_limit) {
        return;
    }
    // The sum is too large, through no single DAG's fault; a change helps most in the largest DAG.
    if let Some(most) = (0..specs.len()).max_by_key(|&dag| of(specs[dag])) {
        findings
            .findings_of(most)
            .fault(|dag| DagFault::TooManyInstances {
                dag,
                in_flight: specs[most].most_in_flight(),
                instances,
                limit: options.instance_limit,
            });
    }
}

#[inline(never)]
fn check_counts(page: &mut DagFindings<'_, '_>) {
    let spec = page.spec;
    let count = spec.subtasks.len();
    if count == 0 {
        page.fault(|dag| DagFault::NoSubtasks { dag });
    }
    if u32::try_from(count).is_err() {
        page.fault(|dag| DagFault::TooManySubtasks { dag, count });
    }
    if spec.jobs == Some(0) {
        page.fault(|dag| DagFault::ZeroJobs { dag });
    }
    if spec.in_flight == Some(0) {
        page.fault(|dag| DagFault::ZeroInFlight { dag });
    }
    if let OnFault::DropJob(limit) = spec.on_fault {
        if limit.faults == 0 || limit.in_all == 0 {
            page.fault(|dag| DagFault::ZeroFaults { dag });
        }
        if limit.window == 0 {
            page.fault(|dag| DagFault::ZeroWindow { dag });
        }
    }
}

#[inline(never)]
fn check_times(page: &mut DagFindings<'_, '_>) {
    let spec = page.spec;
    // An app that registers subtasks states period and deadline with them.
    let has_subtasks = !spec.subtasks.is_empty();
    match spec.period_ns {
        None if has_subtasks => page.fault(|dag| DagFault::MissingPeriod { dag }),
        Some(0) => page.fault(|dag| DagFault::ZeroPeriod { dag }),
        _ => {}
    }
    match spec.relative_deadline_ns {
        None if has_subtasks => page.fault(|dag| DagFault::MissingDeadline { dag }),
        Some(0) => page.fault(|dag| DagFault::ZeroDeadline { dag }),
        _ => {}
    }
    let is_beyond = |jobs: u64| deadline_of(spec, jobs.saturating_sub(1)).is_none();
    let deadline = match spec.jobs {
        _ if is_beyond(1) => Some(OverflowingTime::FirstDeadline),
        Some(jobs) if is_beyond(jobs) => Some(OverflowingTime::LastDeadline),
        _ => None,
    };
    let mut wcets_ns = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    let volume = wcets_ns.try_fold(0_u64, u64::checked_add);
    let volume = volume.is_none().then_some(OverflowingTime::Volume);
    let waits = || {
        spec.subtasks
            .iter()
            .flat_map(|subtask| subtask.waits.iter())
    };
    let mut limits_ns = waits().map(|wait| wait.limit_ns);
    let waiting = limits_ns.try_fold(0_u64, u64::checked_add);
    let waiting = waiting.is_none().then_some(OverflowingTime::Waits);
    for time in deadline.into_iter().chain(volume).chain(waiting) {
        page.fault(|dag| DagFault::TimeOverflow { dag, time });
    }
}

/// Returns the absolute deadline of a job, or `None` if the next nanosecond, when a miss is
/// noticed, exceeds 64 bits.
fn deadline_of(spec: &DagSpec, job: u64) -> Option<u64> {
    let since_offset_ns = spec.period_ns.unwrap_or(0).checked_mul(job)?;
    let release_ns = spec.offset_ns.checked_add(since_offset_ns)?;
    let deadline_ns = release_ns.checked_add(spec.relative_deadline_ns.unwrap_or(0))?;
    (deadline_ns < u64::MAX).then_some(deadline_ns)
}

#[inline(never)]
fn check_subtasks(page: &mut DagFindings<'_, '_>) {
    let spec = page.spec;
    for (index, stated) in spec.subtasks.iter().enumerate() {
        let subtask = || SubtaskLabel::new(spec, index);
        check_sink_deadline(page, index);
        // A sink may have a shorter deadline of its own; a longer one is a fault of its own.
        let deadlines_ns = [stated.relative_deadline_ns, spec.relative_deadline_ns];
        match (stated.wcet_ns, deadlines_ns.into_iter().flatten().min()) {
            (Some(0), _) => page.warn(|dag| Warning::ZeroWcet {
                dag,
                subtask: subtask(),
            }),
            (Some(wcet_ns), Some(relative_deadline_ns)) if wcet_ns > relative_deadline_ns => {
                page.fault(|dag| DagFault::WcetExceedsDeadline {
                    dag,
                    subtask: subtask(),
                    wcet_ns,
                    relative_deadline_ns,
                });
            }
            _ => {}
        }
        // An observed WCET has a margin, and the sum may well be beyond the budget.
        if let (Some(wcet_ns), None) = (stated.wcet_ns, stated.wcet_margin_percent)
            && let Some(budget_ns) = stated.budget_ns.filter(|&budget_ns| budget_ns < wcet_ns)
        {
            page.fault(|dag| DagFault::WcetExceedsBudget {
                dag,
                subtask: subtask(),
                wcet_ns,
                budget_ns,
            });
        }
        check_segments(page, index);
        if let Some(bytes) = stated.stack_bytes
            && !STACK_BYTES.contains(&bytes)
        {
            page.fault(|dag| DagFault::StackOutOfRange {
                dag,
                subtask: subtask(),
                bytes,
            });
        }
        for (direction, arity) in [
            (TopicSide::Input, stated.inputs.len()),
            (TopicSide::Output, stated.outputs.len()),
        ] {
            if arity > MAX_ARITY {
                page.fault(|dag| DagFault::ArityTooLarge {
                    dag,
                    subtask: subtask(),
                    direction,
                    arity,
                });
            }
        }
    }
}

/// Checks the WCETs of a subtask's segments: all or none must be given, and each must be above 0.
fn check_segments(page: &mut DagFindings<'_, '_>, index: usize) {
    let stated = &page.spec.subtasks[index];
    let count = stated.waits.len();
    if count > MOST_WAITS {
        let subtask = page.subtask(index);
        page.fault(|dag| DagFault::TooManyWaits {
            dag,
            subtask,
            count,
        });
        return;
    }
    let given = stated.waits.iter().filter_map(|wait| wait.segment_ns);
    let (count, later_ns) = (
        given.clone().count(),
        given.clone().try_fold(0, u64::checked_add),
    );
    let first_ns = later_ns.and_then(|later_ns| stated.wcet_ns?.checked_sub(later_ns));
    let are_sound = match count {
        // A sum alone, as observed, says nothing about single segments.
        0 => true,
        _ => count == stated.waits.len() && first_ns > Some(0) && given.min() > Some(0),
    };
    if !are_sound {
        let subtask = page.subtask(index);
        page.fault(|dag| DagFault::SegmentsPartlyGiven { dag, subtask });
    }
}

/// Checks a subtask's own deadline. Whether the subtask is a sink is checked with the graph.
fn check_sink_deadline(page: &mut DagFindings<'_, '_>, index: usize) {
    let spec = page.spec;
    let Some(relative_deadline_ns) = spec.subtasks[index].relative_deadline_ns else {
        return;
    };
    let sink = page.subtask(index);
    let of_dag_ns = spec.relative_deadline_ns;
    // A DAG's deadline of 0 is reported once, and not again for each sink.
    if relative_deadline_ns == 0 && of_dag_ns != Some(0) {
        page.fault(|dag| DagFault::ZeroSinkDeadline { dag, sink });
    } else if let Some(of_dag_ns @ 1..) = of_dag_ns
        && relative_deadline_ns > of_dag_ns
    {
        page.fault(|dag| DagFault::SinkDeadlineBeyondDag {
            dag,
            sink,
            relative_deadline_ns,
            of_dag_ns,
        });
    }
}

fn check_priorities_given(page: &mut DagFindings<'_, '_>) {
    let subtasks = &page.spec.subtasks;
    let without = (0..subtasks.len()).filter(|&index| subtasks[index].priority.is_none());
    let without: Vec<_> = without.map(|index| page.subtask(index)).collect();
    // No priority at all is a choice: the commit then derives priorities.
    if !without.is_empty() && without.len() < subtasks.len() {
        page.fault(|dag| DagFault::PrioritiesPartlyGiven { dag, without });
    }
}

fn warn_of_equal_priorities(findings: &mut VerifyFindings<'_>) {
    let mut given: Vec<(u32, usize, usize)> = Vec::new();
    for (dag, spec) in findings.specs.iter().enumerate() {
        for (index, subtask) in spec.subtasks.iter().enumerate() {
            let number = subtask.priority.map(|Priority(number)| number);
            given.extend(number.map(|number| (number, dag, index)));
        }
    }
    for group in sorted(&given).chunk_by(|one, other| one.0 == other.0) {
        if group.len() > 1 {
            let subtasks = group.iter().map(|&(_, dag, index)| {
                let subtask = SubtaskLabel::new(findings.specs[dag], index);
                (findings.label(dag), subtask)
            });
            let warning = Warning::EqualPriorities {
                priority: Priority(group[0].0),
                subtasks: subtasks.collect(),
            };
            findings.warnings.push(warning);
        }
    }
}

/// Checks the clusters' cores, and the cluster of each DAG.
#[inline(never)]
fn check_clusters(options: &CommitOptions, findings: &mut VerifyFindings<'_>) {
    let sizes = options.clusters.sizes();
    for (cluster, &size) in (0..).map(ClusterId).zip(sizes) {
        if size == 0 {
            findings.fault(DagFault::ClusterWithoutCores { cluster });
        }
    }
    let wanted: u64 = sizes.iter().copied().map(u64::from).sum();
    let (cores, clusters) = (options.cores, sizes.len());
    if wanted > cores.into() {
        findings.fault(DagFault::ClustersBeyondCores { wanted, cores });
    }
    for dag in 0..findings.specs.len() {
        let mut page = findings.findings_of(dag);
        match page.spec.cluster {
            None if clusters > 0 => page.fault(|dag| DagFault::NoCluster { dag, clusters }),
            Some(cluster) if cluster.index() >= clusters.max(1) => {
                page.fault(|dag| DagFault::UnknownCluster {
                    dag,
                    cluster,
                    clusters,
                });
            }
            _ => {}
        }
        check_cores(options, &mut page);
    }
}

/// Returns the number of cores in a DAG's cluster.
fn cores_of(options: &CommitOptions, spec: &DagSpec) -> u32 {
    let sizes = options.clusters.sizes();
    let cluster = spec.cluster.unwrap_or_default();
    match sizes.is_empty() {
        true => options.cores,
        // A cluster that does not exist is a fault of its own.
        false => sizes.get(cluster.index()).copied().unwrap_or(u32::MAX),
    }
}

/// Checks the cores stated by a DAG.
fn check_cores(options: &CommitOptions, page: &mut DagFindings<'_, '_>) {
    let cores = cores_of(options, page.spec);
    // The scheduler has a line for each core, and two more, in 16 bits.
    let most = cores.min(0xfffe);
    let largest = page.spec.affinity.iter().copied().max();
    if let Some(core) = largest.filter(|&core| core >= most) {
        page.fault(|dag| DagFault::AffinityOutOfRange { dag, core, cores });
    }
}

/// Returns the cores of a DAG's affinity without duplicates, in ascending order. Returns none if
/// they are all cores of the cluster.
pub(super) fn affinity(options: &CommitOptions, spec: &DagSpec) -> Vec<u32> {
    let mut cores = sorted(&spec.affinity);
    cores.dedup();
    if cores.len() == cores_of(options, spec) as usize {
        cores.clear();
    }
    cores
}

/// Checks that any two DAGs without a table in one cluster execute on the same cores, or share no
/// core.
fn check_affinities(
    options: &CommitOptions,
    tables: &[Option<usize>],
    findings: &mut VerifyFindings<'_>,
) {
    let specs = findings.specs;
    if specs.iter().all(|spec| spec.affinity.is_empty()) {
        return;
    }
    // Each affinity of a cluster, and the first DAG with this affinity.
    let mut groups: Vec<(ClusterId, Vec<u32>, usize)> = Vec::new();
    for (dag, spec) in specs.iter().enumerate() {
        if tables[dag].is_some() {
            continue;
        }
        let (cluster, own) = (spec.cluster.unwrap_or_default(), affinity(options, spec));
        let mut others = groups.iter().filter(|group| group.0 == cluster);
        if others.clone().any(|(_, cores, _)| *cores == own) {
            continue;
        }
        // An empty affinity means all cores.
        let has = |cores: &[u32], core| cores.is_empty() || cores.contains(core);
        let shared = others.find_map(|(_, cores, other)| {
            let mut shared = own.iter().chain(cores);
            let core = shared.find(|core| has(&own, core) && has(cores, core))?;
            Some((findings.label(*other), *core))
        });
        match shared {
            None => groups.push((cluster, own, dag)),
            Some((other, core)) => findings
                .findings_of(dag)
                .fault(|dag| DagFault::AffinitiesOverlap { dag, other, core }),
        }
    }
}

/// Checks the names of DAGs and subtasks.
fn check_names(findings: &mut VerifyFindings<'_>) {
    let specs = findings.specs;
    for (first, second) in duplicates(specs.iter().map(|spec| spec.name.as_str())) {
        let (first, second) = (findings.label(first), findings.label(second));
        let warning = Warning::DuplicateDagName { first, second };
        findings.warnings.push(warning);
    }
    for (dag, spec) in specs.iter().enumerate() {
        let names = spec.subtasks.iter().map(|subtask| subtask.name.as_str());
        for (first, second) in duplicates(names) {
            findings
                .findings_of(dag)
                .fault(|dag| DagFault::DuplicateSubtask {
                    dag,
                    first: SubtaskLabel::new(spec, first),
                    second: SubtaskLabel::new(spec, second),
                });
        }
    }
}

/// Returns the positions of repeated non-empty names, each after the position of the first such
/// name.
fn duplicates<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> Vec<(usize, usize)> {
    let mut interner = Interner::new(names.len());
    let mut first_positions: Vec<usize> = Vec::with_capacity(names.len());
    let mut found = Vec::new();
    for (position, name) in names.enumerate().filter(|(_, name)| !name.is_empty()) {
        let number = interner.intern(name);
        // New names are numbered in order, so an unknown number is the next index of the list.
        match first_positions.get(number) {
            Some(&first) => found.push((first, position)),
            None => first_positions.push(position),
        }
    }
    found
}
