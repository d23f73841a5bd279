//! The journals of all clusters of a run as one.
//!
//! Each is in the order in which its scheduler learnt of things, and stays so: of the next
//! events of two, the earlier one goes first. Nothing in one depends on another, since each
//! DAG and each core is in one cluster; so any order between them tells the same run.

use alloc::vec::Vec;

use super::Journal;
use crate::ids::ClusterId;
use crate::journal::Event;

impl Journal {
    /// Takes over what another cluster's journal of the same run holds, which counts its cores
    /// from the cluster's first one. If there is no memory for both, that counts as lost.
    #[inline(never)]
    pub fn absorb(&mut self, other: Self, cluster: ClusterId, first_core: u32) {
        let mut merged = Vec::new();
        let both = self.events.len() + other.events.len();
        if merged.try_reserve_exact(both).is_err() {
            self.lost += other.written();
            self.is_complete = false;
            return;
        }
        let theirs = other.words();
        let mut theirs = theirs
            .map(|words| Event::on_core_from(*words, first_core))
            .peekable();
        for words in self.words() {
            while let Some(earlier) = theirs.next_if(|theirs| theirs[0] < words[0]) {
                merged.push(earlier);
            }
            merged.push(*words);
        }
        merged.extend(theirs);
        self.events = merged;
        self.oldest = 0;
        self.lost += other.lost;
        self.is_complete &= other.is_complete;
        match (&mut self.tally, other.tally) {
            (Some(ours), Some(theirs)) => ours.adopt(theirs, cluster),
            // A cluster that has lost nothing has counted nothing yet.
            (none, theirs) => *none = none.take().or(theirs),
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::sync::Arc;
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::journal::{Subject, What};
    use crate::{ClusterId, Clusters, CommitOptions, CoreId, DagId, DagSpec, Instance};
    use crate::{Policy, SubtaskId, SubtaskSpec, TaskSet, verify};

    /// Two DAGs of 20 jobs, each in a cluster of one core.
    fn task_set() -> Arc<TaskSet> {
        let spec = |cluster| DagSpec {
            cluster: Some(ClusterId(cluster)),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            jobs: Some(20),
            subtasks: vec![SubtaskSpec::default()],
            ..DagSpec::default()
        };
        let options = CommitOptions::new(Policy::Edf, 2).with_clusters(Clusters::Of(vec![1, 1]));
        let verified = verify(&[spec(0), spec(1)], &options).expect("it is right");
        Arc::new(verified.task_set)
    }

    /// The journal of a cluster, with room for so many bytes in all, after 20 jobs of 3 or
    /// 4 ns.
    fn journal(task_set: &Arc<TaskSet>, cluster: u32, free_bytes: usize) -> Journal {
        let id = ClusterId(cluster);
        let mut journal = Journal::of_cluster(task_set, id, free_bytes, u64::MAX);
        for job in 0..20 {
            let (dag, subtask) = (DagId(cluster), SubtaskId(0));
            let of_job = Subject::of_job(dag, job);
            let instance = Subject::of(Instance { dag, job, subtask });
            let end_ns = 3 + u64::from(cluster);
            for (time_ns, what, subject) in [
                (0, What::Released, of_job),
                (0, What::Ready, instance),
                (1, What::Start, instance),
                (end_ns, What::Finish, instance),
                (end_ns, What::Completed, of_job),
            ] {
                journal.write(CoreId(0), what, 10 * job + time_ns, subject);
            }
        }
        journal
    }

    fn merged(free_bytes: [usize; 2]) -> (Arc<TaskSet>, Journal) {
        let task_set = task_set();
        let mut first = journal(&task_set, 0, free_bytes[0]);
        first.absorb(journal(&task_set, 1, free_bytes[1]), ClusterId(1), 1);
        (task_set, first)
    }

    #[test]
    fn events_of_two_clusters_stand_in_the_order_of_time() {
        let (task_set, journal) = merged([1 << 20; 2]);
        let times: Vec<u64> = journal.events().map(|event| event.time_ns).collect();
        assert!(times.is_sorted());
        assert_eq!((times.len(), journal.lost()), (200, 0));
        assert!(journal.events().all(|event| event.core.0 == event.dag.0));
        assert!(journal.violations(&task_set).is_empty());
    }

    #[test]
    fn statistics_are_those_of_both_whichever_has_lost_events() {
        for free_bytes in [[1 << 20; 2], [2000, 1 << 20], [1 << 20, 2000], [2000; 2]] {
            let (task_set, journal) = merged(free_bytes);
            let small = free_bytes.iter().filter(|bytes| **bytes == 2000).count() as u64;
            assert_eq!(journal.lost(), small * 80, "{free_bytes:?}");
            let statistics = journal.statistics(&task_set).expect("all were counted");
            for (dag, response_ns) in [(0, 3), (1, 4)] {
                let times = &statistics.dag(DagId(dag)).response_time;
                let found = (times.count(), times.max());
                assert_eq!(found, (20, response_ns), "{free_bytes:?}");
            }
            assert!(journal.violations(&task_set).is_empty(), "{free_bytes:?}");
        }
    }
}
