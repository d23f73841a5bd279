//! List schedules: a list of a DAG's subtasks for each of some cores, with times based on WCETs.
//!
//! Let each subtask execute for its WCET. At each completion, look at the *ready* subtasks in the
//! order of their ranks, the longest remaining path first, ties by position. Each subtask goes to
//! the first idle core on which it ends by the core's *limit*. Without such a core the subtask
//! stays ready. No subtask is preempted.
//!
//! A run keeps to these times if it keeps to the lists: each subtask executes on its core only,
//! after the subtask before it, and nothing wins over it. Then each subtask ends at its time after
//! the release, or earlier, even if some executions are shorter than their WCETs. A new schedule
//! for the shorter times might take longer (R. L. Graham's anomalies, 1969). `docs/bounds.md`,
//! "Tables", has the proof.
//!
//! Limits make some cores end early. [`ListSchedule::squeezed`] lowers the limits as far as it
//! finds schedules. The first cores are then full up to the deadline, and the last cores end early.
//!
//! Not guaranteed: that a schedule within the limits is found whenever one exists.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use super::task::Task;
use crate::ids::{ClusterId, DagId, SubtaskId, to_u32};
use crate::table::{CoreList, Table, TableEntry};

/// The most times one core's limit is lowered.
const SQUEEZES: usize = 256;

/// The most pairs of subtasks visited to squeeze one schedule. A schedule of n subtasks counts as
/// n^2, since subtasks refused by all cores are visited again at each completion. Graphs of fewer
/// than 45 subtasks on 16 cores never reach the limit.
const SQUEEZE_STEPS: usize = 1 << 23;

/// A subtask in the list of its core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScheduledSubtask {
    /// The subtask's position in the DAG.
    pub subtask: usize,
    /// The start after the release, in nanoseconds.
    pub start_ns: u64,
    /// The finish, later than the start by the WCET.
    pub finish_ns: u64,
}

/// A schedule of one job on cores of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListSchedule {
    /// By core, its subtasks in the order of their starts; a core may have none.
    pub cores: Vec<Vec<ScheduledSubtask>>,
}

impl ListSchedule {
    /// Schedules the WCETs on as many cores as there are limits, in nanoseconds after the release.
    ///
    /// Returns `None` if no core may take some subtask, or there are no cores.
    #[must_use]
    pub fn within(task: &Task, limits_ns: &[u64]) -> Option<Self> {
        let latest_ns = *limits_ns.iter().max()?;
        let (levels, wcets_ns) = (task.bottom_levels(), task.wcets_ns());
        let mut missing = task.graph.predecessor_counts();
        let mut ready = BinaryHeap::new();
        // Subtasks about to become ready, or ready again.
        let mut released: Vec<usize> = task.sources().collect();
        let mut cores: Vec<Vec<ScheduledSubtask>> = vec![Vec::new(); limits_ns.len()];
        let mut start_ns = 0;
        loop {
            for next in core::mem::take(&mut released) {
                ready.push((levels[next], Reverse(next)));
            }
            let finish_ns = |list: &[ScheduledSubtask]| list.last().map_or(0, |of| of.finish_ns);
            let is_idle = |list: &[ScheduledSubtask]| finish_ns(list) <= start_ns;
            let mut idle = cores.iter().filter(|list| is_idle(list)).count();
            while idle > 0
                && let Some((_, Reverse(subtask))) = ready.pop()
            {
                // Some subtask executes at each instant so far, so the sum is at most the volume.
                let finish_ns = start_ns + wcets_ns[subtask];
                let mut places = cores.iter_mut().zip(limits_ns);
                match places.find(|(list, limit_ns)| is_idle(list) && finish_ns <= **limit_ns) {
                    Some((list, _)) => {
                        idle -= 1;
                        list.push(ScheduledSubtask {
                            subtask,
                            start_ns,
                            finish_ns,
                        });
                    }
                    // The finish only gets later, so no core will ever take the subtask.
                    None if finish_ns > latest_ns => return None,
                    None => released.push(subtask),
                }
            }
            let busy = cores.iter().map(|list| finish_ns(list));
            let Some(next_ns) = busy.filter(|&ns| ns > start_ns).min() else {
                return released.is_empty().then_some(Self { cores });
            };
            start_ns = next_ns;
            let ended = cores.iter().filter_map(|list| list.last());
            for ended in ended.filter(|last| last.finish_ns == start_ns) {
                for next in task.successors(ended.subtask) {
                    missing[next] -= 1;
                    if missing[next] == 0 {
                        released.push(next);
                    }
                }
            }
        }
    }

