//! What the law says of faults that cost a job.

mod support;

use sched_dag::DagId;
use sched_dag::journal::What;
use sched_dag::law::{self, Terms};
use sched_dag::virtual_time::VirtualTime;
use support::{PREEMPTIVE, Script, Spec, commit, dag, scheduler};

#[test]
fn the_law_accepts_what_is_survived_and_nothing_else() {
    let chain = || dag(10, 10, 9, &[0, 0, 0], &[(0, 1), (1, 2)]);
    let breaches = |spec, events: &mut dyn Iterator<Item = _>| {
        let events: Vec<_> = events.collect();
        law::violations(&commit(&[spec], PREEMPTIVE), Terms::EXACT, events)
    };
    let right = chain().surviving(1, 3, 3);
    let run = Script::new(3)
        .failing(|instance| instance.job % 3 == 2 && instance.subtask.0 == 1)
        .run(VirtualTime::new(scheduler(
            std::slice::from_ref(&right),
            PREEMPTIVE,
        )));
    let events = || run.events.iter().copied();
    assert_eq!(breaches(right.clone(), &mut events()), []);
    let record = law::Record::of_events(&run.task_set, true, events()).expect("it is short");
    let failed = record.jobs(DagId(0)).iter().filter(|job| job.has_failed);
    assert_eq!(failed.count(), 3);
    // Held against models that survive less.
    let less = [
        (chain().surviving(1, 4, 3), 2),
        (chain().surviving(1, 3, 2), 1),
        (chain(), 3),
    ];
    for (spec, count) in less {
        let found = breaches(spec, &mut events());
        assert_eq!(found.len(), count, "{found:?}");
        let words = found[0].to_string();
        assert!(
            words.contains("although its DAG does not survive that fault"),
            "{words}"
        );
    }
    // A subtask goes on without having failed.
    let lie = breaches(
        right,
        &mut events().filter(|event| event.what != What::Ended),
    );
    assert!(!lie.is_empty());
}
