//! A set in the real scheduler and virtual time, with a ring for each core.
//!
//! What a kernel does is imitated: a completion's step is made by the core that
//! has finished, any other by core 0, and each core's events go to its own ring.

use std::fmt::Write;
use std::sync::Arc;

use harness::trace::model::Word;
use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, CoreId, DagId, Instance, JobOutcome, Observer,
    OverrunPolicy, Policy, Preemption, Scheduler, verify,
};

use crate::random::Random;
use crate::set::Set;

/// A run's trace, ring by ring.
#[derive(Clone)]
pub(crate) struct Recorder {
    set: Set,
    rings: Vec<Vec<String>>,
    lost: Vec<usize>,
    now_ns: u64,
    /// The core that makes the scheduler's step.
    stepping: CoreId,
    /// What has just been taken from a core: the next start there was requested.
    preempted: Option<CoreId>,
}

impl Recorder {
    /// Runs a set to its end.
    pub(crate) fn run(set: &Set) -> Recorder {
        let options = CommitOptions::new(set.options.policy, set.options.cores)
            .with_construction(ConstructionPolicy::any_graph());
        let verified = verify(&set.specs(), &options).expect("sets are right");
        let cores = set.options.cores as usize;
        let mut recorder = Recorder {
            set: set.clone(),
            rings: vec![Vec::new(); cores],
            lost: vec![0; cores],
            now_ns: 0,
            stepping: CoreId(0),
            preempted: None,
        };
        let mut run = VirtualTime::new(Scheduler::new(Arc::new(verified.task_set), set.options));
        assert_eq!(run.run(&mut recorder), End::Finished);
        recorder
    }

    /// Loses the oldest events of some cores.
    pub(crate) fn lose(&mut self, random: &mut Random) {
        for (ring, lost) in self.rings.iter_mut().zip(&mut self.lost) {
            if !ring.is_empty() && random.chance(60) {
                *lost = random.below(ring.len());
                ring.drain(..*lost);
            }
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
        let events: Vec<&String> = self.rings.iter().flatten().collect();
        for chunk in events.chunks(32) {
            let chunk: Vec<&str> = chunk.iter().map(|event| event.as_str()).collect();
            let chunk = chunk.join(",");
            say(format!("{{\"kind\":\"trace\",\"events\":[{chunk}]}}"));
        }
        let lost: usize = self.lost.iter().sum();
        // Half of all logs say of which core they were.
        let by_core = match lost % 2 {
            0 => String::new(),
            _ => format!(",\"lost_by_core\":{:?}", self.lost),
        };
        say(format!(
            "{{\"kind\":\"trace_end\",\"events\":{},\"lost\":{lost}{by_core},\"complete\":{}}}",
            events.len(),
            lost == 0
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
        format!(
            "{{\"kind\":\"trace_dag\",\"dag\":{number},\"name\":\"d{number}\",\"period_ns\":{},\
             \"relative_deadline_ns\":{},\"offset_ns\":{},\"in_flight\":{},\
             \"overrun\":\"{overrun}\",\"subtasks\":[{}],\"edges\":[{}]}}",
            dag.period_ns,
            dag.deadline_ns,
            dag.offset_ns,
            dag.in_flight,
            subtasks.join(","),
            edges.join(",")
        )
    }

    fn of_job(&mut self, word: Word, dag: DagId, job: u64) {
        let core = self.stepping;
        let (now_ns, word) = (self.now_ns, word.text());
        self.rings[core.index()].push(format!(
            "[{now_ns},\"{word}\",{},{},{job},-1]",
            core.0, dag.0
        ));
    }

    /// Notes an instance's event, about `core`, in the ring of `ring`.
    fn of_instance(&mut self, word: Word, instance: Instance, core: CoreId, ring: CoreId) {
        let Instance { dag, job, subtask } = instance;
        let (now_ns, word) = (self.now_ns, word.text());
        self.rings[ring.index()].push(format!(
            "[{now_ns},\"{word}\",{},{},{job},{}]",
            core.0, dag.0, subtask.0
        ));
    }

    fn runs(&mut self, word: Word, instance: Instance, core: CoreId) {
        if self.preempted.take() == Some(core) {
            self.of_instance(Word::Request, instance, core, self.stepping);
        }
        self.of_instance(word, instance, core, core);
    }
}

impl Observer for Recorder {
    fn released(&mut self, dag: DagId, job: u64, _release_ns: u64) {
        self.of_job(Word::Released, dag, job);
    }

    fn queued(&mut self, dag: DagId, job: u64, _release_ns: u64) {
        self.of_job(Word::Queued, dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, _release_ns: u64) {
        self.of_job(Word::Skipped, dag, job);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.of_job(Word::Aborted, dag, job);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _deadline_ns: u64) {
        self.of_job(Word::Missed, dag, job);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, _outcome: JobOutcome) {
        self.of_job(Word::Completed, dag, job);
    }

    fn ready(&mut self, instance: Instance) {
        self.of_instance(Word::Ready, instance, self.stepping, self.stepping);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.of_instance(Word::Cancelled, instance, self.stepping, self.stepping);
    }
}

impl Workload for Recorder {
    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        self.stepping = CoreId(0);
    }

    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        let Instance { dag, job, subtask } = instance;
        let job = usize::try_from(job).expect("few jobs");
        self.set.dags[dag.index()].subtasks[subtask.index()].executions_ns[job]
    }

    fn started(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.runs(Word::Start, instance, core);
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.runs(Word::Resume, instance, core);
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.of_instance(Word::Suspend, instance, core, core);
        self.preempted = Some(core);
    }

    fn finished(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.stepping = core;
        self.of_instance(Word::Finish, instance, core, core);
    }
}
