//! Support of the tests: sets of DAGs, runs of them, and timelines to hold their journals against.
//!
//! A timeline is text, an instant a line: the time, and the events that are written down, by the
//! journal's words. Only events of the kinds that the text has are compared. Cores are named by
//! `on`, DAGs, jobs and instances as `dag`, `dag.job` and `dag.job.subtask`; a completed job has
//! its outcome. A word with a `=` is asked of the scheduler: a counter of DAG 0, of DAG 1 as in
//! `misses@1=2`, or what [`ask`] knows; a line of such at the end needs no time.

#![allow(dead_code, reason = "each test uses a part of this")]

pub(crate) mod events;
pub(crate) mod hand;
pub(crate) mod script;
pub(crate) mod set;

use std::collections::HashMap;
use std::sync::Arc;

use random::Random;
use sched_dag::journal::{Event, EventKind};
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{
    Activation, CommitOptions, ConstructionPolicy, CoreId, DagId, DagSpec, FaultLimit, HandOff,
    Instance, JobOutcome, OnFault, OverrunPolicy, Policy, Preemption, Priority, Scheduler,
    SchedulerOptions, SubtaskId, SubtaskSpec, TaskSet, Unwritten, Vertex, verify,
};
pub(crate) use script::{Run, Script};

/// Options for static priority with preemption.
pub(crate) const PREEMPTIVE: SchedulerOptions = SchedulerOptions {
    policy: Policy::StaticPriority,
    preemption: Preemption::Enabled,
    cores: 1,
};

pub(crate) const TWO_CORES: SchedulerOptions = cores(2);

/// Likewise, on so many cores.
pub(crate) const fn cores(cores: u32) -> SchedulerOptions {
    SchedulerOptions {
        cores,
        ..PREEMPTIVE
    }
}

/// Likewise, on one core by another policy.
pub(crate) const fn under(policy: Policy) -> SchedulerOptions {
    SchedulerOptions {
        policy,
        ..PREEMPTIVE
    }
}

/// Returns a DAG with period, deadline, jobs, priorities of its subtasks, and edges.
pub(crate) fn dag(
    period_ns: u64,
    deadline_ns: u64,
    jobs: u64,
    priorities: &[u32],
    edges: &[(usize, usize)],
) -> DagSpec {
    let subtask = |&priority: &u32| SubtaskSpec {
        priority: Some(Priority(priority)),
        ..SubtaskSpec::default()
    };
    DagSpec {
        period_ns: Some(period_ns),
        relative_deadline_ns: Some(deadline_ns),
        jobs: Some(jobs),
        in_flight: Some(u32::try_from(jobs).expect("few jobs")),
        subtasks: priorities.iter().map(subtask).collect(),
        edges: edges.to_vec(),
        ..DagSpec::default()
    }
}

/// Draws `percent` of 100 edges along a random order, so that indices are not sorted by
/// precedence; transitive ones occur.
pub(crate) fn shuffled_edges(
    random: &mut Random,
    count: usize,
    percent: u64,
) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..count).collect();
    for position in (1..count).rev() {
        order.swap(position, random.index(position + 1));
    }
    let edges = random.edges(count, percent);
    edges.map(|(from, to)| (order[from], order[to])).collect()
}

/// A DAG with something else.
pub(crate) trait Spec: Sized {
    /// Changes it.
    fn with(self, change: impl FnOnce(&mut DagSpec)) -> DagSpec;

    fn offset(self, offset_ns: u64) -> DagSpec {
        self.with(|dag| dag.offset_ns = offset_ns)
    }

    /// Room for few jobs in flight.
    fn overrunning(self, in_flight: u32, overrun: OverrunPolicy) -> DagSpec {
        self.with(|dag| (dag.in_flight, dag.overrun) = (Some(in_flight), overrun))
    }

    fn sporadic(self) -> DagSpec {
        self.with(|dag| dag.activation = Activation::Sporadic)
    }

    fn endless(self) -> DagSpec {
        self.with(|dag| dag.jobs = None)
    }

    fn wcets(self, wcets_ns: &[u64]) -> DagSpec {
        self.with(|dag| {
            let subtasks = dag.subtasks.iter_mut().zip(wcets_ns);
            subtasks.for_each(|(subtask, wcet_ns)| subtask.wcet_ns = Some(*wcet_ns));
        })
    }

