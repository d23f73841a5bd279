//! Reading reference schedules, strictly: whatever is not as the format says
//! is refused with its line.

use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use sched_dag::{
    ClusterId, Clusters, CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, Priority,
    SubtaskSpec, TaskSet, verify,
};

use crate::case::{Case, CaseDag, InstanceTimes, JobTimes};
use crate::faults::of_file;
use crate::lines::{Line, Lines, Malformed, cases, quoted};

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described above, and for
/// DAGs that cannot be committed.
pub fn parse(text: &str) -> Result<Vec<Case>, Malformed> {
    cases(text, parse_case)
}

fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<Case, Malformed> {
    let &[name, cores, edf, preemptive, count] = header.exactly(5)? else {
        return Err(header.malformed("expected 5 words"));
    };
    let cores = header.cores(cores)?;
    let policy = if yes(header, edf)? {
        Policy::Edf
    } else {
        Policy::StaticPriority
    };
    let preemption = if yes(header, preemptive)? {
        Preemption::Enabled
    } else {
        Preemption::Disabled
    };
    let clusters = match lines.next_if("clusters") {
        Some(line) => Clusters::Of(parse_clusters(&line, cores)?),
        None => Clusters::Undivided,
    };
    let options = CommitOptions::new(policy, cores)
        .with_clusters(clusters.clone())
        .with_construction(ConstructionPolicy::any_graph())
        .with_instance_limit(u32::MAX);

    let mut specs = Vec::new();
    let mut dags: Vec<CaseDag> = Vec::new();
    for _ in 0..at_least_one(header, count)? {
        let line = lines.expect("dag")?;
        let first_instance = dags.last().map_or(0, |before| {
            before.first_instance + before.jobs * before.subtasks
        });
        let cluster = parse_cluster(&clusters, lines)?;
        let (mut spec, dag) = parse_dag(&line, lines, first_instance)?;
        spec.cluster = cluster;
        commit(&line, core::slice::from_ref(&spec), &options)?;
        specs.push(spec);
        dags.push(dag);
    }
    let task_set = commit(header, &specs, &options)?;
    check_horizon(header, &specs, &dags)?;
    let (instances, jobs) = parse_schedule(lines, &dags)?;
    Ok(Case {
        name: name.to_owned(),
        cores,
        clusters,
        policy,
        preemption,
        dags,
        task_set: Arc::new(task_set),
        instances,
        jobs,
    })
}

/// Reads the cores of each cluster, which are all there are.
fn parse_clusters(line: &Line<'_>, cores: u32) -> Result<Vec<u32>, Malformed> {
    let sizes: Vec<u32> = line.numbers(line.words.len())?;
    if sizes.contains(&0) {
        return Err(line.malformed("expected at least 1 core for each cluster, found 0"));
    }
    let sum: u64 = sizes.iter().copied().map(u64::from).sum();
    match sum == cores.into() {
        true => Ok(sizes),
        false => Err(line.malformed(format!(
            "expected clusters of {cores} cores in all, found {sum}"
        ))),
    }
}

/// Reads the cluster of a DAG, which stands after its first record.
fn parse_cluster(
    clusters: &Clusters,
    lines: &mut Lines<'_>,
) -> Result<Option<ClusterId>, Malformed> {
    if *clusters == Clusters::Undivided {
        return Ok(None);
    }
    let line = lines.expect("in")?;
    let number = line.numbers::<u64>(1)?[0];
    let cluster = in_range(&line, "cluster", number, clusters.sizes().len())?;
    Ok(u32::try_from(cluster).ok().map(ClusterId))
}

