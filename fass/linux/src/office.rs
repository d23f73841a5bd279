//! What the clusters of a run share: where each is asked for something, and the end.
//!
//! A run whose cores are not divided is one cluster. Each has a [`Team`](crate::team::Team) of
//! its own: a scheduler under a lock, workers, a release thread. What one wants of another it
//! leaves here and *rings* for that one's release thread; so it never waits for the other's
//! lock.
//!
//! # The end
//!
//! A cluster whose DAGs are over *rests*, and a signal may set it going again. The run is over when
//! all of them rest and no letter is on its way. Both are one count, of *reasons to go on*: a
//! letter adds to it before it can be taken, while its writer has not come to rest.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use sched_dag::{ClusterId, DagId, Moment, Observer, TaskSet};

use crate::level::Levels;
use crate::requests::{Request, Requests};
use crate::sys;

/// What all threads of a run share, of whatever cluster.
#[derive(Debug)]
pub(crate) struct Office {
    /// The number of the plan that runs.
    pub(crate) plan: u64,
    pub(crate) levels: Option<Levels>,
    task_set: Arc<TaskSet>,
    requests: Requests,
    doors: Box<[Door]>,
    /// How many clusters do not rest, and how many letters nobody has taken.
    reasons: AtomicU64,
    /// 1 when all jobs have ended.
    over: AtomicU32,
}

/// Where the others ring for a cluster's release thread. In two cache lines of its own, since
/// processors fetch them in pairs.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Door {
    /// Changes whenever that is to look at once.
    alarm: AtomicU32,
}

impl Office {
    /// Makes it for the clusters of a plan, none of which rests.
    pub(crate) fn new(plan: u64, task_set: &Arc<TaskSet>, levels: Option<Levels>) -> Self {
        let doors: Box<[Door]> = task_set.clusters().map(|_| Door::default()).collect();
        Self {
            plan,
            levels,
            task_set: Arc::clone(task_set),
            requests: Requests::new(task_set.dags().len()),
            reasons: AtomicU64::new(doors.len() as u64),
            doors,
            over: AtomicU32::new(0),
        }
    }

    /// Returns the word that changes whenever a cluster's release thread is to look at once.
    pub(crate) fn alarm(&self, cluster: ClusterId) -> &AtomicU32 {
        &self.doors[cluster.index()].alarm
    }

    /// Makes a cluster's release thread look at once.
    pub(crate) fn ring(&self, cluster: ClusterId) {
        let alarm = self.alarm(cluster);
        alarm.fetch_add(1, Ordering::Release);
        sys::wake(alarm, 1);
    }

    /// Leaves a request from outside to the release thread of the DAG's cluster.
    pub(crate) fn request(&self, dag: DagId, request: Request) {
        self.requests.leave(dag, request);
        self.ring(self.task_set.dag(dag).cluster());
    }

    /// Sends a signal that a cluster raises, if the DAG is in another one, and reports whether it
    /// is.
    pub(crate) fn send(&self, from: ClusterId, dag: DagId) -> bool {
        let cluster = self.task_set.dag(dag).cluster();
        if cluster == from {
            return false;
        }
        self.reasons.fetch_add(1, Ordering::AcqRel);
        self.requests.leave_letter(dag);
        self.ring(cluster);
        true
    }

    /// Tells a cluster's scheduler all that is left for it, and returns how many letters that
    /// were.
    pub(crate) fn serve(
        &self,
        cluster: ClusterId,
        moment: &mut Moment<'_>,
        observer: &mut impl Observer,
    ) -> u64 {
        let is_here = |dag| self.task_set.dag(dag).cluster() == cluster;
        self.requests.serve(is_here, moment, observer)
    }

    /// Takes note, after a step of a cluster's release thread, of the letters that it has taken,
    /// and of whether all its DAGs are over. Reports whether the run is.
    pub(crate) fn settle(&self, rests: &mut bool, is_finished: bool, letters: u64) -> bool {
        let mut lost = letters;
        match (*rests, is_finished) {
            (true, false) => _ = self.reasons.fetch_add(1, Ordering::AcqRel),
            (false, true) => lost += 1,
            _ => {}
        }
        *rests = is_finished;
        if lost > 0 && self.reasons.fetch_sub(lost, Ordering::AcqRel) == lost {
            self.over.store(1, Ordering::Release);
            self.task_set.clusters().for_each(|other| self.ring(other));
            sys::wake(&self.over, i32::MAX);
        }
        self.is_over()
    }

    pub(crate) fn is_over(&self) -> bool {
        self.over.load(Ordering::Acquire) == 1
    }

    /// Waits until all jobs have ended.
    pub(crate) fn wait_until_over(&self) {
        while !self.is_over() {
            sys::wait(&self.over, 0, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sched_dag::{
        ClusterId, Clusters, CommitOptions, DagId, DagSpec, Policy, SubtaskSpec, verify,
    };

    use super::Office;

    #[test]
    fn a_letter_on_its_way_keeps_the_run_going() {
        let spec = |cluster| DagSpec {
            cluster: Some(ClusterId(cluster)),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: vec![SubtaskSpec::default()],
            ..DagSpec::default()
        };
        let options = CommitOptions::new(Policy::Edf, 2).with_clusters(Clusters::Of(vec![1, 1]));
        let verified = verify(&[spec(0), spec(1)], &options).expect("it is right");
        let office = Office::new(0, &Arc::new(verified.task_set), None);
        let (mut first, mut second) = (false, false);
        assert!(!office.settle(&mut second, true, 0));
        assert!(!office.send(ClusterId(0), DagId(0)), "it is its own");
        assert!(office.send(ClusterId(0), DagId(1)));
        assert!(
            !office.settle(&mut first, true, 0),
            "a letter is on its way"
        );
        assert!(!office.settle(&mut second, false, 1), "it goes on");
        assert!(office.settle(&mut second, true, 0));
    }
}
