//! A run in the order of time: its jobs and instances with their histories.

use std::collections::BTreeMap;

use sched_dag::journal::{Event, EventKind};
use sched_dag::{CoreId, DagId, Instance};

use crate::record::Run;

/// A run in the order of time.
#[derive(Debug)]
pub struct View<'r> {
    /// The run.
    pub run: &'r Run,
    /// The first instant after all missing events.
    pub from_ns: u64,
    /// The time of the last event.
    pub end_ns: u64,
    /// The events from `from_ns` on, by time.
    pub events: Vec<Event>,
    /// The instances, each with its history.
    pub histories: BTreeMap<Instance, History>,
    /// The jobs, each with its history.
    pub jobs: BTreeMap<(DagId, u64), JobHistory>,
    /// The due times of sporadic jobs.
    pub due_ns: BTreeMap<(DagId, u64), u64>,
}

/// The times of a job's first events of each kind.
#[derive(Clone, Debug, Default)]
pub struct JobHistory {
    /// The release.
    pub released_ns: Option<u64>,
    /// The end by the overrun policy.
    pub aborted_ns: Option<u64>,
    /// The deadline miss.
    pub missed_ns: Option<u64>,
    /// The completion.
    pub completed_ns: Option<u64>,
}

/// The times of an instance's first events of each kind.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// The readiness.
    pub ready_ns: Option<u64>,
    /// The first start.
    pub start_ns: Option<u64>,
    /// The finish.
    pub finish_ns: Option<u64>,
    /// The time of the cancellation, or of the end by a fault.
    pub dropped_ns: Option<u64>,
    /// The times on a core.
    pub slices: Vec<ExecutionSlice>,
    /// The begin and the end of each wait; `None`: it went on when the trace ended.
    pub waits: Vec<(u64, Option<u64>)>,
    /// The number of preemptions.
    pub suspensions: u64,
}

/// A stretch of execution on one core.
#[derive(Clone, Copy, Debug)]
pub struct ExecutionSlice {
    /// The core.
    pub core: CoreId,
    /// The begin.
    pub from_ns: u64,
    /// The end; `None`: the instance ran when the trace ended.
    pub to_ns: Option<u64>,
}

/// The way in which a stretch of execution ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SliceEnd {
    /// With its instance.
    Finished,
    /// By a preemption.
    Preempted,
    /// In a wait.
    Waits,
    /// By a fault.
    Fault,
    /// Not before the end of the trace.
    Open,
}

