//! The schedule-abstraction graph of periodic DAGs whose subtasks keep their cores.
//!
//! M. Nasri, B. Brandenburg, RTSS 2017; M. Nasri, G. Nelissen, B. Brandenburg, ECRTS 2018 and 2019.
//! This version follows the scheduler's own rules (R2, R5, completions and releases before a
//! dispatch, executions down to 0) and covers schedules without an end.
//!
//! A *state* represents all runs with the same instances dispatched. It has an interval for each
//! core in which the core becomes free, and an interval for the finish of each dispatched instance
//! that still matters. If a run is in a state and dispatches an instance next, the instance is
//! *eligible* there, starts within a computed interval, and the run continues in the successor
//! state (`transitions`). So a list of states is *closed* if it includes the initial state and,
//! with each state, all successors. Every run of any length stays in a closed list, and the latest
//! finishes seen there bound all responses.
//!
//! [`explore()`](super::explore()) searches for such a list. [`check_closed`] checks a list in one
//! pass and trusts nothing of the search.
//!
//! If DAGs have a last job, some state is the last before a candidate is cut off. From there on
//! states count the *laps* (hyperperiods) completed, and a job at or beyond the limit is no
//! candidate. A state without laps stands for any number of laps. So a list needs only the few ends
//! of its states, not every lap.
//!
//! Assumes: each DAG is periodic, and all stated jobs are released, each within the jitter after
//! its nominal release; no instance loses its core or waits; nothing else executes. *Fewer* jobs
//! than stated are a different set: the bounds do not cover pauses, modes, faults, or the early end
//! of one DAG. No release waits for room in flight: the bound and the jitter of a DAG are at most
//! its limit of jobs in flight times the period.

use alloc::vec;
use alloc::vec::Vec;

use super::ratio::greatest_common_divisor;
use crate::fnv::{EMPTY, fnv_1a};
use crate::order::{sort, sorted};
use crate::worded::texts;

/// The largest time of a set, in nanoseconds: 13 days; sums of a few stay far below an `i64`.
const MOST_NS: u64 = 1 << 50;

/// The latest time and the latest release of a state; sums stay far from overflow.
const LATEST_NS: i64 = 1 << 53;

/// The most comparison steps in a check, a limit against forged lists: a second or so.
const STEP_LIMIT: u64 = 1 << 30;

/// The most instances of a hyperperiod.
pub const INSTANCE_LIMIT: u64 = 1 << 12;

/// A DAG of subtasks that keep their cores.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AbstractionDag {
    /// The period in nanoseconds, at least 1.
    pub period_ns: u64,
    /// The first nominal release, in nanoseconds.
    pub offset_ns: u64,
    /// The longest time from a nominal release to the actual release, below the period, in
    /// nanoseconds.
    pub jitter_ns: u64,
    /// The number of jobs, stated for all DAGs or for none.
    pub jobs: Option<u64>,
    /// The subtasks.
    pub subtasks: Vec<AbstractionSubtask>,
    /// The edges.
    pub edges: Vec<(usize, usize)>,
}

/// A subtask that keeps its core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AbstractionSubtask {
    /// The shortest execution in nanoseconds, at most the longest.
    pub best_ns: u64,
    /// The longest execution in nanoseconds, at least 1.
    pub wcet_ns: u64,
    /// The policy's number for the subtask; smaller numbers go first.
    pub number: u64,
    /// The relative deadline in nanoseconds; `None` for a subtask that is no sink.
    pub deadline_ns: Option<u64>,
}

