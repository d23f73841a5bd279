//! The handle of a run: changes the run from any thread while it goes on, and shows it to people.

use std::sync::{Arc, Barrier, PoisonError, RwLock};
use std::time::Duration;
use std::{io, thread};

use end_signals::EndSignals;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, DagKey, Scheduler, SchedulerQuery, TaskSet};

use crate::level::Role;
use crate::office::Office;
use crate::team::Team;
use crate::{clock, sys};

/// The handle of a committed run. The release thread of the DAG's cluster carries out requests at
/// once, or at time 0 of a run that has not begun. After the run, requests do nothing.
///
/// ```
/// use std::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use linux::{Linux, Mechanism};
///
/// let machine = Linux::new(1, Mechanism::Normal).unwrap();
/// let dag = create_dag(); // without a last job
/// let period = Duration::from_millis(2);
/// dag.name("endless").period(period).relative_deadline(period);
/// dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
/// finish_create_dags(&[dag]).unwrap();
/// let control = machine.control().unwrap();
/// std::thread::spawn(move || {
///     std::thread::sleep(Duration::from_millis(20));
///     control.end("endless");
/// });
/// let run = machine.run().unwrap();
/// assert_eq!(run.violations().count(), 0);
/// ```
///
/// A thread asking for the run's state takes a cluster's lock for a moment, so it must not be
/// preempted meanwhile: see [`raise`](Self::raise). No code of the caller runs under the lock:
///
/// ```compile_fail,E0624
/// linux::Control::get().unwrap().with_scheduler(0, |_| panic!("under a lock"));
/// ```
#[derive(Clone)]
pub struct Control {
    pub(crate) office: Arc<Office>,
    /// The teams, by cluster.
    pub(crate) teams: Arc<[Arc<Team>]>,
}

/// The latest committed run, until the run has ended.
static LATEST: RwLock<Option<Control>> = RwLock::new(None);

pub(crate) fn latest() -> Option<Control> {
    LATEST.read().map_or(None, |control| control.clone())
}

pub(crate) fn set(control: Option<Control>) {
    let mut latest = LATEST.write().unwrap_or_else(PoisonError::into_inner);
    let older = std::mem::replace(&mut *latest, control);
    LATEST.clear_poison();
    drop(latest);
    // Dropping this may drop the values owned by the app's functions.
    drop(older);
}

impl std::fmt::Debug for Control {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control").finish_non_exhaustive()
    }
}

impl Control {
    /// Returns the handle of the committed run, unless the run is over.
    ///
    /// ```
    /// assert!(linux::Control::get().is_none()); // nothing is committed
    /// ```
    pub fn get() -> Option<Self> {
        latest().filter(|control| !control.office.is_over())
    }

