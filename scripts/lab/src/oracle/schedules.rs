//! Reference schedules: the execution of every instance, exact to the unit.
//!
//! A case is a set of DAGs with the execution time of every instance, and a schedule agreed on by
//! two independent implementations ([`Case`] holds both). [`check`] replays the DAGs through the
//! real scheduler in virtual time. [`compare`] compares a run, in virtual time or on a machine,
//! with the case: each start, finish and number of preemptions, and each job's release, finish,
//! response time and miss.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

use sched_dag::engine::SubtaskBody;
use sched_dag::journal::{Event, EventKind, EventSubject};
use sched_dag::law::{InstanceRecord, JobRecord, RunRecord};
use sched_dag::lifecycle::{Request, WaitId, WaitLimit};
use sched_dag::virtual_time::{RunOutcome, VirtualTime, Workload};
use sched_dag::{DagId, Instance, JobOutcome, SchedulerOptions, SubtaskId, TaskSet};

pub use super::case::{Case, TimeScale, parse};

use super::{FileOracle, equal};

/// The number of cores that is always simulated. More cores are simulated only if there are as many
/// subtasks: at most one instance of each subtask runs at a time.
const ALWAYS_SIMULATED: usize = 1024;

/// The kind `schedules`.
pub(super) static ORACLE: FileOracle<Case> = FileOracle {
    invocation: "./scripts/oracle schedules",
    about: "Compares starts, finishes, preemptions, response times and misses with those of the \
            scheduler in virtual time.",
    parse,
    check,
    name: |case| &case.name,
    schedules: Some(parse),
};

/// The deviation of starts and finishes from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Deviation {
    /// The largest earliness, in nanoseconds, as a negative number.
    pub earliest_ns: i128,
    /// The largest lateness, in nanoseconds.
    pub latest_ns: i128,
}

impl Deviation {
    /// Returns the deviation covering both.
    pub fn and(self, other: Self) -> Self {
        Self {
            earliest_ns: self.earliest_ns.min(other.earliest_ns),
            latest_ns: self.latest_ns.max(other.latest_ns),
        }
    }
}

/// Replays a case and compares the whole expected schedule.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &Case) -> Result<(), String> {
    let task_set = Arc::new(case.task_set().map_err(|fault| fault.to_string())?);
    let subtasks = task_set.vertices();
    let useful = u32::try_from(subtasks.max(ALWAYS_SIMULATED)).unwrap_or(u32::MAX);
    let options = SchedulerOptions {
        policy: case.policy,
        preemption: case.preemption,
        cores: case.cores.min(useful),
    };
    let bodies = case_bodies(&task_set);
    let mut run = VirtualTime::of_bodies(&task_set, options, bodies, &[]).recording();
    let mut workload = CaseWorkload {
        case,
        answers: Vec::new(),
        timeouts: BTreeMap::new(),
    };
    match run.run(&mut workload) {
        RunOutcome::Finished => {}
        RunOutcome::TimeReached | RunOutcome::Stopped => {
            return Err("the replay stopped early".to_owned());
        }
        RunOutcome::TimeOverflow(instance) => return Err(format!("{instance} never finishes")),
    }
    // The run ended without another event, yet jobs are left: they are stuck.
    if !run.is_finished() {
        return Err("some jobs have not ended".to_owned());
    }
    let events = run.events().into_iter();
    let record = RunRecord::of_events(&task_set, true, events).ok_or("too many jobs")?;
    compare(case, &task_set, &record, 1, 0)?;
    compare_turns(case, run.events(), 1, 0)?;
    for (instance, expected) in &case.turn_times {
        let found = workload.timeouts.get(instance).copied().unwrap_or(0);
        equal(instance, "time-outs", expected.timeouts, found)?;
    }
    Ok(())
}

/// A stand-in for a subtask's function, of which only the turns matter.
struct CaseBody {
    instance: Instance,
    limits_ns: Vec<u64>,
    /// The present turn, from 0 on.
    turn: usize,
    /// Whether the wait before the present turn has ended by its limit.
    has_timed_out: bool,
}