texts! {
    /// Why a set has no closed list.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum NotClosed {
        /// A sink may finish after its deadline, as far as states can tell; a miss is not proven.
        Late { dag: usize, subtask: usize } =
            "subtask {subtask} of dag {dag} may be late, as far as states tell; relax its deadline";
        /// No core, no period, a WCET of 0 or below the shortest execution, a jitter as long as the
        /// period, edges in a circle or to no subtask, a sink without a deadline, or a last job of
        /// some DAGs only.
        NotCovered =
            "none covers this set; let all DAGs be periodic and end, or none, and subtasks keep their \
             cores without waits, locks, groups and lists";
        /// More states than the limit, or a hyperperiod of too many instances or too long.
        Limit = "it has too many states, or a hyperperiod too many instances; use fewer periods";
        /// The text belongs to another set, to other cores, or to other charges.
        Foreign = "it is of another set, of other cores or of other overheads; leave its lines out, and `run` explores this one";
        /// A listed state cannot belong to this set: the numbers of subtasks or cores differ, the
        /// order is wrong, or times are out of range.
        Malformed { state: usize } = "state {state} is none of this set; explore it again";
        /// The list does not include the initial state.
        NoFirst = "no listed state includes the first one; explore the set again";
        /// The list does not include a state a run may reach next.
        Open { state: usize } =
            "state {state} has a successor that no listed state includes; explore the set again";
    }
}

/// A set of DAGs on the cores of one cluster, ready to be explored.
#[derive(Clone, Debug)]
pub struct AbstractionSet {
    pub(super) cores: usize,
    adds_release: bool,
    /// Whether executions are real numbers, and a step sees a release together with all releases
    /// due no later, as on a machine. Otherwise executions are whole nanoseconds, and releases are
    /// late one by one.
    is_real: bool,
    hyperperiod_ns: i64,
    /// By DAG: period, offset, jitter, jobs in a hyperperiod.
    dags: Vec<[i64; 4]>,
    /// By DAG, the number of all jobs; empty: the schedule has no end.
    limits: Vec<i64>,
    /// DAG by DAG.
    vertices: Vec<AbstractVertex>,
}

#[derive(Clone, Debug)]
struct AbstractVertex {
    dag: usize,
    subtask: usize,
    terms: AbstractionSubtask,
    predecessors: Vec<usize>,
    successors: Vec<usize>,
}

/// The finish of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FinishInterval {
    pub(super) vertex: usize,
    pub(super) job: i64,
    pub(super) low_ns: i64,
    pub(super) high_ns: i64,
}

/// A state; states of a list are in normal form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AbstractState {
    /// The completed laps, if jobs are cut off; `None`: any number.
    pub(super) laps: Option<i64>,
    /// By vertex, the number of dispatched jobs.
    pub(super) counts: Vec<i64>,
    /// The earliest and the latest times for cores to become free, each sorted.
    pub(super) free_ns: [Vec<i64>; 2],
    /// Ascending by vertex and job.
    pub(super) finishes: Vec<FinishInterval>,
}

impl AbstractState {
    /// Returns the state as numbers for [`AbstractionSet::state`]: 0, or 1 more than the laps; the
    /// counts; the earliest and the latest times of cores; and four numbers for each finish.
    pub fn numbers(&self) -> Vec<i64> {
        let mut numbers = vec![self.laps.map_or(0, |laps| laps + 1)];
        numbers.extend(&self.counts);
        self.free_ns.iter().for_each(|times| numbers.extend(times));
        for of in &self.finishes {
            let vertex = i64::try_from(of.vertex).unwrap_or(i64::MAX);
            numbers.extend([vertex, of.job, of.low_ns, of.high_ns]);
        }
        numbers
    }
}

/// An instance that may be dispatched next.
struct Candidate {
    vertex: usize,
    key: (i128, usize, i64, usize),
    /// The nominal release.
    release_ns: i64,
    earliest_ns: i64,
    latest_ns: i64,
    /// The latest finish of everything the instance waits for besides its release.
    finished_ns: i64,
}

