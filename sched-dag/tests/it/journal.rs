//! The law on journals: of random sets, whole ones and those that have lost their oldest events,
//! and of one whose faults are survived. (The tests of `trace` tell each breach by hand.)
//!
//! More or other sets: `JOURNALS=100000 JOURNAL_SEED=7 cargo test -p sched-dag --test
//! rules journal`.

use random::Random;
use sched_dag::journal::{Event, EventKind};
use sched_dag::law::{
    Histogram, InstanceRecord, JobRecord, JudgeOptions, RunRecord, RunTally, Violation,
    dispatch_violations, violations,
};
use sched_dag::{CoreId, DagId, Instance, JobOutcome, SubtaskId};

use crate::support::set::{self, Overruns, Set};
use crate::support::{self, PREEMPTIVE, Run, Script, Spec, commit, driver, number};

fn for_each_run(mut with: impl FnMut(u64, &mut Random, &Set, &Run)) {
    let (count, first_seed) = (number("JOURNALS", 1_000), number("JOURNAL_SEED", 1));
    println!("{count} sets from seed {first_seed} on");
    for seed in first_seed..first_seed + count {
        let mut random = Random::new(seed);
        let overruns = random.one_of(&[Overruns::Often, Overruns::Never]);
        let set = set::draw(&mut random, overruns);
        let driver = driver(&set.specs, set.options);
        let run = Script::new(|instance| set.execution_ns(instance)).run(driver);
        with(seed, &mut random, &set, &run);
    }
}

/// The options for a run in virtual time that has gone on to its end.
const COMPLETE: JudgeOptions = JudgeOptions {
    is_complete: true,
    ..JudgeOptions::EXACT
};

/// Returns every breach of every rule.
fn judged(run: &Run, set: &Set, terms: JudgeOptions, events: &[Event]) -> Vec<Violation> {
    let events = events.iter().copied();
    let mut found = violations(&run.task_set, terms, events.clone());
    let of_dispatch = dispatch_violations(&run.task_set, &set.options, terms, events);
    found.extend(of_dispatch);
    found
}

fn record(run: &Run, is_whole: bool, from: usize) -> RunRecord {
    let events = run.events[from..].iter().copied();
    RunRecord::of_events(&run.task_set, is_whole, events).expect("it fits")
}

#[test]
fn the_latest_events_have_the_latest_jobs_whole() {
    let mut kept = 0;
    for_each_run(|seed, random, set, run| {
        let whole = record(run, true, 0);
        let from = random.index(run.events.len());
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
        let terms = JudgeOptions {
            is_whole: false,
            ..COMPLETE
        };
        assert_eq!(judged(run, set, terms, &rest), [], "seed {seed}");
    });
    println!("{kept} jobs of DAGs that lost others");
    assert!(kept > 100);
}

/// Kinds of events that no run may lack.
const NEEDED: [EventKind; 9] = [
    EventKind::Released,
    EventKind::Ready,
    EventKind::Cancelled,
    EventKind::Start,
    EventKind::Suspend,
    EventKind::Resume,
    EventKind::Finish,
    EventKind::Completed,
    EventKind::Missed,
];

#[test]
fn a_journal_with_one_event_changed_breaks_a_rule() {
    // Deleted, doubled, later, earlier, swapped with the next of its instance, on another core, and
    // followed by a miss that is made up.
    let mut counts = [0; 7];
    let few = number("JOURNALS", 80);
    for_each_run(|seed, _, set, run| {
        if seed > few {
            return;
        }
        let mut objects = |kind: usize, event: &Event, change: &dyn Fn(&mut Vec<Event>)| {
            let mut events = run.events.clone();
            change(&mut events);
            events.sort_by_key(|event| event.time_ns);
            let found = judged(run, set, COMPLETE, &events);
            assert!(!found.is_empty(), "seed {seed}: change {kind} of {event:?}");
            counts[kind] += 1;
        };
        let events = run.events.iter().enumerate();
        for (place, event) in events.filter(|(_, event)| NEEDED.contains(&event.what)) {
            let is_next = |other: &Event| other.instance() == event.instance();
            let next = run.events[place + 1..].iter().position(is_next);
            let next = next.filter(|_| event.instance().is_some());
            let next = next.map(|next| place + 1 + next);
            let next_is = |what: EventKind| next.is_some_and(|next| run.events[next].what == what);
            let has = |what: &[EventKind]| {
                let mut all = run.events.iter();
                let of = |event: &Event| (event.dag, event.job);
                all.any(|other| of(other) == of(event) && what.contains(&other.what))
            };
            let is_optional = match event.what {
                // An instance may be cancelled without having been ready.
                EventKind::Ready => next_is(EventKind::Cancelled),
                EventKind::Missed => has(&[EventKind::Aborted, EventKind::Skipped]),
                _ => false,
            };
            if !is_optional {
                objects(0, event, &|events| _ = events.remove(place));
            }
            objects(1, event, &|events| events.insert(place, *event));
            // How long an instance executes, no rule says.
            let is_fixed = !matches!(event.what, EventKind::Cancelled | EventKind::Finish);
            if is_fixed && !(is_optional && event.what == EventKind::Missed) {
                objects(2, event, &|events| events[place].time_ns += 1);
                if event.time_ns > 0 {
                    objects(3, event, &|events| events[place].time_ns -= 1);
                }
            }
            if let Some(next) = next {
                objects(4, event, &|events| {
                    (events[place].what, events[next].what) = (events[next].what, event.what);
                });
            }
            if event.what == EventKind::Finish && set.options.cores > 1 {
                let core = CoreId((event.core.0 + 1) % set.options.cores);
                objects(5, event, &|events| events[place].core = core);
            }
            let is_late = has(&[EventKind::Missed, EventKind::Aborted]);
            if event.what == EventKind::Completed && !is_late {
                let what = EventKind::Missed;
                objects(6, event, &|events| events.push(Event { what, ..*event }));
            }
        }
    });
    println!("deleted, doubled, later, earlier, swapped, elsewhere, made up: {counts:?}");
    assert!(counts.iter().all(|count| *count > 300));
}

