//! A DAG as lines of the kinds `trace_dag` and `graph` describe it.

use std::collections::BTreeSet;

use sched_dag::{
    Activation, ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagSpec, FaultLimit,
    OnFault, OverrunPolicy, Policy, Preemption, Priority, SchedulerOptions, SubtaskSpec, TaskSet,
    verify,
};

use super::line::Line;
use crate::json::Value;
use crate::qemu::MOST_CORES;
use replay::lines::Malformed;

/// Reads how the DAGs are scheduled.
///
/// # Errors
///
/// The first member that is not as the format says.
pub fn options(line: &Line<'_>) -> Result<SchedulerOptions, Malformed> {
    let cores = line.within("cores", 1..=MOST_CORES)?;
    Ok(SchedulerOptions {
        policy: match line.text("policy")? {
            "static" => Policy::StaticPriority,
            "edf" => Policy::Edf,
            other => return Err(line.unknown("policy", other, "static or edf")),
        },
        preemption: match line.text("preemption")? {
            "on" => Preemption::Enabled,
            "off" => Preemption::Disabled,
            other => return Err(line.unknown("preemption", other, "on or off")),
        },
        cores: line.small(cores)?,
    })
}

/// Reads how the cores are divided; they are not if nothing is said of that.
///
/// # Errors
///
/// A cluster's cores are no number.
pub fn clusters(line: &Line<'_>) -> Result<Clusters, Malformed> {
    if line.0.value.get("clusters").is_none() {
        return Ok(Clusters::Undivided);
    }
    let sizes = line.elements("clusters")?.iter().map(Value::as_u64);
    let sizes: Option<Vec<u64>> = sizes.collect();
    let Some(sizes) = sizes else {
        return Err(line.malformed("`clusters` is a list of the number of cores of each"));
    };
    let sizes = sizes.into_iter().map(|cores| line.small(cores));
    Ok(Clusters::Of(sizes.collect::<Result<_, _>>()?))
}

/// Reads a DAG.
///
/// # Errors
///
/// The first member that is not as the format says.
pub fn spec(line: &Line<'_>) -> Result<DagSpec, Malformed> {
    let subtasks = line.elements("subtasks")?.iter();
    let subtasks = subtasks.map(|it| subtask(line, it));
    let mut subtasks: Vec<SubtaskSpec> = subtasks.collect::<Result<_, _>>()?;
    let in_flight = line.within("in_flight", 1..=u64::from(u32::MAX))?;
    let count = subtasks.len() as u64;
    let edge = |edge: &Value| {
        let ends: Option<Vec<u64>> = edge.elements().iter().map(Value::as_u64).collect();
        let ends = ends.filter(|ends| ends.iter().all(|&end| end < count));
        let Some(&[from, to]) = ends.as_deref() else {
            return Err(line.malformed(format!(
                "an edge is a pair of numbers less than {count}, the number of subtasks"
            )));
        };
        Ok((line.small(from)? as usize, line.small(to)? as usize))
    };
    let edges = line.elements("edges")?.iter().map(edge);
    let edges: Vec<(usize, usize)> = edges.collect::<Result<_, _>>()?;
    add_sinks(line, &mut subtasks, &edges)?;
    let is_in_one = line.0.value.get("cluster").is_some();
    let cluster = is_in_one.then(|| line.small(line.number("cluster")?));
    Ok(DagSpec {
        cluster: cluster.transpose()?.map(ClusterId),
        name: line.text("name")?.to_string(),
        activation: match line.flag("sporadic")? {
            true => Activation::Sporadic,
            false => Activation::Periodic,
        },
        period_ns: Some(line.within("period_ns", 1..=u64::MAX)?),
        relative_deadline_ns: Some(line.within("relative_deadline_ns", 1..=u64::MAX)?),
        offset_ns: line.number("offset_ns")?,
        in_flight: Some(line.small(in_flight)?),
        overrun: match line.text("overrun")? {
            "queue" => OverrunPolicy::Queue,
            "skip" => OverrunPolicy::Skip,
            "abort" => OverrunPolicy::Abort,
            other => return Err(line.unknown("overrun", other, "queue, skip or abort")),
        },
        on_fault: on_fault(line)?,
        subtasks,
        edges,
        ..DagSpec::default()
    })
}

