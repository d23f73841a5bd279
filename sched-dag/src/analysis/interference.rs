//! The work other DAGs may execute during a job, in the forms needed by the equations.
//!
//! The equation with `j` chains counts interference on at most `m - j` cores. So a DAG has an
//! [`InterferingWorkload`] for each number of cores, up to the most cores one of its jobs can use.
//! The clipped form asks only for the work in some part of the window, in total as long as the job
//! waits. In such a part no core executes longer than the part lasts. Neither does a chain of the
//! other DAG, because a chain is on one core at a time.

use alloc::vec::Vec;

use super::blocking::{Blocking, largest};
use super::cover::parallelism_covers_and_parts;
use super::task::Task;
use super::waiting::beside_span;
use super::workload::{InterferingWorkload, WorkloadBursts, WorkloadSegment};

/// The interference counted by the multi-path equations. Each variant is a bound, and later
/// variants are tighter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InterferenceBound {
    /// All interference that fits into the window.
    Window,
    /// On each core, no more than the time for which the job waits.
    Waiting,
    /// In addition, no more than that time for each chain.
    Chains,
    /// As [`Chains`](Self::Chains), without the excess of 1 (`schedulability/sharp_clip.rs`).
    Sharp,
}

/// Figures of a DAG's graph needed by its own equations and by those of others.
#[derive(Clone, Debug)]
pub(super) struct GraphSummary {
    /// The most cores one job can use, at least 1 and at most all.
    pub(super) parallelism: u64,
    /// The most work of 1, 2, .. disjoint chains, for as many chains as there are cores; waits
    /// count as work.
    pub(super) covers: Vec<u64>,
    /// The least work left beside the span for `m`, `m - 1`, .. cores, by any form.
    pub(super) left: Vec<u64>,
    /// The work of some disjoint chains.
    chains: Vec<u64>,
    /// The longest executions, which may block other DAGs where subtasks keep their cores.
    pub(super) largest_ns: Vec<u64>,
    pub(super) unblocked: Blocking,
}

impl GraphSummary {
    pub(super) fn of(task: &Task, cores: u32) -> Self {
        let (parallelism, mut covers, chains) = parallelism_covers_and_parts(task, cores);
        let mut largest_ns = largest(task.wcets_ns(), cores);
        if task.has_waits() {
            covers = super::cover::covers(task.oblivious(), covers.len());
            let segments_ns = task.waits().iter().map(|waits| waits.longest_segment_ns);
            largest_ns = largest(&segments_ns.collect::<Vec<u64>>(), cores);
        }
        Self {
            parallelism,
            left: beside_span(task, &covers, cores),
            covers,
            chains,
            largest_ns,
            unblocked: Blocking::none(task),
        }
    }
}

/// All work that may delay a DAG's work due at some time, for as long as the DAG waits.
pub(super) struct DelaySources {
    /// The workloads of DAGs that may outrank it.
    pub(super) others: Vec<InterferingDag>,
    pub(super) blocking: Blocking,
    /// For a blocked DAG with waits, the work left on all cores beside its span, with the blocking
    /// along the path. No other form is valid then.
    pub(super) left_and_blocking: Option<u128>,
    pub(super) bursts: WorkloadBursts,
}

/// Returns the most work of some DAGs on all cores within a window.
pub(super) fn on_all_cores(others: &[InterferingDag], window_ns: u64) -> WorkloadSegment {
    let pieces = others.iter();
    let pieces = pieces.map(|other| other.on_all_cores().at(window_ns));
    pieces.fold(WorkloadSegment::NONE, WorkloadSegment::and)
}

/// A DAG that may outrank the DAG under analysis.
pub(super) struct InterferingDag {
    /// All work of the DAG, on at most 1, 2, .. cores.
    whole: Vec<InterferingWorkload>,
    /// The work beyond its chains, likewise.
    rest: Vec<InterferingWorkload>,
    chains: Vec<InterferingWorkload>,
}