fn parse_dag(
    header: &Line<'_>,
    lines: &mut Lines<'_>,
    first_instance: usize,
) -> Result<(DagSpec, CaseDag), Malformed> {
    let &[period, deadline, offset, jobs, subtasks, edges] = header.exactly(6)? else {
        return Err(header.malformed("expected 6 words"));
    };
    let jobs = at_least_one(header, jobs)?;
    let subtasks = at_least_one(header, subtasks)?;
    let mut spec = DagSpec {
        period_ns: Some(header.number(period)?),
        relative_deadline_ns: Some(header.number(deadline)?),
        offset_ns: header.number(offset)?,
        // The reference never blocks a release.
        in_flight: Some(jobs),
        jobs: Some(u64::from(jobs)),
        ..DagSpec::default()
    };
    let edges: u32 = header.number(edges)?;
    let mut executions_ns = Vec::new();
    for _ in 0..subtasks {
        let line = lines.expect("sub")?;
        let (priority, executions) = parse_subtask(&line, jobs)?;
        spec.subtasks.push(SubtaskSpec {
            priority: Some(priority),
            ..SubtaskSpec::default()
        });
        executions_ns.push(executions);
    }
    let (subtasks, jobs) = (spec.subtasks.len(), executions_ns[0].len());
    for _ in 0..edges {
        let line = lines.expect("edge")?;
        let ends: Vec<usize> = line.numbers(2)?;
        if let Some(end) = ends.iter().find(|&&end| end >= subtasks) {
            return Err(line.malformed(format!("there is no subtask {end}")));
        }
        spec.edges.push((ends[0], ends[1]));
    }
    while let Some(line) = lines.next_if("sink") {
        parse_sink(&line, &mut spec)?;
    }
    Ok((
        spec,
        CaseDag {
            jobs,
            subtasks,
            first_instance,
            executions_ns,
        },
    ))
}

fn parse_subtask(line: &Line<'_>, jobs: u32) -> Result<(Priority, Vec<u64>), Malformed> {
    let [wcet, priority, executions @ ..] = &line.words[..] else {
        return Err(line.malformed("expected `sub wcet prio e_0 ..`"));
    };
    if u32::try_from(executions.len()) != Ok(jobs) {
        return Err(line.malformed(format!(
            "expected an execution time for each of {jobs} jobs, found {}",
            executions.len()
        )));
    }
    let wcet_ns: u64 = line.number(wcet)?;
    let mut executions_ns = Vec::with_capacity(executions.len());
    for word in executions {
        let execution_ns: u64 = line.number(word)?;
        if !(1..=wcet_ns).contains(&execution_ns) {
            return Err(line.malformed(format!(
                "the execution time {execution_ns} is not between 1 and the WCET {wcet_ns}"
            )));
        }
        executions_ns.push(execution_ns);
    }
    Ok((Priority(line.number(priority)?), executions_ns))
}

/// Reads the deadline of a sink.
fn parse_sink(line: &Line<'_>, spec: &mut DagSpec) -> Result<(), Malformed> {
    let &[sink, deadline] = line.exactly(2)? else {
        return Err(line.malformed("expected 2 words"));
    };
    let sink = in_range(line, "subtask", line.number(sink)?, spec.subtasks.len())?;
    fill(
        line,
        &mut spec.subtasks[sink].relative_deadline_ns,
        line.number(deadline)?,
    )
}

/// Verifies DAGs that the record `line` begins.
fn commit(
    line: &Line<'_>,
    specs: &[DagSpec],
    options: &CommitOptions,
) -> Result<TaskSet, Malformed> {
    match verify(specs, options) {
        Ok(verified) => Ok(verified.task_set),
        Err(rejected) => {
            let reasons: Vec<String> = of_file(&rejected).map(|(_, reason)| reason).collect();
            Err(line.malformed(reasons.join("; ")))
        }
    }
}

/// Refuses a case in which even a schedule on one core might end after the last
/// time there is.
fn check_horizon(header: &Line<'_>, specs: &[DagSpec], dags: &[CaseDag]) -> Result<(), Malformed> {
    let last_release_ns = specs.iter().map(|spec| {
        let jobs = spec.jobs.unwrap_or(1);
        u128::from(spec.offset_ns) + u128::from(spec.period_ns.unwrap_or(0)) * u128::from(jobs - 1)
    });
    let executions_ns = dags
        .iter()
        .flat_map(|dag| dag.executions_ns.iter().flatten());
    let busy_ns: u128 = executions_ns
        .map(|&execution_ns| u128::from(execution_ns))
        .sum();
    if last_release_ns.max().unwrap_or(0) + busy_ns > u128::from(u64::MAX) {
        return Err(header.malformed("the schedule may end after the last time that 64 bits hold"));
    }
    Ok(())
}