    /// Survives `faults` within `window` jobs, `in_all` in all.
    fn surviving(self, faults: u32, window: u64, in_all: u32) -> DagSpec {
        let limit = FaultLimit::new(faults, window, in_all);
        self.with(|dag| dag.on_fault = OnFault::DropJob(limit))
    }

    fn non_preemptive(self, subtask: usize) -> DagSpec {
        self.with(|dag| dag.subtasks[subtask].non_preemptive = true)
    }

    /// A deadline of one sink.
    fn due(self, subtask: usize, deadline_ns: u64) -> DagSpec {
        self.with(|dag| dag.subtasks[subtask].relative_deadline_ns = Some(deadline_ns))
    }
}

impl Spec for DagSpec {
    fn with(mut self, change: impl FnOnce(&mut DagSpec)) -> DagSpec {
        change(&mut self);
        self
    }
}

/// Commits DAGs of any shape.
pub(crate) fn commit(specs: &[DagSpec], options: SchedulerOptions) -> Arc<TaskSet> {
    let options = CommitOptions::new(options.policy, options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    let verified = verify(specs, &options).expect("the test's DAGs are right");
    Arc::new(verified.task_set)
}

/// Makes a driver in virtual time for DAGs of any shape.
pub(crate) fn driver(specs: &[DagSpec], options: SchedulerOptions) -> VirtualTime {
    VirtualTime::new(&commit(specs, options), options)
}

/// Makes a scheduler for DAGs of any shape.
pub(crate) fn scheduler(specs: &[DagSpec], options: SchedulerOptions) -> Scheduler {
    Scheduler::new(commit(specs, options), options)
}

/// Ends an instance by the short way, and writes down what that leaves to its driver.
pub(crate) fn pass_on(
    scheduler: &mut Scheduler,
    now_ns: u64,
    core: CoreId,
    vertex: Vertex,
) -> HandOff {
    let finished = scheduler.instance_of(vertex);
    let (done, unwritten) = scheduler.pass_on(now_ns, core, vertex);
    if let HandOff::To(_, decision) = done {
        let log = &mut scheduler.log;
        if unwritten != Unwritten::Nothing {
            log.on_core(core, EventKind::Finish, now_ns, finished);
        }
        if unwritten == Unwritten::FinishAndReady {
            log.on_core(core, EventKind::Ready, log.now_ns(), decision.instance);
        }
    }
    done
}

pub(crate) fn instance(dag: u32, job: u64, subtask: u32) -> Instance {
    Instance::new(DagId(dag), job, SubtaskId(subtask))
}

/// Returns an instance by its name.
pub(crate) fn named(name: &str) -> Instance {
    let parts: Vec<u32> = name.split('.').filter_map(|it| it.parse().ok()).collect();
    let [dag, job, subtask] = parts[..] else {
        panic!("`{name}` is no instance")
    };
    instance(dag, job.into(), subtask)
}

/// Returns a variable's number.
pub(crate) fn number(variable: &str, default: u64) -> u64 {
    let given = std::env::var(variable).ok();
    given.map_or(default, |text| text.parse().expect("a whole number"))
}

/// Runs DAGs to the end.
pub(crate) fn run(specs: &[DagSpec], options: SchedulerOptions, takes: impl Takes) -> Run {
    let run = Script::new(takes).run(driver(specs, options));
    assert!(run.driver.is_finished());
    run
}

/// How long instances execute.
pub(crate) trait Takes {
    fn takes_ns(&mut self, instance: Instance) -> u64;
}

/// All as long.
impl Takes for u64 {
    fn takes_ns(&mut self, _: Instance) -> u64 {
        *self
    }
}

/// Each subtask as long, in every job.
impl<const SUBTASKS: usize> Takes for [u64; SUBTASKS] {
    fn takes_ns(&mut self, instance: Instance) -> u64 {
        self[instance.subtask.index()]
    }
}

/// Likewise, by DAG and subtask.
impl<const DAGS: usize, const SUBTASKS: usize> Takes for [[u64; SUBTASKS]; DAGS] {
    fn takes_ns(&mut self, instance: Instance) -> u64 {
        self[instance.dag.index()][instance.subtask.index()]
    }
}

impl<F: FnMut(Instance) -> u64> Takes for F {
    fn takes_ns(&mut self, instance: Instance) -> u64 {
        self(instance)
    }
}

/// Returns events in words, each with its time.
pub(crate) fn told<'a>(events: impl IntoIterator<Item = &'a Event>) -> Vec<(u64, String)> {
    let mut outcomes: HashMap<(DagId, u64), JobOutcome> = HashMap::new();
    let mut stopped = Vec::new();
    let tell = |event: &Event| {
        let Event { dag, job, what, .. } = *event;
        let outcome = match what {
            EventKind::Aborted => Some(JobOutcome::Aborted),
            EventKind::Restarted => Some(JobOutcome::Failed),
            _ => None,
        };
        let known = outcomes.get(&(dag, job)).copied();
        if let Some(outcome) = outcome
            && known.is_none_or(|known| known == JobOutcome::Missed)
        {
            outcomes.insert((dag, job), outcome);
        }
        if what == EventKind::Missed {
            outcomes.entry((dag, job)).or_insert(JobOutcome::Missed);
        }
        if what == EventKind::DagEnded {
            stopped.push(dag);
        }
        let cut = known.filter(|known| *known != JobOutcome::Missed);
        let ended = stopped.contains(&dag).then_some(JobOutcome::DagEnded);
        let outcome = cut.or(ended).or(known).unwrap_or(JobOutcome::Met);
        let subject = match event.subtask {
            Some(subtask) => format!("{}.{job}.{}", dag.0, subtask.0),
            None if what == EventKind::Entered => job.to_string(),
            None if what.is_of_dag() => dag.0.to_string(),
            None => format!("{}.{job}", dag.0),
        };
        let rest = match what {
            EventKind::Start | EventKind::Suspend | EventKind::Resume => {
                format!(" on {}", event.core.0)
            }
            EventKind::Completed => format!(" {outcome:?}"),
            _ => String::new(),
        };
        (event.time_ns, format!("{what} {subject}{rest}"))
    };
    events.into_iter().map(tell).collect()
}

