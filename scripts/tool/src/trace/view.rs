//! A run's events put in order, and sorted by whom they happened to.
//!
//! Words. A *step* of the scheduler is known by the core that made it and by
//! that core's last machine event before it: between two machine events of a
//! core, a completion's step cannot begin. A *moment* is when and in which step
//! something happened.
//!
//! If events were lost, they were the oldest. A trace is *complete from* the first
//! instant after the first event that is left; what happened before is left out here,
//! and then nothing can be concluded from an event that is not there.

use std::collections::{BTreeMap, BTreeSet};

use sched_dag::{CoreId, DagId, Instance};

use super::breach::Breach;
use super::history::{self, History};
use super::jobs::JobHistory;
use super::model::{Event, Run, What};

/// When and in which step of the scheduler something happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Moment {
    pub(super) time_ns: u64,
    pub(super) core: CoreId,
    /// Counts the core's machine events up to this one.
    step: u64,
}

impl Moment {
    pub(super) fn is_same_step(self, other: Moment) -> bool {
        (self.core, self.step) == (other.core, other.step)
    }
}

/// A run in the order of time.
#[derive(Debug)]
pub(super) struct View<'r> {
    pub(super) run: &'r Run,
    /// The first instant from which on no event is missing.
    pub(super) from_ns: u64,
    /// The time of the last event.
    pub(super) end_ns: u64,
    /// The events from `from_ns` on, by time.
    pub(super) events: Vec<(Event, Moment)>,
    pub(super) histories: BTreeMap<Instance, History>,
    pub(super) jobs: BTreeMap<(DagId, u64), JobHistory>,
    /// The jobs of each DAG of which instances may run, ascending.
    released: BTreeMap<DagId, BTreeSet<u64>>,
    /// When each DAG was ended before its time, by a fault or a stop.
    pub(super) stopped: BTreeMap<DagId, u64>,
}

impl<'r> View<'r> {
    /// Puts a run in order, and adds the breaches that show on the way.
    pub(super) fn new(run: &'r Run, breaches: &mut Vec<Breach>) -> View<'r> {
        let from_ns = complete_from_ns(run);
        let mut events = with_moments(run);
        events.retain(|(event, _)| event.time_ns >= from_ns);
        events.sort_by_key(|(event, _)| event.time_ns);
        let mut view = View {
            run,
            from_ns,
            end_ns: events.last().map_or(from_ns, |(event, _)| event.time_ns),
            events,
            histories: BTreeMap::new(),
            jobs: BTreeMap::new(),
            released: BTreeMap::new(),
            stopped: BTreeMap::new(),
        };
        view.sort_by_job(breaches);
        view.sort_by_instance(breaches);
        view.find_stops();
        view
    }

    /// Reports whether an event that is not there may have been lost.
    pub(super) fn is_lossy(&self) -> bool {
        self.run.lost > 0
    }

    /// Returns the job before `job` of which instances may have run.
    pub(super) fn job_before(&self, dag: DagId, job: u64) -> Option<u64> {
        let jobs = self.released.get(&dag)?;
        jobs.range(..job).next_back().copied()
    }

    /// Reports whether a job was aborted, or cut short by its DAG's end.
    pub(super) fn is_cut(&self, dag: DagId, job: u64) -> bool {
        let aborted = self
            .jobs
            .get(&(dag, job))
            .is_some_and(|job| job.is_aborted());
        aborted || self.stopped.contains_key(&dag)
    }

    fn sort_by_job(&mut self, breaches: &mut Vec<Breach>) {
        for &(event, moment) in &self.events {
            let (dag, job) = (event.dag, event.job);
            let is_signal = matches!(
                event.what,
                What::Signalled | What::Dropped | What::Due | What::Stopped
            );
            if event.what.is_of_job() && !is_signal {
                let history = self.jobs.entry((dag, job)).or_default();
                breaches.extend(history.note(self.run, &event, moment));
            }
            let runs = event.what == What::Released || event.subtask.is_some();
            if runs {
                self.released.entry(dag).or_default().insert(job);
            }
        }
    }

    fn sort_by_instance(&mut self, breaches: &mut Vec<Breach>) {
        let mut lives: BTreeMap<Instance, Vec<(Event, Moment)>> = BTreeMap::new();
        for &(event, moment) in &self.events {
            // A request is a wish; nothing has happened to the instance.
            if let Some(instance) = event.instance()
                && event.what != What::Request
            {
                lives.entry(instance).or_default().push((event, moment));
            }
        }
        for (instance, events) in lives {
            let history = history::follow(self, instance, &events, breaches);
            self.histories.insert(instance, history);
        }
    }

    fn find_stops(&mut self) {
        let mut stopped = BTreeMap::new();
        for (event, _) in &self.events {
            let is_aborted = |job: &JobHistory| job.is_aborted();
            let is_stop = match event.what {
                What::Ended | What::Stopped => true,
                // Only an abort and an end cancel, so this was an end.
                What::Cancelled => {
                    let job = self.jobs.get(&(event.dag, event.job));
                    !job.is_some_and(is_aborted)
                }
                _ => false,
            };
            if is_stop {
                stopped.entry(event.dag).or_insert(event.time_ns);
            }
        }
        self.stopped = stopped;
    }
}

/// Finds the first instant after which no event is missing.
fn complete_from_ns(run: &Run) -> u64 {
    if run.lost == 0 {
        return 0;
    }
    // What is lost came before it, and the time of these was read as they were written.
    let mut events = run.events.iter();
    let first = events.find(|event| !matches!(event.what, What::Finish | What::Due));
    // At that very instant something may be missing.
    first.map_or(u64::MAX, |first| first.time_ns.saturating_add(1))
}

fn with_moments(run: &Run) -> Vec<(Event, Moment)> {
    let mut steps: BTreeMap<CoreId, u64> = BTreeMap::new();
    let moment = |event: &Event| {
        let step = steps.entry(event.core).or_insert(0);
        *step += u64::from(event.what.is_of_machine());
        let moment = Moment {
            time_ns: event.time_ns,
            core: event.core,
            step: *step,
        };
        (*event, moment)
    };
    run.events.iter().map(moment).collect()
}
