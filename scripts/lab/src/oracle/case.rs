//! A reference schedule: a set of DAGs, the execution time of every instance, and a schedule agreed
//! on by two independent implementations.
//!
//! The records of a file are lines of blank-separated words:
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
//! A unit of the file's time counts as a nanosecond here. WCETs play no part in a schedule; they
//! are only checked against the execution times.
//!
//! Reading is strict: any deviation from the format is refused with its line. DAGs have the types
//! of a DAG file, where the samples are the execution times, job by job.

use std::collections::BTreeMap;

use fass_dag_file::{
    FileDag, FileSubtask, Length, Set, check, executed_ns, is_name, no_name, sample_len,
};
use sched_dag::{
    ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, DagId, DagSpec, Instance, Policy,
    Preemption, Priority, SubtaskId, SubtaskSpec, TaskSet, Wait, verify,
};

use text::{Line, Lines, Malformed, cases, quoted};

use super::bounds::parse_wait;

/// A set of DAGs with its expected schedule.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    /// The number of cores.
    pub cores: u32,
    /// The division of the cores into clusters.
    pub clusters: CoreDivision,
    /// The policy ordering the ready instances.
    pub policy: Policy,
    /// Whether a started instance may lose its core.
    pub preemption: Preemption,
    /// The DAGs.
    pub set: Set,
    /// The expected times of the segments of subtasks with waits.
    pub turn_times: BTreeMap<Instance, TurnTimes>,
    /// The expected instances.
    pub instances: BTreeMap<Instance, InstanceTimes>,
    /// The expected jobs, by DAG and number.
    pub jobs: BTreeMap<(DagId, u64), JobTimes>,
}

/// The times of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceTimes {
    /// When the instance first executed.
    pub start_ns: u64,
    /// When the instance had received its whole execution time.
    pub finish_ns: u64,
    /// The number of dispatches that took its core away.
    pub preemptions: u64,
}

/// The times of the turns of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TurnTimes {
    /// The number of waits ended by their limits.
    pub timeouts: u64,
    /// When each segment first executed, and when it ended.
    pub spans_ns: Vec<(u64, u64)>,
}

/// The times of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobTimes {
    /// When the job was released.
    pub release_ns: u64,
    /// When the job was complete.
    pub finish_ns: u64,
    /// The time from release to completion.
    pub response_ns: u64,
    /// Whether the response time exceeds the relative deadline.
    pub missed: bool,
}

/// The conversion from a case's times to machine times.
#[derive(Clone, Copy, Debug)]
pub struct TimeScale {
    /// The length of a unit, in nanoseconds.
    pub unit_ns: u64,
    /// The time by which each segment's execution is shortened, in nanoseconds.
    pub guard_ns: u64,
}

impl Case {
    /// Returns the execution times of an instance's segments, each followed by the time until the
    /// answer to the wait after that segment.
    pub(super) fn sample(&self, instance: Instance) -> &[u64] {
        let dag = &self.set.dags[instance.dag.index()];
        let subtask = instance.subtask.index();
        let mut samples = dag.subtasks[subtask]
            .samples_ns
            .chunks(sample_len(&dag.spec.subtasks[subtask]));
        let job = usize::try_from(instance.job).ok();
        job.and_then(|job| samples.nth(job)).unwrap_or_default()
    }

    /// Verifies the DAGs, and returns them as a task set.
    ///
    /// # Errors
    ///
    /// The first fault, with its line.
    pub fn task_set(&self) -> Result<TaskSet, Malformed> {
        let options = CommitOptions::new(self.policy, self.cores)
            .with_clusters(self.clusters.clone())
            .with_construction(ConstructionPolicy::any_graph())
            .with_instance_limit(u32::MAX);
        check(&self.set, &options, Length::Jobs(1)).map_err(|mut faults| faults.remove(0))?;
        let specs: Vec<DagSpec> = self.set.dags.iter().map(|dag| dag.spec.clone()).collect();
        let verified = verify(&specs, &options).map_err(|rejected| Malformed {
            line: 1,
            reason: rejected.to_string(),
        });
        Ok(verified?.task_set)
    }

