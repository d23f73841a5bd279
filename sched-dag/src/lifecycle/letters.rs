//! Requests to other clusters, and from outside of all, on their way.
//!
//! Each cluster serves the requests that concern its DAGs, with its own part of what the app has
//! stated. A request of a completion goes where it concerns something: a signal, a pause and a
//! resumption to the cluster of the DAG, a mode to that of the modes' DAGs, which are all in one, and
//! a shutdown to all. To another cluster it is a *letter*, which counts in the step in which that
//! takes it, before its releases. Leaving one never waits, and the room is taken at commit:
//!
//! - Signals are counted, so each is one.
//! - Of a pause and a resumption of one DAG that wait, the later one counts, and so it is of modes;
//!   a stop counts more than a closing.
//! - What is taken in one step is served in this order: DAG by DAG, the mode, the end.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::{Entry, Lifecycle, Request};
use crate::ids::{ClusterId, DagId, ModeId};
use crate::task_set::TaskSet;

/// What is on its way to each cluster.
#[derive(Debug)]
pub struct Letters {
    dags: Box<[ToDag]>,
    clusters: Box<[ToCluster]>,
    /// The cluster that serves modes.
    of_modes: ClusterId,
}

/// What waits for one DAG's cluster about that DAG.
#[derive(Debug)]
struct ToDag {
    cluster: ClusterId,
    signals: AtomicU32,
    /// [`NOTHING`], [`PAUSE`] or [`RESUME`].
    change: AtomicU32,
    /// [`NOTHING`], [`CLOSE`] or [`STOP`].
    end: AtomicU32,
}

/// What waits for a cluster about its whole.
#[derive(Debug, Default)]
struct ToCluster {
    /// [`NOTHING`], or a mode and how to enter it, as [`packed`].
    mode: AtomicU32,
    ends: AtomicBool,
}

const NOTHING: u32 = 0;
const PAUSE: u32 = 1;
const RESUME: u32 = 2;
const CLOSE: u32 = 1;
const STOP: u32 = 2;

/// What serves the requests of each cluster.
pub type Parts = Vec<Option<Box<dyn Lifecycle>>>;

/// Makes room for the letters of a run, and divides what serves its requests among its clusters.
///
/// # Errors
///
/// Why it cannot be divided: fact and remedy.
pub fn divide(
    task_set: &TaskSet,
    lifecycle: Option<&dyn Lifecycle>,
) -> Result<(Letters, Parts), &'static str> {
    let cluster_of = |dag: DagId| task_set.dag(dag).cluster();
    let in_modes = lifecycle.map_or_else(Vec::new, Lifecycle::dags_of_modes);
    let mut of_modes = in_modes.into_iter().map(cluster_of);
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
    let letters = Letters {
        dags: (task_set.dags().iter())
            .map(|dag| ToDag {
                cluster: dag.cluster(),
                signals: AtomicU32::new(0),
                change: AtomicU32::new(NOTHING),
                end: AtomicU32::new(NOTHING),
            })
            .collect(),
        clusters: task_set.clusters().map(|_| ToCluster::default()).collect(),
        of_modes: first,
    };
    Ok((letters, task_set.clusters().map(part).collect()))
}

impl Letters {
    /// Leaves a request for the clusters that it concerns, other than the one that it comes `from`,
    /// if any; calls `sent` for each of them, and reports whether it does not concern that one.
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
            | Request::Stop(dag) => self.dags[dag.index()].cluster,
            Request::Enter(..) => self.of_modes,
            Request::ShutDown => {
                for (cluster, to) in (0..).map(ClusterId).zip(&self.clusters) {
                    if Some(cluster) != from {
                        to.ends.store(true, Ordering::Release);
                        sent(cluster);
                    }
                }
                return false;
            }
            Request::Begin | Request::GoOn | Request::Step => return false,
        };
        if Some(to) == from {
            return false;
        }
        let of = |dag: DagId| &self.dags[dag.index()];
        // Release: for the latest values that were shown before.
        match request {
            Request::Signal(dag) => _ = of(dag).signals.fetch_add(1, Ordering::Release),
            Request::Pause(dag) => of(dag).change.store(PAUSE, Ordering::Release),
            Request::Resume(dag) => of(dag).change.store(RESUME, Ordering::Release),
            Request::Close(dag) => _ = of(dag).end.fetch_max(CLOSE, Ordering::Release),
            Request::Stop(dag) => of(dag).end.store(STOP, Ordering::Release),
            Request::Enter(mode, entry) => {
                let place = &self.clusters[to.index()].mode;
                place.store(packed(mode, entry), Ordering::Release);
            }
            Request::ShutDown | Request::Begin | Request::GoOn | Request::Step => {}
        }
        sent(to);
        true
    }

    /// Takes all that waits for a cluster.
    pub fn take(&self, cluster: ClusterId, mut take: impl FnMut(Request)) {
        for (dag, to) in (0..).map(DagId).zip(&self.dags) {
            if to.cluster != cluster {
                continue;
            }
            match to.change.swap(NOTHING, Ordering::Acquire) {
                PAUSE => take(Request::Pause(dag)),
                RESUME => take(Request::Resume(dag)),
                _ => {}
            }
            let signals = to.signals.swap(0, Ordering::Acquire);
            (0..signals).for_each(|_| take(Request::Signal(dag)));
            match to.end.swap(NOTHING, Ordering::Acquire) {
                CLOSE => take(Request::Close(dag)),
                STOP => take(Request::Stop(dag)),
                _ => {}
            }
        }
        let to = &self.clusters[cluster.index()];
        if let Some((mode, entry)) = unpacked(to.mode.swap(NOTHING, Ordering::Acquire)) {
            take(Request::Enter(mode, entry));
        }
        if to.ends.swap(false, Ordering::Acquire) {
            take(Request::ShutDown);
        }
    }
}

