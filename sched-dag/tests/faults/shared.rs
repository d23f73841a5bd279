//! Faults of what subtasks share: states and latest values.

use sched_dag::{DagSpec, LatestSpec, StateSpec, StateUser, TopicPort};

use crate::{assert_fault, port};

fn user(subtask: usize, updates: bool) -> StateUser {
    StateUser { subtask, updates }
}

fn pose(users: &[StateUser]) -> StateSpec {
    StateSpec {
        name: "pose".to_owned(),
        users: users.to_vec(),
    }
}

fn latest(port: TopicPort, samplers: usize) -> LatestSpec {
    LatestSpec { port, samplers }
}

#[test]
fn two_states_of_one_name() {
    assert_fault(
        |spec| spec.states = vec![pose(&[user(0, true)]), pose(&[user(1, true)])],
        "duplicate_state",
        "dag `drive` has two states named `pose`; rename one",
    );
}

#[test]
fn a_state_without_user() {
    assert_fault(
        |spec| spec.states = vec![pose(&[])],
        "unused_state",
        "no subtask uses state `pose` of dag `drive`; register a user or drop the state",
    );
}

#[test]
fn a_state_that_is_only_read() {
    assert_fault(
        |spec| spec.states = vec![pose(&[user(1, false), user(2, false)])],
        "state_never_updated",
        "subtask `fuse` of dag `drive` reads state `pose`, which no subtask updates; register \
         an updater or give the function a constant",
    );
}

#[test]
fn a_state_used_twice_by_a_subtask() {
    assert_fault(
        |spec| spec.states = vec![pose(&[user(1, true), user(1, false)])],
        "state_used_twice",
        "subtask `fuse` of dag `drive` uses state `pose` twice; state its strongest use once",
    );
}

#[test]
fn a_shared_state_of_overlapping_jobs() {
    let share = |spec: &mut DagSpec| {
        spec.in_flight = Some(2);
        spec.states = vec![pose(&[user(0, true), user(1, false)])];
    };
    assert_fault(
        share,
        "state_over_jobs",
        "dag `drive` allows 2 jobs in flight, and state `pose` is shared by subtask `camera`, \
         subtask `fuse`; allow 1 job in flight, or let one subtask own the state",
    );
}

#[test]
fn the_latest_value_of_no_topic() {
    assert_fault(
        |spec| spec.latest = vec![latest(port::<u32>("obstakle"), 1)],
        "latest_unwritten",
        "the latest value of topic `obstakle` of dag `drive` is asked for, and no subtask writes \
         that topic; did you mean `obstacle`? If not, register a writer or correct the name",
    );
}

#[test]
fn the_latest_value_as_another_type() {
    assert_fault(
        |spec| spec.latest = vec![latest(port::<f64>("image"), 1)],
        "latest_type_mismatch",
        "topic `image` of dag `drive` is written as `u32` by subtask `camera` and its latest \
         value read as `f64`; make both the same type",
    );
}

#[test]
fn a_latest_value_without_reader() {
    assert_fault(
        |spec| spec.latest = vec![latest(port::<u32>("image"), 0)],
        "latest_unread",
        "the latest value of topic `image` of dag `drive` is used by no subtask; let one sample \
         it or drop it",
    );
}

#[test]
fn the_latest_value_of_a_moved_message_beside_its_reader() {
    let move_it = |spec: &mut DagSpec| {
        spec.subtasks[0].outputs[0].can_fan_out = false;
        spec.subtasks[1].inputs[0].can_fan_out = false;
        spec.latest = vec![latest(port::<u32>("image"), 1)];
    };
    assert_fault(
        move_it,
        "latest_of_moved",
        "topic `image` of dag `drive` carries `u32`, which can only be moved, and has 2 readers, \
         those of its latest value included; keep one reader or send a type that can be shared",
    );
}