#[test]
fn a_whole_journal_keeps_all_rules_and_its_record_has_the_statistics() {
    for_each_run(|seed, _, set, run| {
        assert_eq!(judged(run, set, COMPLETE, &run.events), [], "seed {seed}");
        let record = record(run, true, 0);
        let mut tally = RunTally::new(&run.task_set, 5);
        run.events.iter().for_each(|event| tally.add(event));
        let same = |counted: &Histogram, times: Vec<u64>| {
            let counted = counted.distribution();
            assert_eq!(counted.count(), times.len() as u64, "seed {seed}");
            let longest = times.into_iter().max().unwrap_or(0);
            assert_eq!(counted.max(), longest, "seed {seed}");
        };
        for (dag, model) in (0..).map(DagId).zip(run.task_set.dags()) {
            let of_complete = |(job, times): (u64, &JobRecord)| {
                let is_complete =
                    matches!(times.outcome, Some(JobOutcome::Met | JobOutcome::Missed));
                let response_ns = record.completion_ns(dag, job)? - times.release_ns?;
                is_complete.then_some(response_ns)
            };
            let responses = record.numbered(dag).filter_map(of_complete);
            same(&tally.dag(dag).response_time, responses.collect());
            for (subtask, _) in (0..).map(SubtaskId).zip(model.subtasks()) {
                let of_job = |(job, _)| {
                    let instance = Instance { dag, job, subtask };
                    Some((instance, *record.instance(instance)?))
                };
                let times: Vec<_> = record.numbered(dag).filter_map(of_job).collect();
                let vertex = run.task_set.vertex(Instance::new(dag, 0, subtask));
                let statistics = tally.subtask(vertex);
                let join_ns = |&(instance, times): &(Instance, InstanceRecord)| {
                    let join_ns = record.join_ns(&run.task_set, instance)?;
                    Some(times.start_ns? - join_ns)
                };
                same(
                    &statistics.join_latency,
                    times.iter().filter_map(join_ns).collect(),
                );
                let finished = times.iter().filter(|(_, times)| times.finish_ns.is_some());
                let executions = statistics.execution_time.distribution();
                assert_eq!(executions.count(), finished.count() as u64);
            }
        }
    });
}

#[test]
fn the_law_accepts_what_is_survived_and_nothing_else() {
    let chain = || support::dag(10, 10, 9, &[0, 0, 0], &[(0, 1), (1, 2)]);
    let right = chain().surviving(1, 3, 3);
    let run = Script::new(3)
        .failing(|instance| instance.job % 3 == 2 && instance.subtask.0 == 1)
        .run(driver(std::slice::from_ref(&right), PREEMPTIVE));
    let breaches = |spec, events: &[Event]| {
        let events = events.iter().copied();
        violations(&commit(&[spec], PREEMPTIVE), JudgeOptions::EXACT, events)
    };
    assert_eq!(breaches(right.clone(), &run.events), []);
    let record = record(&run, true, 0);
    let failed = record.jobs(DagId(0)).iter().filter(|job| job.has_failed);
    assert_eq!(failed.count(), 3);
    // Held against models that survive less.
    let less = [
        (chain().surviving(1, 4, 3), 2),
        (chain().surviving(1, 3, 2), 1),
        (chain(), 3),
    ];
    for (spec, count) in less {
        let found = breaches(spec, &run.events);
        assert_eq!(found.len(), count, "{found:?}");
        let words = found[0].to_string();
        let said = "although its DAG does not survive that fault";
        assert!(words.contains(said), "{words}");
    }
    // A subtask goes on without having failed.
    let mut lie = run.events.clone();
    lie.retain(|event| event.what != EventKind::Ended);
    assert!(!breaches(right, &lie).is_empty());
}
