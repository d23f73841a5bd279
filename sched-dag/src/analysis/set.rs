//! Several DAGs on one set of cores: their response-time equations, solved together.
//!
//! DAG `i` *may outrank* DAG `k` if some instance of `i` may win a core for which an instance of
//! `k` waits. The bound of `k` then depends on the bound of `i`. If priorities do not interleave,
//! the dependency goes one way, from the highest priority down. If they do, or under EDF, it goes
//! round in circles. Both cases are solved alike: start from the bounds of jobs alone, and raise
//! one DAG's bound after the other until nothing changes. All functions are monotone, so the
//! iteration ends in the least solution.
//!
//! Why circles are sound: look at the first job ever to exceed its bound, at the instant when it
//! does. Until then every job kept to its bound, and the workloads in the job's equation assume no
//! more. So the equation holds, and the job did not exceed its bound: a contradiction.
//!
//! A failing DAG makes every DAG fail that it may outrank, because their workloads would rest on a
//! missing bound. Other DAGs keep their bounds.
//!
//! [`multi_path_fp`] and [`multi_path_edf`] accept or refuse a set as a whole, the way the
//! literature compares tests. A commit asks [`answer()`](super::answer()), which judges each DAG
//! separately.

use alloc::vec::Vec;

use super::interference::{DelaySources, GraphSummary, InterferenceBound, InterferingDag};
use super::multi_path::{MultiPathEquations, alone};
use super::pipelined::{OWN_STEPS, PipelineTerms, STEP_LIMIT, SolverFailure};
use super::task::Task;
use super::waiting::{Rounding, with_blocking};
use super::workload::{InterferingWorkload, WorkloadBursts};

/// DAGs with all inputs of their equations.
#[derive(Clone)]
pub(super) struct EquationSet<'a> {
    pub(super) tasks: &'a [&'a Task],
    pub(super) cores: u32,
    /// By DAG, the number of cores counted in its equations.
    counted: Vec<u32>,
    pub(super) shapes: Vec<GraphSummary>,
    pub(super) figures: Vec<PipelineTerms>,
    /// Whether only jobs with deadlines no later count (EDF), for jobs without overlap.
    pub(super) deadlines_limit: bool,
    /// Whether each subtask keeps its core, so that lower-ranked subtasks may block.
    pub(super) keep_cores: bool,
    /// Which interference counts.
    pub(super) clip: InterferenceBound,
    pub(super) bursts: WorkloadBursts,
    pub(super) rounding: Rounding,
    /// Whether the equations have the forms for waiting subtasks; see [`Self::has_waits`].
    pub(super) is_of_waits: bool,
    /// By DAG, whether waits enter its equations; empty: for no DAG.
    with_waits: Vec<bool>,
}

/// The bounds of the DAGs of a set, as far as solved.
#[derive(Debug)]
pub(super) struct DagSolution {
    /// The response-time bound by DAG; `None`: not proven.
    pub(super) responses: Vec<Option<u64>>,
    /// The first DAG to fail by itself.
    pub(super) first_failing: Option<(usize, SolverFailure)>,
    /// By DAG, why it has no response time.
    pub(super) failures: Vec<Option<BoundFailure>>,
}

/// Why a DAG has no response-time bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BoundFailure {
    /// Its own equation has no usable solution.
    Own(SolverFailure),
    /// Another DAG without a bound may outrank it.
    Other(usize),
    /// A DAG that may outrank it has overlapping jobs, and waits enter the equation.
    Overlapping,
}

impl DagSolution {
    fn fail(&mut self, dag: usize, failure: BoundFailure) {
        if let BoundFailure::Own(why) = failure {
            self.first_failing.get_or_insert((dag, why));
        }
        self.failures[dag] = Some(failure);
        self.responses[dag] = None;
    }
}

