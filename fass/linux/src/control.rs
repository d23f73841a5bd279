//! What changes a run while it goes on, from any thread.

use std::io;
use std::sync::Arc;
use std::thread;

use sched_dag::DagId;

use crate::level::Role;
use crate::office::Office;
use crate::requests::Request;
use crate::sys;

/// The handle of a committed run. What it asks for is done by the release thread of the DAG's
/// cluster, at once; after the run it does nothing.
///
/// ```
/// use std::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use linux::{Linux, Mechanism};
/// use sched_dag::DagId;
///
/// let machine = Linux::new(1, Mechanism::Normal).unwrap();
/// let dag = create_dag(); // without a last job
/// let period = Duration::from_millis(2);
/// dag.period(period).relative_deadline(period);
/// dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
/// finish_create_dags(&[dag]).unwrap();
/// let control = machine.control().unwrap();
/// std::thread::spawn(move || {
///     std::thread::sleep(Duration::from_millis(20));
///     control.stop(DagId(0));
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
    pub fn pause(&self, dag: DagId) {
        self.0.request(dag, Request::Pause);
    }

    /// Has a paused DAG's jobs released again.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn resume(&self, dag: DagId) {
        self.0.request(dag, Request::Resume);
    }

    /// Ends a DAG for good: it starts no further instance.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn stop(&self, dag: DagId) {
        self.0.request(dag, Request::Stop);
    }

    pub(crate) fn raise_on_input(self, dag: DagId, arrivals: sys::Arrivals) -> io::Result<()> {
        /// How long such a thread outlives its run.
        const MOST_MS: i32 = 200;
        let office = self.0;
        let watch = move || {
            if let Some(levels) = office.levels {
                levels.bring(sys::thread(), Role::Release);
            }
            while !office.is_over() {
                if arrivals.wait(MOST_MS) {
                    office.request(dag, Request::Signal);
                }
            }
        };
        let thread = thread::Builder::new().name("fass-input".into());
        thread.spawn(watch).map(drop)
    }
}