/// Returns the bodies of a case's subtasks.
fn case_bodies(task_set: &TaskSet) -> impl Iterator<Item = CaseBody> {
    let dags = (0..).map(DagId).zip(task_set.dags());
    dags.flat_map(|(dag, model)| {
        let subtasks = (0..).map(SubtaskId).zip(model.subtasks());
        subtasks.map(move |(id, subtask)| CaseBody {
            instance: Instance::new(dag, 0, id),
            limits_ns: subtask.waits().iter().map(|wait| wait.limit_ns).collect(),
            turn: 0,
            has_timed_out: false,
        })
    })
}

impl SubtaskBody for CaseBody {
    type Alternate = ();

    fn set_job(&mut self, job: u64) {
        self.instance.job = job;
        (self.turn, self.has_timed_out) = (0, false);
    }

    fn subject(&self) -> EventSubject {
        EventSubject::of(self.instance)
    }

    fn discard(&mut self, _: u64) {}

    fn wake(&mut self, has_timed_out: bool) {
        self.turn += 1;
        self.has_timed_out = has_timed_out;
    }

    fn has_effects(&self) -> bool {
        !self.limits_ns.is_empty()
    }

    fn complete(&mut self, _: u64, _: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        self.limits_ns.get(self.turn).copied().map(WaitLimit::For)
    }

    fn alternate(&self) -> Option<()> {
        None
    }

    fn replace(&mut self) {}
}

/// The workload of a case: its execution times, and its devices' answers.
struct CaseWorkload<'c> {
    case: &'c Case,
    /// The answers on their way, each with its time.
    answers: Vec<(u64, WaitId)>,
    /// The number of each instance's waits ended by their limits.
    timeouts: BTreeMap<Instance, u64>,
}

impl Workload<CaseBody> for CaseWorkload<'_> {
    fn execute(&mut self, body: &mut CaseBody, _: u64) -> Option<u64> {
        let instance = body.instance;
        if body.has_timed_out {
            *self.timeouts.entry(instance).or_default() += 1;
        }
        self.case.sample(instance).get(2 * body.turn).copied()
    }

    fn waits(&mut self, wait: WaitId, now_ns: u64) {
        let times = self.case.sample(wait.instance);
        let answer_ns = times.get(2 * wait.number as usize + 1);
        let answer_ns = answer_ns.and_then(|ns| now_ns.checked_add(*ns));
        self.answers.extend(answer_ns.map(|ns| (ns, wait)));
    }

    fn next_request_ns(&self) -> Option<u64> {
        self.answers.iter().map(|answer| answer.0).min()
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        let due = self.answers.iter().position(|answer| answer.0 <= now_ns);
        due.map(|place| Request::Answer(self.answers.swap_remove(place).1))
    }
}

/// Compares the turns of a case's instances with the events of a run; [`compare`] does the rest.
///
/// # Errors
///
/// The first difference, in one line.
pub fn compare_turns(
    case: &Case,
    events: impl IntoIterator<Item = Event>,
    unit_ns: u64,
    tolerance_ns: u64,
) -> Result<Deviation, String> {
    let mut found = BTreeMap::<Instance, Vec<[Option<u64>; 2]>>::new();
    for event in events {
        let Some(instance) = event
            .instance()
            .filter(|of| case.turn_times.contains_key(of))
        else {
            continue;
        };
        let spans = found.entry(instance).or_default();
        let time_ns = Some(event.time_ns);
        match (event.what, spans.last_mut()) {
            (EventKind::Start, _) => spans.push([time_ns, None]),
            (EventKind::Resume, Some([_, Some(_)])) => spans.push([time_ns, None]),
            (EventKind::Wait | EventKind::Finish, Some([_, end])) => *end = time_ns,
            _ => {}
        }
    }
    let mut near = TimeComparison {
        unit_ns,
        tolerance_ns,
        deviation: Deviation::default(),
    };
    for (instance, expected) in &case.turn_times {
        let spans = found.get(instance).map_or(&[][..], |spans| spans);
        let (wanted, there) = (expected.spans_ns.len() as u64, spans.len() as u64);
        equal(instance, "segments", wanted, there)?;
        for ((number, wanted), span) in (0..).zip(&expected.spans_ns).zip(spans) {
            let place = format!("{instance} segment {number}");
            near.check(&place, "start", wanted.0, span[0])?;
            near.check(&place, "end", wanted.1, span[1])?;
        }
    }
    Ok(near.deviation)
}