impl<'a> EquationSet<'a> {
    /// Describes preemptive DAGs, with older jobs winning over younger.
    pub(super) fn new(tasks: &'a [&'a Task], cores: u32) -> Self {
        let shapes: Vec<GraphSummary> = tasks
            .iter()
            .map(|task| GraphSummary::of(task, cores))
            .collect();
        let figures = tasks.iter().zip(&shapes);
        Self {
            tasks,
            cores,
            counted: alloc::vec![cores; tasks.len()],
            figures: figures
                .map(|(task, shape)| PipelineTerms::of(task, cores as usize, shape))
                .collect(),
            shapes,
            deadlines_limit: false,
            keep_cores: false,
            clip: InterferenceBound::Chains,
            bursts: WorkloadBursts::default(),
            rounding: Rounding::Up,
            is_of_waits: tasks.iter().any(|task| task.has_waits()),
            with_waits: Vec::new(),
        }
    }

    /// Solves the equations of DAGs listed from the highest priority to the lowest.
    pub(super) fn in_order(&self) -> Option<Vec<u64>> {
        let order: Vec<usize> = (0..self.tasks.len()).collect();
        let none = alloc::vec![None; order.len()];
        let solution = self.solve(&none, &order, &|other, dag| other < dag);
        solution.responses.into_iter().collect()
    }

    /// Counts only `cores` cores in the equations of a DAG.
    pub(super) fn count_on(&mut self, dag: usize, cores: u32) {
        let own = GraphSummary::of(self.tasks[dag], cores);
        let shape = &mut self.shapes[dag];
        // Next to other DAGs, though, the DAG may execute on all cores.
        (shape.covers, shape.left) = (own.covers, own.left);
        self.counted[dag] = cores;
    }

    /// Reports whether subtasks wait.
    pub(super) const fn has_waits(&self) -> bool {
        self.is_of_waits
    }

    /// Accepts no response time beyond a period for the DAGs marked in `with_waits`: the forms for
    /// waits need jobs without overlap.
    pub(super) fn forbid_overlap(&mut self, with_waits: Vec<bool>) {
        for (figures, _) in (self.figures.iter_mut().zip(&with_waits)).filter(|(_, with)| **with) {
            figures.allow_in_flight(1);
        }
        self.with_waits = with_waits;
    }

    /// Reports whether subtasks wait in a DAG, or in another DAG that may delay it.
    pub(super) fn waits_enter(&self, dag: usize) -> bool {
        self.has_waits() && self.with_waits.get(dag) == Some(&true)
    }

    /// Solves the equations, visiting the DAGs in `order`. Any order will do, but the highest
    /// priority first is fastest. Known bounds stay.
    pub(super) fn solve(
        &self,
        known: &[Option<u64>],
        order: &[usize],
        may_outrank: &dyn Fn(usize, usize) -> bool,
    ) -> DagSolution {
        let mut solution = DagSolution {
            responses: (known.iter().enumerate())
                .map(|(dag, known)| known.or_else(|| self.start(dag)))
                .collect(),
            first_failing: None,
            failures: alloc::vec![None; self.tasks.len()],
        };
        // With waits, a job too long even when alone has no bound. It must fail first, before any
        // DAG that would have to wait for it.
        for &dag in order {
            let limit_ns = self.figures[dag].limit_ns();
            if self.waits_enter(dag) && solution.responses[dag] > Some(limit_ns) {
                solution.fail(dag, BoundFailure::Own(SolverFailure::BeyondDeadline));
            }
        }
        // The budget ends every commit, however the set is built: an unsolved set is not proven.
        let mut steps = EvaluationBudget::of(self.tasks.len());
        let mut is_done = false;
        // Upwards from the least responses: the least fixed point of all equations together.
        while !is_done {
            is_done = true;
            for &dag in order {
                let before = solution.responses[dag];
                if known[dag].is_none()
                    && let Some(start_ns) = before
                {
                    let responses = &solution.responses;
                    match self.respond(dag, start_ns, responses, may_outrank, &mut steps) {
                        Ok(after_ns) => solution.responses[dag] = Some(after_ns),
                        Err(failure) => solution.fail(dag, failure),
                    }
                }
                // A grown response may delay all other DAGs, so another round must visit
                // everything.
                is_done &= solution.responses[dag] == before;
            }
        }
        // The way up has spent the budget. On the way down from the deadlines each round is a
        // bound, so the last whole round can be used.
        if let Some((_, SolverFailure::Limit)) = solution.first_failing
            && let Some(coarse) = self.down_from_deadlines(known, may_outrank)
        {
            solution.responses = coarse.into_iter().map(Some).collect();
            solution.first_failing = None;
            solution.failures.fill(None);
        }
        solution
    }

    /// Returns the least response time of a DAG among others, searching from `start_ns` upwards, or
    /// the failure that prevents one.
    fn respond(
        &self,
        dag: usize,
        start_ns: u64,
        responses: &[Option<u64>],
        may_outrank: &dyn Fn(usize, usize) -> bool,
        steps: &mut EvaluationBudget,
    ) -> Result<u64, BoundFailure> {
        let (equations, figures) = (self.equations(dag), &self.figures[dag]);
        let overlapping = equations.limit_ns + 1;
        let delays = |bound_ns| self.delays_of_job(dag, bound_ns, responses, may_outrank);
        let apart = delays(equations.limit_ns)?;
        let solved = steps.spend(dag, |steps| equations.solve(&apart, start_ns, steps));
        match solved {
            // Jobs that may overlap may still have a bound by the equation for several jobs in
            // flight.
            Err(SolverFailure::BeyondDeadline) if equations.limit_ns < figures.limit_ns() => {
                let together = delays(overlapping)?;
                steps.spend(dag, |steps| figures.solve(&together, start_ns, steps))
            }
            solved => solved,
        }
        .map_err(BoundFailure::Own)
    }

    /// Returns the equations for a DAG's jobs one at a time.
    pub(super) fn equations(&self, dag: usize) -> MultiPathEquations<'_> {
        let figures = &self.figures[dag];
        MultiPathEquations {
            task: self.tasks[dag],
            covers: &self.shapes[dag].covers,
            left: &self.shapes[dag].left,
            cores: self.counted[dag] as usize,
            clip: self.clip,
            rounding: self.rounding,
            limit_ns: figures.limit_ns().min(self.tasks[dag].period_ns()),
        }
    }

    /// Returns the bound of a job alone. No solution lies below, and from there on the workloads
    /// only grow.
    fn start(&self, dag: usize) -> Option<u64> {
        let left = &self.shapes[dag].left;
        alone(self.tasks[dag], left, self.counted[dag], self.rounding)
    }

    /// Tries the deadlines as bounds. If each equation holds with the others' deadlines, the least
    /// solution lies below, however slow the approach from below. From the deadlines the iteration
    /// goes down, as long as steps are left.
    pub(super) fn down_from_deadlines(
        &self,
        known: &[Option<u64>],
        may_outrank: &dyn Fn(usize, usize) -> bool,
    ) -> Option<Vec<u64>> {
        let mut steps = EvaluationBudget::of(self.tasks.len());
        let mut bounds: Vec<u64> = (known.iter().zip(&self.figures))
            .map(|(known, figures)| known.unwrap_or(figures.limit_ns()))
            .collect();
        let mut has_round = false;
        loop {
            let responses: Vec<Option<u64>> = bounds.iter().copied().map(Some).collect();
            let lower = (0..self.tasks.len()).map(|dag| {
                if known[dag].is_some() {
                    return known[dag];
                }
                self.respond(dag, 0, &responses, may_outrank, &mut steps)
                    .ok()
            });
            match lower.collect::<Option<Vec<u64>>>() {
                // The bounds of the last whole round hold; no tighter bounds were found in time.
                None if has_round => return Some(bounds),
                None => return None,
                Some(lower) if lower == bounds => return Some(bounds),
                Some(lower) => bounds = lower,
            }
            has_round = true;
        }
    }

    /// Returns the sources of delay for a DAG's jobs of the given bound, as
    /// [`delays`](Self::delays) does.
    pub(super) fn delays_of_job(
        &self,
        dag: usize,
        bound_ns: u64,
        responses: &[Option<u64>],
        may_outrank: &dyn Fn(usize, usize) -> bool,
    ) -> Result<DelaySources, BoundFailure> {
        let deadline_ns = self.tasks[dag].relative_deadline_ns();
        self.delays(dag, (bound_ns, deadline_ns), responses, may_outrank)
    }

    /// Returns the sources of delay for a DAG's work due at a relative deadline, either its job or
    /// one of its sinks, given the bound of its jobs. Fails with the first DAG that may outrank it
    /// and has no usable bound.
    ///
    /// Where deadlines limit the interference, a DAG counts only with its jobs due by then;
    /// otherwise in full. A DAG that does not count in full may block.
    pub(super) fn delays(
        &self,
        dag: usize,
        (bound_ns, deadline_ns): (u64, u64),
        responses: &[Option<u64>],
        may_outrank: &dyn Fn(usize, usize) -> bool,
    ) -> Result<DelaySources, BoundFailure> {
        let is_apart = |dag: usize, bound_ns| bound_ns <= self.tasks[dag].period_ns();
        let limit_ns =
            Some(deadline_ns).filter(|_| self.deadlines_limit && is_apart(dag, bound_ns));
        let (mut others, mut blocking_ns) = (Vec::new(), Vec::new());
        for other in (0..self.tasks.len()).filter(|&other| other != dag) {
            let outranks = may_outrank(other, dag);
            if outranks {
                // Without the other's response its carry-in is unknown, and so is this bound.
                let response = responses[other].ok_or(BoundFailure::Other(other))?;
                let limit_ns = limit_ns.filter(|_| is_apart(other, response));
                if self.waits_enter(dag) && !is_apart(other, response) {
                    return Err(BoundFailure::Overlapping);
                }
                others.push(self.other(dag, other, response, limit_ns));
            }
            // A DAG that outranks this DAG is in the interference already. Under EDF, however, a
            // later job of the other DAG may block.
            if self.keep_cores && (limit_ns.is_some() || !outranks) {
                blocking_ns.extend_from_slice(&self.shapes[other].largest_ns);
            }
        }
        Ok(self.delays_by(dag, others, &blocking_ns))
    }

    /// Returns the sources of delay of a DAG: workloads, and the longest segments that may block
    /// it.
    fn delays_by(
        &self,
        dag: usize,
        others: Vec<InterferingDag>,
        blocking_ns: &[u64],
    ) -> DelaySources {
        let blocking = (self.shapes[dag].unblocked).by(blocking_ns, self.cores);
        let (task, rounding) = (self.tasks[dag], self.rounding);
        let is_coupled = task.has_waits() || rounding == Rounding::Down;
        let left_and_blocking = (is_coupled && !blocking_ns.is_empty())
            .then(|| with_blocking(task, self.cores, &blocking));
        DelaySources {
            others,
            blocking,
            left_and_blocking,
            bursts: self.bursts.clone(),
        }
    }

    /// Describes the work a DAG with a response-time bound may execute next to another DAG.
    fn other(
        &self,
        dag: usize,
        other: usize,
        response_ns: u64,
        limit_ns: Option<u64>,
    ) -> InterferingDag {
        let (task, shape) = (self.tasks[other], &self.shapes[other]);
        let limit = |workload: InterferingWorkload| match limit_ns {
            Some(limit_ns) => workload.by_deadlines(task.least_deadline_ns(), limit_ns),
            None => workload,
        };
        let cores = self.counted[dag].into();
        InterferingDag::new(task, shape, response_ns, cores, limit)
    }
}

