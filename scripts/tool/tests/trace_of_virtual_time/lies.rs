//! Single changes to a right trace that each break a rule.
//!
//! A lie says whether it could be told of the run at hand. What would not break
//! a rule, such as moving an event within an instant, is never told.

use sched_dag::journal::{Event, What};
use tool::trace::model::Run;

use crate::random::Random;

/// Changes a run, if it can.
pub(crate) type Lie = fn(&mut Run, &mut Random) -> bool;

/// All lies by name.
pub(crate) const LIES: [(&str, Lie); 16] = [
    ("a start is missing", |run, random| {
        drop_one(run, random, What::Start)
    }),
    ("a finish is missing", |run, random| {
        drop_one(run, random, What::Finish)
    }),
    ("a suspension is missing", |run, random| {
        drop_one(run, random, What::Suspend)
    }),
    ("a resumption is missing", |run, random| {
        drop_one(run, random, What::Resume)
    }),
    ("a readiness is missing", missing_readiness),
    ("a release is missing", |run, random| {
        drop_one(run, random, What::Released)
    }),
    ("a completion is missing", |run, random| {
        drop_one(run, random, What::Completed)
    }),
    ("a start happens twice", |run, random| {
        double(run, random, What::Start)
    }),
    ("a finish happens twice", |run, random| {
        double(run, random, What::Finish)
    }),
    ("a miss is made up", made_up_miss),
    ("a miss is not noticed", missing_miss),
    ("a release is early", early_release),
    ("a start comes before the join", start_before_join),
    ("a start comes late", late_start),
    ("start and finish are swapped", swapped),
    ("a finish is on another core", finish_elsewhere),
];

/// Brings the events back into the order of a log.
pub(crate) fn order(run: &mut Run) {
    run.events.sort_by_key(|event| event.time_ns);
}

fn pick(run: &Run, random: &mut Random, is_it: impl Fn(&Event) -> bool) -> Option<usize> {
    let positions = run.events.iter().enumerate();
    let positions: Vec<usize> = positions
        .filter(|(_, event)| is_it(event))
        .map(|(position, _)| position)
        .collect();
    (!positions.is_empty()).then(|| positions[random.below(positions.len())])
}

fn find(run: &Run, like: &Event, what: What) -> Option<usize> {
    let is_it = |event: &Event| {
        event.what == what
            && (event.dag, event.job, event.subtask) == (like.dag, like.job, like.subtask)
    };
    run.events.iter().position(is_it)
}

fn drop_one(run: &mut Run, random: &mut Random, what: What) -> bool {
    let position = pick(run, random, |event| event.what == what);
    position
        .map(|position| run.events.remove(position))
        .is_some()
}

fn missing_readiness(run: &mut Run, random: &mut Random) -> bool {
    let starts = |event: &Event| find(run, event, What::Start).is_some();
    let position = pick(run, random, |event| {
        event.what == What::Ready && starts(event)
    });
    position
        .map(|position| run.events.remove(position))
        .is_some()
}

fn double(run: &mut Run, random: &mut Random, what: What) -> bool {
    let position = pick(run, random, |event| event.what == what);
    let Some(position) = position else {
        return false;
    };
    let event = run.events[position];
    run.events.insert(position, event);
    true
}

fn made_up_miss(run: &mut Run, random: &mut Random) -> bool {
    let position = pick(run, random, |event| event.what == What::Completed);
    let Some(completed) = position.map(|position| run.events[position]) else {
        return false;
    };
    let of_job = |event: &Event| (event.dag, event.job) == (completed.dag, completed.job);
    let is_other =
        |event: &Event| of_job(event) && matches!(event.what, What::Missed | What::Aborted);
    if run.events.iter().any(is_other) {
        return false;
    }
    run.events.push(Event {
        what: What::Missed,
        ..completed
    });
    true
}

fn missing_miss(run: &mut Run, random: &mut Random) -> bool {
    let completes = |event: &Event| {
        let is_cut = |other: &Event| {
            (other.dag, other.job) == (event.dag, event.job)
                && matches!(other.what, What::Skipped | What::Aborted)
        };
        !run.events.iter().any(is_cut)
    };
    let position = pick(run, random, |event| {
        event.what == What::Missed && completes(event)
    });
    position
        .map(|position| run.events.remove(position))
        .is_some()
}

fn early_release(run: &mut Run, random: &mut Random) -> bool {
    let is_late_enough = |event: &Event| {
        event.what == What::Released && run.task_set.dag(event.dag).grid_ns(event.job) > 0
    };
    let Some(position) = pick(run, random, is_late_enough) else {
        return false;
    };
    let event = &run.events[position];
    let nominal_ns = run.task_set.dag(event.dag).grid_ns(event.job);
    run.events[position].time_ns = random.between(0, nominal_ns - 1);
    true
}

/// The last finish of an instance's predecessors.
fn join_ns(run: &Run, event: &Event) -> Option<u64> {
    let subtask = event.subtask?;
    let predecessors = run.task_set.dag(event.dag).predecessors(subtask);
    let finishes = predecessors.iter().map(|&predecessor| {
        let like = Event {
            subtask: Some(predecessor),
            ..*event
        };
        Some(run.events[find(run, &like, What::Finish)?].time_ns)
    });
    finishes.max().flatten()
}

fn start_before_join(run: &mut Run, random: &mut Random) -> bool {
    let waits = |event: &Event| {
        event.what == What::Start && join_ns(run, event).is_some_and(|join_ns| join_ns > 0)
    };
    let Some(position) = pick(run, random, waits) else {
        return false;
    };
    let join_ns = join_ns(run, &run.events[position]).expect("it waits");
    run.events[position].time_ns = join_ns - 1;
    true
}

fn late_start(run: &mut Run, random: &mut Random) -> bool {
    let lasts = |event: &Event| {
        let next = [What::Suspend, What::Finish].map(|what| find(run, event, what));
        let mut next = next
            .into_iter()
            .flatten()
            .map(|next| run.events[next].time_ns);
        event.what == What::Start && next.all(|next_ns| next_ns > event.time_ns + 1)
    };
    let Some(position) = pick(run, random, lasts) else {
        return false;
    };
    run.events[position].time_ns += 1;
    true
}

fn swapped(run: &mut Run, random: &mut Random) -> bool {
    let lasts = |event: &Event| {
        let finish = find(run, event, What::Finish);
        let finish_ns = finish.map(|finish| run.events[finish].time_ns);
        event.what == What::Start && finish_ns.is_some_and(|finish_ns| finish_ns > event.time_ns)
    };
    let Some(start) = pick(run, random, lasts) else {
        return false;
    };
    let finish = find(run, &run.events[start], What::Finish).expect("it lasts");
    let start_ns = run.events[start].time_ns;
    run.events[start].time_ns = run.events[finish].time_ns;
    run.events[finish].time_ns = start_ns;
    true
}

fn finish_elsewhere(run: &mut Run, random: &mut Random) -> bool {
    let position = pick(run, random, |event| event.what == What::Finish);
    let Some(position) = position.filter(|_| run.options.cores > 1) else {
        return false;
    };
    let core = &mut run.events[position].core.0;
    *core = (*core + 1) % run.options.cores;
    true
}