    /// Returns the DAGs with machine times.
    ///
    /// # Errors
    ///
    /// In words: a time is too long at this scale.
    pub fn set_at(&self, scale: TimeScale) -> Result<Set, String> {
        let unit_ns = scale.unit_ns;
        let at_scale = |units: u64| {
            unit_ns.checked_mul(units).ok_or_else(|| {
                format!(
                    "{units} units of {unit_ns} ns are more than 64 bits hold; choose a shorter unit"
                )
            })
        };
        let mut set = self.set.clone();
        for FileDag { spec, subtasks, .. } in &mut set.dags {
            let mut times = vec![&mut spec.offset_ns];
            times.extend(&mut spec.period_ns);
            times.extend(&mut spec.relative_deadline_ns);
            for (spec, of_file) in spec.subtasks.iter_mut().zip(subtasks) {
                let len = sample_len(spec);
                let samples = of_file
                    .samples_ns
                    .iter()
                    .enumerate()
                    .map(|(place, &units)| {
                        let is_segment = (place % len).is_multiple_of(2);
                        let guard_ns = if is_segment { scale.guard_ns } else { 0 };
                        Ok(at_scale(units)?.saturating_sub(guard_ns))
                    });
                of_file.samples_ns = samples.collect::<Result<_, String>>()?;
                times.extend(spec.waits.iter_mut().map(|wait| &mut wait.limit_ns));
                times.extend(&mut spec.relative_deadline_ns);
            }
            for ns in times {
                *ns = at_scale(*ns)?;
            }
        }
        Ok(set)
    }
}

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that deviates from the format above, and for DAGs that cannot
/// be committed.
pub fn parse(text: &str) -> Result<Vec<Case>, Malformed> {
    cases(text, parse_case)
}

/// Reads a case from its header on.
pub(super) fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<Case, Malformed> {
    let [name, cores, edf, preemptive, count] = header.fixed()?;
    if !is_name(name) {
        return Err(header.malformed(no_name(name)));
    }
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
    let mut set = Set {
        name: name.to_owned(),
        ..Set::default()
    };
    for number in 0..header.at_least_one(count)? {
        let mut dag = parse_dag(number, lines, &clusters)?;
        while let Some(line) = lines.next_if("wait") {
            parse_waits(&line, lines, &mut dag)?;
        }
        set.dags.push(dag);
    }
    let mut case = Case {
        name: name.to_owned(),
        cores,
        clusters,
        policy,
        preemption,
        set,
        turn_times: BTreeMap::new(),
        instances: BTreeMap::new(),
        jobs: BTreeMap::new(),
    };
    case.task_set()?;
    check_horizon(header, &case.set)?;
    parse_schedule(lines, &mut case)?;
    Ok(case)
}

