//! The shell with a run that is none: what it asks of it, whatever the platform.

use std::cell::RefCell;
use std::collections::VecDeque;

use sched_dag::{CommitOptions, DagSpec, Policy, SubtaskSpec, TopicPort, verify};

use super::topics::Topics;
use super::*;

thread_local! {
    static TYPED: RefCell<VecDeque<u8>> = const { RefCell::new(VecDeque::new()) };
    static ASKED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

fn asked(what: String) {
    ASKED.with_borrow_mut(|asked| asked.push(what));
}

struct NoRun;

static TOPICS: Topics<NoRun> = Topics::new();

impl LiveRun for NoRun {
    fn task_set() -> Option<Arc<TaskSet>> {
        let ports = Vec::from([TopicPort {
            topic: "points".into(),
            type_id: core::any::TypeId::of::<u32>(),
            type_name: "u32",
            can_fan_out: true,
        }]);
        let subtask = |inputs, outputs| SubtaskSpec {
            inputs,
            outputs,
            ..SubtaskSpec::default()
        };
        let dag = DagSpec {
            name: "lidar".into(),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: vec![subtask(vec![], ports.clone()), subtask(ports, vec![])],
            ..DagSpec::default()
        };
        let verified = verify(&[dag], &CommitOptions::new(Policy::Edf, 1));
        Some(Arc::new(verified.expect("it is sound").task_set))
    }

    fn snapshot(_: DagId) -> Option<Snapshot> {
        None
    }

    fn control(dag: DagId, change: fn(DagId) -> Request) {
        asked(format!("{:?}", change(dag)));
    }

    fn now_ns() -> u64 {
        asked("the time".into());
        1_000_000_000
    }

    fn clusters() -> usize {
        1
    }

    fn with_journal<R>(_: usize, _: impl FnOnce(&mut Journal) -> R) -> Option<R> {
        None
    }

    fn receive() -> Option<u8> {
        TYPED.with_borrow_mut(VecDeque::pop_front)
    }

    fn shut_down() {
        asked("shut down".into());
    }

    fn watch(topic: Option<&str>) -> bool {
        asked(format!("watch {topic:?}"));
        true
    }

    fn take_seen(_: &mut [u8]) -> Option<Seen> {
        None
    }

    fn extra() -> Extra {
        [None, Some(&TOPICS)]
    }
}

#[test]
fn what_is_typed_is_asked_of_the_run_and_no_function_is_told_the_time_for_it() {
    static TOLD: fass::Clock = || panic!("it is told to the function that is interrupted");
    fass::set_clock(&TOLD);
    let typed =
        b"stop lidar\nstart 0\nstop radar\necho points\necho off\nhz points\n\x03shutdown\n";
    TYPED.with_borrow_mut(|bytes| bytes.extend(typed));
    let mut session = Session::<NoRun>::new(false);
    while session.slice() {}
    let expected = [
        "Pause(DagId(0))",
        "Resume(DagId(0))",
        "watch Some(\"points\")",
        "the time",
        "watch None",
        "shut down",
        "shut down",
    ];
    assert_eq!(ASKED.take(), expected);
}
