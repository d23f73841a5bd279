//! The rules as the changes of a state that has nothing but facts.
//!
//! Which jobs there are and how far, what has started, finished, failed or was cancelled;
//! everything else is asked of these, each time anew.

mod compare;
mod faults;
mod releases;

use std::collections::BTreeSet;

use sched_dag::journal::What;
use sched_dag::{DagStatistics, Policy, Preemption};

pub(crate) use compare::instance;
#[allow(unused_imports, reason = "not each test is told of instances")]
pub(crate) use compare::place;

use crate::set::{Dag, Set};

/// Of a DAG.
const MOST_SUBTASKS: usize = 7;

/// What is reported of a DAG's jobs, in order: the job, if it is about one.
type Said = (What, usize);

/// The kinds of reports that are compared.
pub(crate) const SAID: [What; 13] = [
    What::Ready,
    What::Cancelled,
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
    is_missed: bool,
    /// Of each sink, whether it was held against its deadline.
    is_judged: [bool; MOST_SUBTASKS],
    /// Those that the DAG does not have are absent.
    parts: [Part; MOST_SUBTASKS],
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct OfDag {
    jobs: Vec<Job>,
    is_ended: bool,
    is_closed: bool,
    pub(crate) is_paused: bool,
    resumed_ns: u64,
    /// The jobs of the faults that were survived.
    survived: Vec<usize>,
    statistics: DagStatistics,
    sink_misses: [u64; MOST_SUBTASKS],
}

#[derive(Clone)]
pub(crate) struct Facts<'w> {
    set: &'w Set,
    pub(crate) now_ns: u64,
    pub(crate) dags: Vec<OfDag>,
    pub(crate) running: BTreeSet<Place>,
    /// Of each DAG, at this instant.
    said: Vec<Vec<Said>>,
    /// What has become ready or was cancelled at this instant, and whether it is ready.
    turned: BTreeSet<(Place, bool)>,
}

impl<'w> Facts<'w> {
    pub(crate) fn new(set: &'w Set) -> Self {
        let job = |dag: &Dag, number: usize| Job {
            state: State::Ahead,
            due_ns: (dag.signals_ns.is_none())
                .then(|| dag.offset_ns + dag.period_ns * number as u64),
            is_aborted: false,
            is_cut: false,
            has_failed: false,
            is_missed: false,
            is_judged: [false; MOST_SUBTASKS],
            parts: [Part::Absent; MOST_SUBTASKS],
        };
        let of_dag = |dag: &Dag| OfDag {
            jobs: (0..dag.jobs()).map(|number| job(dag, number)).collect(),
            is_ended: false,
            is_closed: false,
            is_paused: false,
            resumed_ns: 0,
            survived: Vec::new(),
            statistics: DagStatistics::default(),
            sink_misses: [0; MOST_SUBTASKS],
        };
        Self {
            set,
            now_ns: 0,
            dags: set.dags.iter().map(of_dag).collect(),
            running: BTreeSet::new(),
            said: vec![Vec::new(); set.dags.len()],
            turned: BTreeSet::new(),
        }
    }

    /// Returns the instances that have started and not ended.
    pub(crate) fn started(&self) -> Vec<Place> {
        let mut started = self.places();
        started.retain(|&place| self.part(place) == Part::Started);
        started
    }

    /// Returns when the driver has to come next, if nothing completes before.
    pub(crate) fn next_event_ns(&self) -> Option<u64> {
        let of_dag = |dag: usize| {
            let due_ns = self.next_due(dag).and_then(|(_, due_ns)| due_ns);
            let late_ns = self.unjudged(dag).map(|(deadline_ns, ..)| deadline_ns + 1);
            due_ns.into_iter().chain(late_ns).min()
        };
        (0..self.dags.len()).filter_map(of_dag).min()
    }

