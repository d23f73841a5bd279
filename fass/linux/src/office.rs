//! State shared by the clusters of a run: mailboxes for requests between clusters, and the end of
//! the run.
//!
//! A run with undivided cores is one cluster. Each cluster has a [`Team`](crate::team::Team) of its
//! own: a scheduler under a lock, workers and a release thread. A request to another cluster is
//! left here as a letter, and the other cluster's release thread is *rung* for. So nobody waits for
//! another cluster's lock.
//!
//! # The end
//!
//! A cluster *rests* when its DAGs are over; a signal may set a resting cluster going again. The
//! run is over when all clusters rest and no letter is on its way. One count of *reasons to go on*
//! covers both conditions: each letter adds one, and so does each cluster that does not rest. A
//! letter is delivered before being counted, since the writer may be a thread from outside, which
//! may lose its processor at any instruction. So a step opened by another letter may serve the new
//! letter early. A step opens only counted letters.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use sched_dag::lifecycle::{Mailboxes, Request};
use sched_dag::{ClusterId, DagId, TaskSet};

use crate::level::Levels;
use crate::sys;

/// State shared by all threads of a run, in all clusters.
#[derive(Debug)]
pub(crate) struct Office {
    /// The number of the running plan.
    pub(crate) plan: u64,
    pub(crate) levels: Option<Levels>,
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) letters: Mailboxes,
    doors: Box<[Door]>,
    /// How many clusters do not rest, plus how many letters are counted and not settled.
    reasons: AtomicU64,
    /// 1 when all jobs have ended.
    over: AtomicU32,
}

/// The place where other threads ring for a cluster's release thread. Aligned to two cache lines,
/// since processors fetch lines in pairs.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Door {
    /// Changes whenever the release thread should look at once.
    alarm: AtomicU32,
    /// How many letters may be there.
    letters: AtomicU64,
}

impl Office {
    /// Makes the office for the clusters of a plan, none of them resting.
    pub(crate) fn new(
        plan: u64,
        task_set: &Arc<TaskSet>,
        letters: Mailboxes,
        levels: Option<Levels>,
    ) -> Self {
        let doors: Box<[Door]> = task_set.clusters().map(|_| Door::default()).collect();
        Self {
            plan,
            levels,
            task_set: Arc::clone(task_set),
            letters,
            reasons: AtomicU64::new(doors.len() as u64),
            doors,
            over: AtomicU32::new(0),
        }
    }

    /// Returns the word changed whenever a cluster's release thread should look at once.
    pub(crate) fn alarm(&self, cluster: ClusterId) -> &AtomicU32 {
        &self.doors[cluster.index()].alarm
    }

    /// Makes a cluster's release thread look at once.
    pub(crate) fn ring(&self, cluster: ClusterId) {
        let alarm = self.alarm(cluster);
        alarm.fetch_add(1, Ordering::Release);
        sys::wake(alarm, 1);
    }

    /// Leaves a request about each DAG, from outside.
    pub(crate) fn send_of_all(&self, request: fn(DagId) -> Request) {
        for dag in (0..).map(DagId).take(self.task_set.dags().len()) {
            self.send(None, request(dag));
        }
    }

    /// Sends a request to the clusters concerned, except to `from`, the cluster of the asking
    /// function. Reports whether `from` is not concerned; `from` is `None` for a thread from
    /// outside. An outside thread may have any level, so it must not take a scheduler's lock: it
    /// could lose its core while holding the lock.
    pub(crate) fn send(&self, from: Option<ClusterId>, request: Request) -> bool {
        self.letters.send(from, request, |cluster| {
            // Before the letter is counted: settled without a reason of its own, it could end the
            // run early.
            self.reasons.fetch_add(1, Ordering::AcqRel);
            let letters = &self.doors[cluster.index()].letters;
            letters.fetch_add(1, Ordering::AcqRel);
            self.ring(cluster);
        })
    }

    /// Returns how many letters a step of a cluster has to take. Taking the letters removes as many
    /// reasons to go on.
    pub(crate) fn open(&self, cluster: ClusterId) -> u64 {
        let letters = &self.doors[cluster.index()].letters;
        // A load first: mostly there are none, and a swap would take the cache line from the
        // senders.
        match letters.load(Ordering::Relaxed) {
            0 => 0,
            _ => letters.swap(0, Ordering::AcqRel),
        }
    }

    /// Reports whether there may be letters for a cluster.
    pub(crate) fn has_letters(&self, cluster: ClusterId) -> bool {
        self.doors[cluster.index()].letters.load(Ordering::Relaxed) > 0
    }

    /// Accounts for a step of a cluster's release thread: how many letters the step took, and
    /// whether all the cluster's DAGs are over. Reports whether the run is over.
    pub(crate) fn settle(&self, rests: &mut bool, is_finished: bool, opened: u64) -> bool {
        let mut lost = opened;
        match (*rests, is_finished) {
            // A signal has set the resting cluster going again. Added before the letters' reasons
            // are subtracted: the sum must not pass 0 in between.
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

    use sched_dag::lifecycle::{Request, divide};
    use sched_dag::{
        ClusterId, CommitOptions, CoreDivision, DagId, DagSpec, Policy, SubtaskSpec, verify,
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
        let options =
            CommitOptions::new(Policy::Edf, 2).with_clusters(CoreDivision::Of(vec![1, 1]));
        let task_set = verify(&[spec(0), spec(1)], &options).expect("it is right");
        let task_set = Arc::new(task_set.task_set);
        let (letters, _) = divide(&task_set, None).expect("there are no modes");
        let office = Office::new(0, &task_set, letters, None);
        let [here, there] = [0, 1].map(ClusterId);
        let signal = |dag| office.send(Some(here), Request::Signal(DagId(dag)));
        let (mut first, mut second) = (false, false);
        assert!(!office.settle(&mut second, true, 0));
        assert!(!signal(0), "it is its own");
        assert!(signal(1) && signal(1));
        assert!(!office.settle(&mut first, true, 0), "there are letters");
        assert_eq!([office.open(there), office.open(there)], [2, 0]);
        assert!(!office.settle(&mut second, false, 2), "it goes on");
        assert!(office.settle(&mut second, true, 0));
    }
}