    /// Skips a DAG's due jobs until the DAG is resumed.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn pause(&self, dag: impl DagKey) {
        self.change(dag, Request::Pause);
    }

    /// Releases a paused DAG's jobs again.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn resume(&self, dag: impl DagKey) {
        self.change(dag, Request::Resume);
    }

    /// Ends a DAG for good: the DAG starts no further instance.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn end(&self, dag: impl DagKey) {
        self.change(dag, Request::End);
    }

    /// Pauses, resumes, closes or ends a DAG.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, if the request is of another kind, not permitted for a DAG, or if a
    /// certificate fixes the set.
    #[track_caller]
    pub fn change(&self, dag: impl DagKey, request: fn(DagId) -> Request) {
        let dag = self.office.task_set.find(dag);
        let request = request(dag);
        use Request::{Close, End, Pause, Resume};
        assert!(
            matches!(request, Pause(of) | Resume(of) | Close(of) | End(of) if of == dag),
            "a DAG is asked for {request:?}; pause, resume, close or end it"
        );
        assert!(
            self.office.task_set.certificate().is_none(),
            "a certificate fixes the set, whose bounds {request:?} would void; run it without one"
        );
        self.office.send(None, request);
    }

    /// Waits until the requests left for a DAG's cluster are taken, the run is over, or a second
    /// has passed. Instances must not wait in this way.
    pub fn wait_for_letters(&self, dag: DagId) {
        let cluster = self.office.task_set.dag(dag).cluster();
        // Polled: no step knows that anybody waits for it.
        for _ in 0..20_000 {
            if !self.office.has_letters(cluster) || self.office.is_over() {
                break;
            }
            thread::sleep(Duration::from_micros(50));
        }
        // A step takes the requests, under the lock.
        let _ = self.with_scheduler(cluster.index(), |_| ());
    }

    /// Stops all releases, and lets jobs in flight go on to their end.
    pub fn close(&self) {
        self.office.send_of_all(Request::Close);
    }

    /// Puts the calling thread before all computing threads, if the run's threads have levels.
    pub fn raise(&self) {
        if let Some(levels) = self.office.levels {
            levels.bring(sys::thread(), Role::Release);
        }
    }

    /// Puts the calling thread behind all computing threads again.
    pub(crate) fn lower(&self) {
        if let Some(levels) = self.office.levels {
            levels.bring(sys::thread(), Role::Abandoned);
        }
    }

    /// Returns the model.
    pub fn task_set(&self) -> &Arc<TaskSet> {
        &self.office.task_set
    }

    /// Asks the scheduler of a cluster a question; returns `None` if there is no such cluster or
    /// DAG.
    pub fn ask(&self, cluster: usize, query: SchedulerQuery<'_>) -> Option<u64> {
        // Checked here: a panic under the lock would call the app's hook under the lock.
        if let SchedulerQuery::Dag(dag, _) = &query {
            self.office.task_set.dags().get(dag.index())?;
        }
        self.with_scheduler(cluster, |scheduler| scheduler.show(query))
    }

    /// Looks at the scheduler of a cluster, briefly. `look` runs under the cluster's lock, so only
    /// this crate may pass one.
    pub(crate) fn with_scheduler<T>(
        &self,
        cluster: usize,
        look: impl FnOnce(&mut Scheduler) -> T,
    ) -> Option<T> {
        let mut state = self.teams.get(cluster)?.lock();
        Some(look(&mut state.engine.scheduler))
    }

    /// Ends the run in an orderly way when a caught signal asks for its end, or has asked already:
    /// releases stop, and jobs in flight go on to their end.
    ///
    /// # Errors
    ///
    /// The system has no more threads.
    pub fn close_when_asked(self, _caught: &EndSignals) -> io::Result<()> {
        /// How long the thread outlives its run.
        const MOST_NS: u64 = 1_000_000_000;
        self.watch("fass-ends", |control| {
            let has_come = EndSignals::wait(clock::now_ns() + MOST_NS);
            if has_come {
                control.close();
            }
            !has_come
        })
    }

    pub(crate) fn raise_on_input(self, dag: DagId, arrivals: sys::Arrivals) -> io::Result<()> {
        /// How long the thread outlives its run.
        const MOST_MS: i32 = 200;
        self.watch("fass-input", move |control| {
            if arrivals.wait(MOST_MS) {
                control.office.send(None, Request::Signal(dag));
            }
            true
        })
    }

    /// Starts a thread waiting for something outside, again and again as long as the run goes on
    /// and `look` returns true. When this function returns, the thread has allocated all its
    /// memory.
    fn watch(self, name: &str, look: impl Fn(&Self) -> bool + Send + 'static) -> io::Result<()> {
        let has_begun = Arc::new(Barrier::new(2));
        let begun = Arc::clone(&has_begun);
        let watch = move || {
            self.raise();
            begun.wait();
            while !self.office.is_over() && look(&self) {}
        };
        thread::Builder::new().name(name.into()).spawn(watch)?;
        has_begun.wait();
        Ok(())
    }
}
