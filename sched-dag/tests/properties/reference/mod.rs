//! The reference: the definition, executed unit by unit.
//!
//! Nothing here is clever. At each unit of time every question is asked anew
//! of the facts so far (what was released, has finished, was cancelled), with
//! the words of the rules: no counters, no queue, no events, nothing shared with
//! the crate but the names of the policies and counters.

mod faults;
mod releases;

use sched_dag::{DagStatistics, Policy, Preemption};

use crate::set::{Dag, Set};
use crate::{InstanceOutcome, JobOutcome, Outcome};

/// Whether a job that is due was released, skipped, or waits, and has ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Ahead,
    Waiting,
    InFlight,
    Over,
}

struct Reference<'a> {
    set: &'a Set,
    now_ns: u64,
    states: Vec<Vec<State>>,
    /// The nominal release time of each job; none of a sporadic one whose signal
    /// has not come.
    due_ns: Vec<Vec<Option<u64>>>,
    executed_ns: Vec<Vec<Vec<u64>>>,
    is_ended: Vec<bool>,
    /// The failures of the present instant of which it is known what they cost.
    judged: Vec<Place>,
    /// For each DAG the jobs of the faults after which it went on.
    survived: Vec<Vec<usize>>,
    outcome: Outcome,
}

/// An instance as DAG, job and subtask.
type Place = (usize, usize, usize);

pub(crate) fn simulate(set: &Set) -> Outcome {
    let per_job = |dag: &Dag| usize::try_from(dag.jobs).expect("few jobs");
    let mut reference = Reference {
        set,
        now_ns: 0,
        states: set
            .dags
            .iter()
            .map(|dag| vec![State::Ahead; per_job(dag)])
            .collect(),
        due_ns: set.dags.iter().map(due_times).collect(),
        executed_ns: set
            .dags
            .iter()
            .map(|dag| vec![vec![0; dag.subtasks.len()]; per_job(dag)])
            .collect(),
        is_ended: vec![false; set.dags.len()],
        judged: Vec::new(),
        survived: set.dags.iter().map(|_| Vec::new()).collect(),
        outcome: Outcome {
            instances: set
                .dags
                .iter()
                .map(|dag| vec![vec![InstanceOutcome::default(); dag.subtasks.len()]; per_job(dag)])
                .collect(),
            jobs: set
                .dags
                .iter()
                .map(|dag| vec![JobOutcome::default(); per_job(dag)])
                .collect(),
            statistics: vec![DagStatistics::default(); set.dags.len()],
            sink_misses: set.dags.iter().map(no_misses).collect(),
        },
    };
    let mut running: Vec<Place> = Vec::new();
    while !reference.is_over() {
        reference.note_ready();
        reference.notice_misses();
        reference.judge_failures();
        reference.end_dags();
        reference.cancel_and_end();
        reference.pause();
        reference.take_signals();
        reference.release();
        let selected = reference.select(&running);
        for &(dag, job, subtask) in &running {
            let has_ended = reference.has_ended((dag, job, subtask));
            if !has_ended && !selected.contains(&(dag, job, subtask)) {
                reference.outcome.instances[dag][job][subtask].preemptions += 1;
            }
        }
        for &place in &selected {
            reference.execute(place);
        }
        running = selected;
        reference.now_ns += 1;
    }
    reference.count();
    reference.outcome
}

/// The grid, or nothing of a sporadic DAG.
fn due_times(dag: &Dag) -> Vec<Option<u64>> {
    let due_ns = |job| match dag.signals_ns {
        Some(_) => None,
        None => Some(dag.offset_ns + dag.period_ns * job),
    };
    (0..dag.jobs).map(due_ns).collect()
}

fn no_misses(dag: &Dag) -> Vec<Option<u64>> {
    let of = |subtask| dag.is_sink(subtask).then_some(0);
    (0..dag.subtasks.len()).map(of).collect()
}