    /// Lowers the limit of each core, from the last core to the first, as far as schedules are
    /// found within a limited number of tries. All limits are `limit_ns` to begin with.
    ///
    /// The schedule may get longer, but never longer than `limit_ns`.
    pub fn squeezed(&self, task: &Task, limit_ns: u64) -> Self {
        let mut limits_ns = vec![limit_ns; self.cores.len()];
        let mut best = self.clone();
        let mut tries = SQUEEZE_STEPS / task.subtask_count().pow(2).max(1);
        for core in (0..limits_ns.len()).rev() {
            for _ in 0..SQUEEZES {
                let before_ns = limits_ns[core];
                let Some(lower_ns) = best.finish_ns(core).checked_sub(1).filter(|_| tries > 0)
                else {
                    break;
                };
                tries -= 1;
                limits_ns[core] = lower_ns;
                let Some(found) = Self::within(task, &limits_ns) else {
                    limits_ns[core] = before_ns;
                    break;
                };
                best = found;
            }
        }
        best
    }

    /// Returns when a core ends its last subtask, in nanoseconds after the release; 0 without any.
    ///
    /// # Panics
    ///
    /// If the core does not exist.
    pub fn finish_ns(&self, core: usize) -> u64 {
        self.cores[core].last().map_or(0, |last| last.finish_ns)
    }

    /// Returns the last finish, in nanoseconds after the release; 0 without subtasks.
    pub fn length_ns(&self) -> u64 {
        let finishes_ns = (0..self.cores.len()).map(|core| self.finish_ns(core));
        finishes_ns.max().unwrap_or(0)
    }

    /// Returns the schedule as a table of one DAG, on cores from `first_core` on.
    pub(super) fn table(&self, dag: usize, period_ns: u64, first_core: usize) -> Table {
        let entry = |of: &ScheduledSubtask| TableEntry {
            dag: DagId(to_u32(dag)),
            subtask: SubtaskId(to_u32(of.subtask)),
            job: 0,
            depth: 0,
            start_ns: of.start_ns,
            length_ns: of.finish_ns - of.start_ns,
        };
        let lists = self.cores.iter().zip(first_core..);
        let lists = lists.map(|(list, core)| CoreList {
            core: to_u32(core),
            entries: list.iter().map(entry).collect(),
        });
        Table {
            cluster: ClusterId(0),
            lap_ns: period_ns,
            lists: lists.filter(|list| !list.entries.is_empty()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ListSchedule;
    use crate::analysis::{Task, multi_path};
    use random::Random;

    #[test]
    fn a_fixed_order_is_never_longer_than_the_bound_of_a_free_one() {
        let mut random = Random::new(35);
        for _ in 0..300 {
            let count = 1 + random.index(12);
            let edges: Vec<_> = random.edges(count, 25).collect();
            let wcets: Vec<u64> = (0..count).map(|_| 1 + random.index(9) as u64).collect();
            let task = Task::new(999, 999, wcets.clone(), &edges).unwrap();
            for cores in 1..5 {
                let limits = vec![999; cores];
                let schedule = ListSchedule::within(&task, &limits).unwrap();
                let length = schedule.length_ns();
                assert!(length <= multi_path(&task, super::to_u32(cores)).unwrap());
                // Lemma 1: the lists as edges make a longest path of that length.
                let pairs = schedule.cores.iter().flat_map(|list| list.windows(2));
                let order = pairs.map(|pair| (pair[0].subtask, pair[1].subtask));
                let all: Vec<_> = edges.iter().copied().chain(order).collect();
                let ordered = Task::new(999, 999, wcets.clone(), &all).unwrap();
                assert_eq!(ordered.length_ns(), length);
                // Lemma 2: a limit for all cores is met, or nothing meets it.
                let by = |limit| ListSchedule::within(&task, &vec![limit; cores]);
                assert_eq!(by(length), Some(schedule.clone()));
                assert_eq!(by(length - 1), None);
                // Squeezed, it keeps to the limit, to every WCET and to every edge.
                let limit = length + random.index(9) as u64;
                assert_is_valid(&schedule.squeezed(&task, limit), &task, limit);
            }
        }
    }

    fn assert_is_valid(schedule: &ListSchedule, task: &Task, limit: u64) {
        let mut times = vec![None; task.subtask_count()];
        for list in &schedule.cores {
            let apart = |pair: &[super::ScheduledSubtask]| pair[0].finish_ns <= pair[1].start_ns;
            assert!(list.windows(2).all(apart));
            for of in list {
                let wcet = task.wcets_ns()[of.subtask];
                assert_eq!(of.finish_ns - of.start_ns, wcet);
                assert!(of.finish_ns <= limit);
                let before = times[of.subtask].replace((of.start_ns, of.finish_ns));
                assert_eq!(before, None);
            }
        }
        let times: Option<Vec<_>> = times.into_iter().collect();
        let times = times.expect("each subtask is in a list");
        for (subtask, &(_, finish)) in times.iter().enumerate() {
            let mut next = task.successors(subtask);
            assert!(next.all(|next| finish <= times[next].0));
        }
    }
}