    /// Begins an instant, unless it is begun.
    pub(crate) fn at(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    pub(crate) fn complete(&mut self, place: Place) {
        let (dag, _, subtask) = place;
        *self.part_mut(place) = Part::Finished;
        self.running.remove(&place);
        if self.set.dags[dag].is_sink(subtask) {
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

    /// The first deadline that sinks of jobs were not held against: when it is, how long after the
    /// nominal release, and of which job.
    fn unjudged(&self, dag: usize) -> Option<(u64, u64, usize)> {
        let model = &self.set.dags[dag];
        let jobs = self.dags[dag].jobs.iter().enumerate();
        let is_known = |job: &Job| {
            matches!(job.state, State::Waiting | State::InFlight) && !job.starts_nothing()
        };
        let of_job = |(number, job): (usize, &Job)| {
            let sinks = (0..model.subtasks.len()).filter(|&subtask| model.is_sink(subtask));
            let unjudged = sinks.filter(|&sink| is_known(job) && !job.is_judged[sink]);
            let relative_ns = unjudged.map(|sink| model.relative_ns(sink)).min()?;
            Some((job.due_ns? + relative_ns, relative_ns, number))
        };
        jobs.filter_map(of_job).min()
    }

    /// R4: notices what is late, in the order of the deadlines. What ends at this very instant,
    /// after a deadline that nobody has noticed, is late as well.
    fn judge(&mut self, dag: usize, ending: Option<Place>) {
        let model = &self.set.dags[dag];
        while let Some((deadline_ns, relative_ns, number)) = self.unjudged(dag)
            && deadline_ns < self.now_ns
        {
            let of_dag = &mut self.dags[dag];
            let (job, statistics) = (&mut of_dag.jobs[number], &mut of_dag.statistics);
            let is_of =
                |&sink: &usize| model.is_sink(sink) && model.relative_ns(sink) == relative_ns;
            let mut late = 0;
            for sink in (0..model.subtasks.len()).filter(is_of) {
                job.is_judged[sink] = true;
                let has_just_ended = ending == Some((dag, number, sink));
                let is_late = job.parts[sink] != Part::Finished || has_just_ended;
                of_dag.sink_misses[sink] += u64::from(is_late);
                late += u64::from(is_late);
            }
            if late > 0 && !std::mem::replace(&mut job.is_missed, true) {
                self.said[dag].push((What::Missed, number));
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
            for job in 0..self.dags[dag].jobs.len() {
                for subtask in 0..self.set.dags[dag].subtasks.len() {
                    let place = (dag, job, subtask);
                    let is_cut = self.dags[dag].jobs[job].starts_nothing();
                    let next = match self.part(place) {
                        Part::Absent if !self.is_free((dag, job, subtask)) => continue,
                        Part::Absent | Part::Ready if is_cut => Part::Cancelled,
                        Part::Absent => Part::Ready,
                        _ => continue,
                    };
                    *self.part_mut(place) = next;
                    self.turned.insert((place, next == Part::Ready));
                    changes = true;
                }
            }
        }
        for job in 0..self.dags[dag].jobs.len() {
            let parts = &self.dags[dag].jobs[job].parts[..self.set.dags[dag].subtasks.len()];
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
        statistics.completed += u64::from(!job.starts_nothing());
        let is_cut = job.is_aborted || job.is_cut || job.has_failed;
        if !is_cut && !job.is_missed {
            statistics.consecutive_misses = 0;
        }
        self.said[dag].push((What::Completed, number));
    }

    /// R2: nothing but cores holds it back.
    fn is_free(&self, (dag, job, subtask): Place) -> bool {
        let jobs = &self.dags[dag].jobs;
        let ended = |job: usize, subtask: usize| jobs[job].parts[subtask].has_ended();
        let mut edges = self.set.dags[dag].edges.iter();
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
        let options = self.set.options;
        let keeps_core = |&(dag, _, subtask): &Place| {
            options.preemption == Preemption::Disabled
                || self.set.dags[dag].subtasks[subtask].non_preemptive
        };
        let mut selected: BTreeSet<Place> =
            self.running.iter().copied().filter(keeps_core).collect();
        let mut others = self.places();
        others.retain(|&place| {
            matches!(self.part(place), Part::Ready | Part::Started) && !selected.contains(&place)
        });
        others.sort_by_key(|&(dag, job, subtask)| {
            let model = &self.set.dags[dag];
            let urgency = match options.policy {
                Policy::StaticPriority => Some(u64::from(model.subtasks[subtask].priority)),
                Policy::Edf => {
                    let due_ns = self.dags[dag].jobs[job].due_ns;
                    due_ns.map(|due_ns| due_ns + model.earliest_ns(subtask))
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
        let dags = self.set.dags.iter().enumerate();
        let places = dags.flat_map(|(dag, model)| {
            let subtasks = model.subtasks.len();
            (0..model.jobs())
                .flat_map(move |job| (0..subtasks).map(move |subtask| (dag, job, subtask)))
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
}

impl Part {
    const fn has_ended(self) -> bool {
        matches!(self, Self::Finished | Self::Failed | Self::Cancelled)
    }
}