/// Reads what a fault costs: the DAG, unless something is stated.
fn on_fault(line: &Line<'_>) -> Result<OnFault, Malformed> {
    if line.0.value.get("on_fault").is_none() {
        return Ok(OnFault::EndDag);
    }
    let numbers = line.elements("on_fault")?.iter().map(Value::as_u64);
    let numbers: Option<Vec<u64>> = numbers.collect();
    let Some(&[faults, window, in_all]) = numbers.as_deref() else {
        return Err(line.malformed("`on_fault` is [faults, window in jobs, faults in all]"));
    };
    Ok(OnFault::DropJob(FaultLimit {
        faults: line.small(faults)?,
        window,
        in_all: line.small(in_all)?,
    }))
}

fn subtask(line: &Line<'_>, value: &Value) -> Result<SubtaskSpec, Malformed> {
    let read = || {
        let [name, priority, non_preemptive, wcet_ns] = value.elements() else {
            return None;
        };
        let is_wcet = *wcet_ns == Value::Null || wcet_ns.as_u64().is_some();
        let non_preemptive = non_preemptive
            .as_u64()
            .filter(|&flag| flag < 2 && is_wcet)?;
        let priority = u32::try_from(priority.as_u64()?).ok()?;
        Some(SubtaskSpec {
            name: name.as_text()?.to_string(),
            wcet_ns: wcet_ns.as_u64(),
            priority: Some(Priority(priority)),
            non_preemptive: non_preemptive == 1,
            ..SubtaskSpec::default()
        })
    };
    read().ok_or_else(|| {
        line.malformed("a subtask is [name, priority, non-preemptive 0 or 1, WCET or null]")
    })
}

/// Reads the deadlines of sinks, which are stated if there are several. One that a shared
/// state puts before another counts as that one's predecessor only.
fn add_sinks(
    line: &Line<'_>,
    subtasks: &mut [SubtaskSpec],
    edges: &[(usize, usize)],
) -> Result<(), Malformed> {
    if line.0.value.get("sinks").is_none() {
        return Ok(());
    }
    let followed: BTreeSet<usize> = edges.iter().map(|edge| edge.0).collect();
    for sink in line.elements("sinks")? {
        let pair: Option<Vec<u64>> = sink.elements().iter().map(Value::as_u64).collect();
        let count = subtasks.len() as u64;
        let Some(&[sink, deadline_ns]) = pair.as_deref().filter(|pair| pair.first() < Some(&count))
        else {
            return Err(line.malformed(format!(
                "a sink is a pair of a number less than {count}, the number of subtasks, and its \
                 relative deadline"
            )));
        };
        let sink = line.small(sink)? as usize;
        if !followed.contains(&sink) {
            subtasks[sink].relative_deadline_ns = Some(deadline_ns);
        }
    }
    Ok(())
}

/// Makes the model of DAGs that stand on these lines, as a commit does.
///
/// # Errors
///
/// What a commit would say, at the line of the first DAG without which it is right.
pub fn task_set(
    kind: &str,
    (options, clusters): (SchedulerOptions, &Clusters),
    dags: &[DagSpec],
    lines: &[usize],
) -> Result<TaskSet, Malformed> {
    let options = CommitOptions::new(options.policy, options.cores)
        .with_construction(ConstructionPolicy::any_graph())
        .with_clusters(clusters.clone())
        .with_instance_limit(u32::MAX);
    if dags.is_empty() {
        return Ok(TaskSet::default());
    }
    verify(dags, &options)
        .map(|verified| verified.task_set)
        .map_err(|rejected| {
            let is_right = |line: &usize| {
                let before = lines.partition_point(|other| other <= line);
                verify(&dags[..before], &options).is_ok()
            };
            let wrong = lines.partition_point(is_right);
            let faults: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
            Malformed {
                line: lines.get(wrong).or(lines.last()).copied().unwrap_or(1),
                reason: format!("`{kind}`: {}", faults.join("; ")),
            }
        })
}