impl<'r> View<'r> {
    /// Builds the view of a run.
    pub fn new(run: &'r Run) -> View<'r> {
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
        // Stable: events of one instant keep the order of the journal.
        view.events.sort_by_key(|event| event.time_ns);
        view.end_ns = view.events.last().map_or(view.from_ns, |last| last.time_ns);
        for event in &view.events {
            let of_job = (event.dag, event.job);
            match (event.what, event.instance()) {
                (EventKind::Request, _) => {}
                (_, Some(instance)) => {
                    let history = view.histories.entry(instance).or_default();
                    history.note(event, run.lost > 0, view.from_ns);
                }
                (EventKind::Due, None) => {
                    view.due_ns.insert(of_job, event.time_ns);
                }
                (EventKind::Signalled | EventKind::Dropped, None) => {}
                (what, None) if what.is_of_dag() => {}
                (_, None) => view.jobs.entry(of_job).or_default().note(event),
            }
        }
        view
    }

    /// Returns the judged events in the order of the journal.
    pub fn in_the_order_of_the_log(&self) -> impl Iterator<Item = Event> {
        let events = self.run.events.iter().copied();
        events.filter(|event| event.time_ns >= self.from_ns)
    }

    /// Returns the nominal release of a job; 0 if the release of a sporadic job is unknown.
    pub fn release_ns(&self, dag: DagId, job: u64) -> u64 {
        let model = self.run.task_set.dag(dag);
        match model.is_sporadic() {
            true => self.due_ns.get(&(dag, job)).copied().unwrap_or(0),
            false => model.grid_ns(job),
        }
    }

    /// Returns the absolute deadline of a job.
    pub fn deadline_ns(&self, dag: DagId, job: u64) -> u64 {
        let relative_ns = self.run.task_set.dag(dag).relative_deadline_ns();
        self.release_ns(dag, job).saturating_add(relative_ns)
    }
}

/// Returns the first instant after all missing events.
pub(crate) fn complete_from_ns(run: &Run) -> u64 {
    if run.lost == 0 {
        return 0;
    }
    // Ends of turns and due times may be dated before their writing; all other events bear the time
    // of their writing, so every lost event is older.
    let is_dated_back = |what| matches!(what, EventKind::Finish | EventKind::Wait | EventKind::Due);
    let mut events = run.events.iter();
    let first = events.find(|event| !is_dated_back(event.what));
    // Other events of that very instant may be lost.
    first.map_or(u64::MAX, |first| first.time_ns.saturating_add(1))
}

impl JobHistory {
    fn note(&mut self, event: &Event) {
        let place = match event.what {
            EventKind::Released => &mut self.released_ns,
            EventKind::Aborted => &mut self.aborted_ns,
            EventKind::Missed => &mut self.missed_ns,
            EventKind::Completed => &mut self.completed_ns,
            _ => return,
        };
        place.get_or_insert(event.time_ns);
    }
}

impl History {
    /// Returns the wait that ended a stretch of execution, if any.
    pub fn wait_after(&self, slice: ExecutionSlice) -> Option<(u64, Option<u64>)> {
        let mut waits = self.waits.iter().copied();
        waits.find(|(from_ns, _)| slice.to_ns == Some(*from_ns))
    }

    /// Returns how the stretch of execution with this number ended.
    pub fn end_of(&self, number: usize) -> SliceEnd {
        let is_last = number + 1 == self.slices.len();
        match self.slices[number] {
            ExecutionSlice { to_ns: None, .. } => SliceEnd::Open,
            slice if self.wait_after(slice).is_some() => SliceEnd::Waits,
            _ if is_last && self.finish_ns.is_some() => SliceEnd::Finished,
            _ if is_last && self.dropped_ns.is_some() => SliceEnd::Fault,
            // The last one, too, if the trace ends before its resumption.
            _ => SliceEnd::Preempted,
        }
    }

    fn note(&mut self, event: &Event, is_lossy: bool, from_ns: u64) {
        let time_ns = event.time_ns;
        // A resumption needs no such start: it begins a slice by itself.
        let is_first = self.slices.is_empty() && self.start_ns.is_none();
        let ran = matches!(
            event.what,
            EventKind::Suspend | EventKind::Wait | EventKind::Finish | EventKind::Ended
        );
        if is_lossy && is_first && ran {
            // The start is lost: the instance has run since before the trace.
            self.begin_slice(event.core, from_ns);
        }
        // Any later event of the instance ends the slice; a second one does not move its end.
        if let Some(slice) = self.slices.last_mut() {
            slice.to_ns.get_or_insert(time_ns);
        }
        if let Some((_, to_ns)) = self.waits.last_mut() {
            to_ns.get_or_insert(time_ns);
        }
        let place = match event.what {
            EventKind::Ready => &mut self.ready_ns,
            EventKind::Start => &mut self.start_ns,
            EventKind::Finish => &mut self.finish_ns,
            EventKind::Cancelled | EventKind::Ended => &mut self.dropped_ns,
            _ => &mut None,
        };
        place.get_or_insert(time_ns);
        self.suspensions += u64::from(event.what == EventKind::Suspend);
        if event.what == EventKind::Wait {
            self.waits.push((time_ns, None));
        }
        if matches!(event.what, EventKind::Start | EventKind::Resume) {
            self.begin_slice(event.core, time_ns);
        }
    }

    fn begin_slice(&mut self, core: CoreId, from_ns: u64) {
        self.slices.push(ExecutionSlice {
            core,
            from_ns,
            to_ns: None,
        });
    }
}
