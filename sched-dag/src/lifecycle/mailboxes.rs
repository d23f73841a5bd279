//! Mailboxes: requests to other clusters, and from outside of all clusters.
//!
//! Each cluster serves the requests about its DAGs, with its own part of the app's lifecycle. A
//! completed instance's request goes to the cluster concerned: a signal, a pause and a resumption
//! to the cluster of the DAG; a mode to the cluster of the modes' DAGs, which are all in the same
//! cluster; and a shutdown to all clusters. A request to another cluster is a *letter*, effective
//! in the step in which the receiver takes the letter, before the releases of that step. Sending a
//! letter never waits, because the room for letters is allocated at commit:
//!
//! - Signals are counted, so none is lost on the way; the receiver may still drop a signal (S2,
//!   S4).
//! - Of a pause and a resumption of one DAG waiting together, the later counts. The same holds for
//!   modes. An end counts more than a closing.
//! - Of two answers to waits of one subtask, the answer to the later wait counts.
//! - All letters taken in one step are served in this order: the mode; DAG by DAG its pause or
//!   resumption, its signals, its end, the answers to its waits; the end of the run. A mode,
//!   letters about one DAG (except answers) and the end of the run, left by one sender in this
//!   order, are served in this order, even if they are taken in two steps. Between several DAGs or
//!   senders, the order is open.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use super::Lifecycle;
use crate::ids::{ClusterId, DagId, Instance, ModeId, SubtaskId};
use crate::request::{ModeEntry, Request, WaitId};
use crate::task_set::{Dag, TaskSet};

/// Letters on their way to each cluster.
#[derive(Debug)]
pub struct Mailboxes {
    dags: Box<[DagMailbox]>,
    clusters: Box<[ClusterMailbox]>,
    /// The cluster serving modes.
    of_modes: ClusterId,
}

/// Letters to one DAG's cluster about that DAG.
#[derive(Debug)]
struct DagMailbox {
    cluster: ClusterId,
    signals: AtomicU32,
    /// [`NOTHING`], [`PAUSE`] or [`RESUME`].
    change: AtomicU32,
    /// [`NOTHING`], [`CLOSE`] or [`END`].
    end: AtomicU32,
    /// For each waiting subtask, the latest wait with an answer, as [`wait_word`]; 0 for none.
    answers: Box<[(SubtaskId, AtomicU64)]>,
}

/// Letters to a cluster about all of its DAGs.
#[derive(Debug, Default)]
struct ClusterMailbox {
    /// [`NOTHING`], or a mode with its way of entry, as [`packed`].
    mode: AtomicU32,
    ends: AtomicBool,
}

const NOTHING: u32 = 0;
const PAUSE: u32 = 1;
const RESUME: u32 = 2;
const CLOSE: u32 = 1;
const END: u32 = 2;

/// The lifecycle of each cluster, serving the requests to the cluster.
pub type Parts = Vec<Option<Box<dyn Lifecycle>>>;

/// Makes room for the letters of a run, and divides the lifecycle among the run's clusters.
///
/// # Errors
///
/// The reason why the lifecycle cannot be divided: fact and remedy.
pub fn divide(
    task_set: &TaskSet,
    lifecycle: Option<&dyn Lifecycle>,
) -> Result<(Mailboxes, Parts), &'static str> {
    let cluster_of = |dag: DagId| task_set.dag(dag).cluster();
    let in_modes = lifecycle.map_or_else(Vec::new, Lifecycle::dags_of_modes);
    let mut of_modes = in_modes.into_iter().map(cluster_of);
    // A change of modes pauses and resumes in one step, and a step belongs to one cluster.
    let first = of_modes.next().unwrap_or_default();
    if of_modes.any(|other| other != first) {
        return Err(
            "the cores are divided, and DAGs of several clusters are in modes; put all DAGs \
                    that are in a mode into one cluster",
        );
    }
    let part = |cluster| {
        let is_here = |dag| cluster_of(dag) == cluster;
        lifecycle.map(|whole| whole.part(&is_here, cluster == first))
    };
    let letters = Mailboxes::new(task_set, first);
    Ok((letters, task_set.clusters().map(part).collect()))
}

impl Mailboxes {
    /// Makes room for the letters of a run; cluster `of_modes` serves modes.
    pub(crate) fn new(task_set: &TaskSet, of_modes: ClusterId) -> Self {
        let mailbox = |dag: &Dag| DagMailbox {
            cluster: dag.cluster(),
            signals: AtomicU32::new(0),
            change: AtomicU32::new(NOTHING),
            end: AtomicU32::new(NOTHING),
            answers: answers(dag),
        };
        let clusters = task_set.clusters();
        Self {
            dags: task_set.dags().iter().map(mailbox).collect(),
            clusters: clusters.map(|_| ClusterMailbox::default()).collect(),
            of_modes,
        }
    }

