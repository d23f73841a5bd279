//! Several DAGs on one set of cores: their response-time equations together.
//!
//! DAG `i` *may outrank* DAG `k` if some instance of `i` may win a core that an
//! instance of `k` waits for. The bound of `k` then depends on the bound of
//! `i`. If priorities do not interleave this goes one way, from the highest
//! down; if they do, or under EDF, it goes round in circles. Both are solved
//! alike: start from the bounds of jobs alone, raise one DAG's after the other until
//! nothing changes.
//! All functions are monotone, so that ends in the least solution of all.
//!
//! Why circles are sound: look at the first job ever to exceed its bound, at
//! the instant when it does. Until then every job kept to its bound, which is
//! all that the workloads in its equation assume; so its equation holds, and
//! it did not exceed its bound.
//!
//! A DAG that fails takes those with it that it may outrank, since their
//! workloads would rest on a bound that does not exist; others keep theirs.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::above::Above;
use super::interference::{Clip, Other, Shape};
use super::multi_path::{Equations, alone};
use super::pipelined::{Figures, STEP_LIMIT, STEPS_PER_DAG, Unsolved};
use super::refusal::Refusal;
use super::task::Task;
use super::workload::Workload;

/// The DAGs of an order with their bounds so far, and with sums of their workloads.
pub(super) trait Front {
    /// Reports whether each DAG may outrank those after it and no other.
    fn goes_down(&self) -> bool;

    /// Returns those that may outrank a DAG, or the first of them in the order of the commit
    /// that has no bound; with a limit only jobs that are due no later than that count.
    ///
    /// It knows of those before it in the order what was put since the last DAG of the order
    /// was, and of those after it what was put until then.
    fn among<'a>(
        &'a self,
        set: &'a Set<'a>,
        dag: usize,
        limit_ns: Option<u64>,
    ) -> Result<Box<dyn Above + 'a>, usize>;

    /// Takes the bound of a DAG; all are put in, in the order, and then again.
    fn put(&mut self, set: &Set<'_>, dag: usize, response_ns: Option<u64>);
}

/// Makes a front without bounds, by an order, by who may outrank whom, and by whether jobs count
/// up to a deadline only.
pub(super) type NewFront =
    fn(&Set<'_>, &[usize], &dyn Fn(usize, usize) -> bool, bool) -> Box<dyn Front>;

/// DAGs with what enters their equations.
pub(super) struct Set<'a> {
    pub(super) tasks: &'a [&'a Task],
    pub(super) cores: u32,
    pub(super) shapes: Vec<Shape>,
    pub(super) figures: Vec<Figures>,
    /// Whether only jobs with deadlines no later count (EDF with `D <= T`).
    pub(super) deadlines_limit: bool,
    /// Which interference counts.
    pub(super) clip: Clip,
    /// Bounds that are known already, by DAG.
    pub(super) known: Vec<Option<u64>>,
    /// How workloads are added up, if they shall be.
    pub(super) front: Option<NewFront>,
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

