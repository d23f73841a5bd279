//! One instance's life: ready, started, suspended and resumed in turns, over.
//!
//! The rule *one life*: an instance becomes ready once, starts once and only
//! when ready, is suspended only where it runs, resumed only when suspended,
//! and finishes once, where it runs. That also says that it is on one core at a
//! time.
//!
//! Events of one instant on different cores have no known order. They are taken
//! in an order in which each is allowed, if there is one: an instance that is
//! suspended on one core and resumed on another in the same nanosecond breaks
//! no rule.
//!
//! If events were lost, the first one left tells what must have been before.

use sched_dag::law::sweep::Stage;
use sched_dag::{CoreId, Instance};

use super::breach::{Breach, Rule};
use super::model::{Event, Run, What};
use super::view::{Moment, View};

/// What is known of an instance.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    pub(super) ready: Option<Moment>,
    pub(super) start: Option<Moment>,
    pub(super) finish: Option<Moment>,
    /// When it was cancelled, or ended by a fault.
    pub(super) dropped: Option<Moment>,
    /// The times on a core.
    pub(super) slices: Vec<Slice>,
    /// What it was from when on, in the order of time.
    pub(super) stages: Vec<(u64, Stage)>,
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

impl History {
    /// Returns when the instance was over: finished, cancelled or ended.
    pub(super) fn over(&self) -> Option<Moment> {
        self.finish.or(self.dropped)
    }
}

/// Follows an instance through its events, which are in the order of time.
pub(super) fn follow(
    view: &View<'_>,
    instance: Instance,
    events: &[(Event, Moment)],
    breaches: &mut Vec<Breach>,
) -> History {
    let mut history = History::default();
    let mut stage = Stage::Absent;
    let mut instants = events.chunk_by(|one, other| one.0.time_ns == other.0.time_ns);
    if view.is_lossy()
        && let Some(first) = instants.clone().next()
    {
        stage = before(first);
        history.enter(view.from_ns, stage);
    }
    for instant in &mut instants {
        for (event, moment) in arrange(stage, instant) {
            if !is_allowed(stage, &event) {
                breaches.push(objection(view.run, instance, stage, &event));
            }
            history.note(&event, moment);
            stage = after(&event);
        }
    }
    history
}

/// Puts the events of one instant into an order in which each is allowed, if
/// one is found, and else leaves them as they are.
fn arrange(stage: Stage, instant: &[(Event, Moment)]) -> Vec<(Event, Moment)> {
    let mut search = Search {
        left: instant.to_vec(),
        arranged: Vec::new(),
        tries: MOST_TRIES,
    };
    match search.complete(stage) {
        true => search.arranged,
        false => instant.to_vec(),
    }
}

/// The most steps of a search. An instant has one or two events but in virtual
/// time, and there rarely more than ten.
const MOST_TRIES: u32 = 10_000;

struct Search {
    left: Vec<(Event, Moment)>,
    arranged: Vec<(Event, Moment)>,
    tries: u32,
}

impl Search {
    /// Arranges what is left, each core's events in their order.
    fn complete(&mut self, stage: Stage) -> bool {
        let mut index = 0;
        while index < self.left.len() {
            let (event, moment) = self.left[index];
            let earlier = &self.left[..index];
            let is_next_there = earlier.iter().all(|(other, _)| other.core != event.core);
            if is_next_there && is_allowed(stage, &event) && self.tries > 0 {
                self.tries -= 1;
                self.left.remove(index);
                self.arranged.push((event, moment));
                if self.complete(after(&event)) {
                    return true;
                }
                self.arranged.pop();
                self.left.insert(index, (event, moment));
            }
            index += 1;
        }
        self.left.is_empty()
    }
}

fn is_allowed(stage: Stage, event: &Event) -> bool {
    match (stage, event.what) {
        (Stage::Absent, What::Ready | What::Cancelled)
        | (Stage::Ready, What::Start | What::Cancelled)
        | (Stage::Suspended, What::Resume)
        // Whichever core finds the fault, or stops the DAG, ends the instance.
        | (Stage::Running(_) | Stage::Suspended, What::Ended) => true,
        (Stage::Running(core), What::Suspend | What::Finish) => core == event.core,
        _ => false,
    }
}

/// Returns what an instance must have been before its first known instant: what
/// one of the events asks for, if all of them are allowed then.
fn before(first: &[(Event, Moment)]) -> Stage {
    let asked_for = |(event, _): &(Event, Moment)| match event.what {
        What::Start => Stage::Ready,
        What::Resume => Stage::Suspended,
        What::Suspend | What::Finish | What::Ended => Stage::Running(event.core),
        _ => Stage::Absent,
    };
    let allows_all = |stage: &Stage| {
        let mut stage = *stage;
        arrange(stage, first).iter().all(|(event, _)| {
            let before = std::mem::replace(&mut stage, after(event));
            is_allowed(before, event)
        })
    };
    let stages = || first.iter().map(asked_for);
    let any = stages().next().unwrap_or(Stage::Absent);
    stages().find(allows_all).unwrap_or(any)
}

/// Returns what an instance is after an event.
fn after(event: &Event) -> Stage {
    match event.what {
        What::Ready => Stage::Ready,
        What::Start | What::Resume => Stage::Running(event.core),
        What::Suspend => Stage::Suspended,
        _ => Stage::Over,
    }
}

fn objection(run: &Run, instance: Instance, stage: Stage, event: &Event) -> Breach {
    let does = match event.what {
        What::Ready => "becomes ready in a step on",
        What::Start => "starts on",
        What::Suspend => "is suspended on",
        What::Resume => "is resumed on",
        What::Finish => "finishes on",
        What::Cancelled => "is cancelled in a step on",
        _ => "is ended on",
    };
    let is = match stage {
        Stage::Absent => "never was ready".into(),
        Stage::Ready => "is ready and has not started".into(),
        Stage::Running(core) => format!("runs on core {}", core.0),
        Stage::Suspended => "is suspended".into(),
        Stage::Over => "is over already".into(),
    };
    let core = event.core.0;
    let name = run.name(instance);
    Breach {
        rule: Rule::OneLife,
        time_ns: event.time_ns,
        text: format!("{name} {does} core {core} although it {is}"),
    }
}

impl History {
    /// Takes note of an event, whether it is allowed or not.
    fn note(&mut self, event: &Event, moment: Moment) {
        let place = match event.what {
            What::Ready => Some(&mut self.ready),
            What::Start => Some(&mut self.start),
            What::Finish => Some(&mut self.finish),
            What::Cancelled | What::Ended => Some(&mut self.dropped),
            _ => None,
        };
        if let Some(place) = place {
            place.get_or_insert(moment);
        }
        self.suspensions += u64::from(event.what == What::Suspend);
        self.enter(event.time_ns, after(event));
    }

    fn enter(&mut self, time_ns: u64, stage: Stage) {
        if let Some(slice) = self.slices.last_mut() {
            slice.to_ns.get_or_insert(time_ns);
        }
        if let Stage::Running(core) = stage {
            self.slices.push(Slice {
                core,
                from_ns: time_ns,
                to_ns: None,
            });
        }
        self.stages.push((time_ns, stage));
    }
}