    /// Leaves a request for the clusters concerned, except the sender's own cluster `from`, if any,
    /// and calls `sent` for each receiver. Reports whether the request does not concern `from`.
    pub fn send(
        &self,
        from: Option<ClusterId>,
        request: Request,
        mut sent: impl FnMut(ClusterId),
    ) -> bool {
        let to = match request {
            Request::Signal(dag)
            | Request::Pause(dag)
            | Request::Resume(dag)
            | Request::Close(dag)
            | Request::End(dag) => self.dags[dag.index()].cluster,
            Request::Answer(wait) => self.dags[wait.instance.dag.index()].cluster,
            Request::Enter(..) => self.of_modes,
            Request::ShutDown => {
                for (cluster, to) in (0..).map(ClusterId).zip(&self.clusters) {
                    if Some(cluster) != from {
                        to.ends.store(true, Ordering::Release);
                        sent(cluster);
                    }
                }
                // The request concerns the sender's own cluster as well.
                return false;
            }
            Request::Begin | Request::GoOn | Request::Step => return false,
        };
        if Some(to) == from {
            return false;
        }
        let of = |dag: DagId| &self.dags[dag.index()];
        // Release: so that the receiver sees the latest values shown before the letter.
        match request {
            Request::Signal(dag) => _ = of(dag).signals.fetch_add(1, Ordering::Release),
            Request::Pause(dag) => of(dag).change.store(PAUSE, Ordering::Release),
            Request::Resume(dag) => of(dag).change.store(RESUME, Ordering::Release),
            Request::Close(dag) => _ = of(dag).end.fetch_max(CLOSE, Ordering::Release),
            Request::End(dag) => of(dag).end.store(END, Ordering::Release),
            Request::Enter(mode, entry) => {
                let place = &self.clusters[to.index()].mode;
                place.store(packed(mode, entry), Ordering::Release);
            }
            Request::Answer(wait) => {
                let answers = &of(wait.instance.dag).answers;
                let place = answers.iter().find(|of| of.0 == wait.instance.subtask);
                // Of two answers, the older comes too late: its instance waits for the other by
                // now.
                place.map(|of| of.1.fetch_max(wait_word(wait), Ordering::Release));
            }
            Request::ShutDown | Request::Begin | Request::GoOn | Request::Step => {}
        }
        sent(to);
        true
    }

    /// Takes all letters to a cluster.
    pub fn take_all(&self, cluster: ClusterId, mut take: impl FnMut(Request)) {
        let of_all = &self.clusters[cluster.index()];
        // Each word is taken and emptied in one access: later letters belong to the next step. The
        // letters served last are emptied first. Otherwise one sender's letters, left between two
        // of these accesses, could be taken in the wrong order, in two steps.
        let ends = of_all.ends.swap(false, Ordering::Acquire);
        let mode = || {
            // A plain load suffices in nearly all rounds.
            let is_there = of_all.mode.load(Ordering::Relaxed) != NOTHING;
            let word = is_there.then(|| of_all.mode.swap(NOTHING, Ordering::Acquire));
            let asked = word.and_then(unpacked);
            asked.map(|(mode, entry)| Request::Enter(mode, entry))
        };
        for (dag, to) in (0..).map(DagId).zip(&self.dags) {
            if to.cluster != cluster {
                continue;
            }
            let end = to.end.swap(NOTHING, Ordering::Acquire);
            let signals = to.signals.swap(0, Ordering::Acquire);
            let change = to.change.swap(NOTHING, Ordering::Acquire);
            // Only now: a mode that the same sender has left before these letters is there by now,
            // and comes first.
            mode().into_iter().for_each(&mut take);
            match change {
                PAUSE => take(Request::Pause(dag)),
                RESUME => take(Request::Resume(dag)),
                _ => {}
            }
            (0..signals).for_each(|_| take(Request::Signal(dag)));
            match end {
                CLOSE => take(Request::Close(dag)),
                END => take(Request::End(dag)),
                _ => {}
            }
            for (subtask, answer) in &to.answers {
                let word = answer.swap(0, Ordering::Acquire);
                let wait = wait_of(dag, *subtask, word);
                wait.into_iter()
                    .for_each(|wait| take(Request::Answer(wait)));
            }
        }
        mode().into_iter().for_each(&mut take);
        if ends {
            take(Request::ShutDown);
        }
    }
}

/// Returns room for answers to the waiting subtasks.
fn answers(dag: &Dag) -> Box<[(SubtaskId, AtomicU64)]> {
    let numbered = (0..).map(SubtaskId).zip(dag.subtasks());
    let waiting = numbered.filter(|(_, subtask)| !subtask.waits().is_empty());
    waiting.map(|(id, _)| (id, AtomicU64::new(0))).collect()
}

/// Returns a word for a wait of a subtask: larger for a later wait, never 0.
const fn wait_word(wait: WaitId) -> u64 {
    // Eight bits are enough: a subtask states at most 254 waits (`MOST_WAITS`).
    (wait.instance.job << 8) | (wait.number as u64 + 1)
}

