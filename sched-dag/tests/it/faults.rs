//! Faults of a commit that differ from those of `docs/errors.md`, which shows one of each code
//! with its text: other limits, other offenders, several at once. And warnings.

use std::any::{TypeId, type_name};

use sched_dag::{
    CommitOptions, ConstructionPolicy, CountLimit, DagFault, DagSpec, LatestSpec, Policy, Priority,
    RejectedDags, SubtaskId, SubtaskSpec, TopicPort, verify,
};

const DRIVE: &str = "drive: > camera > image; image > fuse > obstacle; obstacle > brake >";

/// Returns a DAG from its name and its subtasks, each as `inputs > name > outputs`.
fn dag(text: &str) -> DagSpec {
    let (name, subtasks) = text.split_once(':').expect("a name");
    let subtask = |text: &str| {
        let parts: Vec<&str> = text.split('>').collect();
        let [inputs, name, outputs] = parts[..] else {
            panic!("`{text}` is no subtask")
        };
        let ports = |topics: &str| topics.split_whitespace().map(port::<u32>).collect();
        SubtaskSpec {
            name: name.trim().to_owned(),
            inputs: ports(inputs),
            outputs: ports(outputs),
            ..SubtaskSpec::default()
        }
    };
    let subtasks = subtasks.split(';').filter(|text| !text.is_empty());
    DagSpec {
        name: name.to_owned(),
        period_ns: Some(100),
        relative_deadline_ns: Some(50),
        subtasks: subtasks.map(subtask).collect(),
        ..DagSpec::default()
    }
}

fn port<T: 'static>(topic: &str) -> TopicPort {
    TopicPort {
        topic: topic.to_owned(),
        type_id: TypeId::of::<T>(),
        type_name: type_name::<T>(),
        can_fan_out: true,
    }
}

/// Returns `DRIVE` after a change.
fn drive(change: impl FnOnce(&mut DagSpec)) -> DagSpec {
    let mut spec = dag(DRIVE);
    change(&mut spec);
    spec
}

fn with_edges(text: &str, edges: &[(usize, usize)]) -> DagSpec {
    DagSpec {
        edges: edges.to_vec(),
        ..dag(text)
    }
}

fn options() -> CommitOptions {
    CommitOptions::new(Policy::StaticPriority, 2)
}

struct Refused(RejectedDags);

#[track_caller]
fn refused(specs: &[DagSpec]) -> Refused {
    Refused(verify(specs, &options()).expect_err("the commit has a fault"))
}

impl Refused {
    /// Compares all faults with the lines of a text, each the code and what the fault names, with
    /// `...` between.
    #[track_caller]
    fn must_say(&self, expected: &str) {
        let faults = self.0.faults().iter();
        let said = faults.map(|fault| format!("{} {fault}", fault.code()));
        let said: Vec<String> = said.collect();
        assert_eq!(said.len(), expected.lines().count(), "{said:#?}");
        for (text, expected) in said.iter().zip(expected.lines()) {
            let (code, named) = expected.trim().split_once(' ').expect("a code and names");
            let mut rest = text.strip_prefix(code).unwrap_or_default();
            for part in named.split("...") {
                let behind = rest.split_once(part).map(|(_, behind)| behind);
                rest = behind.unwrap_or_else(|| panic!("`{text}` does not say {expected}"));
            }
        }
    }
}

#[test]
fn a_right_dag_has_neither_fault_nor_warning() {
    let right = drive(|spec| {
        let limits = [Some(16 << 10), None, Some(1 << 20)];
        let subtasks = spec.subtasks.iter_mut().zip(limits);
        subtasks.for_each(|(subtask, bytes)| subtask.stack_bytes = bytes);
        spec.subtasks[1].wcet_ns = Some(50);
    });
    let verified = verify(&[right], &options()).expect("no fault");
    assert_eq!(verified.warnings, []);
    let dag = &verified.task_set.dags()[0];
    let said = (dag.name(), dag.in_flight(), dag.jobs());
    assert_eq!(said, ("drive", 2, None));
    let [camera, fuse, brake] = [0, 1, 2].map(SubtaskId);
    assert_eq!((dag.sources(), dag.sinks()), (&[camera][..], &[brake][..]));
    assert_eq!(dag.topological_order(), [camera, fuse, brake]);
}

