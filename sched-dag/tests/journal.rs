//! The law on journals of random sets, whole ones and those that have lost their
//! oldest events.
//!
//! More or other sets: `JOURNALS=100000 JOURNAL_SEED=7 cargo test -p sched-dag --test
//! journal`.

#[allow(dead_code, reason = "its own test uses all of it")]
#[path = "properties/set.rs"]
mod set;
mod support;

pub(crate) use support::random;

use random::Random;
use sched_dag::journal::{Event, What};
use sched_dag::law::{Record, Tally, Terms, Violation, dispatch_violations, violations};
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{DagId, Instance, JobOutcome};
use set::{Overruns, Set};
use support::{Run, Script, number, scheduler};

fn for_each_run(mut with: impl FnMut(u64, &mut Random, &Set, &Run)) {
    let (count, first_seed) = (number("JOURNALS", 500), number("JOURNAL_SEED", 1));
    println!("{count} sets from seed {first_seed} on");
    for seed in first_seed..first_seed + count {
        let mut random = Random::new(seed);
        let overruns = match random.chance(50) {
            true => Overruns::Often,
            false => Overruns::Never,
        };
        let set = set::draw(&mut random, overruns);
        let driver = VirtualTime::new(scheduler(&set.specs(), set.options));
        let run = Script::new(|instance| set.execution_ns(instance)).run(driver);
        with(seed, &mut random, &set, &run);
    }
}

/// What the rules say of a run in virtual time that has gone on to its end.
const COMPLETE: Terms = Terms {
    is_complete: true,
    ..Terms::EXACT
};

/// Returns every breach of every rule.
fn judged(run: &Run, set: &Set, terms: Terms, events: &[Event]) -> Vec<Violation> {
    let events = events.iter().copied();
    let mut found = violations(&run.task_set, terms, events.clone());
    let of_dispatch = dispatch_violations(&run.task_set, &set.options, terms, events);
    found.extend(of_dispatch);
    found
}

fn record(run: &Run, is_whole: bool, from: usize) -> Record {
    let events = run.events[from..].iter().copied();
    Record::of_events(&run.task_set, is_whole, events).expect("it fits")
}

#[test]
fn a_whole_journal_keeps_all_rules() {
    for_each_run(|seed, _, set, run| {
        assert_eq!(judged(run, set, COMPLETE, &run.events), [], "seed {seed}");
    });
}

#[test]
fn the_latest_events_have_the_latest_jobs_whole() {
    let mut kept = 0;
    for_each_run(|seed, random, set, run| {
        let whole = record(run, true, 0);
        let from = random.below(run.events.len());
        let rest = record(run, false, from);
        for (dag, _) in (0..).map(DagId).zip(run.task_set.dags()) {
            for (job, times) in rest.numbered(dag) {
                assert_eq!(Some(times), whole.job(dag, job), "seed {seed}");
                let instances = rest.instances(dag, job);
                assert_eq!(instances, whole.instances(dag, job), "seed {seed}");
                kept += u64::from(rest.first_job(dag) > 0);
            }
        }
        // At the very instant of the first event something may be missing.
        let after = |event: &Event| event.time_ns > run.events[from].time_ns;
        let rest: Vec<Event> = run.events.iter().copied().filter(after).collect();
        let terms = Terms {
            is_whole: false,
            ..COMPLETE
        };
        assert_eq!(judged(run, set, terms, &rest), [], "seed {seed}");
    });
    println!("{kept} jobs of DAGs that lost others");
    assert!(kept > 100);
}

/// What must not be missing, whatever the run.
const NEEDED: [What; 8] = [
    What::Released,
    What::Ready,
    What::Cancelled,
    What::Start,
    What::Suspend,
    What::Resume,
    What::Finish,
    What::Completed,
];