impl AbstractionDag {
    /// Reports whether executions are in order, edges stay in range and form no circle, and each
    /// sink has a deadline.
    fn is_whole(&self) -> bool {
        let count = self.subtasks.len();
        let (mut after, mut missing) = (vec![Vec::new(); count], vec![0_usize; count]);
        for &(from, to) in &self.edges {
            if from >= count || to >= count {
                return false;
            }
            after[from].push(to);
            missing[to] += 1;
        }
        let mut subtasks = self.subtasks.iter().zip(&after);
        let is_timed = subtasks.all(|(of, after)| {
            let is_due = of.deadline_ns.is_some() || !after.is_empty();
            of.wcet_ns > 0 && of.best_ns <= of.wcet_ns && is_due
        });
        // In a circle no subtask ever becomes ready.
        let mut ready: Vec<usize> = (0..count).filter(|&of| missing[of] == 0).collect();
        let mut place = 0;
        while let Some(&from) = ready.get(place) {
            for &to in &after[from] {
                missing[to] -= 1;
                if missing[to] == 0 {
                    ready.push(to);
                }
            }
            place += 1;
        }
        is_timed && ready.len() == count
    }
}

impl AbstractionSet {
    /// Prepares a set. `adds_release`: the policy adds the nominal release to the numbers.
    /// `is_real`: executions are real numbers, and a step sees a release together with all releases
    /// due no later.
    ///
    /// # Errors
    ///
    /// [`NotClosed::Limit`]: the hyperperiod is too long, or has too many instances;
    /// [`NotClosed::NotCovered`].
    pub fn new(
        cores: u32,
        dags: &[AbstractionDag],
        adds_release: bool,
        is_real: bool,
    ) -> Result<Self, NotClosed> {
        let mut hyperperiod_ns = 1_u64;
        let mut subtasks = dags.iter().map(|dag| dag.subtasks.len() as u64);
        if subtasks.try_fold(0_u64, |sum, of| sum.checked_add(of)) > Some(INSTANCE_LIMIT) {
            return Err(NotClosed::Limit);
        }
        for dag in dags {
            if cores == 0 || dag.jitter_ns >= dag.period_ns || !dag.is_whole() {
                return Err(NotClosed::NotCovered);
            }
            let (so_far, period_ns) = (hyperperiod_ns.into(), dag.period_ns.into());
            let product = so_far / greatest_common_divisor(so_far, period_ns) * period_ns;
            hyperperiod_ns = u64::try_from(product).map_err(|_| NotClosed::Limit)?;
        }
        let mut set = Self {
            cores: cores as usize,
            adds_release,
            is_real,
            hyperperiod_ns: whole(hyperperiod_ns)?,
            dags: Vec::new(),
            limits: Vec::new(),
            vertices: Vec::new(),
        };
        let mut instances = 0_u64;
        for (number, dag) in dags.iter().enumerate() {
            let jobs = hyperperiod_ns / dag.period_ns;
            instances = instances.saturating_add(jobs.saturating_mul(dag.subtasks.len() as u64));
            let times = [dag.period_ns, dag.offset_ns, dag.jitter_ns].map(whole);
            let [period, offset, jitter] = times;
            set.dags.push([period?, offset?, jitter?, whole(jobs)?]);
            if let Some(limit) = dag.jobs {
                whole(limit.saturating_mul(dag.period_ns))?;
                set.limits.push(whole(limit)?);
            }
            let first = set.vertices.len();
            for (subtask, terms) in dag.subtasks.iter().enumerate() {
                let times_ns = terms.wcet_ns.max(terms.best_ns);
                whole(times_ns.max(terms.deadline_ns.unwrap_or(0)))?;
                let ends = |of: fn(&(usize, usize)) -> [usize; 2]| {
                    let ends = dag.edges.iter().map(of).filter(|ends| ends[0] == subtask);
                    ends.map(|ends| first + ends[1]).collect()
                };
                set.vertices.push(AbstractVertex {
                    dag: number,
                    subtask,
                    terms: *terms,
                    predecessors: ends(|&(from, to)| [to, from]),
                    successors: ends(|&(from, to)| [from, to]),
                });
            }
        }
        match instances {
            // Some DAGs end while others go on.
            _ if !set.limits.is_empty() && set.limits.len() < dags.len() => {
                Err(NotClosed::NotCovered)
            }
            ..=INSTANCE_LIMIT => Ok(set),
            _ => Err(NotClosed::Limit),
        }
    }