/// Returns a word for a mode and how to enter it, which is not [`NOTHING`].
const fn packed(mode: ModeId, entry: Entry) -> u32 {
    let entry = match entry {
        Entry::AtOnce => 1,
        Entry::WhenIdle => 2,
    };
    mode.0 << 2 | entry
}

const fn unpacked(word: u32) -> Option<(ModeId, Entry)> {
    let entry = match word & 3 {
        1 => Entry::AtOnce,
        2 => Entry::WhenIdle,
        _ => return None,
    };
    Some((ModeId(word >> 2), entry))
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::lifecycle::Changes;
    use crate::{Clusters, CommitOptions, DagSpec, Policy, SubtaskSpec, verify};

    /// Three DAGs, in clusters 0, 1 and 1.
    fn task_set() -> TaskSet {
        let spec = |cluster| DagSpec {
            cluster: Some(ClusterId(cluster)),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: vec![SubtaskSpec::default()],
            ..DagSpec::default()
        };
        let options = CommitOptions::new(Policy::Edf, 2).with_clusters(Clusters::Of(vec![1, 1]));
        let verified = verify(&[spec(0), spec(1), spec(1)], &options);
        verified.expect("it is right").task_set
    }

    #[test]
    fn requests_go_where_they_concern_something_and_the_later_one_counts() {
        let changes = Changes::new(3, true).with_modes(vec![vec![DagId(1)], vec![DagId(2)]]);
        let (letters, _) = divide(&task_set(), Some(&changes)).expect("modes are in one cluster");
        let [here, there] = [0, 1].map(ClusterId);
        let modes = [Entry::AtOnce, Entry::WhenIdle].map(|entry| Request::Enter(ModeId(1), entry));
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
        for request in [Request::Stop(DagId(2)), Request::Close(DagId(2))] {
            assert!(letters.send(None, request, |cluster| assert_eq!(cluster, there)));
        }
        let mut taken = Vec::new();
        letters.take(there, |request| taken.push(request));
        let expected = [
            Request::Signal(DagId(1)),
            Request::Signal(DagId(1)),
            Request::Resume(DagId(2)),
            Request::Stop(DagId(2)),
            modes[1],
            Request::ShutDown,
        ];
        assert_eq!(taken, expected);
        letters.take(there, |request| panic!("{request:?} was taken"));
        letters.take(here, |request| panic!("{request:?} is of another cluster"));
    }

    #[test]
    fn each_cluster_serves_what_concerns_its_own_dags() {
        let changes = Changes::new(3, true).with_paused(vec![DagId(0), DagId(2)]);
        let (_, mut parts) = divide(&task_set(), Some(&changes)).expect("there are no modes");
        let mut served = |cluster: usize, request| {
            let mut changes = Vec::new();
            let part = parts[cluster].as_mut().expect("each has one");
            part.serve(request, &mut changes);
            changes
        };
        use crate::lifecycle::Change::{Close, Pause};
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
        let changes = Changes::new(3, false).with_modes(vec![vec![DagId(0)], vec![DagId(2)]]);
        let why = divide(&task_set(), Some(&changes)).expect_err("DAG 0 is elsewhere");
        assert!(why.contains("into one cluster"), "{why}");
    }
}
