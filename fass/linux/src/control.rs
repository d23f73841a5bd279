//! The handle of a run: what changes it while it goes on, from any thread, and shows it to people.

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

/// The handle of a committed run. Its requests are carried out by the release thread of the DAG's
/// cluster, at once; after the run it does nothing.
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
/// A thread that asks it how the run does takes a cluster's lock for a moment, so it has to be one
/// that nobody preempts meanwhile: [`raise`](Self::raise). Nothing of the caller's runs under it:
///
/// ```compile_fail,E0624
/// linux::Control::get().unwrap().with_scheduler(0, |_| panic!("under a lock"));
/// ```
#[derive(Clone)]
pub struct Control {
    pub(crate) office: Arc<Office>,
    /// By cluster.
    pub(crate) teams: Arc<[Arc<Team>]>,
}

/// The run that was committed last, until it has ended.
static LATEST: RwLock<Option<Control>> = RwLock::new(None);

pub(crate) fn latest() -> Option<Control> {
    LATEST.read().map_or(None, |control| control.clone())
}

pub(crate) fn set(control: Option<Control>) {
    let mut latest = LATEST.write().unwrap_or_else(PoisonError::into_inner);
    let older = std::mem::replace(&mut *latest, control);
    LATEST.clear_poison();
    drop(latest);
    // It may be the last one of what the app's functions own.
    drop(older);
}

impl std::fmt::Debug for Control {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control").finish_non_exhaustive()
    }
}

impl Control {
    /// Returns the handle of the run that is committed, unless it is over.
    ///
    /// ```
    /// assert!(linux::Control::get().is_none()); // nothing is committed
    /// ```
    pub fn get() -> Option<Self> {
        latest().filter(|control| !control.office.is_over())
    }

    /// Has a DAG's due jobs skipped until it is resumed.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn pause(&self, dag: impl DagKey) {
        self.change(dag, Request::Pause);
    }

    /// Has a paused DAG's jobs released again.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn resume(&self, dag: impl DagKey) {
        self.change(dag, Request::Resume);
    }

    /// Ends a DAG for good: it starts no further instance.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn end(&self, dag: impl DagKey) {
        self.change(dag, Request::End);
    }

    /// Has a DAG paused, resumed, closed or ended.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, the request is another one, which a DAG may not take, or a certificate
    /// fixes the set.
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

    /// Waits until the requests that were left for a DAG's cluster are taken, the run is over, or a
    /// second has passed. No instance may wait so.
    pub fn wait_for_letters(&self, dag: DagId) {
        let cluster = self.office.task_set.dag(dag).cluster();
        for _ in 0..20_000 {
            if !self.office.has_letters(cluster) || self.office.is_over() {
                break;
            }
            thread::sleep(Duration::from_micros(50));
        }
        // They are taken in a step, under the lock.
        let _ = self.with_scheduler(cluster.index(), |_| ());
    }

    /// Has nothing more released, and what is in flight go on to its end.
    pub fn close(&self) {
        self.office.send_of_all(Request::Close);
    }

    /// Puts the calling thread before all that compute.
    pub fn raise(&self) {
        if let Some(levels) = self.office.levels {
            levels.bring(sys::thread(), Role::Release);
        }
    }

    /// Puts it behind them again.
    pub(crate) fn lower(&self) {
        if let Some(levels) = self.office.levels {
            levels.bring(sys::thread(), Role::Abandoned);
        }
    }

    /// Returns the model.
    pub fn task_set(&self) -> &Arc<TaskSet> {
        &self.office.task_set
    }

    /// Has the scheduler of a cluster answer a question; `None` if there is no such cluster or DAG.
    pub fn ask(&self, cluster: usize, query: SchedulerQuery<'_>) -> Option<u64> {
        // Asked here: a panic under the lock would call the app's hook there.
        if let SchedulerQuery::Dag(dag, _) = &query {
            self.office.task_set.dags().get(dag.index())?;
        }
        self.with_scheduler(cluster, |scheduler| scheduler.show(query))
    }

    /// Looks at the scheduler of a cluster, shortly. What it calls is under the cluster's lock, so
    /// none but this crate says what.
    pub(crate) fn with_scheduler<T>(
        &self,
        cluster: usize,
        look: impl FnOnce(&mut Scheduler) -> T,
    ) -> Option<T> {
        let mut state = self.teams.get(cluster)?.lock();
        Some(look(&mut state.engine.scheduler))
    }

    /// Has the run end in order when a signal that is caught asks for it, or has: nothing more is
    /// released, and what is in flight goes on to its end.
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

    /// Starts a thread that waits for something outside, again and again while there is a run and
    /// `look` wants more. It has allocated all it needs when this returns.
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
