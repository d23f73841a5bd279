//! Worked examples: values from the papers, and schedules that show them.

use sched_dag::analysis::{
    InterferenceBound, NotProvenReason, Task, covers, intra_task, multi_path, multi_path_edf,
    multi_path_fp, width,
};
use sched_dag::{DagSpec, Instance, Policy, Preemption, Priority};

use super::simulate::{commit, observe, responses, spec};
use super::{DIAMOND, FP, answered, bounds, settings};
use crate::support::Script;

const NON_PREEMPTIVE_EDF: (Policy, Preemption) = (Policy::Edf, Preemption::Disabled);

fn fork_join() -> Task {
    let edges: Vec<(usize, usize)> = (1..5).flat_map(|v| [(0, v), (v, 5)]).collect();
    Task::new(50, 50, vec![2, 6, 5, 4, 3, 1], &edges).expect("well formed")
}

/// Returns when one job alone finishes, in registration order.
fn makespan(spec: &DagSpec, cores: u32, preemption: Preemption) -> u64 {
    let task_set = commit(std::slice::from_ref(spec), Policy::StaticPriority, cores);
    let subtasks = task_set.dags()[0].subtasks();
    let platform = (Policy::StaticPriority, preemption, cores);
    responses(&task_set, platform, 900, |instance| {
        subtasks[instance.subtask.index()].wcet_ns().expect("given")
    })[0]
}

#[test]
fn e1_and_e11_one_fork_join() {
    let task = fork_join();
    assert_eq!((task.length_ns(), task.volume_ns()), (9, 21));
    assert_eq!(covers(&task, 9), [9, 14, 18, 21]);
    assert_eq!(
        [1, 2, 3, 4].map(|m| multi_path(&task, m)),
        [21, 15, 12, 9].map(Some)
    );
    assert_eq!(task.bottom_levels(), [9, 7, 6, 5, 4, 1]);
    assert_eq!(multi_path(&task, 0), None);
    let none = Task::new(9, 9, vec![], &[]).unwrap();
    assert_eq!([0, 2].map(|m| multi_path(&none, m)), [None, Some(0)]);
}

#[test]
fn e2_e3_and_e13_two_dags() {
    let forks = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];
    let one = Task::new(10, 10, vec![1, 2, 2, 1], &DIAMOND).unwrap();
    let two = Task::new(20, 20, vec![1, 3, 3, 3, 1], &forks).unwrap();
    let tasks = [&one, &two];
    for clip in [
        InterferenceBound::Window,
        InterferenceBound::Waiting,
        InterferenceBound::Chains,
    ] {
        assert_eq!(multi_path_fp(&tasks, 2, clip), Some(vec![4, 14]));
    }
    // The commit, which comes from below, has bounds under EDF, too. Alone, the first DAG has two
    // paths that cover it: 4, where Graham's bound is 5.
    assert_eq!(multi_path_edf(&tasks, 2, InterferenceBound::Chains), None);
    let specs = [
        spec(10, 10, &[1, 2, 2, 1], &DIAMOND, 0),
        spec(20, 20, &[1, 3, 3, 3, 1], &forks, 1),
    ];
    for (policy, expected) in [(Policy::StaticPriority, [4, 14]), (Policy::Edf, [8, 14])] {
        let kind = (policy, Preemption::Enabled);
        assert_eq!(
            bounds(&answered(&specs, &settings(kind, 2))),
            expected.map(Some),
            "{policy:?}"
        );
    }
    assert_eq!(width(&fork_join()), Some(4));
}

/// Deadlines limit what counts, also those beyond periods, as long as no jobs overlap.
#[test]
fn deadlines_beyond_periods_limit_what_counts() {
    let specs = [spec(10, 10, &[4, 4], &[], 0), spec(20, 29, &[9, 9], &[], 1)];
    let answer = answered(&specs, &settings((Policy::Edf, Preemption::Enabled), 2));
    assert_eq!(bounds(&answer), [Some(4), Some(17)]);
}

#[test]
fn e5_intra_task_priorities() {
    let edges = [
        (0, 1),
        (0, 3),
        (0, 4),
        (1, 2),
        (1, 4),
        (2, 7),
        (3, 4),
        (4, 5),
        (4, 6),
        (4, 7),
        (5, 7),
        (6, 7),
    ];
    let wcets = [5, 16, 15, 1, 10, 17, 7, 11];
    let task = Task::new(1000, 1000, wcets.to_vec(), &edges).unwrap();
    let observed = |order: &[usize]| {
        let mut spec = spec(1000, 1000, &wcets, &edges, 0);
        for (rank, &subtask) in (0..).zip(order) {
            spec.subtasks[subtask].priority = Some(Priority(rank));
        }
        makespan(&spec, 2, Preemption::Enabled)
    };
    let given = [0, 1, 2, 3, 4, 6, 5, 7];
    assert_eq!(
        (observed(&given), intra_task(&task, &given, 2)),
        (64, Some(70))
    );
    assert_eq!(multi_path(&task, 2), Some(66));
    let assigned = [0, 1, 3, 4, 5, 2, 6, 7];
    assert_eq!(
        (observed(&assigned), intra_task(&task, &assigned, 2)),
        (59, Some(65))
    );
}

