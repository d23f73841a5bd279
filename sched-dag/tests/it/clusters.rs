//! Clusters: each runs as if it were alone on a machine of its own, and is bounded as such.
//!
//! More or other sets: `CLUSTERED=100000 CLUSTER_SEED=7 cargo test -p sched-dag --test
//! rules clusters`.

use std::sync::Arc;

use random::Random;
use sched_dag::analysis::{
    self, AnalysisResult, AnalysisSettings, NotProvenReason, Overheads, SchedulabilityTest,
};
use sched_dag::journal::Event;
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{
    ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, CoreId, DagId, DagSpec, Instance,
    Policy, Preemption, SchedulerOptions, SubtaskId, TaskSet, verify,
};

use crate::support::set::{self, Set};
use crate::support::{self, Script, Spec, TWO_CORES, number};

fn commit(specs: &[DagSpec], options: SchedulerOptions, clusters: CoreDivision) -> Arc<TaskSet> {
    let options = CommitOptions::new(options.policy, options.cores)
        .with_construction(ConstructionPolicy::any_graph())
        .with_clusters(clusters);
    Arc::new(verify(specs, &options).expect("sets are right").task_set)
}

/// Runs a set, of which DAG k is that of the original with the number `originals[k]`, and returns
/// what happens, by the original's numbers.
fn events(set: &Set, task_set: &Arc<TaskSet>, cores: u32, originals: &[u32]) -> Vec<Event> {
    let original = |dag: DagId| DagId(originals[dag.index()]);
    let of = |it: Instance| Instance {
        dag: original(it.dag),
        ..it
    };
    let options = SchedulerOptions {
        cores,
        ..set.options
    };
    let script = Script::new(|it| set.execution_ns(of(it))).failing(|it| set.fails(of(it)));
    let run = script.run(VirtualTime::new(task_set, options));
    assert!(run.driver.is_finished());
    let named = |event: &Event| Event {
        dag: original(event.dag),
        ..*event
    };
    run.events.iter().map(named).collect()
}

/// Pins subtasks of a set, and in clusters of several cores leaves the last one to what is pinned
/// to it, if they are to be in groups.
fn state_cores(specs: &mut [DagSpec], sizes: &[u32], has_groups: bool, random: &mut Random) {
    // What keeps its core delays what is pinned to that, so which core it has would matter.
    let mut all = specs.iter().flat_map(|spec| &spec.subtasks);
    if all.any(|subtask| subtask.non_preemptive) {
        return;
    }
    for spec in specs {
        let cores = spec.cluster.map_or(1, |cluster| sizes[cluster.index()]);
        for subtask in &mut spec.subtasks {
            subtask.core = random.chance(40).then(|| random.within(0..=cores - 1));
        }
        if has_groups && cores > 1 {
            spec.affinity = (0..cores - 1).collect();
        }
    }
}

#[test]
fn a_cluster_runs_as_if_it_were_alone() {
    let (count, first_seed) = (number("CLUSTERED", 400), number("CLUSTER_SEED", 1));
    println!("{count} sets from seed {first_seed} on");
    for seed in first_seed..first_seed + count {
        let mut random = Random::new(seed);
        let mut set = set::draw(&mut random, set::Overruns::Often);
        let sizes: Vec<u32> = (0..random.within(1..=3))
            .map(|_| random.within(1..=3))
            .collect();
        set.options.cores = sizes.iter().sum();
        let mut specs = set.specs();
        for spec in &mut specs {
            let cluster = u32::try_from(random.index(sizes.len())).expect("few clusters");
            spec.cluster = Some(ClusterId(cluster));
        }
        if set.options.preemption == Preemption::Enabled {
            state_cores(&mut specs, &sizes, seed % 2 == 0, &mut random);
        }
        let all: Vec<u32> = (0..).take(specs.len()).collect();
        let divided = commit(&specs, set.options, CoreDivision::Of(sizes.clone()));
        let together = events(&set, &divided, set.options.cores, &all);
        let mut first = 0;
        for (cluster, &cores) in (0..).map(ClusterId).zip(&sizes) {
            let is_here = |dag: &u32| specs[*dag as usize].cluster == Some(cluster);
            let here: Vec<u32> = all.iter().copied().filter(is_here).collect();
            let alone = match &here[..] {
                [] => Vec::new(),
                _ => {
                    let spec = |dag: &u32| specs[*dag as usize].clone();
                    let apart = |spec: DagSpec| spec.with(|spec| spec.cluster = None);
                    let specs: Vec<DagSpec> = here.iter().map(spec).map(apart).collect();
                    let task_set = commit(&specs, set.options, CoreDivision::Undivided);
                    events(&set, &task_set, cores, &here)
                }
            };
            let same = |event: Event, first: u32| {
                assert!((first..first + cores).contains(&event.core.0), "{event:?}");
                if let Some(of) = event.instance().filter(|_| event.what.is_of_machine()) {
                    let core = event.core.0 - first;
                    let affinity = &specs[of.dag.index()].affinity;
                    let is_right = match specs[of.dag.index()].subtasks[of.subtask.index()].core {
                        Some(pin) => pin == core,
                        None => affinity.is_empty() || affinity.contains(&core),
                    };
                    assert!(is_right, "{event:?}");
                }
                // Which of them it is may depend on the driver's calls.
                let core = CoreId(0);
                Event { core, ..event }
            };
            let events = together.iter().filter(|event| is_here(&event.dag.0));
            let events: Vec<Event> = events.map(|event| same(*event, first)).collect();
            let alone: Vec<Event> = alone.iter().map(|event| same(*event, 0)).collect();
            assert_eq!(events, alone, "seed {seed}, {cluster:?}");
            first += cores;
        }
    }
}

