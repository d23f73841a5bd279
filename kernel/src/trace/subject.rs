//! What an event happened to: an instance or a job, in two words.

use sched_dag::{DagId, Instance, SubtaskId};

/// An instance, or a whole job, as events are recorded of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Subject {
    /// The DAG in the upper half, in the lower one the subtask.
    pub(crate) ids: u64,
    pub(crate) job: u64,
}

/// Stands where a subtask's number does, for a whole job.
const NO_SUBTASK: u64 = 0xffff_ffff;

impl Subject {
    /// Stands where there is none.
    pub(crate) const NONE: Self = Self {
        ids: u64::MAX,
        job: u64::MAX,
    };

    /// Makes what stands for an instance.
    #[inline]
    pub(crate) fn of(instance: Instance) -> Self {
        Self {
            ids: u64::from(instance.dag.0) << 32 | u64::from(instance.subtask.0),
            job: instance.job,
        }
    }

    /// Makes what stands for a whole job.
    pub(crate) fn of_job(dag: DagId, job: u64) -> Self {
        Self {
            ids: u64::from(dag.0) << 32 | NO_SUBTASK,
            job,
        }
    }

    /// Returns the DAG.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "32 bits are left")]
    pub(crate) const fn dag(self) -> DagId {
        DagId((self.ids >> 32) as u32)
    }

    /// Returns the subtask, `None` for a whole job.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "32 bits are left")]
    pub(crate) fn subtask(self) -> Option<SubtaskId> {
        let subtask = self.ids & NO_SUBTASK;
        (subtask != NO_SUBTASK).then_some(SubtaskId(subtask as u32))
    }

    /// Returns the instance, `None` for a whole job.
    #[inline]
    pub(crate) fn instance(self) -> Option<Instance> {
        Some(Instance {
            dag: self.dag(),
            job: self.job,
            subtask: self.subtask()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_back_what_it_stands_for() {
        let instance = Instance {
            dag: DagId(u32::MAX),
            job: 5,
            subtask: SubtaskId(7),
        };
        assert_eq!(Subject::of(instance).instance(), Some(instance));
        let job = Subject::of_job(DagId(3), 5);
        assert_eq!((job.dag(), job.job), (DagId(3), 5));
        assert_eq!(job.instance(), None);
        assert_eq!(Subject::NONE.instance(), None);
    }
}
