//! Several DAGs on one set of cores: their response-time equations together.
//!
//! DAG `i` *may outrank* DAG `k` if some instance of `i` may win a core that an
//! instance of `k` waits for. The bound of `k` then depends on the bound of
//! `i`. If priorities do not interleave this goes one way, from the highest
//! down; if they do, or under EDF, it goes round in circles. Both are solved
//! alike: start from Graham's bounds, improve one DAG after the other until nothing changes.
//! All functions are monotone, so that ends in the least solution of all.
//!
//! Why circles are sound: look at the first job ever to exceed its bound, at
//! the instant when it does. Until then every job kept to its bound, which is
//! all that the workloads in its equation assume; so its equation holds, and
//! it did not exceed its bound.
//!
//! A DAG that fails takes those with it that it may outrank, since their
//! workloads would rest on a bound that does not exist; others keep theirs.

use alloc::vec::Vec;

use super::graham::graham;
use super::response::{Figures, STEP_LIMIT, Unsolved};
use super::task::Task;
use super::workload::Workload;

/// DAGs with what enters their equations.
pub(super) struct Set<'a> {
    pub(super) tasks: &'a [&'a Task],
    pub(super) cores: u64,
    /// The most cores that one job can use, by DAG, at most `cores`.
    pub(super) parallelism: &'a [u64],
    pub(super) figures: Vec<Figures>,
    /// Whether only jobs with deadlines no later count (EDF with `D <= T`).
    pub(super) deadlines_limit: bool,
    /// Bounds that are known already, by DAG.
    pub(super) known: Vec<Option<u64>>,
}

/// What is known about each DAG of a set.
#[derive(Debug)]
pub(super) struct Solution {
    /// The response-time bound by DAG, `None` if not proven.
    pub(super) responses: Vec<Option<u64>>,
    /// The DAG that failed first, on its own account.
    pub(super) first_failing: Option<(usize, Unsolved)>,
    /// Why a DAG has no response time, by DAG.
    pub(super) failures: Vec<Option<Failure>>,
}

/// Why a DAG has no response-time bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Failure {
    /// Its own equation has no usable solution.
    Own(Unsolved),
    /// This DAG may outrank it and has no bound itself.
    Other(usize),
}

impl<'a> Set<'a> {
    /// Describes DAGs that are preemptive and whose older jobs win.
    pub(super) fn new(tasks: &'a [&'a Task], cores: u64, parallelism: &'a [u64]) -> Self {
        let figures = tasks.iter().zip(parallelism);
        Self {
            tasks,
            cores,
            parallelism,
            figures: figures
                .map(|(task, &p)| Figures::of(task, cores, p))
                .collect(),
            deadlines_limit: false,
            known: alloc::vec![None; tasks.len()],
        }
    }

    /// Solves the equations, visiting the DAGs in `order` (of any sort; the
    /// highest priority first is fastest).
    pub(super) fn solve(
        &self,
        order: &[usize],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Solution {
        let mut responses: Vec<Option<u64>> =
            (0..self.tasks.len()).map(|dag| self.start(dag)).collect();
        let mut first_failing = None;
        let mut failures = alloc::vec![None; self.tasks.len()];
        let mut steps = STEP_LIMIT;
        let mut changed = true;
        while changed {
            changed = false;
            for &dag in order.iter().filter(|&&dag| self.known[dag].is_none()) {
                let Some(before) = responses[dag] else {
                    continue;
                };
                let after = match self.interference(dag, &responses, &may_outrank) {
                    Err(other) => Err(Failure::Other(other)),
                    Ok(others) => self.figures[dag]
                        .solve(&others, before, &mut steps)
                        .map_err(|why| {
                            first_failing.get_or_insert((dag, why));
                            Failure::Own(why)
                        }),
                };
                failures[dag] = after.err();
                let after = after.ok();
                changed |= after != responses[dag];
                responses[dag] = after;
            }
        }
        if let Some((_, Unsolved::Limit)) = first_failing
            && let Some(coarse) = self.within_deadlines(&may_outrank)
        {
            responses = coarse;
            first_failing = None;
            failures.fill(None);
        }
        Solution {
            responses,
            first_failing,
            failures,
        }
    }

    /// Returns what is known, or Graham's bound, below which no solution lies: from there on the
    /// workloads only grow.
    fn start(&self, dag: usize) -> Option<u64> {
        let graham = || graham(self.tasks[dag], u32::try_from(self.cores).ok()?);
        self.known[dag].or_else(graham)
    }

    /// Tries the deadlines as bounds: if each equation holds with the others'
    /// deadlines, then the least solution lies below, however slowly one
    /// comes near it.
    fn within_deadlines(
        &self,
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Option<Vec<Option<u64>>> {
        let deadline = |dag: usize| self.tasks[dag].relative_deadline_ns();
        let deadlines = (0..self.tasks.len()).map(|dag| self.known[dag].or(Some(deadline(dag))));
        let deadlines: Vec<Option<u64>> = deadlines.collect();
        let mut steps = STEP_LIMIT;
        let bounds = (0..self.tasks.len()).map(|dag| {
            if let known @ Some(_) = self.known[dag] {
                return Some(known);
            }
            let others = self.interference(dag, &deadlines, &may_outrank).ok()?;
            self.figures[dag]
                .solve(&others, 0, &mut steps)
                .ok()
                .map(Some)
        });
        bounds.collect()
    }

    /// Returns the workloads of the DAGs that may outrank `dag`, or the first of
    /// these that has no bound.
    fn interference(
        &self,
        dag: usize,
        responses: &[Option<u64>],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<Workload>, usize> {
        let others = (0..self.tasks.len()).filter(|&other| other != dag && may_outrank(other, dag));
        let workloads = others.map(|other| {
            let task = self.tasks[other];
            let workload = Workload::new(
                task,
                responses[other].ok_or(other)?,
                self.parallelism[other],
                self.cores,
            );
            Ok(if self.deadlines_limit {
                let deadline = self.tasks[dag].relative_deadline_ns();
                workload.under_edf(task.relative_deadline_ns(), deadline)
            } else {
                workload
            })
        });
        workloads.collect()
    }
}