/// Compares a case with the record of a run in which a unit of the case's time took `unit_ns`.
/// Starts, finishes and response times may deviate by `tolerance_ns`. Returns the largest
/// deviations.
///
/// # Errors
///
/// The first difference in the order of the reference's starts, then of its jobs, in one line.
pub fn compare(
    case: &Case,
    task_set: &TaskSet,
    record: &RunRecord,
    unit_ns: u64,
    tolerance_ns: u64,
) -> Result<Deviation, String> {
    let instances: BTreeMap<Instance, &InstanceRecord> = record.all_instances(task_set).collect();
    let dags = (0..).map(DagId).zip(task_set.dags());
    let jobs = dags.flat_map(|(dag, _)| {
        let numbered = record.numbered(dag);
        numbered.map(move |(job, times)| ((dag, job), times))
    });
    let jobs: BTreeMap<(DagId, u64), &JobRecord> = jobs.collect();
    if !instances.keys().eq(case.instances.keys()) || !jobs.keys().eq(case.jobs.keys()) {
        return Err("there were other jobs or instances than the case's".to_owned());
    }
    let mut near = TimeComparison {
        unit_ns,
        tolerance_ns,
        deviation: Deviation::default(),
    };
    // In the order of starts, the first difference is the cause of the later ones.
    let mut by_start: Vec<_> = case.instances.iter().zip(instances.values()).collect();
    by_start.sort_by_key(|((_, expected), _)| expected.start_ns);
    for ((instance, expected), found) in by_start {
        near.check(instance, "start", expected.start_ns, found.start_ns)?;
        near.check(instance, "finish", expected.finish_ns, found.finish_ns)?;
        let preemptions = found.preemptions.into();
        equal(instance, "preemptions", expected.preemptions, preemptions)?;
    }
    for ((&(dag, job), expected), found) in case.jobs.iter().zip(jobs.values()) {
        let place = format!("dag {} job {job}", dag.0);
        let release_ns = found.release_ns.unwrap_or(u64::MAX);
        let expected_ns = expected.release_ns.saturating_mul(unit_ns);
        // A release has no tolerance: it is nominal, and no machine delays it.
        equal(&place, "release", expected_ns, release_ns)?;
        let finish_ns = record.completion_ns(dag, job);
        near.check(&place, "finish", expected.finish_ns, finish_ns)?;
        let response_ns = found.ended_ns.map(|ended_ns| ended_ns - release_ns);
        near.check(&place, "response", expected.response_ns, response_ns)?;
        let missed = found.outcome != Some(JobOutcome::Met);
        equal(&place, "missed", expected.missed.into(), missed.into())?;
    }
    Ok(near.deviation)
}

/// Compares times, and keeps the largest deviations.
struct TimeComparison {
    unit_ns: u64,
    tolerance_ns: u64,
    deviation: Deviation,
}

impl TimeComparison {
    fn check(
        &mut self,
        place: impl Display,
        what: &str,
        units: u64,
        found_ns: Option<u64>,
    ) -> Result<(), String> {
        let found_ns = found_ns.ok_or_else(|| format!("{place}: {what}: there was none"))?;
        let difference_ns = i128::from(found_ns) - i128::from(units) * i128::from(self.unit_ns);
        if difference_ns.unsigned_abs() > u128::from(self.tolerance_ns) {
            // With decimals, since the difference may be a fraction of a unit.
            let (whole, part) = (found_ns / self.unit_ns, found_ns % self.unit_ns);
            let found = match u128::from(part) * 1000 / u128::from(self.unit_ns) {
                0 => whole.to_string(),
                thousandths => format!("{whole}.{thousandths:03}"),
            };
            return Err(format!("{place}: {what}: expected {units}, found {found}"));
        }
        self.deviation = self.deviation.and(Deviation {
            earliest_ns: difference_ns,
            latest_ns: difference_ns,
        });
        Ok(())
    }
}