fn wait_of(dag: DagId, subtask: SubtaskId, word: u64) -> Option<WaitId> {
    let job = word >> 8;
    let number = u32::try_from(word & 0xff).ok()?.checked_sub(1)?;
    let instance = Instance { dag, job, subtask };
    Some(WaitId { instance, number })
}

/// Returns a word for a mode with its way of entry, never [`NOTHING`].
const fn packed(mode: ModeId, entry: ModeEntry) -> u32 {
    let entry = match entry {
        ModeEntry::AtOnce => 1,
        ModeEntry::WhenIdle => 2,
    };
    mode.0 << 2 | entry
}

const fn unpacked(word: u32) -> Option<(ModeId, ModeEntry)> {
    let entry = match word & 3 {
        1 => ModeEntry::AtOnce,
        2 => ModeEntry::WhenIdle,
        _ => return None,
    };
    Some((ModeId(word >> 2), entry))
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::lifecycle::LifecyclePlan;
    use crate::{CommitOptions, CoreDivision, DagSpec, Policy, SubtaskSpec, verify};

    /// Three DAGs, in clusters 0, 1 and 1.
    fn task_set() -> TaskSet {
        let spec = |cluster| DagSpec {
            cluster: Some(ClusterId(cluster)),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: vec![SubtaskSpec::default()],
            ..DagSpec::default()
        };
        let options =
            CommitOptions::new(Policy::Edf, 2).with_clusters(CoreDivision::Of(vec![1, 1]));
        let verified = verify(&[spec(0), spec(1), spec(1)], &options);
        verified.expect("it is right").task_set
    }

    #[test]
    fn requests_go_where_they_concern_something_and_the_later_one_counts() {
        let changes = LifecyclePlan::new(3, true).with_modes(vec![vec![DagId(1)], vec![DagId(2)]]);
        let (letters, _) = divide(&task_set(), Some(&changes)).expect("modes are in one cluster");
        let [here, there] = [0, 1].map(ClusterId);
        let modes =
            [ModeEntry::AtOnce, ModeEntry::WhenIdle].map(|entry| Request::Enter(ModeId(1), entry));
        for (request, is_away) in [
            (Request::Signal(DagId(0)), false),
            (Request::Signal(DagId(1)), true),
            (Request::Signal(DagId(1)), true),
            (Request::Pause(DagId(2)), true),
            (Request::Resume(DagId(2)), true),
            (modes[0], true),
            (modes[1], true),
            (Request::ShutDown, false),
            (Request::Begin, false),
        ] {
            let mut sent = Vec::new();
            let away = letters.send(Some(here), request, |cluster| sent.push(cluster));
            assert_eq!(away, is_away, "{request:?}");
            let leaves = is_away || request == Request::ShutDown;
            assert_eq!(sent, vec![there; usize::from(leaves)], "{request:?}");
        }
        for request in [Request::End(DagId(2)), Request::Close(DagId(2))] {
            assert!(letters.send(None, request, |cluster| assert_eq!(cluster, there)));
        }
        let mut taken = Vec::new();
        letters.take_all(there, |request| taken.push(request));
        let expected = [
            modes[1],
            Request::Signal(DagId(1)),
            Request::Signal(DagId(1)),
            Request::Resume(DagId(2)),
            Request::End(DagId(2)),
            Request::ShutDown,
        ];
        assert_eq!(taken, expected);
        letters.take_all(there, |request| panic!("{request:?} was taken"));
        letters.take_all(here, |request| panic!("{request:?} is of another cluster"));
    }

    #[test]
    fn each_cluster_serves_what_concerns_its_own_dags() {
        let changes = LifecyclePlan::new(3, true).with_paused(vec![DagId(0), DagId(2)]);
        let (_, mut parts) = divide(&task_set(), Some(&changes)).expect("there are no modes");
        let mut served = |cluster: usize, request| {
            let mut changes = Vec::new();
            let part = parts[cluster].as_mut().expect("each has one");
            part.serve(request, &mut changes);
            changes
        };
        use crate::lifecycle::LifecycleChange::{Close, Pause};
        assert_eq!(served(0, Request::Begin), [Pause(DagId(0))]);
        assert_eq!(served(1, Request::Begin), [Pause(DagId(2))]);
        assert_eq!(
            served(1, Request::ShutDown),
            [Close(DagId(1)), Close(DagId(2))]
        );
        assert_eq!(served(0, Request::ShutDown), [Close(DagId(0))]);
    }

    #[test]
    fn modes_of_several_clusters_are_refused() {
        let changes = LifecyclePlan::new(3, false).with_modes(vec![vec![DagId(0)], vec![DagId(2)]]);
        let why = divide(&task_set(), Some(&changes)).expect_err("DAG 0 is elsewhere");
        assert!(why.contains("into one cluster"), "{why}");
    }
}
