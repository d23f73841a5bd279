//! Chains on a journal by hand: which there are, and their times as they are computed by hand.

use sched_dag::chains::{Chain, ChainLatencies, SampledEdge, SampledJobs};
use sched_dag::{
    Activation, CommitOptions, ConstructionPolicy, DagId, DagSpec, FaultLimit, Instance, OnFault,
    Policy, SubtaskId, SubtaskSpec, TaskSet, verify,
};

use crate::support::events::events;

/// `camera` (period 100, `expose` before `detect`), `plan` (period 60), `motor` (period 20):
/// `plan` samples what `detect` writes, `motor/drive` what `plan` writes.
fn model() -> (TaskSet, [SampledEdge; 2]) {
    let dags = [
        dag("camera", 100, &["expose", "detect"]),
        dag("plan", 60, &["plan"]),
        dag("motor", 20, &["drive"]),
    ];
    let options = CommitOptions::new(Policy::Edf, 2)
        .with_construction(ConstructionPolicy::any_graph())
        .with_instance_limit(u32::MAX);
    let samplings = [
        sampling(place(0, 1), place(1, 0)),
        sampling(place(1, 0), place(2, 0)),
    ];
    let verified = verify(&dags, &options).expect("a sound set");
    (verified.task_set, samplings)
}

fn dag(name: &str, period_ns: u64, subtasks: &[&str]) -> DagSpec {
    let subtask = |name: &&str| SubtaskSpec {
        name: (*name).into(),
        wcet_ns: Some(10),
        ..SubtaskSpec::default()
    };
    DagSpec {
        name: name.into(),
        period_ns: Some(period_ns),
        relative_deadline_ns: Some(period_ns),
        subtasks: subtasks.iter().map(subtask).collect(),
        edges: (1..subtasks.len()).map(|at| (at - 1, at)).collect(),
        ..DagSpec::default()
    }
}

fn sampling(writer: (DagId, SubtaskId), reader: (DagId, SubtaskId)) -> SampledEdge {
    SampledEdge { writer, reader }
}

fn place(dag: u32, subtask: u32) -> (DagId, SubtaskId) {
    (DagId(dag), SubtaskId(subtask))
}

/// `detect` finishes at 30 and 145; `plan` starts at 5, 65, 125,
/// 185 and so finds nothing, job 0, job 0 and job 1; it finishes at 15, 75, 135 and 195.
const RUN: &str = "\
0 released 0 0, released 1 0, released 2 0
5 start 1 0 0
10 start 2 0 0
12 finish 2 0 0
15 finish 1 0 0
20 finish 0 0 0
30 finish 0 0 1
60 released 1 1, released 2 3
62 start 2 3 0
64 finish 2 3 0
65 start 1 1 0
75 finish 1 1 0, start 2 4 0
80 released 2 4
82 finish 2 4 0
100 released 0 1, released 2 5
101 start 2 5 0
103 finish 2 5 0
120 released 1 2
125 start 1 2 0
135 finish 1 2 0
140 released 2 7
141 start 2 7 0
143 finish 2 7 0
145 finish 0 1 1
180 released 1 3, released 2 9
185 start 1 3 0
195 finish 1 3 0
200 released 0 2, released 2 10
201 start 2 10 0
204 finish 2 10 0";

#[test]
fn the_times_of_a_small_run_are_those_computed_by_hand() {
    let (task_set, samplings) = model();
    let chains = Chain::all(&task_set, &samplings);
    let [chain] = &chains[..] else {
        panic!("{chains:?}");
    };
    let names = chain.names(&task_set);
    let names: Vec<String> = names.map(|name| name.to_string()).collect();
    let expected = ["camera/expose", "camera/detect", "plan/plan", "motor/drive"];
    assert_eq!(names, expected);
    let latencies = chain.latencies(&task_set, events(RUN).iter().copied());
    let expected = ChainLatencies {
        // The outputs at 12 and 64 go back to no image: `plan` 0 had found none. Those at 82, 103
        // and 143 go back to the image of 0, that at 204 to the one of 100.
        output_age_ns: vec![82, 103, 143, 104],
        // Each up to the next output.
        data_age_ns: vec![103, 143, 204],
        // What happens just after 0 is in the image of 100, and first seen in the output of 204.
        reaction_ns: vec![204],
    };
    assert_eq!(latencies, expected);
    let sampled = SampledJobs::new(&samplings, events(RUN).into_iter());
    let plan = |job| Instance::new(DagId(1), job, SubtaskId(0));
    let images = [0, 1, 2, 3].map(|job| sampled.job(plan(job), place(0, 1)));
    assert_eq!(images, [None, Some(0), Some(0), Some(1)]);
}

#[test]
fn what_finishes_at_the_very_start_counts_by_its_place_in_the_journal() {
    let (task_set, samplings) = model();
    let swapped = RUN.replace("finish 1 1 0, start 2 4 0", "start 2 4 0, finish 1 1 0");
    let chain = &Chain::all(&task_set, &samplings)[0];
    let latencies = chain.latencies(&task_set, events(&swapped).into_iter());
    assert_eq!(latencies.output_age_ns, [103, 143, 104]);
}