impl InterferingDag {
    /// Describes the workloads of a DAG with a response-time bound, each changed by `limit`.
    pub(super) fn new(
        task: &Task,
        shape: &GraphSummary,
        response_ns: u64,
        cores: u64,
        limit: impl Fn(InterferingWorkload) -> InterferingWorkload,
    ) -> Self {
        let workload = |volume_ns, parallelism, cores| {
            let all = InterferingWorkload::new(task, volume_ns, response_ns, parallelism, cores);
            limit(all)
        };
        let by_cores = |volume_ns: u64| {
            // Once the count reaches the most cores of one job, overlapping jobs may use all cores.
            let of_all = |count| {
                if count < shape.parallelism {
                    count
                } else {
                    cores
                }
            };
            let counts = 1..=shape.parallelism;
            let workloads = counts.map(|count| workload(volume_ns, count, of_all(count)));
            workloads.collect()
        };
        let left = task.volume_ns() - shape.chains.iter().sum::<u64>();
        Self {
            whole: by_cores(task.volume_ns()),
            rest: if left > 0 { by_cores(left) } else { Vec::new() },
            chains: (shape.chains.iter())
                .map(|&volume_ns| workload(volume_ns, 1, cores))
                .collect(),
        }
    }

    /// Returns the workload on all cores.
    pub(super) fn on_all_cores(&self) -> &InterferingWorkload {
        &self.whole[self.whole.len() - 1]
    }

    /// Adds for each `j` the work on `m - j` cores within a window: to `plain` all work that fits,
    /// and to `clipped` the work limited to the time for which the job waits. `times` are the
    /// window and the waiting time, in nanoseconds.
    pub(super) fn add_to(
        &self,
        times: (u64, u64),
        clip: InterferenceBound,
        cores: usize,
        plain: &mut [WorkloadSegment],
        clipped: &mut [WorkloadSegment],
    ) {
        let of_chains = (clip >= InterferenceBound::Chains).then(|| self.of_chains(times));
        let mut last = 0;
        let mut pieces = [WorkloadSegment::NONE; 2];
        for (j, (plain, clipped)) in plain.iter_mut().zip(clipped).enumerate() {
            let count = (cores - j).min(self.whole.len());
            if count != last {
                last = count;
                pieces = self.pieces(times, count, of_chains);
            }
            *plain = plain.and(pieces[0]);
            *clipped = clipped.and(pieces[1]);
        }
    }

    /// Returns the workload on at most `cores` cores, plain and clipped, and the number of cores
    /// counted.
    pub(super) fn on(&self, times: (u64, u64), cores: usize) -> (usize, [u128; 2]) {
        let count = cores.min(self.whole.len());
        let pieces = self.pieces(times, count, Some(self.of_chains(times)));
        (count, pieces.map(|piece| piece.value))
    }

    /// Returns the clipped workload on at most `cores` cores as a function of the job's waiting
    /// time only, with a fixed window. The function is exact until the end of its piece.
    pub(super) fn ahead(&self, times: (u64, u64), cores: usize) -> WorkloadSegment {
        let piece = |part: &InterferingWorkload| {
            let all = WorkloadSegment::new(part.at(times.0).value, 0, None);
            all.lower(part.over(times.1))
        };
        let place = cores.min(self.whole.len()) - 1;
        let parts = self.chains.iter().chain(self.rest.get(place)).map(piece);
        let sum = parts.fold(WorkloadSegment::NONE, WorkloadSegment::and);
        piece(&self.whole[place]).lower(sum)
    }

    fn of_chains(&self, times: (u64, u64)) -> WorkloadSegment {
        let chains = self.chains.iter().map(|chain| chain.within(times));
        chains.fold(WorkloadSegment::NONE, WorkloadSegment::and)
    }

    fn pieces(
        &self,
        times: (u64, u64),
        count: usize,
        of_chains: Option<WorkloadSegment>,
    ) -> [WorkloadSegment; 2] {
        let whole = &self.whole[count - 1];
        let (plain, clipped) = (whole.at(times.0), whole.within(times));
        let by_chains = of_chains.map(|of_chains| {
            let rest = self.rest.get(count - 1).map(|rest| rest.within(times));
            clipped.least(of_chains.and(rest.unwrap_or(WorkloadSegment::NONE)))
        });
        [plain, by_chains.unwrap_or(clipped)]
    }
}