/// The number of evaluations of equations left. A DAG takes shared steps first and then its own, so
/// a DAG that converges slowly takes away no other DAG's bound.
pub(super) struct EvaluationBudget {
    shared: u64,
    /// By DAG.
    own: Vec<u64>,
}

impl EvaluationBudget {
    pub(super) fn of(dags: usize) -> Self {
        Self {
            shared: STEP_LIMIT,
            own: alloc::vec![OWN_STEPS; dags],
        }
    }

    /// Lets `work` spend the steps available to a DAG.
    pub(super) fn spend<T>(&mut self, dag: usize, work: impl FnOnce(&mut u64) -> T) -> T {
        let own = self.own[dag];
        // Each DAG has steps of its own, so a DAG with slow equations leaves the others theirs.
        let mut left = self.shared + own;
        let result = work(&mut left);
        // The shared steps are spent first.
        self.own[dag] = left.min(own);
        self.shared = left - self.own[dag];
        result
    }
}

/// Reports whether there are cores, and `D <= T` for every DAG.
pub(super) fn constrained(tasks: &[&Task], cores: u32) -> bool {
    let one = |task: &&Task| task.relative_deadline_ns() <= task.period_ns();
    cores > 0 && tasks.iter().all(one)
}

/// Bounds the response times under global fixed priorities, also of overlapping jobs. The DAGs come
/// from the highest priority to the lowest. Returns `None` if there are no cores, or if a DAG has
/// no bound within its deadline.
#[must_use]
pub fn multi_path_fp(tasks: &[&Task], cores: u32, clip: InterferenceBound) -> Option<Vec<u64>> {
    let mut set = (cores > 0).then(|| EquationSet::new(tasks, cores))?;
    set.clip = clip;
    if tasks.iter().any(|task| task.has_waits()) {
        set.forbid_overlap(alloc::vec![true; tasks.len()]);
    }
    set.in_order()
}