    /// Returns a hash of everything in the set.
    pub(super) fn hash(&self) -> u64 {
        let mut hash = EMPTY;
        let mut add = |number: u64| hash = fnv_1a(hash, &number.to_le_bytes());
        add(self.cores as u64);
        add(u64::from(self.adds_release) + 2 * u64::from(self.is_real));
        for (dag, times) in self.dags.iter().enumerate() {
            times.iter().for_each(|time| add(time.cast_unsigned()));
            add(self
                .limits
                .get(dag)
                .map_or(0, |limit| limit.cast_unsigned() + 1));
        }
        for of in &self.vertices {
            let AbstractionSubtask {
                best_ns,
                wcet_ns,
                number,
                deadline_ns,
            } = of.terms;
            let deadline_ns = deadline_ns.map_or(0, |ns| ns + 1);
            let terms = [of.dag as u64, best_ns, wcet_ns, number, deadline_ns];
            terms.into_iter().for_each(&mut add);
            add(of.predecessors.len() as u64);
            of.predecessors.iter().for_each(|&of| add(of as u64));
        }
        hash
    }

    /// Returns zeros by DAG and subtask.
    pub(super) fn no_bounds(&self) -> Vec<Vec<u64>> {
        let mut bounds = vec![vec![]; self.dags.len()];
        for vertex in &self.vertices {
            bounds[vertex.dag].push(0);
        }
        bounds
    }

    /// Returns the state before the first dispatch.
    pub(super) fn initial(&self) -> AbstractState {
        self.normal(AbstractState {
            laps: None,
            counts: vec![0; self.vertices.len()],
            free_ns: [vec![0; self.cores], vec![0; self.cores]],
            finishes: vec![],
        })
    }

    /// Returns the state with such [numbers](AbstractState::numbers), if the set can have it.
    pub fn state(&self, numbers: &[i64]) -> Option<AbstractState> {
        let (laps, rest) = numbers.split_first()?;
        let (counts, rest) = rest.split_at_checked(self.vertices.len())?;
        let (low_ns, rest) = rest.split_at_checked(self.cores)?;
        let (high_ns, rest) = rest.split_at_checked(self.cores)?;
        let (finishes, []) = rest.as_chunks() else {
            return None;
        };
        let finish = |&[vertex, job, low_ns, high_ns]: &[i64; 4]| {
            Some(FinishInterval {
                vertex: usize::try_from(vertex).ok()?,
                job,
                low_ns,
                high_ns,
            })
        };
        let state = AbstractState {
            laps: (*laps != 0).then(|| laps.saturating_sub(1)),
            counts: counts.to_vec(),
            free_ns: [low_ns.to_vec(), high_ns.to_vec()],
            finishes: finishes.iter().map(finish).collect::<Option<_>>()?,
        };
        self.has_shape(&state).then_some(state)
    }

    /// Reports whether a state, whoever made it, has the form required by
    /// [`transitions`](Self::transitions) and [`includes`](Self::includes).
    fn has_shape(&self, state: &AbstractState) -> bool {
        let is_time = |ns: &i64| (-LATEST_NS..=LATEST_NS).contains(ns);
        let is_count = |(count, vertex): (&i64, &AbstractVertex)| {
            let last_ns = count.checked_mul(self.dags[vertex.dag][0]);
            *count >= 0 && last_ns.is_some_and(|ns| is_time(&ns))
        };
        let is_finish = |of: &FinishInterval| {
            let count = state.counts.get(of.vertex);
            count.is_some_and(|&count| (-1..count).contains(&of.job))
                && is_time(&of.low_ns)
                && is_time(&of.high_ns)
        };
        let over_ns = state.laps.unwrap_or(0).checked_mul(self.hyperperiod_ns);
        let mut counts = state.counts.iter().zip(&self.vertices);
        over_ns.is_some_and(|ns| (0..=LATEST_NS).contains(&ns))
            && (state.laps.is_none() || !self.limits.is_empty())
            && state.counts.len() == self.vertices.len()
            && counts.all(is_count)
            && (state.free_ns.iter()).all(|times| {
                times.len() == self.cores && times.is_sorted() && times.iter().all(is_time)
            })
            && state.finishes.iter().all(is_finish)
            // A second entry of one instance would hide behind the first.
            && (state.finishes.windows(2))
                .all(|of| (of[0].vertex, of[0].job) < (of[1].vertex, of[1].job))
    }