impl Solution {
    /// Returns the bounds if there is one for each DAG.
    pub(super) fn complete(self) -> Result<Vec<u64>, Refusal> {
        match self.first_failing {
            Some((position, why)) => Err(why.at(position)),
            None => Ok(self.responses.into_iter().flatten().collect()),
        }
    }
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
    pub(super) fn new(tasks: &'a [&'a Task], cores: u32) -> Self {
        let shapes: Vec<Shape> = tasks.iter().map(|task| Shape::of(task, cores)).collect();
        let figures = tasks.iter().zip(&shapes);
        Self {
            tasks,
            cores,
            figures: figures
                .map(|(task, shape)| Figures::of(task, cores as usize, shape))
                .collect(),
            shapes,
            deadlines_limit: false,
            clip: Clip::Chains,
            known: alloc::vec![None; tasks.len()],
            front: None,
        }
    }

    /// Solves the equations, visiting the DAGs in `order`: of any sort where nothing is added up
    /// (the highest priority first is fastest), else as [`front`](Self::front) has it.
    pub(super) fn solve(
        &self,
        order: &[usize],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Solution {
        let mut solution = Solution {
            responses: (0..self.tasks.len()).map(|dag| self.start(dag)).collect(),
            first_failing: None,
            failures: alloc::vec![None; self.tasks.len()],
        };
        let mut steps = self.most_steps();
        let mut front = self.front(order, &may_outrank, self.deadlines_limit);
        let goes_down = front.as_ref().is_some_and(|front| front.goes_down());
        if !goes_down {
            self.put_all(&mut front, order, &solution.responses);
        }
        let mut is_done = false;
        while !is_done {
            is_done = true;
            for &dag in order {
                let before = solution.responses[dag];
                if self.known[dag].is_none() && before.is_some() {
                    let limit_ns = self.limit_ns(dag);
                    let (bounds, front) = (&solution.responses, front.as_deref());
                    let others = self.others(front, dag, limit_ns, bounds, &may_outrank);
                    self.visit(dag, others, &mut solution, &mut steps);
                }
                let after = solution.responses[dag];
                is_done &= goes_down || after == before;
                if let Some(front) = &mut front {
                    front.put(self, dag, after);
                }
            }
        }
        if let Some((_, Unsolved::Limit)) = solution.first_failing
            && let Ok(coarse) = self.down_from_deadlines(order, &may_outrank)
        {
            solution.responses = coarse.into_iter().map(Some).collect();
            solution.first_failing = None;
            solution.failures.fill(None);
        }
        solution
    }

    /// Raises the response time of a DAG among others to what its equations give, if none of
    /// the others has failed.
    fn visit(
        &self,
        dag: usize,
        others: Result<Box<dyn Above + '_>, usize>,
        solution: &mut Solution,
        steps: &mut u64,
    ) {
        let start_ns = solution.responses[dag].unwrap_or(0);
        let after = match others {
            Err(other) => Err(Failure::Other(other)),
            Ok(others) => (self.respond(dag, &*others, start_ns, steps)).map_err(|why| {
                solution.first_failing.get_or_insert((dag, why));
                Failure::Own(why)
            }),
        };
        solution.failures[dag] = after.err();
        solution.responses[dag] = after.ok();
    }

    /// Returns a front without bounds, if workloads shall be added up. Those that may outrank a
    /// DAG must be the first of the order, but for itself; so they are in the order of their most
    /// urgent priorities, and in any order if all may outrank all.
    pub(super) fn front(
        &self,
        order: &[usize],
        may_outrank: impl Fn(usize, usize) -> bool,
        deadlines_limit: bool,
    ) -> Option<Box<dyn Front>> {
        let front = self.front.filter(|_| self.clip == Clip::Chains)?;
        Some(front(self, order, &may_outrank, deadlines_limit))
    }

    /// Tells a front all bounds.
    pub(super) fn put_all(
        &self,
        front: &mut Option<Box<dyn Front>>,
        order: &[usize],
        responses: &[Option<u64>],
    ) {
        if let Some(front) = front {
            order
                .iter()
                .for_each(|&dag| front.put(self, dag, responses[dag]));
        }
    }

    /// Returns the DAGs that may outrank `dag`, by a front or one by one, or the first of these
    /// that has no bound; with a limit only jobs that are due no later than that count.
    pub(super) fn others<'s>(
        &'s self,
        front: Option<&'s (dyn Front + 's)>,
        dag: usize,
        limit_ns: Option<u64>,
        responses: &[Option<u64>],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Result<Box<dyn Above + 's>, usize> {
        match front {
            Some(front) => front.among(self, dag, limit_ns),
            None => {
                let each = self.interference_up_to(dag, limit_ns, responses, may_outrank);
                Ok(Box::new(each?))
            }
        }
    }

    /// Returns how often all equations together may be evaluated.
    fn most_steps(&self) -> u64 {
        STEP_LIMIT.max(STEPS_PER_DAG * self.tasks.len() as u64)
    }

    /// Returns the deadline up to which others' jobs count for a DAG's, if there is one.
    fn limit_ns(&self, dag: usize) -> Option<u64> {
        let deadline_ns = self.tasks[dag].relative_deadline_ns();
        self.deadlines_limit.then_some(deadline_ns)
    }

    /// Returns the least response time of a DAG among others, if it is at least `start_ns`.
    pub(super) fn respond(
        &self,
        dag: usize,
        others: &dyn Above,
        start_ns: u64,
        steps: &mut u64,
    ) -> Result<u64, Unsolved> {
        let (equations, figures) = (self.equations(dag), &self.figures[dag]);
        match equations.solve(others, start_ns, steps) {
            Err(Unsolved::BeyondDeadline) if equations.limit_ns < figures.limit_ns() => {
                figures.solve(others, start_ns, steps)
            }
            solved => solved,
        }
    }

    /// Returns the equations of a DAG's jobs one at a time.
    pub(super) fn equations(&self, dag: usize) -> Equations<'_> {
        let figures = &self.figures[dag];
        Equations {
            task: self.tasks[dag],
            covers: &self.shapes[dag].covers,
            cores: self.cores as usize,
            blocking: &figures.blocking,
            clip: self.clip,
            limit_ns: figures.limit_ns().min(self.tasks[dag].period_ns()),
        }
    }

    /// Returns what is known, or the bound of a job alone, below which no solution lies: from
    /// there on the workloads only grow.
    fn start(&self, dag: usize) -> Option<u64> {
        let alone = || alone(self.tasks[dag], &self.shapes[dag].covers, self.cores.into());
        self.known[dag].or_else(alone)
    }

    /// Tries the deadlines as bounds: if each equation holds with the others'
    /// deadlines, then the least solution lies below, however slowly one
    /// comes near it. From there it goes down, as long as steps are left.
    pub(super) fn down_from_deadlines(
        &self,
        order: &[usize],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<u64>, (usize, Unsolved)> {
        let mut steps = self.most_steps();
        let mut bounds: Vec<u64> = (self.known.iter().zip(self.tasks))
            .map(|(known, task)| known.unwrap_or(task.relative_deadline_ns()))
            .collect();
        let mut front = self.front(order, &may_outrank, self.deadlines_limit);
        let mut has_round = false;
        loop {
            let responses: Vec<Option<u64>> = bounds.iter().copied().map(Some).collect();
            self.put_all(&mut front, order, &responses);
            let lower = (0..self.tasks.len()).map(|dag| {
                if let Some(known) = self.known[dag] {
                    return Ok(known);
                }
                let (limit_ns, front) = (self.limit_ns(dag), front.as_deref());
                let others = self.others(front, dag, limit_ns, &responses, &may_outrank);
                let others = others.map_err(|_| (dag, Unsolved::Limit))?;
                let response = self.respond(dag, &*others, 0, &mut steps);
                response.map_err(|why| (dag, why))
            });
            match lower.collect::<Result<Vec<u64>, _>>() {
                Err(_) if has_round => return Ok(bounds),
                Err(why) => return Err(why),
                Ok(lower) if lower == bounds => return Ok(bounds),
                Ok(lower) => bounds = lower,
            }
            has_round = true;
        }
    }

    /// Returns the workloads of the DAGs that may outrank `dag`, or the first of
    /// these that has no bound.
    pub(super) fn interference(
        &self,
        dag: usize,
        responses: &[Option<u64>],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<Other>, usize> {
        self.interference_up_to(dag, self.limit_ns(dag), responses, may_outrank)
    }

    /// Does the same; with a limit only jobs that are due no later than that count.
    pub(super) fn interference_up_to(
        &self,
        dag: usize,
        limit_ns: Option<u64>,
        responses: &[Option<u64>],
        may_outrank: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<Other>, usize> {
        let others = (0..self.tasks.len()).filter(|&other| other != dag && may_outrank(other, dag));
        let others = others.map(|other| {
            let response = responses[other].ok_or(other)?;
            Ok(self.other(other, response, limit_ns))
        });
        others.collect()
    }

    /// Describes what a DAG with a response-time bound may execute next to another one.
    pub(super) fn other(&self, other: usize, response_ns: u64, limit_ns: Option<u64>) -> Other {
        let (task, shape) = (self.tasks[other], &self.shapes[other]);
        let limit = |workload: Workload| match limit_ns {
            Some(limit_ns) => workload.under_edf(task.least_deadline_ns(), limit_ns),
            None => workload,
        };
        Other::new(task, shape, response_ns, self.cores.into(), limit)
    }
}

/// Reports whether there are cores and every DAG has `D <= T`.
pub(super) fn constrained(tasks: &[&Task], cores: u32) -> bool {
    let one = |task: &&Task| task.relative_deadline_ns() <= task.period_ns();
    cores > 0 && tasks.iter().all(one)
}
