//! A reference schedule: a set of DAGs, the execution time of every instance,
//! and the schedule that two independent implementations agree on.
//!
//! The records of such a file, blank-separated words, one record a line:
//!
//! ```text
//! case NAME m edf(0/1) preemptive(0/1) ndags
//! clusters m_0 m_1 ..           if the cores are divided; the sum is m
//! dag T D O K nsub nedge        then, if there are clusters: in C; then nsub lines:  sub wcet prio e_0 .. e_{K-1}
//!                               then nedge lines: edge u v
//! sink v D_v                    for sinks with a deadline of their own, D_v <= D
//! wait v n C_0 W_1 C_1 .. W_n C_n    for subtasks with waits: WCETs of segments, and limits
//! act v k e_0 a_1 e_1 .. a_n e_n     after each of these, what each job k does: a segment's
//!                               execution time, and how long after it the answer comes
//! x dag job subtask start finish preemptions      (each instance once)
//! s dag job subtask timeouts start_0 end_0 ..     (each instance of a subtask with waits once)
//! j dag job release finish response missed(0/1)   (each job once)
//! end
//! ```
//!
//! One unit of the file's time counts as a nanosecond here; the one that runs
//! a case chooses how long a unit is. WCETs play no part in a schedule; they are only
//! checked against the execution times.
//!
//! Reading is strict: whatever is not as the format says is refused with its line.

use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{
    ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, DagId, DagSpec, Instance, Policy,
    Preemption, Priority, SubtaskId, SubtaskSpec, TaskSet, Wait, verify,
};

use text::{Line, Lines, Malformed, cases, of_file, quoted};

/// One set of DAGs with its expected schedule.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    /// Its records, from which it can be read again.
    pub text: String,
    /// The number of cores.
    pub cores: u32,
    /// How these are divided.
    pub clusters: CoreDivision,
    /// How ready instances are ordered.
    pub policy: Policy,
    /// Whether a started instance may lose its core.
    pub preemption: Preemption,
    /// The verified DAGs.
    pub task_set: Arc<TaskSet>,
    /// The execution times: of each DAG, for each subtask that of each job.
    pub executions_ns: Vec<Vec<Vec<u64>>>,
    /// The turns of each instance of a subtask with waits.
    pub turns: BTreeMap<Instance, Vec<Turn>>,
    /// When each of these is expected to take place.
    pub turn_times: BTreeMap<Instance, TurnTimes>,
    /// The expected instances.
    pub instances: BTreeMap<Instance, InstanceTimes>,
    /// The expected jobs, by DAG and number.
    pub jobs: BTreeMap<(DagId, u64), JobTimes>,
}

/// The times of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceTimes {
    /// When it first executed.
    pub start_ns: u64,
    /// When it had executed for its execution time.
    pub finish_ns: u64,
    /// How many dispatches took its core away.
    pub preemptions: u64,
}

/// A turn of an instance: a segment, and the wait behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Turn {
    /// How long it executes.
    pub execution_ns: u64,
    /// How long after it the answer to its wait comes; `None` behind the last segment.
    pub answer_ns: Option<u64>,
}

/// The times of the turns of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TurnTimes {
    /// How many of its waits ended by their limits.
    pub timeouts: u64,
    /// When each segment first executed, and when it had executed.
    pub spans_ns: Vec<(u64, u64)>,
}

/// The times of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobTimes {
    /// When it was released.
    pub release_ns: u64,
    /// When it was complete.
    pub finish_ns: u64,
    /// The time between.
    pub response_ns: u64,
    /// Whether that is more than the relative deadline.
    pub missed: bool,
}

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described above, and for
/// DAGs that cannot be committed.
pub fn parse(text: &str) -> Result<Vec<Case>, Malformed> {
    cases(text, |header, lines| parse_block(text, header, lines))
}

/// Reads the case of a text that begins with the record `header`.
///
/// # Errors
///
/// As [`parse`].
pub fn parse_block(
    text: &str,
    header: &Line<'_>,
    lines: &mut Lines<'_>,
) -> Result<Case, Malformed> {
    let case = parse_case(header, lines)?;
    let records = text.lines().take(lines.last()).skip(header.number - 1);
    Ok(Case {
        text: records.flat_map(|record| [record, "\n"]).collect(),
        ..case
    })
}

fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<Case, Malformed> {
    let [name, cores, edf, preemptive, count] = header.fixed()?;
    let cores = header.cores(cores)?;
    let policy = match header.flag(edf)? {
        true => Policy::Edf,
        false => Policy::StaticPriority,
    };
    let preemption = match header.flag(preemptive)? {
        true => Preemption::Enabled,
        false => Preemption::Disabled,
    };
    let clusters = match lines.next_if("clusters") {
        Some(line) => CoreDivision::Of(parse_clusters(&line, cores)?),
        None => CoreDivision::Undivided,
    };
    let options = CommitOptions::new(policy, cores)
        .with_clusters(clusters.clone())
        .with_construction(ConstructionPolicy::any_graph())
        .with_instance_limit(u32::MAX);

    let mut specs = Vec::new();
    let mut executions_ns = Vec::new();
    let mut turns = BTreeMap::new();
    for dag in (0..header.at_least_one(count)?).map(DagId) {
        let line = lines.expect("dag")?;
        let (mut spec, of_dag_ns) = parse_dag(&line, lines, &clusters)?;
        while let Some(line) = lines.next_if("wait") {
            parse_waits(&line, lines, (dag, &mut spec), &of_dag_ns, &mut turns)?;
        }
        commit(&line, core::slice::from_ref(&spec), &options)?;
        specs.push(spec);
        executions_ns.push(of_dag_ns);
    }
    let task_set = commit(header, &specs, &options)?;
    check_horizon(header, &specs, &executions_ns)?;
    let mut case = Case {
        name: name.to_owned(),
        text: String::new(),
        cores,
        clusters,
        policy,
        preemption,
        task_set: Arc::new(task_set),
        executions_ns,
        turns,
        turn_times: BTreeMap::new(),
        instances: BTreeMap::new(),
        jobs: BTreeMap::new(),
    };
    parse_schedule(lines, &mut case)?;
    Ok(case)
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

/// Reads a DAG and the execution times of its subtasks' instances.
fn parse_dag(
    header: &Line<'_>,
    lines: &mut Lines<'_>,
    clusters: &CoreDivision,
) -> Result<(DagSpec, Vec<Vec<u64>>), Malformed> {
    let [period, deadline, offset, jobs, subtasks, edges] = header.fixed()?;
    let jobs = header.at_least_one(jobs)?;
    let subtasks = header.at_least_one(subtasks)?;
    let edges: u32 = header.number(edges)?;
    let mut spec = DagSpec {
        period_ns: Some(header.number(period)?),
        relative_deadline_ns: Some(header.number(deadline)?),
        offset_ns: header.number(offset)?,
        // The reference never blocks a release.
        in_flight: Some(jobs),
        jobs: Some(u64::from(jobs)),
        ..DagSpec::default()
    };
    if *clusters != CoreDivision::Undivided {
        let line = lines.expect("in")?;
        let [cluster] = line.fixed()?;
        let cluster = line.index("cluster", cluster, clusters.sizes().len())?;
        spec.cluster = u32::try_from(cluster).ok().map(ClusterId);
    }
    let mut executions_ns = Vec::new();
    for _ in 0..subtasks {
        let (subtask, of_subtask_ns) = parse_subtask(&lines.expect("sub")?, jobs)?;
        spec.subtasks.push(subtask);
        executions_ns.push(of_subtask_ns);
    }
    let subtasks = spec.subtasks.len();
    spec.edges = lines.edges(edges, subtasks)?;
    while let Some(line) = lines.next_if("sink") {
        let [sink, deadline] = line.fixed()?;
        let sink = line.index("subtask", sink, subtasks)?;
        let place = &mut spec.subtasks[sink].relative_deadline_ns;
        once(&line, place.replace(line.number(deadline)?))?;
    }
    Ok((spec, executions_ns))
}

/// Reads a subtask and the execution time of each job's instance.
fn parse_subtask(line: &Line<'_>, jobs: u32) -> Result<(SubtaskSpec, Vec<u64>), Malformed> {
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
    let execution = |word: &&str| match line.number(word)? {
        execution_ns if (1..=wcet_ns).contains(&execution_ns) => Ok(execution_ns),
        execution_ns => Err(line.malformed(format!(
            "the execution time {execution_ns} is not between 1 and the WCET {wcet_ns}"
        ))),
    };
    let executions_ns = executions.iter().map(execution).collect::<Result<_, _>>()?;
    let subtask = SubtaskSpec {
        priority: Some(Priority(line.number(priority)?)),
        ..SubtaskSpec::default()
    };
    Ok((subtask, executions_ns))
}

/// Reads the waits of a subtask, and the turns of its instance in each job.
fn parse_waits(
    line: &Line<'_>,
    lines: &mut Lines<'_>,
    (dag, spec): (DagId, &mut DagSpec),
    executions_ns: &[Vec<u64>],
    turns: &mut BTreeMap<Instance, Vec<Turn>>,
) -> Result<(), Malformed> {
    let numbers: Vec<u64> = line.numbers(line.words.len())?;
    let [_, count, _, pairs @ ..] = &numbers[..] else {
        return Err(line.malformed("expected `wait v n C_0 W_1 C_1 ..`"));
    };
    let subtask = line.index("subtask", line.words[0], executions_ns.len())?;
    let (pairs, rest) = pairs.as_chunks::<2>();
    if pairs.is_empty() || pairs.len() as u64 != *count || !rest.is_empty() {
        return Err(line.malformed(format!("expected {count} waits, each with its segment")));
    }
    let waits = &mut spec.subtasks[subtask].waits;
    if !waits.is_empty() {
        return Err(line.malformed(format!("subtask {subtask} has its waits already")));
    }
    // WCETs play no part in a schedule.
    *waits = (pairs.iter())
        .map(|&[limit_ns, _]| Wait {
            limit_ns,
            segment_ns: None,
        })
        .collect();
    for (job, &execution_ns) in (0..).zip(&executions_ns[subtask]) {
        let line = lines.expect("act")?;
        let numbers: Vec<u64> = line.numbers(2 * pairs.len() + 3)?;
        let named = [
            line.index("subtask", line.words[0], executions_ns.len())? as u64,
            numbers[1],
        ];
        if named != [subtask as u64, job] {
            return Err(line.malformed(format!("expected `act {subtask} {job} ..`")));
        }
        let of_job = numbers[2..].chunks(2).map(|turn| Turn {
            execution_ns: turn[0],
            answer_ns: turn.get(1).copied(),
        });
        let of_job: Vec<Turn> = of_job.collect();
        if of_job.iter().map(|turn| turn.execution_ns).sum::<u64>() != execution_ns {
            return Err(line.malformed(format!(
                "the segments of job {job} do not come to its execution time {execution_ns}"
            )));
        }
        let subtask = SubtaskId(u32::try_from(subtask).unwrap_or(u32::MAX));
        turns.insert(Instance { dag, job, subtask }, of_job);
    }
    Ok(())
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
fn check_horizon(
    header: &Line<'_>,
    specs: &[DagSpec],
    executions_ns: &[Vec<Vec<u64>>],
) -> Result<(), Malformed> {
    let last_release_ns = specs.iter().map(|spec| {
        let jobs = spec.jobs.unwrap_or(1);
        u128::from(spec.offset_ns) + u128::from(spec.period_ns.unwrap_or(0)) * u128::from(jobs - 1)
    });
    let executions_ns = executions_ns.iter().flatten().flatten().copied();
    let busy_ns: u128 = executions_ns.map(u128::from).sum();
    let waiting_ns = specs.iter().map(|spec| {
        let waits = spec.subtasks.iter().flat_map(|subtask| &subtask.waits);
        let of_job_ns: u128 = waits.map(|wait| u128::from(wait.limit_ns)).sum();
        of_job_ns * u128::from(spec.jobs.unwrap_or(1))
    });
    let held_ns = busy_ns + waiting_ns.sum::<u128>();
    if last_release_ns.max().unwrap_or(0) + held_ns > u128::from(u64::MAX) {
        return Err(header.malformed("the schedule may end after the last time that 64 bits hold"));
    }
    Ok(())
}

/// Reads what is expected of each instance and each job.
fn parse_schedule(lines: &mut Lines<'_>, case: &mut Case) -> Result<(), Malformed> {
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
        match line.kind {
            "x" => {
                let [dag, job, subtask, start, finish, preemptions] = line.fixed()?;
                let instance = instance_of(&line, case, [dag, job, subtask])?;
                let times = InstanceTimes {
                    start_ns: line.number(start)?,
                    finish_ns: line.number(finish)?,
                    preemptions: line.number(preemptions)?,
                };
                once(&line, case.instances.insert(instance, times))?;
            }
            "s" => {
                let numbers: Vec<u64> = line.numbers(line.words.len())?;
                let [_, _, _, timeouts, spans @ ..] = &numbers[..] else {
                    return Err(line.malformed("expected `s dag job subtask timeouts start_0 ..`"));
                };
                let of = [line.words[0], line.words[1], line.words[2]];
                let instance = instance_of(&line, case, of)?;
                let turns = case.turns.get(&instance).map_or(0, Vec::len);
                if turns == 0 || 2 * turns != spans.len() {
                    return Err(line.malformed(format!(
                        "expected the spans of {turns} segments of {instance}"
                    )));
                }
                let times = TurnTimes {
                    timeouts: *timeouts,
                    spans_ns: spans.chunks_exact(2).map(|of| (of[0], of[1])).collect(),
                };
                once(&line, case.turn_times.insert(instance, times))?;
            }
            "j" => {
                let [dag, job, release, finish, response, missed] = line.fixed()?;
                // Each subtask has an instance of each job.
                let Instance { dag, job, .. } = instance_of(&line, case, [dag, job, "0"])?;
                let times = JobTimes {
                    release_ns: line.number(release)?,
                    finish_ns: line.number(finish)?,
                    response_ns: line.number(response)?,
                    missed: line.flag(missed)?,
                };
                once(&line, case.jobs.insert((dag, job), times))?;
            }
            "end" => {
                line.exactly(0)?;
                return check_all_told(&line, case);
            }
            other => {
                return Err(line.malformed(format!(
                    "expected `x`, `s`, `j` or `end`, found {}",
                    quoted(other)
                )));
            }
        }
    }
}

/// Returns the instance that a record names by its DAG, job and subtask.
fn instance_of(
    line: &Line<'_>,
    case: &Case,
    [dag, job, subtask]: [&str; 3],
) -> Result<Instance, Malformed> {
    let id = |index| u32::try_from(index).unwrap_or(u32::MAX);
    let dag = line.index("dag", dag, case.executions_ns.len())?;
    let of_dag = &case.executions_ns[dag];
    Ok(Instance {
        dag: DagId(id(dag)),
        job: line.index("job", job, of_dag[0].len())? as u64,
        subtask: SubtaskId(id(line.index("subtask", subtask, of_dag.len())?)),
    })
}

/// Refuses a case that ends without what is expected of some instance or job.
fn check_all_told(end: &Line<'_>, case: &Case) -> Result<(), Malformed> {
    let jobs: usize = case.executions_ns.iter().map(|dag| dag[0].len()).sum();
    let instances: usize = case.executions_ns.iter().flatten().map(Vec::len).sum();
    let instances = instances - case.instances.len();
    let jobs = jobs - case.jobs.len();
    let turns = case.turns.len() - case.turn_times.len();
    if instances + jobs + turns > 0 {
        return Err(end.malformed(format!(
            "the case ends without {instances} `x` records, {turns} `s` records and {jobs} `j` \
             records"
        )));
    }
    Ok(())
}

/// Refuses a record that has replaced an earlier one.
fn once<T>(line: &Line<'_>, earlier: Option<T>) -> Result<(), Malformed> {
    match earlier {
        None => Ok(()),
        Some(_) => Err(line.malformed("this record stands here twice")),
    }
}