#[test]
fn numbers_have_limits() {
    let stacks = drive(|spec| {
        let beyond = [0, (16 << 10) - 1, (1 << 20) + 1];
        let subtasks = spec.subtasks.iter_mut().zip(beyond);
        subtasks.for_each(|(subtask, bytes)| subtask.stack_bytes = Some(bytes));
    });
    refused(&[stacks]).must_say(
        "stack_out_of_range `camera`...0 bytes...16384 to 1048576
         stack_out_of_range `fuse`...16383 bytes
         stack_out_of_range `brake`...1048577 bytes",
    );
    refused(&[drive(|spec| spec.affinity = vec![3, 2, 0, 3])])
        .must_say("affinity_out_of_range dag `drive`...core 3...has 2, counted from 0");
    for (wcet_ns, deadline_ns, said) in [
        (20_000_001, 20_000_000, "`fuse`...20.000001ms...20ms"),
        (51, 50, "`fuse`...51ns...50ns"),
    ] {
        let long = drive(|spec| {
            spec.subtasks[1].wcet_ns = Some(wcet_ns);
            spec.relative_deadline_ns = Some(deadline_ns);
        });
        refused(&[long]).must_say(&format!("wcet_exceeds_deadline {said}"));
    }
    let last = drive(|spec| spec.jobs = Some(u64::MAX / 100 + 1));
    refused(&[last]).must_say("time_overflow last job of dag `drive`...; lower the number of jobs");
    let sum = drive(|spec| {
        spec.period_ns = Some(u64::MAX / 4);
        spec.relative_deadline_ns = Some(u64::MAX - 1);
        spec.jobs = Some(1);
        let subtasks = spec.subtasks.iter_mut();
        subtasks.for_each(|subtask| subtask.wcet_ns = Some(u64::MAX / 2));
    });
    refused(&[sum]).must_say("time_overflow sum of the WCETs of dag `drive`");
    let many = drive(|spec| {
        spec.period_ns = Some(1);
        spec.relative_deadline_ns = Some(u64::MAX / 2);
    });
    refused(&[many]).must_say(
        "too_many_instances 27670116110564327424...`drive` with 9223372036854775808 jobs",
    );
    let wide = |count: usize| {
        let topics: Vec<String> = (0..count).map(|index| format!("t{index}")).collect();
        let topics = topics.join(" ");
        dag(&format!("wide: > from > {topics}; {topics} > to >"))
    };
    assert!(verify(&[wide(16)], &options()).is_ok());
    refused(&[wide(17)]).must_say(
        "arity_too_large `from`...17 outputs
         arity_too_large `to`...17 inputs",
    );
}

#[test]
fn a_stated_wcet_is_within_the_budget() {
    let mut budgeted = drive(|spec| spec.subtasks[1].wcet_ns = Some(41));
    budgeted.subtasks[1].budget_ns = Some(40);
    refused(&[budgeted.clone()]).must_say("wcet_exceeds_budget `fuse`...41ns...40ns");
    budgeted.subtasks[1].wcet_margin_percent = Some(20);
    assert!(verify(&[budgeted], &CommitOptions::new(Policy::Edf, 2)).is_ok());
}

#[test]
fn of_many_faults_the_first_are_told_and_the_others_counted() {
    // What subtasks would have stated is not missed, and a DAG without name has a number.
    refused(&[DagSpec::default()]).must_say("no_subtasks dag 0 has");
    let many: Vec<DagSpec> = (0..10_000).map(|n| dag(&format!("d{n}:"))).collect();
    let Refused(rejected) = refused(&many);
    assert_eq!(rejected.faults().len(), 10_000);
    let text = rejected.to_string();
    assert_eq!(text.lines().count(), 21);
    assert!(text.contains("dag `d19` has no subtask"), "{text}");
    assert!(text.ends_with("\nand 9980 more faults"), "{text}");
}

