//! A journal as text: an instant a line, its time and then each event as its word, DAG, job and
//! perhaps subtask. All are on core 0.

use sched_dag::journal::Event;
use sched_dag::{CoreId, DagId, SubtaskId};

pub(crate) fn events(text: &str) -> Vec<Event> {
    let instant = |line: &str| {
        let (time_ns, events) = line.trim().split_once(' ').expect("a time");
        let time_ns = time_ns.parse().expect("a time");
        let event = |event: &str| {
            let words: Vec<&str> = event.split(' ').collect();
            let number = |at: usize| words[at].parse().expect("a number");
            Event {
                time_ns,
                what: words[0].parse().expect("an event's word"),
                core: CoreId(0),
                dag: DagId(number(1)),
                job: number(2).into(),
                subtask: (words.len() > 3).then(|| SubtaskId(number(3))),
            }
        };
        events.split(", ").map(event).collect::<Vec<_>>()
    };
    text.lines().flat_map(instant).collect()
}