/// Two DAGs of 6 ms each in 10, and one of unknown length.
fn three() -> [DagSpec; 3] {
    [(0, Some(6)), (1, Some(6)), (1, None)].map(|(cluster, wcet_ns)| {
        let mut dag = support::dag(10, 10, 1, &[1], &[]);
        dag.subtasks[0].wcet_ns = wcet_ns;
        dag.cluster = Some(ClusterId(cluster));
        dag
    })
}

const EDF: SchedulerOptions = SchedulerOptions {
    policy: Policy::Edf,
    ..TWO_CORES
};

/// Analyses DAGs in two clusters of one core.
fn answer(specs: &[DagSpec]) -> (AnalysisResult, String) {
    let settings = AnalysisSettings {
        policy: EDF.policy,
        preemption: EDF.preemption,
        cores: EDF.cores,
        overheads: Overheads::default(),
    };
    let task_set = commit(specs, EDF, CoreDivision::Of(vec![1, 1]));
    let answer = analysis::answer(&task_set, &settings);
    (answer, analysis::witness(&task_set, &settings))
}

#[test]
fn each_cluster_is_analysed_on_its_own_cores() {
    let (one_each, _) = answer(&three()[..2]);
    let bounds = one_each.bounds.iter().map(|bound| bound.unwrap().bound_ns);
    assert_eq!(bounds.collect::<Vec<_>>(), [6, 6]);
    assert_eq!(one_each.sinks_ns, [[Some(6)], [Some(6)]]);
    // Both on one core: that is too much for it, and the other cluster's core is no help.
    let (one_for_both, _) = answer(&[three()[1].clone(), three()[1].clone()]);
    assert!(
        one_for_both
            .reasons
            .contains(&Some(NotProvenReason::Overload))
    );
}

#[test]
fn what_is_unknown_in_one_cluster_weakens_nothing_in_another() {
    let (answer, witness) = answer(&three());
    assert_eq!(answer.bounds[0].unwrap().bound_ns, 6);
    assert_eq!(
        answer.reasons[1],
        Some(NotProvenReason::DelayedBy { dag: DagId(2) })
    );
    let unknown = answer.first_failing.unwrap();
    assert_eq!(unknown.dag, DagId(2));
    assert!(
        matches!(unknown.reason, NotProvenReason::Unknown(_)),
        "{unknown:?}"
    );
    let begins = |line: &&str| line.starts_with("machine 1 ");
    assert_eq!(witness.lines().filter(begins).count(), 2, "one for each");
}

#[test]
fn bounds_of_pinned_subtasks_need_an_order_on_cores_of_their_own() {
    let mut specs = three();
    specs[2].subtasks[0].wcet_ns = Some(1);
    let before = answer(&specs).0;
    assert!(before.is_proven());
    // On its core it goes first, whatever the deadlines.
    specs[2].subtasks[0].core = Some(0);
    let owned = answer(&specs).0;
    let bounds = owned.bounds.iter().map(|bound| {
        let bound = bound.as_ref().unwrap();
        (bound.bound_ns, bound.test)
    });
    let (first, other) = (before.bounds[0].unwrap(), before.bounds[1].unwrap());
    let expected = [
        (first.bound_ns, first.test),
        (other.bound_ns, SchedulabilityTest::Member),
        (1, SchedulabilityTest::Owner),
    ];
    assert_eq!(bounds.collect::<Vec<_>>(), expected);
    // No edge says which of two goes first.
    let again = specs[2].subtasks[0].clone();
    specs[2].subtasks.push(again);
    let (unordered, _) = answer(&specs);
    let pinned = |subtask| NotProvenReason::Pinned {
        subtask: SubtaskId(subtask),
    };
    let behind = NotProvenReason::DelayedBy { dag: DagId(2) };
    assert_eq!(unordered.reasons, [None, Some(behind), Some(pinned(1))]);
    assert_eq!(unordered.first_failing.unwrap().dag, DagId(2));
    // Of two DAGs on one core neither has it to itself, and each counts for the other.
    specs[2].subtasks.pop();
    specs[1].subtasks[0].core = Some(0);
    let (shared, _) = answer(&specs);
    let beside = SchedulabilityTest::BesidePins;
    let tests = shared.bounds.iter().map(|bound| bound.unwrap().test);
    assert_eq!(tests.collect::<Vec<_>>(), [first.test, beside, beside]);
}

#[test]
fn an_undivided_machine_is_cluster_0() {
    let mut dag = support::dag(10, 10, 1, &[1], &[]);
    dag.cluster = Some(ClusterId(0));
    let task_set = commit(&[dag], EDF, CoreDivision::Undivided);
    assert!(!task_set.is_divided());
    assert_eq!(task_set.clusters().collect::<Vec<_>>(), [ClusterId(0)]);
    assert_eq!(task_set.cores_of(ClusterId(0), 2), 0..2);
    assert_eq!(task_set.dag(DagId(0)).subtask(SubtaskId(0)).priority().0, 1);
}