    /// Returns the number of jobs of a DAG left after `laps` laps.
    fn limit(&self, dag: usize, laps: i64) -> i64 {
        self.limits[dag] - laps * self.dags[dag][3]
    }

    /// Returns a state for each end that cuts off a candidate of the given state.
    fn ends(&self, state: &AbstractState) -> Vec<AbstractState> {
        let mut ends = Vec::new();
        if state.laps.is_some() || self.limits.is_empty() {
            return ends;
        }
        for candidate in self.candidates(state) {
            let dag = self.vertices[candidate.vertex].dag;
            let left = self.limits[dag] - state.counts[candidate.vertex];
            let laps = left / self.dags[dag][3];
            let mut counts = self.vertices.iter().zip(&state.counts);
            let is_end = left >= 0
                && left == laps * self.dags[dag][3]
                && counts.all(|(of, count)| *count <= self.limit(of.dag, laps));
            if is_end
                && !ends
                    .iter()
                    .any(|end: &AbstractState| end.laps == Some(laps))
            {
                let mut end = state.clone();
                end.laps = Some(laps);
                ends.push(end);
            }
        }
        ends
    }

    /// Calls `each` with the normal successors of a state and of its ends, as
    /// [`transitions`](Self::transitions) does.
    pub(super) fn successors(
        &self,
        state: &AbstractState,
        bounds: &mut [Vec<u64>],
        each: &mut dyn FnMut(AbstractState) -> Result<(), NotClosed>,
    ) -> Result<(), NotClosed> {
        self.transitions(state, bounds, each)?;
        let mut ends = self.ends(state).into_iter();
        ends.try_for_each(|end| self.transitions(&end, bounds, each))
    }

    /// Returns the next job of each vertex, if all its predecessors have been dispatched.
    fn candidates(&self, state: &AbstractState) -> Vec<Candidate> {
        let mut candidates = Vec::new();
        for (position, vertex) in self.vertices.iter().enumerate() {
            let job = state.counts[position];
            let mut before = vertex.predecessors.iter();
            let is_cut = state
                .laps
                .is_some_and(|laps| job >= self.limit(vertex.dag, laps));
            if is_cut || before.any(|&of| state.counts[of] <= job) {
                continue;
            }
            let [period_ns, offset_ns, jitter_ns, _] = self.dags[vertex.dag];
            let release_ns = offset_ns + job * period_ns;
            let [mut earliest_ns, mut finished_ns] = [release_ns, -LATEST_NS];
            for finish in &state.finishes {
                if self.precedes(finish, position, job) {
                    earliest_ns = earliest_ns.max(finish.low_ns);
                    finished_ns = finished_ns.max(finish.high_ns);
                }
            }
            let added_ns = if self.adds_release { release_ns } else { 0 };
            let number = i128::from(vertex.terms.number) + i128::from(added_ns);
            candidates.push(Candidate {
                vertex: position,
                key: (number, vertex.dag, job, vertex.subtask),
                release_ns,
                earliest_ns,
                latest_ns: finished_ns.max(release_ns + jitter_ns),
                finished_ns,
            });
        }
        candidates
    }

    /// Reports whether an instance becomes ready only after a finish.
    fn precedes(&self, finish: &FinishInterval, vertex: usize, job: i64) -> bool {
        match finish.vertex == vertex {
            true => finish.job == job - 1,
            false => {
                finish.job == job && self.vertices[vertex].predecessors.contains(&finish.vertex)
            }
        }
    }