#[test]
fn a_journal_with_one_event_changed_breaks_a_rule() {
    // Deleted, doubled, later, earlier, and swapped with the next of its instance.
    let mut counts = [0; 5];
    let few = number("JOURNALS", 15);
    for_each_run(|seed, _, set, run| {
        if seed > few {
            return;
        }
        let objects = |change: &str, event: &Event, mut events: Vec<Event>| {
            events.sort_by_key(|event| event.time_ns);
            let found = judged(run, set, COMPLETE, &events);
            assert!(!found.is_empty(), "seed {seed}: {change} {event:?}");
        };
        for (place, event) in run.events.iter().enumerate() {
            if !NEEDED.contains(&event.what) {
                continue;
            }
            let is_next = |other: &&Event| other.instance() == event.instance();
            let next = run.events[place + 1..].iter().position(|it| is_next(&it));
            let next = next.filter(|_| event.instance().is_some());
            let next = next.map(|next| place + 1 + next);
            let next_is = |what: What| next.is_some_and(|next| run.events[next].what == what);
            // An instance may be cancelled without having been ready.
            if event.what != What::Ready || !next_is(What::Cancelled) {
                let mut deleted = run.events.clone();
                deleted.remove(place);
                objects("deleted", event, deleted);
            }
            let mut doubled = run.events.clone();
            doubled.insert(place, *event);
            objects("doubled", event, doubled);
            counts[0] += 1;
            counts[1] += 1;
            // How long an instance executes, no rule says.
            if !matches!(event.what, What::Cancelled | What::Finish) {
                let mut later = run.events.clone();
                later[place].time_ns += 1;
                objects("later", event, later);
                counts[2] += 1;
                if event.time_ns > 0 {
                    let mut earlier = run.events.clone();
                    earlier[place].time_ns -= 1;
                    objects("earlier", event, earlier);
                    counts[3] += 1;
                }
            }
            if let Some(next) = next {
                let mut swapped = run.events.clone();
                (swapped[place].what, swapped[next].what) = (swapped[next].what, event.what);
                objects("swapped", event, swapped);
                counts[4] += 1;
            }
        }
    });
    println!("deleted, doubled, later, earlier, swapped: {counts:?}");
    assert!(counts.iter().all(|count| *count > 300));
}

#[test]
fn statistics_are_those_of_the_record() {
    for_each_run(|seed, _, _, run| {
        let record = record(run, true, 0);
        let mut tally = Tally::new(&run.task_set, 5);
        run.events.iter().for_each(|event| tally.take(event));
        for (dag, model) in (0..).map(DagId).zip(run.task_set.dags()) {
            let complete = record.numbered(dag).filter_map(|(job, times)| {
                let is_complete =
                    matches!(times.outcome, Some(JobOutcome::Met | JobOutcome::Missed));
                let response_ns = record.completion_ns(dag, job)? - times.release_ns?;
                is_complete.then_some(response_ns)
            });
            let responses: Vec<u64> = complete.collect();
            let counted = &tally.dag(dag).response_time;
            assert_eq!(counted.count(), responses.len() as u64, "seed {seed}");
            let longest = responses.iter().max().copied().unwrap_or(0);
            assert_eq!(counted.max(), longest, "seed {seed}");
            for (subtask, _) in (0..).map(sched_dag::SubtaskId).zip(model.subtasks()) {
                let instance = |job| Instance { dag, job, subtask };
                let times = || {
                    record.numbered(dag).filter_map(|(job, _)| {
                        let instance = instance(job);
                        record.instance(instance).map(|times| (instance, *times))
                    })
                };
                let statistics = tally.subtask(run.task_set.vertex(instance(0)));
                let joins = times().filter_map(|(instance, times)| {
                    let join_ns = record.join_ns(&run.task_set, instance)?;
                    Some(times.start_ns? - join_ns)
                });
                let joins: Vec<u64> = joins.collect();
                let counted = &statistics.join_latency;
                assert_eq!(counted.count(), joins.len() as u64, "seed {seed}");
                assert_eq!(counted.max(), joins.into_iter().max().unwrap_or(0));
                let finished = times().filter(|(_, times)| times.finish_ns.is_some());
                assert_eq!(statistics.execution_time.count(), finished.count() as u64);
            }
        }
    });
}
