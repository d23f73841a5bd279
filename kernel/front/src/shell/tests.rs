//! The shell with a run that is none: what it asks of it, whatever the platform.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::time::Duration;

use fass::Occupation;
use fass::platform::{LaunchError, Plan, Platform, RunConfig};
use sched_dag::{CommitOptions, DagSpec, Policy, SubtaskSpec, TopicPort, verify};

use super::topics::TopicCommands;
use super::*;

thread_local! {
    static TYPED: RefCell<VecDeque<u8>> = const { RefCell::new(VecDeque::new()) };
    static ASKED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

fn asked(what: String) {
    ASKED.with_borrow_mut(|asked| asked.push(what));
}

struct NoRun;

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

    fn control(dag: DagId, change: fn(DagId) -> Request) {
        asked(format!("{:?}", change(dag)));
    }

    fn now_ns() -> u64 {
        asked("the time".into());
        1_000_000_000
    }

    fn ask(_: usize, _: SchedulerQuery<'_>) -> Option<u64> {
        None
    }

    fn receive() -> Option<u8> {
        TYPED.with_borrow_mut(VecDeque::pop_front)
    }

    fn watch(topic: Option<&str>) -> bool {
        asked(format!("watch {topic:?}"));
        true
    }

    fn take_seen(_: &mut [u8]) -> Option<WatchedValue> {
        None
    }
}

/// A platform that is not to be asked for the time.
struct Untold;

impl Platform for Untold {
    fn terms(&self) -> RunConfig {
        RunConfig::of_cores(1)
    }

    fn now_ns(&self) -> u64 {
        panic!("it is told to the function that is interrupted")
    }

    fn execute_for(&self, _: Duration, _: Occupation) {}

    fn launch(&self, _: Plan) -> Result<(), LaunchError> {
        Ok(())
    }
}

#[test]
fn what_is_typed_is_asked_of_the_run_and_no_function_is_told_the_time_for_it() {
    fass::platform::install(&Untold).expect("it is the only one");
    TOPICS.set(Box::leak(Box::new(TopicCommands::<NoRun>::new())));
    let typed =
        b"pause lidar\nresume 0\npause radar\necho points\necho off\nhz points\n\x03shutdown\n";
    TYPED.with_borrow_mut(|bytes| bytes.extend(typed));
    let mut session = ShellSession::<NoRun>::new(false);
    while session.slice() {}
    let expected = [
        "Pause(DagId(0))",
        "Resume(DagId(0))",
        "watch Some(\"points\")",
        "the time",
        "watch None",
        "Close(DagId(0))",
        "Close(DagId(0))",
    ];
    assert_eq!(ASKED.take(), expected);
}

/// Returns what a line is refused with, and nothing if it is not.
fn refusal(line: &str) -> Option<String> {
    refusal_of(line, &NoRun::task_set().expect("it is there"))
}

fn refusal_of(line: &str, task_set: &TaskSet) -> Option<String> {
    let mut refusal = None;
    answer::<NoRun>(line, task_set, &mut |why| refusal = Some(why.to_string()));
    ASKED.take();
    refusal
}

#[test]
fn each_command_of_the_help_is_one() {
    for (line, _) in HELP.iter().filter(|(line, _)| *line != "trace on") {
        let line = line.replace(['[', ']'], "").replace("DAG", "lidar");
        assert_eq!(refusal(&line), None, "{line}");
    }
    assert_eq!(refusal("stats"), None);
    assert_eq!(refusal("stats  0"), None);
    let no_room = "there is no room for events; boot without `trace_events=0`";
    assert_eq!(refusal("trace on").as_deref(), Some(no_room));
}

#[test]
fn a_set_with_a_certificate_is_not_paused() {
    let mut task_set = Arc::unwrap_or_clone(NoRun::task_set().expect("it is there"));
    task_set.fix("certificate v1 of 0\n");
    for line in ["pause lidar", "resume 0"] {
        let refused = refusal_of(line, &task_set).expect("it is refused");
        assert!(refused.starts_with("a certificate fixes the set"));
    }
    assert_eq!(refusal_of("dags", &task_set), None);
}

#[test]
fn what_is_no_command_is_told_the_commands() {
    for (line, expected) in [
        ("trace", "`trace` wants `on` or `off`"),
        ("help me", "`help` wants nothing after it"),
        (
            "pause",
            "`pause` wants the name or the number of a DAG; `dags` lists them",
        ),
        (
            "stats left eye",
            "there is no dag `left eye`; `dags` lists them",
        ),
    ] {
        assert_eq!(refusal(line).as_deref(), Some(expected));
    }
    assert_eq!(
        no_command("stpo", core::iter::empty).to_string(),
        "`stpo` is no command; there are help, dags, stats [DAG], pause DAG, resume DAG, \
         trace off, trace on, shutdown"
    );
    assert!(refusal("stpo lidar").is_some_and(|why| why.starts_with("`stpo` is no command")));
}