    /// Calls `each` with the normal successor of a state for each eligible instance, and raises
    /// bounds to the latest finishes of sinks.
    ///
    /// # Errors
    ///
    /// A sink may be late, or `each` fails.
    fn transitions(
        &self,
        state: &AbstractState,
        bounds: &mut [Vec<u64>],
        each: &mut dyn FnMut(AbstractState) -> Result<(), NotClosed>,
    ) -> Result<(), NotClosed> {
        let candidates = self.candidates(state);
        let first_ready = candidates.iter().map(|of| of.latest_ns).min();
        let busy_until_ns = state.free_ns[1][0].max(first_ready.unwrap_or(i64::MIN));
        for chosen in &candidates {
            let start_ns = chosen.earliest_ns.max(state.free_ns[0][0]);
            let more_urgent = candidates.iter().filter(|of| of.key < chosen.key);
            // A more urgent instance ready at the same instant goes first. The instants just before
            // are whole only if executions are. Once a release is seen, so are all releases due no
            // later.
            let latest = more_urgent.map(|of| match of.release_ns <= chosen.release_ns {
                true if self.is_real => of.finished_ns,
                _ => of.latest_ns,
            });
            let first = latest.min().unwrap_or(i64::MAX);
            let latest_ns = busy_until_ns.min(first - i64::from(!self.is_real));
            if start_ns > latest_ns || start_ns >= first {
                continue;
            }
            let AbstractVertex {
                dag,
                subtask,
                terms,
                ..
            } = &self.vertices[chosen.vertex];
            let job = state.counts[chosen.vertex];
            let low_ns = start_ns + terms.best_ns.cast_signed();
            let high_ns = latest_ns + terms.wcet_ns.cast_signed();
            if let Some(deadline_ns) = terms.deadline_ns {
                let [period_ns, offset_ns, ..] = self.dags[*dag];
                let response_ns = (high_ns - offset_ns - job * period_ns)
                    .max(0)
                    .cast_unsigned();
                if response_ns > deadline_ns {
                    let (dag, subtask) = (*dag, *subtask);
                    return Err(NotClosed::Late { dag, subtask });
                }
                let bound_ns = &mut bounds[*dag][*subtask];
                *bound_ns = response_ns.max(*bound_ns);
            }
            let finish = FinishInterval {
                vertex: chosen.vertex,
                job,
                low_ns,
                high_ns,
            };
            each(self.successor(state, finish, [start_ns, latest_ns]))?;
        }
        Ok(())
    }

    /// Returns the normal state after the dispatch of an instance that starts between two times.
    fn successor(
        &self,
        state: &AbstractState,
        finish: FinishInterval,
        [start_ns, latest_ns]: [i64; 2],
    ) -> AbstractState {
        let mut next = state.clone();
        next.counts[finish.vertex] += 1;
        let finishes_ns = [finish.low_ns, finish.high_ns];
        for (times, finish_ns) in next.free_ns.iter_mut().zip(finishes_ns) {
            times.remove(0);
            times
                .iter_mut()
                .for_each(|time| *time = start_ns.max(*time));
            let place = times.partition_point(|time| *time <= finish_ns);
            times.insert(place, finish_ns);
        }
        for earlier in &mut next.finishes {
            if self.precedes(earlier, finish.vertex, finish.job) {
                earlier.high_ns = earlier.high_ns.min(latest_ns);
            }
        }
        next.finishes.push(finish);
        self.normal(next)
    }

    /// Drops everything that no later start can see, and counts from the present hyperperiod.
    pub(super) fn normal(&self, mut state: AbstractState) -> AbstractState {
        let counts = &state.counts;
        state.finishes.retain(|of| {
            let later = &self.vertices[of.vertex].successors;
            of.job == counts[of.vertex] - 1 || later.iter().any(|&next| counts[next] <= of.job)
        });
        let now_ns = self.now_ns(&state);
        state.finishes.retain(|of| of.high_ns > now_ns);
        let jobs = |number: usize| self.dags[self.vertices[number].dag][3];
        let laps = state.counts.iter().enumerate();
        let laps = laps.map(|(number, count)| count.div_euclid(jobs(number)));
        let laps = laps.min().unwrap_or(0);
        let back_ns = laps * self.hyperperiod_ns;
        state.laps = state.laps.map(|over| over + laps);
        for (number, count) in state.counts.iter_mut().enumerate() {
            *count -= laps * jobs(number);
        }
        for times in &mut state.free_ns {
            times
                .iter_mut()
                .for_each(|time| *time = now_ns.max(*time) - back_ns);
        }
        for finish in &mut state.finishes {
            finish.job -= laps * jobs(finish.vertex);
            finish.low_ns = now_ns.max(finish.low_ns) - back_ns;
            finish.high_ns -= back_ns;
        }
        state.finishes = sorted(&state.finishes);
        state
    }