#[test]
fn outputs_behind_the_end_of_a_dag_do_not_count() {
    let (task_set, samplings) = model();
    // The camera has one job: the next one would have been due at 100.
    let mut ended = events(RUN);
    ended.retain(|event| event.dag != DagId(0) || event.job == 0);
    let chain = &Chain::all(&task_set, &samplings)[0];
    let latencies = chain.latencies(&task_set, ended.into_iter());
    assert_eq!(latencies.output_age_ns, [82]);
    assert!(latencies.data_age_ns.is_empty() && latencies.reaction_ns.is_empty());
}

#[test]
fn pauses_do_not_count_and_jobs_that_faults_may_take_do() {
    let (task_set, samplings) = model();
    let chain = &Chain::all(&task_set, &samplings)[0];
    // The camera is paused before its job of 100, and resumed for that of 200.
    let paused = RUN.replace("100 released 0 1, ", "99 off 0 0\n100 skipped 0 1, ");
    let paused = paused.replace("145 finish 0 1 1", "145 on 0 0");
    let latencies = chain.latencies(&task_set, events(&paused).into_iter());
    // `plan` has the image of before the pause up to its job of 180, and that goes on to the motor.
    assert_eq!(latencies.output_age_ns, [82]);
    // The motor is paused between its outputs of 103 and 143.
    let paused = RUN.replace("120 released", "119 off 2 0\n120 skipped 2 6, released");
    let paused = paused.replace("140 released", "140 on 2 0, released");
    let latencies = chain.latencies(&task_set, events(&paused).into_iter());
    assert_eq!(latencies.output_age_ns, [82, 103, 143, 104]);
    assert_eq!(latencies.data_age_ns, [103, 204]);
    // Of 3 jobs 2 may be lost, with a window of 2 all that may be in all.
    for (window, period_ns) in [(3, 300), (2, 600)] {
        let mut spec = dag("camera", 100, &["expose"]);
        spec.on_fault = OnFault::DropJob(FaultLimit::new(2, window, 5));
        let dags = [spec, dag("motor", 20, &["drive"])];
        let task_set = verify(&dags, &CommitOptions::new(Policy::Edf, 2))
            .unwrap()
            .task_set;
        let chain = &Chain::all(&task_set, &[sampling(place(0, 0), place(1, 0))])[0];
        let age = chain.output_age_bound_ns(&task_set, &[Some(50), Some(5)]);
        assert_eq!(age, Ok(period_ns + 50 + 5));
    }
}

#[test]
fn bounds_are_sums_and_name_the_dag_that_has_none() {
    let (task_set, samplings) = model();
    let chain = &Chain::all(&task_set, &samplings)[0];
    let responses_ns = [Some(50), Some(20), Some(5)];
    let age = chain.output_age_bound_ns(&task_set, &responses_ns);
    let reaction = chain.reaction_bound_ns(&task_set, &responses_ns);
    assert_eq!((age, reaction), (Ok(150 + 80 + 5), Ok(150 + 80 + 25)));
    let lacking = [Some(50), None, Some(5)];
    assert_eq!(chain.reaction_bound_ns(&task_set, &lacking), Err(DagId(1)));
}

#[test]
fn a_link_adds_its_stated_delay_and_a_periodic_receiver_its_period() {
    let bound = |activation, period_ns| {
        let mut behind = dag("act", period_ns, &["hear"]);
        behind.activation = activation;
        let options = CommitOptions::new(Policy::Edf, 2);
        let task_set = verify(&[dag("sense", 60, &["tell"]), behind], &options)
            .unwrap()
            .task_set;
        let edge = sampling(place(0, 0), place(1, 0));
        let chain = &Chain::all(&task_set, &[edge])[0];
        chain.output_age_bound_over_links_ns(&task_set, &[Some(30), Some(9)], &[(edge, 500)])
    };
    assert_eq!(bound(Activation::Sporadic, 59), Ok(30 + 500 + 9));
    // With a clock that is a bit slower its jobs would be rarer than messages.
    assert_eq!(bound(Activation::Sporadic, 60), Err(DagId(1)));
    assert_eq!(bound(Activation::Periodic, 61), Ok(30 + 500 + 61 + 9));
}

#[test]
fn chains_between_two_subtasks_are_found_by_name_and_pass_no_dag_twice() {
    let (task_set, mut samplings) = model();
    let find = |name| Chain::find(&task_set, name).expect(name);
    assert_eq!(find("camera/1"), place(0, 1));
    assert_eq!(Chain::find(&task_set, "camera/focus"), None);
    let ways = |samplings: &[SampledEdge], from, to| {
        Chain::between(&task_set, samplings, find(from), find(to)).len()
    };
    assert_eq!(ways(&samplings, "camera/detect", "motor/drive"), 1);
    assert_eq!(ways(&samplings, "camera/expose", "camera/detect"), 1);
    assert_eq!(ways(&samplings, "motor/drive", "camera/detect"), 0);
    // The plan also depends on what the motor does: a circle of DAGs.
    samplings[0] = sampling(place(2, 0), place(1, 0));
    assert_eq!(ways(&samplings, "motor/drive", "plan/plan"), 1);
    assert_eq!(Chain::all(&task_set, &samplings), []);
}