/// Bounds the response times under global EDF, in the order given. The iteration goes down from the
/// deadlines and therefore accepts a little less than [`answer()`](super::answer()). Returns `None`
/// if there are no cores, or if a DAG has `D > T` or no bound within its deadline.
#[must_use]
pub fn multi_path_edf(tasks: &[&Task], cores: u32, clip: InterferenceBound) -> Option<Vec<u64>> {
    let mut set = constrained(tasks, cores).then(|| EquationSet::new(tasks, cores))?;
    set.clip = clip;
    set.deadlines_limit = true;
    set.down_from_deadlines(&alloc::vec![None; tasks.len()], &|_, _| true)
}

#[cfg(test)]
mod tests {
    use super::{InterferenceBound, multi_path_fp};
    use crate::analysis::Task;

    #[test]
    fn interference_counts_only_while_the_job_waits() {
        // One of two cores is always free for the chain, so at most 2 of the 9 matter.
        let long = Task::new(100, 100, vec![9, 2], &[]).unwrap();
        let low = Task::new(100, 100, vec![4, 4], &[(0, 1)]).unwrap();
        let bounds = |clip| multi_path_fp(&[&long, &low], 2, clip).unwrap()[1];
        assert_eq!(
            (
                bounds(InterferenceBound::Window),
                bounds(InterferenceBound::Chains)
            ),
            (14, 11)
        );
    }
}