#[test]
fn e12_graham_anomalies() {
    let wcets = [3, 2, 2, 2, 4, 4, 4, 4, 9];
    let edges = [(0, 8), (3, 4), (3, 5), (3, 6), (3, 7)];
    let finish = |wcets: &[u64], edges: &[(usize, usize)], cores| {
        let spec = spec(1000, 1000, wcets, edges, 0);
        let finish = makespan(&spec, cores, Preemption::Disabled);
        let task = Task::new(1000, 1000, wcets.to_vec(), edges).unwrap();
        assert!(Some(finish) <= multi_path(&task, cores));
        finish
    };
    assert_eq!(finish(&wcets, &edges, 3), 12);
    assert_eq!(finish(&wcets.map(|wcet| wcet - 1), &edges, 3), 13);
    assert_eq!(finish(&wcets, &edges, 4), 15);
    assert_eq!(finish(&wcets, &[(0, 8), (3, 6), (3, 7)], 3), 16);
}

#[test]
fn a_dag_near_its_bound_slowly_leaves_a_more_urgent_one_its_own() {
    // The urgent one takes four fifths of a core: the other's equations grow by 10 us a step,
    // for 30 s and more.
    let edges = [(1, 3), (1, 2), (3, 0), (3, 4)];
    let urgent = spec(50_000, 60_000, &[10_000; 5], &edges, 0);
    // What is next to the path keeps the second form with its excess.
    let path = [10_000_000_000, 10_000_000_000, 10_000_000_000, 1];
    let slow = spec(
        150_000_000_000,
        150_000_000_000,
        &path,
        &[(0, 1), (1, 2)],
        1,
    );
    let answer = answered(&[urgent, slow], &settings(FP, 2));
    assert_eq!(bounds(&answer)[0], Some(40_000));
    assert_eq!(answer.reasons, [None, Some(NotProvenReason::Limit)]);
}

#[test]
fn under_edf_what_has_a_shorter_deadline_may_block_too() {
    // The second DAG may be released during the chain and be due after it, and keep its cores
    // when the chain goes on: 6 + 6 at its first subtask and 6 at the second, besides two jobs of 12
    // that are due before it, makes 42 on two cores. It waits for 3 + 2, next to 6 and a chain that
    // is due before it: 16 on two cores.
    let chain = spec(40, 40, &[2, 3], &[(0, 1)], 0);
    let short = spec(20, 20, &[6, 6], &[], 1);
    let answer = answered(&[chain, short], &settings(NON_PREEMPTIVE_EDF, 2));
    assert_eq!(bounds(&answer), [Some(26), Some(14)]);
}

/// A job may be older by more than a period, and due no later in all of its sinks: released at 0 and
/// 170, the sink of the second job waits for what is due at 220 of the first, from 208 to 218.
#[test]
fn a_sink_waits_for_an_older_job_that_came_long_before() {
    let mut two_sinks = spec(100, 220, &[10, 39], &[], 0);
    two_sinks.subtasks[0].relative_deadline_ns = Some(50);
    let long = spec(10_000, 210, &[159], &[], 0);
    let edf = settings((Policy::Edf, Preemption::Enabled), 1);
    assert_eq!(answered(&[two_sinks, long], &edf).sinks_ns[0][0], Some(48));
}

#[test]
fn a_sink_waits_for_what_is_due_later_and_keeps_its_core() {
    let mut quick = spec(100, 100, &[1, 1], &[], 0);
    quick.subtasks[0].relative_deadline_ns = Some(10);
    quick.offset_ns = 1;
    let slow = spec(1000, 1000, &[50], &[], 0);
    let specs = [quick.clone(), slow.clone()];
    let settings = settings(NON_PREEMPTIVE_EDF, 1);
    assert_eq!(answered(&specs, &settings).bounds[0], None);
    // With time to wait for it, that is what the bounds count.
    quick.subtasks[0].relative_deadline_ns = Some(60);
    let specs = [quick, slow];
    let answer = answered(&specs, &settings);
    assert_eq!(bounds(&answer)[0], Some(52));
    assert_eq!(answer.sinks_ns[0], [Some(51), Some(52)]);
    let (policy, preemption) = NON_PREEMPTIVE_EDF;
    let task_set = commit(&specs, policy, 1);
    let script = Script::new(|instance: Instance| [1, 50, 50][instance.dag.index()]);
    let observed = observe(&task_set, (policy, preemption, 1), 1000, script);
    assert_eq!(observed.subtasks[0], [50, 51]);
}