#[test]
fn cycles_are_printed_hop_by_hop_one_a_knot_and_the_shortest() {
    // A source, a ring of four with a short cut of three, and a pair.
    let ring = [(0, 4), (4, 3), (3, 2), (2, 1), (1, 4), (2, 4)];
    let pair = [(2, 5), (5, 6), (6, 5), (6, 7)];
    let subtasks = "knots: >a>; >b>; >c>; >d>; >e>; >f>; >g>; >h>";
    refused(&[with_edges(subtasks, &[&ring[..], &pair].concat())]).must_say(
        "cycle : subtask `c` -> subtask `e` -> subtask `d` -> subtask `c`;
         cycle : subtask `f` -> subtask `g` -> subtask `f`;",
    );
    refused(&[with_edges(": >>; >>", &[(0, 1), (1, 0)])]).must_say(
        "no_source dag 0
         no_sink dag 0
         cycle dag 0...: subtask 0 -> subtask 1 -> subtask 0;",
    );
    let to_itself = with_edges(DRIVE, &[(1, 1)]);
    refused(&[to_itself]).must_say("self_edge subtask `fuse` of dag `drive`");
}

#[test]
fn groups_of_cores_are_disjoint() {
    let on = |name: &str, affinity: &[u32]| {
        let mut spec = dag(&format!("{name}: > from > of-{name}; of-{name} > to >"));
        spec.affinity = affinity.to_vec();
        spec
    };
    let four = CommitOptions::new(Policy::Edf, 4);
    let said = |specs: &[DagSpec]| Refused(verify(specs, &four).expect_err("they overlap"));
    said(&[on("a", &[1, 0]), on("b", &[3, 1]), on("c", &[0, 1, 1])])
        .must_say("affinities_overlap dag `a` and dag `b` share core 1 and not all others");
    // One that states none has all.
    said(&[on("a", &[]), on("b", &[3]), on("c", &[2])]).must_say(
        "affinities_overlap dag `a` and dag `b` share core 3
         affinities_overlap dag `a` and dag `c` share core 2",
    );
    said(&[on("a", &[2]), on("b", &[])])
        .must_say("affinities_overlap dag `a` and dag `b` share core 2");
    let affinity = |specs: &[DagSpec]| -> Vec<Vec<u32>> {
        let verified = verify(specs, &four).expect("they are disjoint").task_set;
        let dags = verified.dags().iter();
        dags.map(|dag| dag.affinity().to_vec()).collect()
    };
    // All that are stated are as none.
    let all = [on("a", &[3, 1, 0, 2, 0]), on("b", &[])];
    assert_eq!(affinity(&all), [vec![], vec![]]);
    let apart = [on("a", &[2, 0, 2]), on("b", &[1]), on("c", &[0, 2])];
    assert_eq!(affinity(&apart), [vec![0, 2], vec![1], vec![0, 2]]);
}

#[test]
fn a_policy_or_another_scheduler_may_accept_it() {
    let parts = [dag(&format!("{DRIVE}; > logger >"))];
    refused(&parts).must_say(
        "not_connected 2 parts...subtask `camera`...subtask `logger`
         several_sources 2 sources: subtask `camera`, subtask `logger`
         several_sinks 2 sinks: subtask `brake`, subtask `logger`",
    );
    let relaxed = options().with_construction(ConstructionPolicy::any_graph());
    assert_eq!(verify(&parts, &relaxed).expect("any graph").warnings, []);

    let writers = [dag(&DRIVE.replace("> image;", "> image obstacle;"))];
    refused(&writers).must_say("several_writers `obstacle`...: subtask `camera`, subtask `fuse`;");
    let several = ConstructionPolicy {
        writers: CountLimit::Several,
        ..ConstructionPolicy::paper()
    };
    let verified = verify(&writers, &options().with_construction(several)).expect("allowed");
    let brake = SubtaskId(2);
    assert_eq!(verified.task_set.dags()[0].predecessors(brake).len(), 2);

    let partly = [drive(|spec| spec.subtasks[1].priority = Some(Priority(3)))];
    refused(&partly)
        .must_say("priorities_partly_given 2 without priority: subtask `camera`, subtask `brake`;");
    assert!(verify(&partly, &CommitOptions::new(Policy::Edf, 1)).is_ok());
}

