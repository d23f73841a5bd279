//! What the tests share: building DAGs in a line, and a log of all events.

#![allow(dead_code, reason = "each test uses a part of this")]

pub(crate) mod bench;
pub(crate) mod random;
pub(crate) mod written;

use std::fmt::Write;
use std::sync::Arc;

use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, CoreId, DagId, DagSpec, DagStatistics, Decision, Instance,
    JobOutcome, Observer, OverrunPolicy, Policy, Preemption, Priority, Scheduler, SchedulerOptions,
    SubtaskId, SubtaskSpec, TaskSet, verify,
};

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

/// Returns a DAG of one subtask, with room for few jobs in flight.
pub(crate) fn overrunning(dag: DagSpec, in_flight: u32, overrun: OverrunPolicy) -> DagSpec {
    DagSpec {
        in_flight: Some(in_flight),
        overrun,
        ..dag
    }
}

/// Commits DAGs of any shape.
pub(crate) fn commit(specs: &[DagSpec], options: SchedulerOptions) -> Arc<TaskSet> {
    let options = CommitOptions::new(options.policy, options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    Arc::new(
        verify(specs, &options)
            .expect("the test's DAGs are right")
            .task_set,
    )
}

/// Makes a scheduler for DAGs of any shape.
pub(crate) fn scheduler(specs: &[DagSpec], options: SchedulerOptions) -> Scheduler {
    Scheduler::new(commit(specs, options), options)
}

/// Completes instances at one instant, and returns the decisions.
pub(crate) fn step(
    scheduler: &mut Scheduler,
    now_ns: u64,
    completed: &[Instance],
) -> Vec<Decision> {
    let mut moment = scheduler.at(now_ns);
    for &instance in completed {
        moment.complete(instance, &mut ());
    }
    moment.release_due(&mut ()).dispatch().to_vec()
}

pub(crate) fn start(core: u32, instance: Instance) -> Decision {
    Decision::Start {
        core: CoreId(core),
        instance,
    }
}

pub(crate) fn instance(dag: u32, job: u64, subtask: u32) -> Instance {
    Instance {
        dag: DagId(dag),
        job,
        subtask: SubtaskId(subtask),
    }
}

/// Everything that happened, one event a line: time, event, instance as
/// `dag.job.subtask` or job as `dag.job`.
pub(crate) struct Log<F> {
    pub(crate) lines: Vec<String>,
    now_ns: u64,
    execution_ns: F,
    /// The instances that fail at the end of their execution.
    pub(crate) failing: Vec<Instance>,
    /// Whether there are other functions for their subtasks.
    pub(crate) is_replaceable: bool,
}

impl<F: FnMut(Instance) -> u64> Log<F> {
    pub(crate) fn new(execution_ns: F) -> Self {
        Self {
            lines: Vec::new(),
            now_ns: 0,
            execution_ns,
            failing: Vec::new(),
            is_replaceable: true,
        }
    }

    fn note(&mut self, event: std::fmt::Arguments<'_>) {
        let mut line = self.now_ns.to_string();
        write!(line, " {event}").expect("a string takes all");
        self.lines.push(line);
    }
}

/// Runs DAGs to the end and returns all events and each DAG's counters.
pub(crate) fn run(
    specs: &[DagSpec],
    options: SchedulerOptions,
    execution_ns: impl FnMut(Instance) -> u64,
) -> (Vec<String>, Vec<DagStatistics>) {
    run_failing(specs, options, &[], execution_ns)
}

/// Runs DAGs to the end as [`run`] does, while some instances fail.
pub(crate) fn run_failing(
    specs: &[DagSpec],
    options: SchedulerOptions,
    failing: &[Instance],
    execution_ns: impl FnMut(Instance) -> u64,
) -> (Vec<String>, Vec<DagStatistics>) {
    let mut log = Log::new(execution_ns);
    log.failing = failing.to_vec();
    let mut run = VirtualTime::new(scheduler(specs, options));
    assert_eq!(run.run(&mut log), End::Finished);
    assert!(run.is_finished());
    let dags = 0..u32::try_from(specs.len()).expect("few DAGs");
    let statistics = dags
        .map(|dag| *run.scheduler_of(DagId(dag)).statistics(DagId(dag)))
        .collect();
    (log.lines, statistics)
}

/// Events as lines, to be compared with what is expected.
pub(crate) trait Timeline {
    /// Fails unless they are as the text says, which has those of an instant on a line or
    /// several. Only those of the kinds that the text has are compared.
    fn must_be(&self, expected: &str);
}

impl Timeline for [String] {
    #[track_caller]
    fn must_be(&self, expected: &str) {
        let at_one_time = |line: &str| {
            let (time, events) = line.trim().split_once(' ').unwrap_or_default();
            let timed = |event: &str| format!("{time} {event}");
            events.split(", ").map(timed).collect::<Vec<_>>()
        };
        let lines = expected.lines().filter(|line| !line.trim().is_empty());
        let expected: Vec<String> = lines.flat_map(at_one_time).collect();
        let kind = |line: &str| line.split(' ').nth(1).map(str::to_owned);
        let events: Vec<&str> = self
            .iter()
            .map(String::as_str)
            .filter(|event| expected.iter().any(|line| kind(line) == kind(event)))
            .collect();
        assert_eq!(events, expected, "\nhappened:\n{}\n", events.join("\n"));
    }
}

struct Short(Instance);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.0.dag.0, self.0.job, self.0.subtask.0)
    }
}

impl<F: FnMut(Instance) -> u64> Observer for Log<F> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.note(format_args!("released {}.{job} of {release_ns}", dag.0));
    }

    fn queued(&mut self, dag: DagId, job: u64, _release_ns: u64) {
        self.note(format_args!("queued {}.{job}", dag.0));
    }

    fn skipped(&mut self, dag: DagId, job: u64, _release_ns: u64) {
        self.note(format_args!("skipped {}.{job}", dag.0));
    }

    fn ready(&mut self, instance: Instance) {
        self.note(format_args!("ready {}", Short(instance)));
    }

    fn cancelled(&mut self, instance: Instance) {
        self.note(format_args!("cancelled {}", Short(instance)));
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.note(format_args!("aborted {}.{job}", dag.0));
    }

    fn restarted(&mut self, instance: Instance) {
        self.note(format_args!("restarted {}", Short(instance)));
    }

    fn ended(&mut self, dag: DagId) {
        self.note(format_args!("end {}", dag.0));
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        self.note(format_args!("missed {}.{job} of {deadline_ns}", dag.0));
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.note(format_args!("ended {}.{job} {outcome:?}", dag.0));
    }
}

impl<F: FnMut(Instance) -> u64> Workload for Log<F> {
    const WANTED: &'static [sched_dag::journal::What] = sched_dag::told::ALL;

    fn heard(&mut self, news: &sched_dag::News) {
        sched_dag::told::tell(news, self);
    }

    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        (self.execution_ns)(instance)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        self.failing.contains(&instance)
    }

    fn is_replaceable(&mut self, _instance: Instance) -> bool {
        self.is_replaceable
    }

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn started(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.note(format_args!("start {} on {}", Short(instance), core.0));
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.note(format_args!("preempt {} on {}", Short(instance), core.0));
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.note(format_args!("resume {} on {}", Short(instance), core.0));
    }

    fn finished(&mut self, instance: Instance, _core: CoreId, _now_ns: u64) {
        self.note(format_args!("finish {}", Short(instance)));
    }

    fn failed(&mut self, instance: Instance, _core: CoreId, _now_ns: u64) {
        self.note(format_args!("fail {}", Short(instance)));
    }
}
