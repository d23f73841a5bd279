//! Shared states become precedence: which edges, and that they suffice.

mod support;

use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, LatestSpec, Policy, StateSpec, StateUser,
    SubtaskId, SubtaskSpec, TopicPort, verify,
};
use support::random::Random;
use support::{PREEMPTIVE, commit, cores, dag};

fn state(name: &str, users: &[(usize, bool)]) -> StateSpec {
    let user = |&(subtask, updates)| StateUser { subtask, updates };
    StateSpec {
        name: name.to_owned(),
        users: users.iter().map(user).collect(),
    }
}

fn with_state(edges: &[(usize, usize)], subtasks: usize, users: &[(usize, bool)]) -> DagSpec {
    DagSpec {
        in_flight: None,
        states: vec![state("pose", users)],
        ..dag(10, 10, 3, &vec![0; subtasks], edges)
    }
}

/// Returns the edges that the state adds, as pairs.
fn added(spec: DagSpec) -> Vec<(u32, u32)> {
    let task_set = commit(&[spec], PREEMPTIVE);
    let precedences = task_set.dag(DagId(0)).state_precedences().iter();
    precedences
        .map(|edge| (edge.earlier.0, edge.later.0))
        .collect()
}

const FORK: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];

#[test]
fn without_a_path_the_order_of_registration_decides() {
    let spec = with_state(&FORK, 5, &[(3, true), (1, true), (2, true)]);
    assert_eq!(added(spec), [(1, 2), (2, 3)]);
}

#[test]
fn readers_stay_parallel() {
    let spec = with_state(
        &FORK,
        5,
        &[(0, true), (1, false), (2, false), (3, false), (4, true)],
    );
    assert_eq!(
        added(spec),
        [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)]
    );
}

#[test]
fn a_path_against_the_order_of_registration_wins() {
    // 1 is after 2 by a path; a state that both update must not close a cycle.
    let edges = [(0, 2), (2, 1), (1, 3)];
    let spec = with_state(&edges, 4, &[(1, true), (2, true)]);
    assert_eq!(added(spec), [(2, 1)]);
}

#[test]
fn a_subtask_registered_first_may_still_come_later_by_its_predecessors() {
    // 0 -> 3 -> 1 -> 4 and 0 -> 2 -> 4: one core would run 0, 2, 3, 1, 4.
    let edges = [(0, 3), (3, 1), (1, 4), (0, 2), (2, 4)];
    let spec = with_state(&edges, 5, &[(1, true), (2, true)]);
    assert_eq!(added(spec), [(2, 1)]);
}

#[test]
fn several_states_never_close_a_cycle() {
    for seed in 0..500 {
        let mut random = Random::new(seed);
        let subtasks = random.between(2, 12);
        let count = usize::try_from(subtasks).expect("small");
        // Edges along a random order, so that registration is not topological.
        let mut order: Vec<usize> = (0..count).collect();
        for last in (1..count).rev() {
            order.swap(last, random.below(last + 1));
        }
        let mut edges = Vec::new();
        for later in 1..count {
            for earlier in 0..later {
                if random.chance(25) {
                    edges.push((order[earlier], order[later]));
                }
            }
        }
        let states = (0..3).map(|number| {
            let mut users = vec![(0, true)];
            for subtask in 1..count {
                if random.chance(50) {
                    users.push((subtask, random.chance(50)));
                }
            }
            state(&format!("state {number}"), &users)
        });
        let spec = DagSpec {
            states: states.collect(),
            in_flight: Some(1),
            ..dag(1000, 1000, 3, &vec![0; count], &edges)
        };
        let states = spec.states.clone();
        let task_set = commit(std::slice::from_ref(&spec), cores(4));
        let model = task_set.dag(DagId(0));
        assert_eq!(model.topological_order().len(), count, "seed {seed}");
        // Any two conflicting users are ordered by a path.
        let mut reaches = vec![vec![false; count]; count];
        for &subtask in model.topological_order().iter().rev() {
            for &successor in model.successors(subtask) {
                let after = reaches[successor.index()].clone();
                let of = &mut reaches[subtask.index()];
                of[successor.index()] = true;
                of.iter_mut()
                    .zip(after)
                    .for_each(|(mine, theirs)| *mine |= theirs);
            }
        }
        for state in &states {
            for (position, one) in state.users.iter().enumerate() {
                for other in &state.users[position + 1..] {
                    let ordered =
                        reaches[one.subtask][other.subtask] || reaches[other.subtask][one.subtask];
                    let conflict = one.updates || other.updates;
                    assert!(ordered || !conflict, "seed {seed}: {one:?}, {other:?}");
                }
            }
        }
    }
}

#[test]
fn one_user_alone_costs_nothing() {
    let spec = DagSpec {
        in_flight: Some(3),
        ..with_state(&FORK, 5, &[(2, true)])
    };
    assert_eq!(added(spec), []);
}

#[test]
fn a_shared_state_allows_one_job_in_flight() {
    let spec = with_state(&FORK, 5, &[(1, true), (2, false)]);
    assert_eq!(commit(&[spec], PREEMPTIVE).dag(DagId(0)).in_flight(), 1);
}

/// The edge is no way around the paper's shape: parts that only share a state are
/// still parts.
#[test]
fn sharing_a_state_does_not_connect() {
    let spec = with_state(&[], 2, &[(0, true), (1, true)]);
    let options = CommitOptions::new(Policy::StaticPriority, 1);
    let rejected = verify(&[spec], &options).expect_err("two parts");
    let codes: Vec<&str> = rejected
        .faults()
        .iter()
        .map(sched_dag::Fault::code)
        .collect();
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
        period_ns: Some(10),
        relative_deadline_ns: Some(10),
        subtasks: vec![writer],
        latest: vec![LatestSpec { port, samplers: 1 }],
        ..DagSpec::default()
    };
    let options = CommitOptions::new(Policy::StaticPriority, 1)
        .with_construction(ConstructionPolicy::paper());
    let verified = verify(&[spec], &options).expect("it is right");
    assert_eq!(verified.warnings, []);
    assert_eq!(verified.task_set.dag(DagId(0)).sinks(), [SubtaskId(0)]);
}