#[test]
fn a_misspelt_topic_is_reported_from_both_sides_and_makes_no_second_sink() {
    refused(&[dag(&DRIVE.replace("> obstacle;", "> obstacel;"))]).must_say(
        "unwritten_topic `brake`...`obstacle`...did you mean `obstacel`? If not,
         not_connected 2 parts
         unread_topic `fuse`...`obstacel`...did you mean `obstacle`? If not,",
    );
    let port = port::<u32>("obstakle");
    let latest = drive(|spec| spec.latest = vec![LatestSpec { port, samplers: 1 }]);
    refused(&[latest]).must_say("latest_unwritten `obstakle`...did you mean `obstacle`? If not,");
}

#[test]
fn a_second_sink_that_writes_a_misspelt_topic_is_asked_what_it_means() {
    let sinks = ConstructionPolicy {
        sinks: CountLimit::Several,
        ..ConstructionPolicy::paper()
    };
    let log = dag(&format!("{DRIVE}; image > log > obstakle"));
    let verified = verify(&[log], &options().with_construction(sinks)).expect("a warning");
    let text = verified.warnings[0].to_string();
    assert!(
        text.contains("`obstakle`, which no subtask reads; did you mean `obstacle`? If not, drop"),
        "{text}"
    );
}

#[test]
fn a_topic_that_would_be_another_fault_or_is_of_another_dag_is_not_suggested() {
    let other = "park: > sonar > near; near near1 > stop >";
    for (misspelt, topic) in [
        // `fuse` reads `image` already, and so cannot mean it again.
        (DRIVE.replace("image >", "image image2 >"), "`image2`"),
        // `image` has its writer.
        (DRIVE.replace("> obstacle", "> obstacle imagf"), "`imagf`"),
        // `near` and `near1` are of another DAG.
        (DRIVE.replace("obstacle >", "obstacle nera >"), "`nera`"),
        (DRIVE.replace("> obstacle", "> obstacle near2"), "`near2`"),
    ] {
        let text = refused(&[dag(&misspelt), dag(other)]).0.to_string();
        let is_suggested = text.contains("did you mean");
        assert!(text.contains(topic) && !is_suggested, "{text}");
    }
}

#[test]
fn of_many_misspelt_topics_those_that_are_told_get_a_suggestion() {
    let pair = |number: u32| format!("; start >> topic-{number:03}; topci-{number:03} >>");
    let pairs: String = (0..25).map(pair).collect();
    let Refused(rejected) = refused(&[dag(&format!("many: > from > start{pairs}"))]);
    let is_asked = |fault: &DagFault| fault.to_string().contains("did you mean `topic-0");
    let asked: Vec<bool> = rejected.faults().iter().map(is_asked).collect();
    assert_eq!(asked[..20], [true; 20]);
    assert!(!asked[20..].contains(&true));
}

#[test]
fn what_is_suspicious_is_a_warning() {
    let mut odd = dag(&DRIVE.replace("brake >", "brake > force"));
    for (subtask, priority) in odd.subtasks.iter_mut().zip([7, 2, 7]) {
        subtask.priority = Some(Priority(priority));
    }
    odd.subtasks[1].wcet_ns = Some(0);
    let twin = dag("drive: > look > sight; sight > stop >");
    let verified = verify(&[odd, twin], &options()).expect("only warnings");
    let texts: Vec<String> = verified.warnings.iter().map(ToString::to_string).collect();
    let expected = [
        "subtask `fuse` of dag `drive` has a WCET of 0 ns; measure it, or leave the WCET out",
        "priority 7 is given 2 times: to subtask `camera` of dag `drive`, subtask `brake` of dag \
         `drive`; the order of registration decides between them",
        "two DAGs are named `drive` (number 0 and 1); rename one",
        "subtask `brake`, a sink of dag `drive`, writes topic `force`, which no subtask reads; \
         drop the output",
    ];
    assert_eq!(texts, expected);
    let twice = dag(&DRIVE.replace("> image;", "> image image;"));
    refused(&[twice]).must_say("duplicate_topic subtask `camera`...writes topic `image` twice");
}
