//! A run in virtual time that writes its journal.

#![allow(dead_code, reason = "each test uses a part of this")]

use std::collections::VecDeque;
use std::sync::Arc;

use sched_dag::journal::What;
use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    CoreId, DagId, Instance, JobOutcome, Observer, Recorder, Scheduler, SchedulerOptions, TaskSet,
};

/// Executes each instance for as long as it is told, sends signals, writes all down.
pub(crate) struct Written<F> {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) journal: Recorder,
    execution_ns: F,
    pub(crate) fails: fn(Instance) -> bool,
    /// Signals by time.
    pub(crate) signals: VecDeque<(u64, DagId)>,
    /// At which DAG's completions which DAG gets a signal.
    pub(crate) chained: Option<(DagId, DagId)>,
    /// What became of each signal.
    pub(crate) arrivals: Vec<(u64, Option<u64>)>,
}

impl<F: FnMut(Instance) -> u64> Written<F> {
    pub(crate) fn new(task_set: &Arc<TaskSet>, execution_ns: F) -> Self {
        Self {
            task_set: Arc::clone(task_set),
            journal: Recorder::new(Arc::clone(task_set)),
            execution_ns,
            fails: |_| false,
            signals: VecDeque::new(),
            chained: None,
            arrivals: Vec::new(),
        }
    }

    /// Runs the DAGs until nothing happens any more.
    pub(crate) fn run(&mut self, options: SchedulerOptions) -> VirtualTime {
        let mut run = VirtualTime::new(Scheduler::new(Arc::clone(&self.task_set), options));
        assert_eq!(run.run(self), End::Finished);
        run
    }
}

/// Passes reports on to the journal.
macro_rules! written {
    ($($report:ident($($name:ident: $type:ty),+);)+) => {
        $(fn $report(&mut self, $($name: $type),+) {
            self.journal.$report($($name),+);
        })+
    };
}

impl<F> Observer for Written<F> {
    written! {
        released(dag: DagId, job: u64, release_ns: u64);
        queued(dag: DagId, job: u64, release_ns: u64);
        skipped(dag: DagId, job: u64, release_ns: u64);
        ready(instance: Instance);
        cancelled(instance: Instance);
        aborted(dag: DagId, job: u64);
        restarted(instance: Instance);
        deadline_missed(dag: DagId, job: u64, deadline_ns: u64);
        job_completed(dag: DagId, job: u64, outcome: JobOutcome);
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        self.arrivals.push((self.journal.now_ns, release_ns));
        self.journal.signalled(dag, job, release_ns);
    }
}

impl<F: FnMut(Instance) -> u64> Workload for Written<F> {
    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        (self.execution_ns)(instance)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        (self.fails)(instance)
    }

    fn is_replaceable(&mut self, _instance: Instance) -> bool {
        true
    }

    fn instant(&mut self, now_ns: u64) {
        self.journal.now_ns = now_ns;
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.signals.front().map(|&(at_ns, _)| at_ns)
    }

    fn take_signal(&mut self, now_ns: u64) -> Option<DagId> {
        let (_, dag) = self.signals.pop_front_if(|(at_ns, _)| *at_ns <= now_ns)?;
        Some(dag)
    }

    fn started(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Start, instance, core);
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Suspend, instance, core);
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Resume, instance, core);
    }

    fn finished(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        self.journal.on_core(What::Finish, instance, core);
        if let Some((from, to)) = self.chained
            && instance.dag == from
        {
            self.signals.push_front((now_ns, to));
        }
    }

    fn failed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Ended, instance, core);
    }
}