/// Reads the number of cores of each cluster; together they must be all cores.
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
    number: u32,
    lines: &mut Lines<'_>,
    clusters: &CoreDivision,
) -> Result<FileDag, Malformed> {
    let header = lines.expect("dag")?;
    let [period, deadline, offset, jobs, subtasks, edges] = header.fixed()?;
    let jobs = header.at_least_one(jobs)?;
    let subtasks = header.at_least_one(subtasks)?;
    let edges: u32 = header.number(edges)?;
    let mut spec = DagSpec {
        name: number.to_string(),
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
    let mut of_file = Vec::new();
    for number in 0..subtasks {
        let (subtask, more) = parse_subtask(number, &lines.expect("sub")?, jobs)?;
        spec.subtasks.push(subtask);
        of_file.push(more);
    }
    let subtasks = spec.subtasks.len();
    spec.edges = lines.edges(edges, subtasks)?;
    while let Some(line) = lines.next_if("sink") {
        let [sink, deadline] = line.fixed()?;
        let sink = line.index("subtask", sink, subtasks)?;
        let place = &mut spec.subtasks[sink].relative_deadline_ns;
        once(&line, place.replace(line.number(deadline)?))?;
    }
    Ok(FileDag {
        spec,
        line: header.number,
        subtasks: of_file,
        ..FileDag::default()
    })
}

/// Reads a subtask and the execution time of each job's instance.
fn parse_subtask(
    number: u32,
    line: &Line<'_>,
    jobs: u32,
) -> Result<(SubtaskSpec, FileSubtask), Malformed> {
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
    let subtask = SubtaskSpec {
        name: number.to_string(),
        priority: Some(Priority(line.number(priority)?)),
        ..SubtaskSpec::default()
    };
    let of_file = FileSubtask {
        line: line.number,
        samples_ns: executions.iter().map(execution).collect::<Result<_, _>>()?,
    };
    Ok((subtask, of_file))
}

/// Reads the waits of a subtask, and the turns of its instance in each job.
fn parse_waits(line: &Line<'_>, lines: &mut Lines<'_>, dag: &mut FileDag) -> Result<(), Malformed> {
    let (subtask, _, times) = parse_wait(line, dag.subtasks.len())?;
    let waits = &mut dag.spec.subtasks[subtask].waits;
    if !waits.is_empty() {
        return Err(line.malformed(format!("subtask {subtask} has its waits already")));
    }
    waits.extend(times[1..].iter().step_by(2).map(|&limit_ns| Wait {
        limit_ns,
        // WCETs play no part in a schedule.
        segment_ns: None,
    }));
    let samples_ns = &mut dag.subtasks[subtask].samples_ns;
    let mut turns_ns = Vec::new();
    for (job, &execution_ns) in (0..).zip(&**samples_ns) {
        let line = lines.expect("act")?;
        let numbers: Vec<u64> = line.numbers(times.len() + 2)?;
        if numbers[..2] != [subtask as u64, job] {
            return Err(line.malformed(format!("expected `act {subtask} {job} ..`")));
        }
        if executed_ns(&numbers[2..]) != execution_ns {
            return Err(line.malformed(format!(
                "the segments of job {job} do not come to its execution time {execution_ns}"
            )));
        }
        turns_ns.extend(&numbers[2..]);
    }
    *samples_ns = turns_ns.into();
    Ok(())
}

/// Refuses a case whose schedule could end after the largest 64-bit time if everything ran on a
/// single core.
fn check_horizon(header: &Line<'_>, set: &Set) -> Result<(), Malformed> {
    let (mut last_release_ns, mut held_ns) = (0, 0);
    for FileDag { spec, subtasks, .. } in &set.dags {
        let jobs = u128::from(spec.jobs.unwrap_or(1));
        let period_ns = u128::from(spec.period_ns.unwrap_or(0));
        last_release_ns = last_release_ns.max(u128::from(spec.offset_ns) + period_ns * (jobs - 1));
        for (subtask, of_file) in spec.subtasks.iter().zip(subtasks) {
            let samples = of_file
                .samples_ns
                .chunks(sample_len(subtask))
                .map(executed_ns);
            let limits = subtask.waits.iter().map(|wait| u128::from(wait.limit_ns));
            held_ns += samples.map(u128::from).sum::<u128>() + jobs * limits.sum::<u128>();
        }
    }
    if last_release_ns + held_ns > u128::from(u64::MAX) {
        return Err(header.malformed("the schedule may end after the last time that 64 bits hold"));
    }
    Ok(())
}

/// Reads the expected times of each instance and each job.
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
                let turns = case.sample(instance).len();
                if turns == 1 || turns + 1 != spans.len() {
                    return Err(line.malformed(format!(
                        "expected the spans of the segments of {instance}, which waits"
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

/// Returns the instance named by a record's DAG, job and subtask.
fn instance_of(
    line: &Line<'_>,
    case: &Case,
    [dag, job, subtask]: [&str; 3],
) -> Result<Instance, Malformed> {
    let id = |index| u32::try_from(index).unwrap_or(u32::MAX);
    let dag = line.index("dag", dag, case.set.dags.len())?;
    let FileDag { spec, subtasks, .. } = &case.set.dags[dag];
    let jobs = usize::try_from(spec.jobs.unwrap_or(0)).unwrap_or(usize::MAX);
    Ok(Instance {
        dag: DagId(id(dag)),
        job: line.index("job", job, jobs)? as u64,
        subtask: SubtaskId(id(line.index("subtask", subtask, subtasks.len())?)),
    })
}

/// Refuses a case without a record for some instance or job.
fn check_all_told(end: &Line<'_>, case: &Case) -> Result<(), Malformed> {
    let mut left = [0; 3];
    for FileDag { spec, .. } in &case.set.dags {
        let waiting = spec
            .subtasks
            .iter()
            .filter(|subtask| !subtask.waits.is_empty());
        let each = [spec.subtasks.len(), waiting.count(), 1];
        for (left, each) in left.iter_mut().zip(each) {
            *left += spec.jobs.unwrap_or(0) * each as u64;
        }
    }
    let told = [case.instances.len(), case.turn_times.len(), case.jobs.len()];
    for (left, told) in left.iter_mut().zip(told) {
        *left -= told as u64;
    }
    let [instances, turns, jobs] = left;
    if left != [0; 3] {
        return Err(end.malformed(format!(
            "the case ends without {instances} `x` records, {turns} `s` records and {jobs} `j` \
             records"
        )));
    }
    Ok(())
}

/// Refuses a record that has replaced an earlier record.
fn once<T>(line: &Line<'_>, earlier: Option<T>) -> Result<(), Malformed> {
    match earlier {
        None => Ok(()),
        Some(_) => Err(line.malformed("this record stands here twice")),
    }
}
