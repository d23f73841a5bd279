//! What a cluster has to do with the others: letters, and the end.
//!
//! A signal to a DAG of another cluster is a *letter*: a counter of that DAG goes up by one, and
//! the other cluster hears a *knock*, a flag in a cache line of its own. It takes all letters in
//! its next step. So the writer never waits, and a cluster that gets no letters only ever reads
//! its own flag.
//!
//! # The end
//!
//! A cluster that has nothing left to do *rests*: a letter may set it going again. The run is over
//! when nobody is awake and no letter is on its way. Both are one count, of *reasons to go on*,
//! which a letter adds to before it can be taken, while its writer is awake: so it is 0 only at
//! the end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use sched_dag::{ClusterId, DagId, TaskSet};

use crate::relax::poll;

/// The others, as one cluster sees them.
pub(crate) trait Others: Copy + Send + Sync {
    /// Whether there may be letters at all: then idle workers need the lock, to take them.
    const MAY_KNOCK: bool = true;

    /// Reports whether the next step is to look at letters, or at the end.
    #[inline]
    fn have_knocked(self) -> bool {
        false
    }

    /// Takes all letters, each of which signals a DAG.
    #[inline]
    fn take(self, signal: impl FnMut(DagId)) {
        let _ = signal;
    }

    /// Sends a signal if its DAG is in another cluster, and reports whether it is.
    #[inline]
    fn send(self, dag: DagId) -> bool {
        let _ = dag;
        false
    }

    /// Returns when the cluster's next instant is, whose own next event is due then; `None` at
    /// the end. If nothing is due it rests, and letters come at `now_ns`.
    #[inline]
    fn next_ns(self, due_ns: Option<u64>, now_ns: u64) -> Option<u64> {
        let _ = now_ns;
        due_ns
    }

    /// Ends the run, because of a panic.
    fn end(self) {}
}

/// There are no others.
impl Others for () {
    const MAY_KNOCK: bool = false;
}

/// What all clusters of a run share.
#[derive(Debug)]
pub(crate) struct Office {
    task_set: Arc<TaskSet>,
    doors: Box<[Door]>,
    /// By DAG, how many letters have not been taken.
    letters: Box<[AtomicU64]>,
    reasons: Reasons,
}

/// Where the others knock at one cluster. In two cache lines, since processors fetch them in
/// pairs.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Door {
    has_knock: AtomicBool,
    is_over: AtomicBool,
}

/// How many clusters are awake, and how many letters on their way.
#[derive(Debug)]
#[repr(align(128))]
struct Reasons(AtomicU64);

impl Office {
    /// Makes it for the clusters of a task set, all of which are awake.
    pub(crate) fn new(task_set: &Arc<TaskSet>) -> Self {
        let doors: Box<[Door]> = task_set.clusters().map(|_| Door::default()).collect();
        let dags = task_set.dags().iter();
        Self {
            task_set: Arc::clone(task_set),
            letters: dags.map(|_| AtomicU64::new(0)).collect(),
            reasons: Reasons(AtomicU64::new(doors.len() as u64)),
            doors,
        }
    }

    /// Returns the view of one cluster.
    pub(crate) fn seen_from(&self, cluster: ClusterId) -> Neighbours<'_> {
        Neighbours {
            office: self,
            cluster,
            door: &self.doors[cluster.index()],
        }
    }

    /// Takes reasons to go on away, and ends the run if none is left.
    fn give_up(&self, reasons: u64) {
        if self.reasons.0.fetch_sub(reasons, Ordering::AcqRel) == reasons {
            self.end();
        }
    }

    fn end(&self) {
        for door in &self.doors {
            door.is_over.store(true, Ordering::Release);
            door.has_knock.store(true, Ordering::Release);
        }
    }
}

/// The other clusters of a divided run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neighbours<'a> {
    office: &'a Office,
    cluster: ClusterId,
    /// The cluster's own.
    door: &'a Door,
}

impl Neighbours<'_> {
    /// Waits for a letter, and reports whether it is not the end that comes.
    fn rest(&self) -> bool {
        let (office, door) = (self.office, self.door);
        office.give_up(1);
        poll(|| {
            if door.is_over.load(Ordering::Acquire) {
                return Some(false);
            }
            // A letter is a reason itself until we take it, which we do awake.
            door.has_knock.load(Ordering::Acquire).then(|| {
                office.reasons.0.fetch_add(1, Ordering::AcqRel);
                true
            })
        })
    }
}

impl Others for Neighbours<'_> {
    #[inline]
    fn have_knocked(self) -> bool {
        self.door.has_knock.load(Ordering::Relaxed)
    }

    #[inline]
    fn take(self, mut signal: impl FnMut(DagId)) {
        if !self.have_knocked() || !self.door.has_knock.swap(false, Ordering::AcqRel) {
            return;
        }
        let mut taken = 0;
        for (dag, place) in (0..).map(DagId).zip(&self.office.letters) {
            if self.office.task_set.dag(dag).cluster() != self.cluster {
                continue;
            }
            // Acquire: for the latest values that were shown before.
            let letters = place.swap(0, Ordering::Acquire);
            (0..letters).for_each(|_| signal(dag));
            taken += letters;
        }
        self.office.give_up(taken);
    }

    fn send(self, dag: DagId) -> bool {
        let cluster = self.office.task_set.dag(dag).cluster();
        if cluster == self.cluster {
            return false;
        }
        self.office.reasons.0.fetch_add(1, Ordering::AcqRel);
        self.office.letters[dag.index()].fetch_add(1, Ordering::Release);
        let door = &self.office.doors[cluster.index()];
        door.has_knock.store(true, Ordering::Release);
        true
    }

    fn next_ns(self, due_ns: Option<u64>, now_ns: u64) -> Option<u64> {
        if self.door.is_over.load(Ordering::Acquire) {
            return None;
        }
        due_ns.or_else(|| self.rest().then_some(now_ns))
    }

    fn end(self) {
        self.office.end();
    }
}
