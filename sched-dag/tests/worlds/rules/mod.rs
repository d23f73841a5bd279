//! The rules as the changes of a state that has nothing but facts.
//!
//! Which jobs there are and how far, what has started, finished, failed or was cancelled;
//! everything else is asked of these, each time anew.

mod faults;
mod releases;

use std::collections::BTreeSet;

use sched_dag::journal::What;
use sched_dag::{DagStatistics, JobOutcome, Policy, Preemption};

use crate::world::{Dag, JOBS, MOST_SUBTASKS, World};

/// What is reported of a DAG's jobs, in order: the job, if it is about one, and its outcome.
pub(crate) type Said = (What, usize, Option<JobOutcome>);

/// The kinds of reports that are compared.
pub(crate) const SAID: [What; 11] = [
    What::Released,
    What::Queued,
    What::Skipped,
    What::Aborted,
    What::Missed,
    What::Completed,
    What::Stopped,
    What::Off,
    What::On,
    What::Closed,
    What::Restarted,
];

/// An instance as DAG, job and subtask.
pub(crate) type Place = (usize, usize, usize);

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum State {
    Ahead,
    /// It is due and not dealt with yet.
    Due,
    Waiting,
    InFlight,
    Over,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Part {
    Absent,
    Ready,
    Started,
    Finished,
    Failed,
    Cancelled,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Job {
    state: State,
    due_ns: Option<u64>,
    is_aborted: bool,
    is_cut: bool,
    has_failed: bool,
    is_judged: bool,
    is_missed: bool,
    /// Those that the DAG does not have are absent.
    parts: [Part; MOST_SUBTASKS],
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct OfDag {
    pub(crate) jobs: [Job; JOBS],
    pub(crate) is_ended: bool,
    pub(crate) is_closed: bool,
    pub(crate) is_paused: bool,
    resumed_ns: u64,
    /// The jobs of the faults that were survived.
    survived: Vec<usize>,
    pub(crate) statistics: DagStatistics,
}

#[derive(Clone, Debug)]
pub(crate) struct Facts<'w> {
    world: &'w World,
    pub(crate) now_ns: u64,
    pub(crate) dags: Vec<OfDag>,
    pub(crate) running: BTreeSet<Place>,
    /// Of each DAG, at this instant.
    pub(crate) said: Vec<Vec<Said>>,
}

impl<'w> Facts<'w> {
    pub(crate) fn new(world: &'w World) -> Self {
        let job = |dag: &Dag, number: usize| Job {
            state: State::Ahead,
            due_ns: (!dag.is_sporadic).then(|| dag.period_ns * number as u64),
            is_aborted: false,
            is_cut: false,
            has_failed: false,
            is_judged: false,
            is_missed: false,
            parts: [Part::Absent; MOST_SUBTASKS],
        };
        let of_dag = |dag: &Dag| OfDag {
            jobs: std::array::from_fn(|number| job(dag, number)),
            is_ended: false,
            is_closed: false,
            is_paused: false,
            resumed_ns: 0,
            survived: Vec::new(),
            statistics: DagStatistics::default(),
        };
        Self {
            world,
            now_ns: 0,
            dags: world.dags.iter().map(of_dag).collect(),
            running: BTreeSet::new(),
            said: vec![Vec::new(); world.dags.len()],
        }
    }

    /// Returns the instances that have started and not ended.
    pub(crate) fn started(&self) -> Vec<Place> {
        let mut started = self.places();
        started.retain(|&place| self.part(place) == Part::Started);
        started
    }

    /// Returns how many due jobs of a DAG wait.
    pub(crate) fn waiting(&self, dag: usize) -> usize {
        let jobs = self.dags[dag].jobs.iter();
        jobs.filter(|job| job.state == State::Waiting).count()
    }

    /// Returns when the driver has to come next, if nothing completes before.
    pub(crate) fn next_event_ns(&self) -> Option<u64> {
        let of_dag = |dag: usize| {
            let deadline_ns = self.world.dags[dag].deadline_ns;
            let ahead = self.next_due(dag).and_then(|(_, due_ns)| due_ns);
            let jobs = self.dags[dag].jobs.iter();
            let late_ns = jobs.filter(|job| job.is_unjudged()).filter_map(|job| {
                let due_ns = job.due_ns?;
                Some(due_ns + deadline_ns + 1)
            });
            late_ns.chain(ahead).min()
        };
        (0..self.dags.len()).filter_map(of_dag).min()
    }

    pub(crate) fn complete(&mut self, place: Place) {
        let (dag, _, subtask) = place;
        *self.part_mut(place) = Part::Finished;
        self.running.remove(&place);
        if self.world.dags[dag].is_sink(subtask) {
            self.judge(dag, Some(place));
        }
        self.settle(dag);
    }

    /// Ends an instant: releases, then one dispatch.
    pub(crate) fn end_instant(&mut self) {
        for dag in 0..self.dags.len() {
            self.serve(dag);
        }
        self.dispatch();
    }

    /// R4: notices what is late, job by job. What ends at this very instant, after a deadline
    /// that nobody has noticed, is late as well.
    fn judge(&mut self, dag: usize, ending: Option<Place>) {
        let model = &self.world.dags[dag];
        let now_ns = self.now_ns;
        let OfDag {
            jobs, statistics, ..
        } = &mut self.dags[dag];
        for (number, job) in jobs.iter_mut().enumerate() {
            let due_ns = job.due_ns.unwrap_or(u64::MAX - model.deadline_ns);
            if !job.is_unjudged() || due_ns + model.deadline_ns >= now_ns {
                continue;
            }
            job.is_judged = true;
            let is_late = |subtask: usize| {
                let has_just_ended = ending == Some((dag, number, subtask));
                model.is_sink(subtask) && (job.parts[subtask] != Part::Finished || has_just_ended)
            };
            if (0..model.subtasks()).any(is_late) {
                job.is_missed = true;
                self.said[dag].push((What::Missed, number, None));
                statistics.misses += 1;
                statistics.consecutive_misses += 1;
                statistics.most_consecutive_misses = statistics
                    .most_consecutive_misses
                    .max(statistics.consecutive_misses);
            }
        }
    }

    /// R2, cancellations and R4, until nothing changes.
    fn settle(&mut self, dag: usize) {
        let mut changes = true;
        while changes {
            changes = false;
            for job in 0..JOBS {
                for subtask in 0..self.world.dags[dag].subtasks() {
                    let place = (dag, job, subtask);
                    let is_cut = self.dags[dag].jobs[job].starts_nothing();
                    let next = match self.part(place) {
                        Part::Absent if !self.is_free((dag, job, subtask)) => continue,
                        Part::Absent | Part::Ready if is_cut => Part::Cancelled,
                        Part::Absent => Part::Ready,
                        _ => continue,
                    };
                    *self.part_mut(place) = next;
                    changes = true;
                }
            }
        }
        for job in 0..JOBS {
            let parts = &self.dags[dag].jobs[job].parts[..self.world.dags[dag].subtasks()];
            let is_complete = parts.iter().all(|part| part.has_ended());
            if is_complete && self.dags[dag].jobs[job].state == State::InFlight {
                self.end_job(dag, job);
            }
        }
    }

    fn end_job(&mut self, dag: usize, number: usize) {
        self.judge(dag, None);
        let OfDag {
            jobs, statistics, ..
        } = &mut self.dags[dag];
        let job = &mut jobs[number];
        job.state = State::Over;
        let outcome = if job.is_aborted {
            JobOutcome::Aborted
        } else if job.is_cut {
            JobOutcome::DagEnded
        } else if job.has_failed {
            JobOutcome::Failed
        } else if job.is_missed {
            JobOutcome::Missed
        } else {
            JobOutcome::Met
        };
        statistics.completed += u64::from(!job.starts_nothing());
        if outcome == JobOutcome::Met {
            statistics.consecutive_misses = 0;
        }
        self.said[dag].push((What::Completed, number, Some(outcome)));
    }

    /// R2: nothing but cores holds it back.
    fn is_free(&self, (dag, job, subtask): Place) -> bool {
        let jobs = &self.dags[dag].jobs;
        let ended = |job: usize, subtask: usize| jobs[job].parts[subtask].has_ended();
        let mut edges = self.world.dags[dag].edges.iter();
        let was_released = |job: &usize| jobs[*job].parts.iter().any(|part| *part != Part::Absent);
        jobs[job].state == State::InFlight
            && edges.all(|&(from, to)| to != subtask || ended(job, from))
            && (0..job)
                .rev()
                .find(was_released)
                .is_none_or(|before| ended(before, subtask))
    }

    /// R5.
    fn dispatch(&mut self) {
        let options = self.world.options;
        let keeps_core = |&(dag, _, subtask): &Place| {
            options.preemption == Preemption::Disabled
                || self.world.dags[dag].is_first_non_preemptive && subtask == 0
        };
        let mut selected: BTreeSet<Place> =
            self.running.iter().copied().filter(keeps_core).collect();
        let mut others = self.places();
        others.retain(|&place| {
            matches!(self.part(place), Part::Ready | Part::Started) && !selected.contains(&place)
        });
        others.sort_by_key(|&(dag, job, subtask)| {
            let model = &self.world.dags[dag];
            let urgency = match options.policy {
                Policy::StaticPriority => Some(u64::from(model.priorities[subtask])),
                Policy::Edf => {
                    let due_ns = self.dags[dag].jobs[job].due_ns;
                    due_ns.map(|due_ns| due_ns + model.deadline_ns)
                }
            };
            (urgency, dag, job, subtask)
        });
        let idle = (options.cores as usize).saturating_sub(selected.len());
        selected.extend(others.into_iter().take(idle));
        for &place in &selected {
            *self.part_mut(place) = Part::Started;
        }
        self.running = selected;
    }

    fn places(&self) -> Vec<Place> {
        let dags = self.world.dags.iter().enumerate();
        let places = dags.flat_map(|(dag, model)| {
            (0..JOBS)
                .flat_map(move |job| (0..model.subtasks()).map(move |subtask| (dag, job, subtask)))
        });
        places.collect()
    }

    fn first(&self, dag: usize, state: State) -> Option<usize> {
        let mut jobs = self.dags[dag].jobs.iter();
        jobs.position(|job| job.state == state)
    }

    fn part(&self, (dag, job, subtask): Place) -> Part {
        self.dags[dag].jobs[job].parts[subtask]
    }

    fn part_mut(&mut self, (dag, job, subtask): Place) -> &mut Part {
        &mut self.dags[dag].jobs[job].parts[subtask]
    }
}

impl Job {
    fn starts_nothing(&self) -> bool {
        self.is_aborted || self.is_cut || self.has_failed
    }

    fn is_unjudged(&self) -> bool {
        let is_known = matches!(self.state, State::Waiting | State::InFlight);
        is_known && !self.starts_nothing() && !self.is_judged
    }
}

impl Part {
    const fn has_ended(self) -> bool {
        matches!(self, Self::Finished | Self::Failed | Self::Cancelled)
    }
}
