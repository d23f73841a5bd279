//! What changes a run while it goes on, from any thread.

use std::io;
use std::sync::{Arc, Barrier};
use std::thread;

use sched_dag::lifecycle::Request;
use sched_dag::{DagId, DagKey};

use crate::end_signals::{self, EndSignals};
use crate::level::Role;
use crate::office::Office;
use crate::sys;

/// The handle of a committed run. What it asks for is done by the release thread of the DAG's
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
///     control.stop("endless");
/// });
/// let run = machine.run().unwrap();
/// assert_eq!(run.violations().count(), 0);
/// ```
#[derive(Clone)]
pub struct Control(Arc<Office>);

impl std::fmt::Debug for Control {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control").finish_non_exhaustive()
    }
}

impl Control {
    pub(crate) const fn new(office: Arc<Office>) -> Self {
        Self(office)
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
    pub fn stop(&self, dag: impl DagKey) {
        self.change(dag, Request::Stop);
    }

    #[track_caller]
    fn change(&self, dag: impl DagKey, request: fn(DagId) -> Request) {
        self.0.send(None, request(self.0.task_set.find(dag)));
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
        self.watch("fass-ends", |office| {
            let has_come = end_signals::wait(sys::now_ns() + MOST_NS);
            if has_come {
                office.send_of_all(Request::Close);
            }
            !has_come
        })
    }

    pub(crate) fn raise_on_input(self, dag: DagId, arrivals: sys::Arrivals) -> io::Result<()> {
        /// How long the thread outlives its run.
        const MOST_MS: i32 = 200;
        self.watch("fass-input", move |office| {
            if arrivals.wait(MOST_MS) {
                office.send(None, Request::Signal(dag));
            }
            true
        })
    }

    /// Starts a thread that waits for something outside, again and again while there is a run and
    /// `look` wants more. What it allocates it has when this returns.
    fn watch(self, name: &str, look: impl Fn(&Office) -> bool + Send + 'static) -> io::Result<()> {
        let office = self.0;
        let has_begun = Arc::new(Barrier::new(2));
        let begun = Arc::clone(&has_begun);
        let watch = move || {
            if let Some(levels) = office.levels {
                levels.bring(sys::thread(), Role::Release);
            }
            begun.wait();
            while !office.is_over() && look(&office) {}
        };
        thread::Builder::new().name(name.into()).spawn(watch)?;
        has_begun.wait();
        Ok(())
    }
}