    /// Returns a time before which nothing starts.
    pub(super) fn now_ns(&self, state: &AbstractState) -> i64 {
        let earliest = self.candidates(state).into_iter().map(|of| of.earliest_ns);
        state.free_ns[0][0].max(earliest.min().unwrap_or(i64::MIN))
    }

    /// Reports whether each run of a normal state is also in another normal state.
    pub(super) fn includes(&self, outer: &AbstractState, inner: &AbstractState) -> bool {
        let [outer_ns, inner_ns] = [&outer.free_ns, &inner.free_ns];
        let is_earlier = |(outer, inner): (&i64, &i64)| outer <= inner;
        let of = |state: &AbstractState, finish: &FinishInterval| {
            let same = |one: &&FinishInterval| (one.vertex, one.job) == (finish.vertex, finish.job);
            state.finishes.iter().find(same).copied()
        };
        (outer.laps, &outer.counts) == (inner.laps, &inner.counts)
            && outer_ns[0].iter().zip(&inner_ns[0]).all(is_earlier)
            && inner_ns[1].iter().zip(&outer_ns[1]).all(is_earlier)
            && inner.finishes.iter().all(|finish| {
                of(outer, finish).is_some_and(|known| {
                    known.low_ns <= finish.low_ns && finish.high_ns <= known.high_ns
                })
            })
            && {
                let unknown = outer
                    .finishes
                    .iter()
                    .filter(|of_outer| of(inner, of_outer).is_none());
                let latest_ns = unknown.map(|finish| finish.low_ns).max();
                latest_ns.is_none_or(|latest_ns| latest_ns <= self.now_ns(inner))
            }
    }
}

/// Checks in one pass that a list of normal states is closed. Returns by DAG and subtask the
/// longest responses of sinks, in nanoseconds; 0 for a subtask that is no sink.
///
/// # Errors
///
/// A sink may be late, the list is open or does not include the initial state, a state is
/// malformed, or a limit is exceeded.
pub fn check_closed(
    set: &AbstractionSet,
    states: &[AbstractState],
) -> Result<Vec<Vec<u64>>, NotClosed> {
    if let Some(state) = states.iter().position(|state| !set.has_shape(state)) {
        return Err(NotClosed::Malformed { state });
    }
    let mut by_counts: Vec<usize> = (0..states.len()).collect();
    sort(&mut by_counts, &mut |one, other| {
        states[one].counts.cmp(&states[other].counts)
    });
    let mut steps_left = STEP_LIMIT;
    let mut has = |state: &AbstractState| {
        let first = by_counts.partition_point(|&of| states[of].counts < state.counts);
        for of in by_counts[first..].iter().map(|&of| &states[of]) {
            if of.counts != state.counts {
                break;
            }
            let steps = (of.finishes.len() * state.finishes.len() + set.vertices.len()) as u64;
            steps_left = steps_left.checked_sub(steps).ok_or(NotClosed::Limit)?;
            if set.includes(of, state) {
                return Ok(true);
            }
        }
        Ok(false)
    };
    if !has(&set.initial())? {
        return Err(NotClosed::NoFirst);
    }
    let mut bounds = set.no_bounds();
    for (number, state) in states.iter().enumerate() {
        set.successors(state, &mut bounds, &mut |next| match has(&next)? {
            true => Ok(()),
            false => Err(NotClosed::Open { state: number }),
        })?;
    }
    Ok(bounds)
}

fn whole(ns: u64) -> Result<i64, NotClosed> {
    match ns {
        ..=MOST_NS => Ok(ns.cast_signed()),
        _ => Err(NotClosed::Limit),
    }
}