type Schedule = (Vec<InstanceTimes>, Vec<Vec<JobTimes>>);

fn parse_schedule(lines: &mut Lines<'_>, dags: &[CaseDag]) -> Result<Schedule, Malformed> {
    let count = dags.iter().map(|dag| dag.jobs * dag.subtasks).sum();
    let mut instances: Vec<Option<InstanceTimes>> = vec![None; count];
    let mut jobs: Vec<Vec<Option<JobTimes>>> =
        dags.iter().map(|dag| vec![None; dag.jobs]).collect();
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
        match line.kind {
            "x" => {
                let numbers: Vec<u64> = line.numbers(6)?;
                let (dag, job) = dag_and_job(&line, dags, numbers[0], numbers[1])?;
                let subtask = in_range(&line, "subtask", numbers[2], dags[dag].subtasks)?;
                let times = InstanceTimes {
                    start_ns: numbers[3],
                    finish_ns: numbers[4],
                    preemptions: numbers[5],
                };
                fill(
                    &line,
                    &mut instances[dags[dag].position(job, subtask)],
                    times,
                )?;
            }
            "j" => {
                let words = line.exactly(6)?;
                let numbers: Vec<u64> = words[..5]
                    .iter()
                    .map(|word| line.number(word))
                    .collect::<Result<_, _>>()?;
                let (dag, job) = dag_and_job(&line, dags, numbers[0], numbers[1])?;
                let times = JobTimes {
                    release_ns: numbers[2],
                    finish_ns: numbers[3],
                    response_ns: numbers[4],
                    missed: yes(&line, words[5])?,
                };
                fill(&line, &mut jobs[dag][job], times)?;
            }
            "end" => {
                line.exactly(0)?;
                return complete(&line, instances, jobs);
            }
            other => {
                return Err(line.malformed(format!(
                    "expected `x`, `j` or `end`, found {}",
                    quoted(other)
                )));
            }
        }
    }
}

fn complete(
    end: &Line<'_>,
    instances: Vec<Option<InstanceTimes>>,
    jobs: Vec<Vec<Option<JobTimes>>>,
) -> Result<Schedule, Malformed> {
    let missing = instances
        .iter()
        .filter(|instance| instance.is_none())
        .count();
    let missing_jobs = jobs.iter().flatten().filter(|job| job.is_none()).count();
    if missing + missing_jobs > 0 {
        return Err(end.malformed(format!(
            "the case ends without {missing} `x` records and {missing_jobs} `j` records"
        )));
    }
    let jobs = jobs
        .into_iter()
        .map(|jobs| jobs.into_iter().flatten().collect());
    Ok((instances.into_iter().flatten().collect(), jobs.collect()))
}

fn fill<T>(line: &Line<'_>, place: &mut Option<T>, value: T) -> Result<(), Malformed> {
    match place.replace(value) {
        None => Ok(()),
        Some(_) => Err(line.malformed("this record stands here twice")),
    }
}

fn dag_and_job(
    line: &Line<'_>,
    dags: &[CaseDag],
    dag: u64,
    job: u64,
) -> Result<(usize, usize), Malformed> {
    let dag = in_range(line, "dag", dag, dags.len())?;
    Ok((dag, in_range(line, "job", job, dags[dag].jobs)?))
}

fn in_range(line: &Line<'_>, what: &str, number: u64, count: usize) -> Result<usize, Malformed> {
    usize::try_from(number)
        .ok()
        .filter(|&number| number < count)
        .ok_or_else(|| line.malformed(format!("there is no {what} {number}")))
}

fn at_least_one(line: &Line<'_>, word: &str) -> Result<u32, Malformed> {
    match line.number(word)? {
        0 => Err(line.malformed(format!("`{}` needs at least 1 here, found 0", line.kind))),
        number => Ok(number),
    }
}

fn yes(line: &Line<'_>, word: &str) -> Result<bool, Malformed> {
    match word {
        "0" => Ok(false),
        "1" => Ok(true),
        _ => Err(line.malformed(format!("expected 0 or 1, found {}", quoted(word)))),
    }
}
