//! A run's events in the order of time, and sorted by what they happened to: what the
//! figures and the viewer need. Nothing is judged here.
//!
//! If events were lost, they were the oldest. A trace is *complete from* the first
//! instant after the first event that is left; what happened before is left out here.

use std::collections::BTreeMap;

use sched_dag::journal::{Event, What};
use sched_dag::{CoreId, DagId, Instance};

use crate::record::Run;

/// A run in the order of time.
#[derive(Debug)]
pub(super) struct View<'r> {
    pub(super) run: &'r Run,
    /// The first instant from which on no event is missing.
    pub(super) from_ns: u64,
    /// The time of the last event.
    pub(super) end_ns: u64,
    /// The events from `from_ns` on, by time.
    pub(super) events: Vec<Event>,
    pub(super) histories: BTreeMap<Instance, History>,
    /// The jobs, each with what has happened to it and when.
    pub(super) jobs: BTreeMap<(DagId, u64), JobHistory>,
    /// When sporadic jobs were due.
    due_ns: BTreeMap<(DagId, u64), u64>,
}

/// What happened to a job, and when first.
#[derive(Clone, Debug, Default)]
pub(super) struct JobHistory {
    pub(super) released_ns: Option<u64>,
    pub(super) aborted_ns: Option<u64>,
    pub(super) missed_ns: Option<u64>,
    pub(super) completed_ns: Option<u64>,
}

/// What happened to an instance, and when first.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    pub(super) ready_ns: Option<u64>,
    pub(super) start_ns: Option<u64>,
    pub(super) finish_ns: Option<u64>,
    /// When it was cancelled, or ended by a fault.
    pub(super) dropped_ns: Option<u64>,
    /// The times on a core.
    pub(super) slices: Vec<Slice>,
    pub(super) suspensions: u64,
}

/// A stretch of time on one core.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slice {
    pub(super) core: CoreId,
    pub(super) from_ns: u64,
    /// `None`: it ran when the trace ended.
    pub(super) to_ns: Option<u64>,
}

impl<'r> View<'r> {
    /// Puts a run in order.
    pub(super) fn new(run: &'r Run) -> View<'r> {
        let mut view = View {
            run,
            from_ns: complete_from_ns(run),
            end_ns: 0,
            events: Vec::new(),
            histories: BTreeMap::new(),
            jobs: BTreeMap::new(),
            due_ns: BTreeMap::new(),
        };
        view.events = view.in_the_order_of_the_log().collect();
        view.events.sort_by_key(|event| event.time_ns);
        view.end_ns = view.events.last().map_or(view.from_ns, |last| last.time_ns);
        for event in &view.events {
            let of_job = (event.dag, event.job);
            match (event.what, event.instance()) {
                (What::Request, _) => {}
                (_, Some(instance)) => {
                    let history = view.histories.entry(instance).or_default();
                    history.note(event, run.lost > 0, view.from_ns);
                }
                (What::Due, None) => {
                    view.due_ns.insert(of_job, event.time_ns);
                }
                (What::Signalled | What::Dropped, None) => {}
                (what, None) if what.is_of_dag() => {}
                (_, None) => view.jobs.entry(of_job).or_default().note(event),
            }
        }
        view
    }

    /// Returns the events that are judged, in the order in which they were learnt of.
    pub(super) fn in_the_order_of_the_log(&self) -> impl Iterator<Item = Event> {
        let events = self.run.events.iter().copied();
        events.filter(|event| event.time_ns >= self.from_ns)
    }

    /// Returns the nominal release of a job; 0 if nothing is known of that of a sporadic
    /// one.
    pub(super) fn release_ns(&self, dag: DagId, job: u64) -> u64 {
        let model = self.run.task_set.dag(dag);
        match model.is_sporadic() {
            true => self.due_ns.get(&(dag, job)).copied().unwrap_or(0),
            false => model.grid_ns(job),
        }
    }

    /// Returns the absolute deadline of a job.
    pub(super) fn deadline_ns(&self, dag: DagId, job: u64) -> u64 {
        let relative_ns = self.run.task_set.dag(dag).relative_deadline_ns();
        self.release_ns(dag, job).saturating_add(relative_ns)
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

impl JobHistory {
    fn note(&mut self, event: &Event) {
        let place = match event.what {
            What::Released => &mut self.released_ns,
            What::Aborted => &mut self.aborted_ns,
            What::Missed => &mut self.missed_ns,
            What::Completed => &mut self.completed_ns,
            _ => return,
        };
        place.get_or_insert(event.time_ns);
    }
}

impl History {
    /// Returns when the instance was over: finished, cancelled or ended.
    pub(super) fn over_ns(&self) -> Option<u64> {
        self.finish_ns.or(self.dropped_ns)
    }

    fn note(&mut self, event: &Event, is_lossy: bool, from_ns: u64) {
        let time_ns = event.time_ns;
        let is_first = self.slices.is_empty() && self.start_ns.is_none();
        let ran = matches!(event.what, What::Suspend | What::Finish | What::Ended);
        if is_lossy && is_first && ran {
            // It has been running since before the trace.
            self.begin(event.core, from_ns);
        }
        if let Some(slice) = self.slices.last_mut() {
            slice.to_ns.get_or_insert(time_ns);
        }
        let place = match event.what {
            What::Ready => &mut self.ready_ns,
            What::Start => &mut self.start_ns,
            What::Finish => &mut self.finish_ns,
            What::Cancelled | What::Ended => &mut self.dropped_ns,
            _ => &mut None,
        };
        place.get_or_insert(time_ns);
        self.suspensions += u64::from(event.what == What::Suspend);
        if matches!(event.what, What::Start | What::Resume) {
            self.begin(event.core, time_ns);
        }
    }

    fn begin(&mut self, core: CoreId, from_ns: u64) {
        self.slices.push(Slice {
            core,
            from_ns,
            to_ns: None,
        });
    }
}
