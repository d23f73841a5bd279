//! What the scheduler reports while it takes a step.

use core::sync::atomic::Ordering;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use fass::Replacement;
use fass::edge::Happened;
use sched_dag::journal::{Subject, What};
use sched_dag::placement::Placement;
use sched_dag::{ClusterId, CoreId, DagId, Instance, JobOutcome, Journal, ModeId, Observer};
use sched_dag::{TaskSet, Vertex};

use super::Runner;
use super::cluster::{self, Cluster};
use super::loans::{Loan, Loans};
use super::time::here;
use crate::machine::abandoned::Abandoned;
use crate::machine::context::Parked;
use crate::machine::this_core;
use crate::run::edge;

/// Writes what the scheduler reports into the journal, with the time of the instant that
/// the scheduler is told of: at a completion when the function returned, so a join's
/// latency includes the wait for the lock.
pub(super) struct Watcher {
    cluster: &'static Cluster,
    pub(super) journal: Journal,
    /// The bodies, and which core has which.
    pub(super) placement: Placement<Loan, Parked>,
    /// The functions that would replace those of these, by vertex.
    next: Box<[Option<Replacement>]>,
    loans: Loans,
    /// The runners whose functions faults have ended, unless they go on with others. There is
    /// room for all.
    pub(super) lost: Vec<Loan>,
    pub(super) task_set: Arc<TaskSet>,
    /// The instant, on the run's time.
    pub(super) instant_ns: u64,
    /// Whether anything has happened to a job as a whole.
    pub(super) has_job_news: bool,
    /// What this core has just finished, as long as nothing else is reported, and when.
    pub(super) finished: Option<Loan>,
    pub(super) finish_ns: u64,
}

impl Watcher {
    /// Makes one of a cluster, without a body.
    pub(super) fn new(id: ClusterId, task_set: &Arc<TaskSet>, journal: Journal) -> Self {
        let all = u32::try_from(this_core::all().len()).unwrap_or(u32::MAX);
        let cores = task_set.cores_of(id, all);
        Self {
            cluster: cluster::nth(id.index()),
            journal,
            placement: Placement::empty(task_set.vertices(), cores.len()),
            next: vec![None; task_set.vertices()].into(),
            loans: Loans::new(task_set.vertices()),
            lost: Vec::with_capacity(task_set.vertices()),
            task_set: Arc::clone(task_set),
            instant_ns: 0,
            has_job_news: false,
            finished: None,
            finish_ns: 0,
        }
    }

    /// Returns the cluster that it reports of.
    #[inline]
    pub(super) const fn cluster(&self) -> &'static Cluster {
        match cluster::MAY_DIVIDE {
            true => self.cluster,
            false => &cluster::FIRST,
        }
    }

    /// Takes the journal out; what is left records nothing.
    pub(super) fn take_journal(&mut self) -> Journal {
        let empty = Journal::new(&self.task_set, 0, 0);
        core::mem::replace(&mut self.journal, empty)
    }

    /// Notes that this core has just finished something.
    #[inline]
    pub(super) fn note_finish(&mut self, finished: Loan, finish_ns: u64) {
        let before = self.finished.replace(finished);
        debug_assert!(before.is_none());
        self.finish_ns = finish_ns;
    }

    /// Puts the runner of a vertex into its place, at the commit.
    pub(super) fn begin(&mut self, runner: Runner) {
        let (vertex, loan) = (runner.vertex, Loan::of(runner));
        self.next[vertex.index()] = loan.body.replacement();
        self.loans.note(&loan);
        self.placement.replace(vertex, loan);
    }

    /// Returns what would take the place of a function if a fault ended it now.
    pub(super) fn next(&self, vertex: Vertex) -> Option<&Replacement> {
        let next = self.next[vertex.index()].as_ref()?;
        next.is_there().then_some(next)
    }

    /// Takes back what this core had with it as a fault ended that, and returns its vertex.
    pub(super) fn recover(&mut self, here: CoreId, left: &Abandoned) -> Option<Vertex> {
        let lost = (self.loans).recover(&mut self.placement, here.index(), left)?;
        let vertex = lost.vertex;
        self.lost.push(lost);
        Some(vertex)
    }

    /// Writes down what has happened to a whole job.
    fn of_job(&mut self, what: What, dag: DagId, job: u64) {
        self.has_job_news = true;
        self.note(what, self.instant_ns, Subject::of_job(dag, job));
    }

    /// Tells what crosses the edge: of a job, or of an instance.
    fn tell(&self, what: What, (dag, subtask, job): (DagId, u32, u64), release_ns: Option<u64>) {
        let at_ns = self.instant_ns;
        let happened = Happened {
            dag,
            subtask,
            job,
            release_ns,
            at_ns,
        };
        edge::happened(what, &happened);
    }

    /// Writes down what has happened.
    fn note(&mut self, what: What, time_ns: u64, subject: Subject) {
        let here = here();
        self.settle(here);
        self.journal.write(here, what, time_ns, subject);
    }

    /// Writes down that this core, `here`, has just finished something, if it has, and puts
    /// that at rest.
    #[inline]
    pub(super) fn settle(&mut self, here: CoreId) {
        if let Some(finished) = self.finished.take() {
            let (vertex, subject) = (finished.vertex, finished.subject());
            (self.journal).write(here, What::Finish, self.finish_ns, subject);
            self.placement.finish(here.index(), vertex, finished);
        }
    }
}

