//! A set in the real scheduler and virtual time, and the trace that a kernel leaves.
//!
//! The requests that a kernel makes of cores are imitated.

use std::fmt::Write;
use std::sync::Arc;

use sched_dag::Recorder as Journal;
use sched_dag::journal::{Event, What};
use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, CoreId, DagId, Instance, JobOutcome, Observer,
    OverrunPolicy, Policy, Preemption, Scheduler, verify,
};

use crate::random::Random;
use crate::set::Set;

/// A run's trace.
#[derive(Clone)]
pub(crate) struct Recorder {
    set: Set,
    events: Vec<Event>,
    lost: usize,
}

impl Recorder {
    /// Runs a set to its end.
    pub(crate) fn run(set: &Set) -> Recorder {
        let options = CommitOptions::new(set.options.policy, set.options.cores)
            .with_construction(ConstructionPolicy::any_graph());
        let verified = verify(&set.specs(), &options).expect("sets are right");
        let task_set = Arc::new(verified.task_set);
        let mut driver = Driver {
            set,
            journal: Journal::new(Arc::clone(&task_set)),
            preempted: None,
        };
        let mut run = VirtualTime::new(Scheduler::new(task_set, set.options));
        assert_eq!(run.run(&mut driver), End::Finished);
        Recorder {
            set: set.clone(),
            events: driver.journal.events,
            lost: 0,
        }
    }

    /// Loses the oldest events.
    pub(crate) fn lose(&mut self, random: &mut Random) {
        if !self.events.is_empty() {
            self.lost = random.below(self.events.len());
            self.events.drain(..self.lost);
        }
    }

    /// Returns the trace as a kernel prints it.
    pub(crate) fn log(&self) -> String {
        let options = self.set.options;
        let mut log = String::from("a line for people\n");
        let policy = match options.policy {
            Policy::StaticPriority => "static",
            Policy::Edf => "edf",
        };
        let preemption = match options.preemption {
            Preemption::Enabled => "on",
            Preemption::Disabled => "off",
        };
        let mut say = |line: String| writeln!(log, "{line}").expect("a string takes it");
        say(format!(
            "{{\"kind\":\"trace_begin\",\"policy\":\"{policy}\",\"preemption\":\"{preemption}\",\
             \"cores\":{},\"run\":0}}",
            options.cores
        ));
        for number in 0..self.set.dags.len() {
            say(self.dag_line(number));
        }
        for chunk in self.events.chunks(32) {
            let chunk: Vec<String> = chunk.iter().map(as_json).collect();
            let chunk = chunk.join(",");
            say(format!("{{\"kind\":\"trace\",\"events\":[{chunk}]}}"));
        }
        say(format!(
            "{{\"kind\":\"trace_end\",\"events\":{},\"lost\":{},\"complete\":{}}}",
            self.events.len(),
            self.lost,
            self.lost == 0
        ));
        log
    }

    fn dag_line(&self, number: usize) -> String {
        let dag = &self.set.dags[number];
        let overrun = match dag.overrun {
            OverrunPolicy::Queue => "queue",
            OverrunPolicy::Skip => "skip",
            OverrunPolicy::Abort => "abort",
        };
        let subtasks = dag.subtasks.iter().enumerate().map(|(number, subtask)| {
            format!(
                "[\"s{number}\",{},{},null]",
                subtask.priority,
                u8::from(subtask.non_preemptive)
            )
        });
        let subtasks: Vec<String> = subtasks.collect();
        let edges = dag.edges.iter().map(|(from, to)| format!("[{from},{to}]"));
        let edges: Vec<String> = edges.collect();
        let stated = dag.subtasks.iter().enumerate();
        let sinks = stated
            .filter_map(|(number, subtask)| Some(format!("[{number},{}]", subtask.deadline_ns?)));
        let sinks: Vec<String> = sinks.collect();
        format!(
            "{{\"kind\":\"trace_dag\",\"dag\":{number},\"name\":\"d{number}\",\"period_ns\":{},\
             \"relative_deadline_ns\":{},\"offset_ns\":{},\"in_flight\":{},\
             \"overrun\":\"{overrun}\",\"subtasks\":[{}],\"edges\":[{}],\"sinks\":[{}]}}",
            dag.period_ns,
            dag.deadline_ns,
            dag.offset_ns,
            dag.in_flight,
            subtasks.join(","),
            edges.join(","),
            sinks.join(",")
        )
    }
}

fn as_json(event: &Event) -> String {
    let Event {
        time_ns,
        what,
        core,
        dag,
        job,
        subtask,
    } = event;
    let subtask = subtask.map_or(-1, |subtask| i64::from(subtask.0));
    format!(
        "[{time_ns},\"{what}\",{},{},{job},{subtask}]",
        core.0, dag.0
    )
}

/// The run as the driver shows it.
struct Driver<'s> {
    set: &'s Set,
    journal: Journal,
    /// What has just been taken from a core: the next start there was requested.
    preempted: Option<CoreId>,
}

impl Driver<'_> {
    fn runs(&mut self, what: What, instance: Instance, core: CoreId) {
        if self.preempted.take() == Some(core) {
            self.journal.on_core(What::Request, instance, core);
        }
        self.journal.on_core(what, instance, core);
    }
}

impl Observer for Driver<'_> {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.journal.released(dag, job, release_ns);
    }

    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.journal.queued(dag, job, release_ns);
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.journal.skipped(dag, job, release_ns);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.journal.aborted(dag, job);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        self.journal.deadline_missed(dag, job, deadline_ns);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.journal.job_completed(dag, job, outcome);
    }

    fn ready(&mut self, instance: Instance) {
        self.journal.ready(instance);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.journal.cancelled(instance);
    }
}

impl Workload for Driver<'_> {
    fn instant(&mut self, now_ns: u64) {
        self.journal.now_ns = now_ns;
    }

    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        let Instance { dag, job, subtask } = instance;
        let job = usize::try_from(job).expect("few jobs");
        self.set.dags[dag.index()].subtasks[subtask.index()].executions_ns[job]
    }

    fn started(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.runs(What::Start, instance, core);
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.runs(What::Resume, instance, core);
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Suspend, instance, core);
        self.preempted = Some(core);
    }

    fn finished(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Finish, instance, core);
    }
}