/// Asks a scheduler, and fails if it does not say what is expected: `key=value`.
#[track_caller]
pub(crate) fn ask(scheduler: &Scheduler, question: &str) {
    let (key, expected) = question.split_once('=').expect("a question");
    let (key, dag) = key.split_once('@').unwrap_or((key, "0"));
    let dag = DagId(dag.parse().expect("a DAG's number"));
    let said = match key {
        "now" => scheduler.now_ns().to_string(),
        "next" => (scheduler.next_event_ns()).map_or("never".into(), |ns| ns.to_string()),
        "runs" => {
            let cores = (0..scheduler.options().cores).map(CoreId);
            let running = cores.map(|core| match scheduler.running(core) {
                Some(Instance { dag, job, subtask }) => format!("{}.{job}.{}", dag.0, subtask.0),
                None => "-".to_owned(),
            });
            running.collect::<Vec<_>>().join("+")
        }
        "finished" => scheduler.is_finished().to_string(),
        "over" => scheduler.is_over(dag).to_string(),
        "ended" => scheduler.is_ended(dag).to_string(),
        "paused" => scheduler.is_paused(dag).to_string(),
        "waiting" => scheduler.waiting(dag).to_string(),
        "in_flight" => scheduler.in_flight(dag).to_string(),
        counter => {
            let all = format!("{:?}", scheduler.statistics(dag));
            let (_, rest) = (all.split_once(&format!(" {counter}: "))).expect("a counter");
            rest.split([',', ' ']).next().unwrap_or_default().to_owned()
        }
    };
    assert_eq!(said, expected, "{question}");
}

/// Returns the lines of a text, each with its parts: (time, (questions, events)).
pub(crate) type Line<'t> = (Option<u64>, Vec<&'t str>, Vec<&'t str>);

pub(crate) fn line(text: &str) -> Line<'_> {
    let text = text.trim();
    let (first, rest) = text.split_once(' ').unwrap_or((text, ""));
    let time_ns = first.parse().ok();
    let parts = if time_ns.is_some() { rest } else { text };
    let parts = parts.split(", ").filter(|part| !part.is_empty());
    let (questions, events) = parts.partition(|part| part.contains('='));
    (time_ns, questions, events)
}

pub(crate) fn kind(event: &str) -> &str {
    event.split(' ').next().unwrap_or_default()
}