impl Observer for Watcher {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        if self.task_set.dag(dag).is_sporadic() {
            self.note(What::Due, release_ns, Subject::of_job(dag, job));
            self.tell(What::Released, (dag, 0, job), Some(release_ns));
        }
        self.of_job(What::Released, dag, job);
    }

    fn queued(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Queued, dag, job);
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.tell(What::Skipped, (dag, 0, job), Some(release_ns));
        self.of_job(What::Skipped, dag, job);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.of_job(What::Aborted, dag, job);
    }

    fn restarted(&mut self, instance: Instance) {
        self.note(What::Restarted, self.instant_ns, Subject::of(instance));
        let Instance { dag, subtask, job } = instance;
        self.tell(What::Restarted, (dag, subtask.0, job), None);
        let vertex = self.task_set.vertex(instance);
        if let Some(mut runner) = self.lost.pop_if(|lost| lost.vertex == vertex) {
            runner.body.replace();
            self.placement.replace(vertex, runner);
        }
    }

    fn ended(&mut self, dag: DagId) {
        self.of_job(What::Stopped, dag, 0);
    }

    fn switched_off(&mut self, dag: DagId) {
        self.of_job(What::Off, dag, 0);
    }

    fn switched_on(&mut self, dag: DagId) {
        self.of_job(What::On, dag, 0);
    }

    fn closed(&mut self, dag: DagId) {
        self.of_job(What::Closed, dag, 0);
    }

    fn entered(&mut self, mode: ModeId) {
        self.of_job(What::Entered, DagId(0), mode.0.into());
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {
        self.of_job(What::Missed, dag, job);
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        let what = match release_ns {
            Some(_) => What::Signalled,
            None => What::Dropped,
        };
        self.of_job(what, dag, job);
    }

    fn ready(&mut self, instance: Instance) {
        self.note(What::Ready, self.instant_ns, Subject::of(instance));
    }

    fn cancelled(&mut self, instance: Instance) {
        self.note(What::Cancelled, self.instant_ns, Subject::of(instance));
        let Instance { dag, subtask, job } = instance;
        self.tell(What::Cancelled, (dag, subtask.0, job), None);
        let vertex = self.task_set.vertex(instance);
        if let Some(runner) = self.placement.resting(vertex) {
            runner.body.discard(instance.job);
        }
    }

    fn job_completed(&mut self, dag: DagId, job: u64, _: JobOutcome) {
        self.of_job(What::Completed, dag, job);
        // The jobs of a DAG without end are no progress.
        if self.task_set.dag(dag).jobs().is_some() {
            self.cluster().jobs_ended.fetch_add(1, Ordering::Relaxed);
        }
    }
}