impl Reference<'_> {
    fn is_over(&self) -> bool {
        self.set.dags.iter().enumerate().all(|(dag, model)| {
            let jobs = self.states[dag].iter().zip(&self.due_ns[dag]);
            let mut jobs = jobs.map(|(&state, due_ns)| {
                state == State::Over || state == State::Ahead && due_ns.is_none()
            });
            let signals_ns = model.signals_ns.iter().flatten();
            let is_last = |&at_ns: &u64| at_ns < self.now_ns;
            jobs.all(|is_over| is_over) && signals_ns.into_iter().all(is_last)
        })
    }

    /// The deadline of the most urgent sink that a subtask reaches.
    fn deadline_ns(&self, (dag, job, subtask): Place) -> u64 {
        let model = &self.set.dags[dag];
        if model.is_sink(subtask) {
            let relative_ns = model.subtasks[subtask].deadline_ns;
            let due_ns = self.due_ns[dag][job].expect("it is in flight or waits");
            return due_ns + relative_ns.unwrap_or(model.deadline_ns);
        }
        let successors = model.edges.iter().filter(|edge| edge.0 == subtask);
        let deadlines_ns = successors.map(|edge| self.deadline_ns((dag, job, edge.1)));
        deadlines_ns.min().expect("it is no sink")
    }

    /// A sink that has not finished at its deadline is late, and its job has missed a deadline.
    fn notice_misses(&mut self) {
        for dag in 0..self.states.len() {
            for job in 0..self.states[dag].len() {
                let alive = matches!(self.states[dag][job], State::Waiting | State::InFlight)
                    && !self.is_cut(dag, job);
                if alive {
                    self.notice_misses_of(dag, job);
                }
            }
        }
    }

    fn notice_misses_of(&mut self, dag: usize, job: usize) {
        let model = &self.set.dags[dag];
        for sink in (0..model.subtasks.len()).filter(|&subtask| model.is_sink(subtask)) {
            let deadline_ns = self.deadline_ns((dag, job, sink));
            let finish_ns = self.outcome.instances[dag][job][sink].finish_ns;
            let is_late = finish_ns.is_none_or(|finish_ns| finish_ns > deadline_ns);
            if self.now_ns != deadline_ns + 1 || !is_late {
                continue;
            }
            let misses = self.outcome.sink_misses[dag][sink].as_mut();
            *misses.expect("it is a sink") += 1;
            let missed_ns = &mut self.outcome.jobs[dag][job].missed_ns;
            if missed_ns.is_none() {
                *missed_ns = Some(self.now_ns);
                let statistics = &mut self.outcome.statistics[dag];
                statistics.consecutive_misses += 1;
                statistics.most_consecutive_misses = statistics
                    .most_consecutive_misses
                    .max(statistics.consecutive_misses);
            }
        }
    }

    /// Whether an instance has ended, as far as that is told yet.
    fn has_ended(&self, place: Place) -> bool {
        let (dag, job, subtask) = place;
        let instance = self.outcome.instances[dag][job][subtask];
        instance.finish_ns.is_some()
            || instance.failed_ns.is_some_and(|at_ns| at_ns < self.now_ns)
            || self.judged.contains(&place)
            || instance.cancelled_ns.is_some()
    }

    /// Whether a job starts no further instance.
    fn is_cut(&self, dag: usize, job: usize) -> bool {
        let job = &self.outcome.jobs[dag][job];
        job.aborted_ns.is_some() || job.is_cut || job.has_failed
    }

    /// Notes which instances have become ready by what has happened so far: none
    /// of a job that is cut.
    fn note_ready(&mut self) {
        for place in self.all_instances() {
            let (dag, job, subtask) = place;
            let is_known = self.outcome.instances[dag][job][subtask].ready_ns.is_some();
            if !is_known && !self.is_cut(dag, job) && self.is_ready(place) {
                self.outcome.instances[dag][job][subtask].ready_ns = Some(self.now_ns);
            }
        }
    }

    /// R1 and R2, for an instance that has not ended.
    fn is_ready(&self, (dag, job, subtask): Place) -> bool {
        let before = (0..job)
            .rev()
            .find(|&before| self.outcome.jobs[dag][before].released_ns.is_some());
        let predecessors = self.set.dags[dag]
            .edges
            .iter()
            .filter(|edge| edge.1 == subtask);
        self.states[dag][job] == State::InFlight
            && !self.has_ended((dag, job, subtask))
            && predecessors
                .into_iter()
                .all(|edge| self.has_ended((dag, job, edge.0)))
            && before.is_none_or(|before| self.has_ended((dag, before, subtask)))
    }

    /// Cancels what is ready and not started in jobs that are cut, until nothing
    /// changes, and ends jobs of which all instances have ended.
    fn cancel_and_end(&mut self) {
        loop {
            let mut changed = false;
            for place in self.all_instances() {
                let (dag, job, subtask) = place;
                let is_cut = self.is_cut(dag, job);
                let started = self.outcome.instances[dag][job][subtask].start_ns.is_some();
                if is_cut && !started && self.is_ready(place) {
                    self.outcome.instances[dag][job][subtask].cancelled_ns = Some(self.now_ns);
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        self.note_ready();
        for dag in 0..self.states.len() {
            for job in 0..self.states[dag].len() {
                let subtasks = 0..self.set.dags[dag].subtasks.len();
                if self.states[dag][job] == State::InFlight
                    && subtasks
                        .into_iter()
                        .all(|subtask| self.has_ended((dag, job, subtask)))
                {
                    self.states[dag][job] = State::Over;
                    self.outcome.jobs[dag][job].ended_ns = Some(self.now_ns);
                    if !self.is_cut(dag, job) && self.outcome.jobs[dag][job].missed_ns.is_none() {
                        self.outcome.statistics[dag].consecutive_misses = 0;
                    }
                }
            }
        }
    }

    /// R5: the instances that execute during the next unit.
    fn select(&self, running: &[Place]) -> Vec<Place> {
        let cores = self.set.options.cores as usize;
        let keeps_core = |&(dag, job, subtask): &Place| {
            !self.has_ended((dag, job, subtask))
                && (self.set.options.preemption == Preemption::Disabled
                    || self.set.dags[dag].subtasks[subtask].non_preemptive)
        };
        let mut selected: Vec<Place> = running
            .iter()
            .filter(|place| keeps_core(place))
            .copied()
            .collect();
        let mut others: Vec<Place> = self
            .all_instances()
            .into_iter()
            .filter(|&place| self.is_ready(place) && !selected.contains(&place))
            .collect();
        others.sort_by_key(|&(dag, job, subtask)| {
            let urgency = match self.set.options.policy {
                Policy::StaticPriority => u64::from(self.set.dags[dag].subtasks[subtask].priority),
                Policy::Edf => self.deadline_ns((dag, job, subtask)),
            };
            (urgency, dag, job, subtask)
        });
        others.truncate(cores.saturating_sub(selected.len()));
        selected.extend(others);
        selected
    }

    fn execute(&mut self, (dag, job, subtask): Place) {
        let instance = &mut self.outcome.instances[dag][job][subtask];
        instance.start_ns.get_or_insert(self.now_ns);
        self.executed_ns[dag][job][subtask] += 1;
        if self.executed_ns[dag][job][subtask]
            == self.set.dags[dag].subtasks[subtask].executions_ns[job]
        {
            let ended_ns = Some(self.now_ns + 1);
            if self.set.dags[dag].subtasks[subtask].fails_in == Some(job as u64) {
                instance.failed_ns = ended_ns;
            } else {
                instance.finish_ns = ended_ns;
            }
        }
    }

    /// Returns the instances of all jobs in flight.
    fn all_instances(&self) -> Vec<Place> {
        let mut places = Vec::new();
        for (dag, states) in self.states.iter().enumerate() {
            for job in (0..states.len()).filter(|&job| states[job] == State::InFlight) {
                places.extend(
                    (0..self.set.dags[dag].subtasks.len()).map(|subtask| (dag, job, subtask)),
                );
            }
        }
        places
    }

    /// Counts what is to be seen in the jobs and instances.
    fn count(&mut self) {
        let Outcome {
            instances,
            jobs,
            statistics,
            ..
        } = &mut self.outcome;
        for (dag, statistics) in statistics.iter_mut().enumerate() {
            let due_ns = self.due_ns[dag].iter();
            for (job, &due_ns) in jobs[dag].iter_mut().zip(due_ns) {
                let was_due = job.released_ns.is_some() || job.skipped_ns.is_some();
                job.nominal_ns = due_ns.filter(|_| was_due);
            }
            let count = |is: fn(&JobOutcome) -> bool| {
                let jobs = jobs[dag].iter();
                jobs.filter(|job| is(job)).count() as u64
            };
            let failed = instances[dag].iter().flatten();
            let failed = failed.filter(|instance| instance.failed_ns.is_some());
            statistics.faults = failed.count() as u64;
            statistics.released = count(|job| job.released_ns.is_some());
            statistics.skips = count(|job| job.skipped_ns.is_some());
            statistics.restarts = self.survived[dag].len() as u64;
            statistics.failed = count(|job| job.has_failed);
            statistics.aborts = count(|job| job.aborted_ns.is_some());
            statistics.misses = count(|job| job.missed_ns.is_some());
            statistics.cut_short = count(|job| job.is_cut);
            statistics.completed = count(|job| {
                job.ended_ns.is_some() && job.aborted_ns.is_none() && !job.is_cut && !job.has_failed
            });
        }
    }
}
