//! Single changes to a right trace that each break a rule.
//!
//! Each is applied where it can be. A change that would not break a rule, such as moving an event
//! within an instant, is never made.

use common::random::Random;
use sched_dag::journal::{Event, EventKind};
use tool::record::Run;

/// A lie: its name, the kinds of events to which it can be applied, and the change to the event at
/// a position.
pub(crate) type Lie = (
    &'static str,
    EventKind,
    fn(&Run, &Event) -> bool,
    fn(&mut Run, usize, &mut Random),
);

/// All lies.
pub(crate) const LIES: [Lie; 16] = [
    ("a start is missing", EventKind::Start, any, remove),
    ("a finish is missing", EventKind::Finish, any, remove),
    ("a suspension is missing", EventKind::Suspend, any, remove),
    ("a resumption is missing", EventKind::Resume, any, remove),
    ("a readiness is missing", EventKind::Ready, starts, remove),
    ("a release is missing", EventKind::Released, any, remove),
    ("a completion is missing", EventKind::Completed, any, remove),
    ("a start happens twice", EventKind::Start, any, double),
    ("a finish happens twice", EventKind::Finish, any, double),
    ("a miss is made up", EventKind::Completed, is_in_time, miss),
    (
        "a miss is not noticed",
        EventKind::Missed,
        is_not_cut,
        remove,
    ),
    ("a release is early", EventKind::Released, is_after_0, early),
    (
        "a start before the join",
        EventKind::Start,
        joins,
        before_join,
    ),
    ("a start comes late", EventKind::Start, runs_on, late),
    ("start and finish swapped", EventKind::Start, finishes, swap),
    (
        "a finish elsewhere",
        EventKind::Finish,
        has_others,
        elsewhere,
    ),
];

/// Applies a lie to one of the events to which it can be applied, if there is one.
pub(crate) fn tell((_, what, can_be, change): Lie, run: &mut Run, random: &mut Random) -> bool {
    let events = run.events.iter().enumerate();
    let of_these = events.filter(|(_, event)| event.what == what && can_be(run, event));
    let places: Vec<usize> = of_these.map(|(place, _)| place).collect();
    if places.is_empty() {
        return false;
    }
    change(run, places[random.index(places.len())], random);
    // The order of a log.
    run.events.sort_by_key(|event| event.time_ns);
    true
}

/// Returns the positions of other events of the same instance or job.
fn find(run: &Run, like: &Event, what: EventKind) -> Option<usize> {
    let of = |event: &Event| (event.dag, event.job, event.subtask);
    let mut events = run.events.iter();
    events.position(|event| event.what == what && of(event) == of(like))
}

fn time_ns(run: &Run, like: &Event, what: EventKind) -> Option<u64> {
    find(run, like, what).map(|place| run.events[place].time_ns)
}

fn any(_: &Run, _: &Event) -> bool {
    true
}

fn starts(run: &Run, event: &Event) -> bool {
    find(run, event, EventKind::Start).is_some()
}

fn is_in_time(run: &Run, event: &Event) -> bool {
    [EventKind::Missed, EventKind::Aborted]
        .iter()
        .all(|&what| find(run, event, what).is_none())
}

fn is_not_cut(run: &Run, event: &Event) -> bool {
    [EventKind::Skipped, EventKind::Aborted]
        .iter()
        .all(|&what| find(run, event, what).is_none())
}

fn is_after_0(run: &Run, event: &Event) -> bool {
    run.task_set.dag(event.dag).grid_ns(event.job) > 0
}

/// Returns the last finish of an instance's predecessors.
fn join_ns(run: &Run, event: &Event) -> Option<u64> {
    let predecessors = run.task_set.dag(event.dag).predecessors(event.subtask?);
    let finishes = predecessors.iter().map(|&predecessor| {
        let subtask = Some(predecessor);
        time_ns(run, &Event { subtask, ..*event }, EventKind::Finish)
    });
    finishes.max().flatten()
}

fn joins(run: &Run, event: &Event) -> bool {
    join_ns(run, event) > Some(0)
}

fn runs_on(run: &Run, event: &Event) -> bool {
    let next = [EventKind::Suspend, EventKind::Finish].map(|what| time_ns(run, event, what));
    let mut next = next.into_iter().flatten();
    next.all(|next_ns| next_ns > event.time_ns + 1)
}

fn finishes(run: &Run, event: &Event) -> bool {
    time_ns(run, event, EventKind::Finish) > Some(event.time_ns)
}

fn has_others(run: &Run, _: &Event) -> bool {
    run.options.cores > 1
}

fn remove(run: &mut Run, place: usize, _: &mut Random) {
    run.events.remove(place);
}

fn double(run: &mut Run, place: usize, _: &mut Random) {
    run.events.insert(place, run.events[place]);
}

fn miss(run: &mut Run, place: usize, _: &mut Random) {
    let what = EventKind::Missed;
    let missed = Event {
        what,
        ..run.events[place]
    };
    run.events.push(missed);
}

fn early(run: &mut Run, place: usize, random: &mut Random) {
    let event = &mut run.events[place];
    let nominal_ns = run.task_set.dag(event.dag).grid_ns(event.job);
    event.time_ns = random.within(0..=nominal_ns - 1);
}

fn before_join(run: &mut Run, place: usize, _: &mut Random) {
    let join_ns = join_ns(run, &run.events[place]).expect("it waits");
    run.events[place].time_ns = join_ns - 1;
}

fn late(run: &mut Run, place: usize, _: &mut Random) {
    run.events[place].time_ns += 1;
}

fn swap(run: &mut Run, start: usize, _: &mut Random) {
    let finish = find(run, &run.events[start], EventKind::Finish).expect("it finishes");
    let start_ns = run.events[start].time_ns;
    run.events[start].time_ns = run.events[finish].time_ns;
    run.events[finish].time_ns = start_ns;
}

fn elsewhere(run: &mut Run, place: usize, _: &mut Random) {
    let core = &mut run.events[place].core.0;
    *core = (*core + 1) % run.options.cores;
}
