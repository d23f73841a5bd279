//! What others than the run's threads want of it: signals, pauses, stops.
//!
//! Such a thread may be of any level, so it must not take the scheduler's lock: it
//! would lose its core with it. It leaves its request in a word for each DAG and wakes
//! the release thread of the DAG's cluster, which serves it. What is asked for twice before that
//! is done once.

use std::sync::atomic::{AtomicU32, Ordering};

use sched_dag::{DagId, Moment};

const SIGNAL: u32 = 1;
const PAUSE: u32 = 2;
const RESUME: u32 = 4;
const STOP: u32 = 8;
const CLOSE: u32 = 16;

/// What one DAG is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    /// A sporadic DAG gets a signal.
    Signal,
    /// Its due jobs are skipped from now on.
    Pause,
    /// They are released again.
    Resume,
    /// It ends for good.
    Stop,
    /// It releases nothing more, and what is in flight goes on to its end.
    Close,
}

/// The requests that have not been served, by DAG.
#[derive(Debug)]
pub(crate) struct Requests(Box<[AtomicU32]>);

impl Requests {
    pub(crate) fn new(dags: usize) -> Self {
        Self((0..dags).map(|_| AtomicU32::new(0)).collect())
    }

    /// Leaves one. Of a pause and a resumption the later one counts.
    pub(crate) fn leave(&self, dag: DagId, request: Request) {
        let (bit, instead_of) = match request {
            Request::Signal => (SIGNAL, 0),
            Request::Pause => (PAUSE, RESUME),
            Request::Resume => (RESUME, PAUSE),
            Request::Stop => (STOP, 0),
            Request::Close => (CLOSE, 0),
        };
        let change = |bits: u32| Some(bits & !instead_of | bit);
        // The change never refuses.
        let _ = self.0[dag.index()].fetch_update(Ordering::Release, Ordering::Relaxed, change);
    }

    /// Tells the scheduler of these DAGs all that are left for it.
    pub(crate) fn serve(&self, is_here: impl Fn(DagId) -> bool, moment: &mut Moment<'_>) {
        for (dag, place) in (0..).map(DagId).zip(&self.0) {
            if place.load(Ordering::Relaxed) == 0 || !is_here(dag) {
                continue;
            }
            let bits = place.swap(0, Ordering::Acquire);
            if bits & RESUME != 0 {
                moment.resume(dag);
            }
            if bits & PAUSE != 0 {
                moment.pause(dag);
            }
            if bits & SIGNAL != 0 {
                moment.signal(dag);
            }
            if bits & STOP != 0 {
                moment.stop(dag);
            }
            if bits & CLOSE != 0 {
                moment.close(dag);
            }
        }
    }
}
