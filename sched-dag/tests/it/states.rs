//! Shared states become precedence: which edges, and that they suffice.

use random::Random;
use sched_dag::{
    CommitOptions, DagFault, DagId, DagSpec, LatestSpec, Policy, StateSpec, StateUser, SubtaskId,
    SubtaskSpec, TopicPort, verify,
};

use crate::support::{PREEMPTIVE, commit, dag, shuffled_edges};

/// A state with its users, and whether each updates it.
fn state(name: &str, users: &[(usize, bool)]) -> StateSpec {
    let user = |&(subtask, updates)| StateUser { subtask, updates };
    StateSpec {
        name: name.to_owned(),
        users: users.iter().map(user).collect(),
    }
}

fn with_states(edges: &[(usize, usize)], subtasks: usize, states: Vec<StateSpec>) -> DagSpec {
    DagSpec {
        in_flight: None,
        states,
        ..dag(1000, 1000, 3, &vec![0; subtasks], edges)
    }
}

#[test]
fn users_of_a_state_get_the_edges_that_order_them() {
    let fork = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];
    let update = |subtask| (subtask, true);
    let read = |subtask| (subtask, false);
    for (why, edges, users, added) in [
        (
            "without a path the order of registration decides",
            &fork[..],
            &[update(3), update(1), update(2)][..],
            &[(1, 2), (2, 3)][..],
        ),
        (
            "readers stay parallel",
            &fork,
            &[update(0), read(1), read(2), read(3), update(4)],
            &fork,
        ),
        (
            "a path against the order of registration wins, as a cycle must not close",
            &[(0, 2), (2, 1), (1, 3), (3, 4)],
            &[update(1), update(2)],
            &[(2, 1)],
        ),
        (
            "one registered first may come later by its predecessors: a core runs 0, 2, 3, 1, 4",
            &[(0, 3), (3, 1), (1, 4), (0, 2), (2, 4)],
            &[update(1), update(2)],
            &[(2, 1)],
        ),
        ("one user alone costs nothing", &fork, &[update(2)], &[]),
    ] {
        let spec = with_states(edges, 5, vec![state("pose", users)]);
        let task_set = commit(&[spec], PREEMPTIVE);
        let dag = task_set.dag(DagId(0));
        let found = dag.state_precedences().iter();
        let found: Vec<_> = found
            .map(|it| (it.earlier.index(), it.later.index()))
            .collect();
        assert_eq!(found, added, "{why}");
        assert!(users.len() == 1 || dag.in_flight() == 1, "{why}");
    }
}

#[test]
fn several_states_never_close_a_cycle() {
    for seed in 0..500 {
        let mut random = Random::new(seed);
        let count = 2 + random.index(11);
        // So registration is not topological.
        let edges = shuffled_edges(&mut random, count, 25);
        let states = ["one", "two", "three"].map(|name| {
            let others = (1..count).filter(|_| random.chance(50));
            let others: Vec<usize> = others.collect();
            let others = others
                .into_iter()
                .map(|subtask| (subtask, random.chance(50)));
            let users: Vec<_> = [(0, true)].into_iter().chain(others).collect();
            state(name, &users)
        });
        let spec = with_states(&edges, count, states.to_vec());
        let task_set = commit(&[spec], PREEMPTIVE);
        let model = task_set.dag(DagId(0));
        assert_eq!(model.topological_order().len(), count, "seed {seed}");
        // Any two conflicting users are ordered by a path: a bit for each that one reaches.
        let mut reaches = vec![0_u32; count];
        for &subtask in model.topological_order().iter().rev() {
            for &successor in model.successors(subtask) {
                reaches[subtask.index()] |= 1 << successor.0 | reaches[successor.index()];
            }
        }
        for state in &states {
            for one in &state.users {
                let conflicts = |other: &&StateUser| one.updates || other.updates;
                for other in state.users.iter().filter(conflicts) {
                    let (from, to) = (one.subtask, other.subtask);
                    let is_ordered = reaches[from] >> to & 1 != reaches[to] >> from & 1;
                    assert!(from == to || is_ordered, "seed {seed}: {one:?}, {other:?}");
                }
            }
        }
    }
}

/// The edge is no way around the paper's shape: parts that only share a state are
/// still parts.
#[test]
fn sharing_a_state_does_not_connect() {
    let spec = with_states(&[], 2, vec![state("pose", &[(0, true), (1, true)])]);
    let options = CommitOptions::new(Policy::StaticPriority, 1);
    let rejected = verify(&[spec], &options).expect_err("two parts");
    let codes: Vec<&str> = rejected.faults().iter().map(DagFault::code).collect();
    assert_eq!(codes, ["not_connected", "several_sources", "several_sinks"]);
}

#[test]
fn a_topic_whose_latest_value_is_read_is_not_unread_and_its_writer_may_be_the_sink() {
    let port = TopicPort {
        topic: "pose".to_owned(),
        type_id: std::any::TypeId::of::<u32>(),
        type_name: "u32",
        can_fan_out: true,
    };
    let writer = SubtaskSpec {
        outputs: vec![port.clone()],
        ..SubtaskSpec::default()
    };
    let spec = DagSpec {
        subtasks: vec![writer],
        latest: vec![LatestSpec { port, samplers: 1 }],
        ..dag(10, 10, 1, &[], &[])
    };
    let verified = verify(&[spec], &CommitOptions::new(Policy::Edf, 1)).expect("it is right");
    assert_eq!(verified.warnings, []);
    assert_eq!(verified.task_set.dag(DagId(0)).sinks(), [SubtaskId(0)]);
}
