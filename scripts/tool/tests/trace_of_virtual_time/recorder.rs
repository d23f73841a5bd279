//! A set in the real scheduler and virtual time, and the trace that a kernel leaves.
//!
//! The requests that a kernel makes of cores are imitated.

use std::sync::Arc;

use sched_dag::Recorder as Journal;
use sched_dag::journal::What;
use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, CoreId, DagId, Instance, JobOutcome, Observer, Scheduler,
    TaskSet, verify,
};
use tool::trace::commit::Committed;
use tool::trace::model::Run;

use crate::random::Random;
use crate::set::Set;

/// Runs a set to its end, and returns what a trace tells of that.
pub(crate) fn record(set: &Set) -> Run {
    let options = CommitOptions::new(set.options.policy, set.options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&set.specs(), &options).expect("sets are right");
    let task_set = Arc::new(verified.task_set);
    let mut driver = Driver {
        set,
        journal: Journal::new(Arc::clone(&task_set)),
        preempted: None,
    };
    let mut run = VirtualTime::new(Scheduler::new(Arc::clone(&task_set), set.options));
    assert_eq!(run.run(&mut driver), End::Finished);
    Run {
        number: 0,
        line: 1,
        options: set.options,
        usual_bound_ns: 0,
        task_set: TaskSet::clone(&task_set),
        committed: Committed::default(),
        events: driver.journal.events,
        lost: 0,
        complete: true,
    }
}

/// Loses the oldest events.
pub(crate) fn lose(run: &mut Run, random: &mut Random) {
    if !run.events.is_empty() {
        let lost = random.below(run.events.len());
        run.events.drain(..lost);
        run.lost = u64::try_from(lost).expect("few events");
        run.complete = lost == 0;
    }
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
