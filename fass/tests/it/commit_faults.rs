//! Faults that `fass` itself finds, besides one of each code, whose texts `docs/errors.md`
//! shows, and that all faults of all DAGs come at once.

use core::time::Duration;
use std::slice;

use crate::support::{PERIOD, named, panic_message};
use fass::commit::{ConstructionPolicy, CountLimit, finish_create_dags_with};
use fass::shared::Parameter;
use fass::{Dag, create_dag};

/// Commits DAGs that are refused for these reasons: the beginnings of all lines.
#[track_caller]
fn assert_refused(dags: &[Dag], expected: &[&str]) {
    crate::support::install();
    let construction = ConstructionPolicy {
        writers: CountLimit::Several,
        ..ConstructionPolicy::paper()
    };
    let error = finish_create_dags_with(dags, construction).expect_err("the commit is refused");
    let text = error.to_string();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), expected.len(), "{text}");
    for (line, beginning) in lines.iter().zip(expected) {
        assert!(line.starts_with(beginning), "{line}");
    }
}

/// A faultless DAG whose topics carry its name.
fn faultless(name: &str) -> Dag {
    let dag = create_dag();
    dag.name(name);
    dag.register_periodic_subtask(|| (1,), vec![name], PERIOD, named("source"));
    dag.register_sink_subtask(|_: (i32,)| (), vec![name], PERIOD, named("sink"));
    dag
}

#[test]
fn what_is_committed_or_of_another_dag_cannot_be_changed() {
    let dag = faultless("done");
    drop(crate::support::commit(slice::from_ref(&dag)));
    let late = || dag.register_sink_subtask(|()| (), vec![], PERIOD, named("late"));
    assert_eq!(
        panic_message(late),
        "dag `done` is committed and cannot be changed; build a new DAG and commit that"
    );
    let [dag, other] = [(); 2].map(|()| create_dag());
    let [here, there] =
        [&dag, &other].map(|dag| dag.register_untyped_subtask(|_job| (), named("work")));
    let told = panic_message(|| _ = dag.precede(&here, &there));
    assert!(
        told.starts_with("UntypedSubtask(0) is a subtask of another DAG"),
        "{told}"
    );
}

#[test]
fn a_refused_commit_changes_nothing() {
    let dag = create_dag();
    dag.name("unfinished");
    dag.register_periodic_subtask(|| (1,), vec!["number"], PERIOD, named("source"));
    assert_refused(slice::from_ref(&dag), &["dag `unfinished` "]);
    dag.register_sink_subtask(|_: (i32,)| (), vec!["number"], PERIOD, named("sink"));
    crate::support::run_job(&mut crate::support::commit(&[dag]), 0);
}

#[test]
fn all_faults_of_all_dags_come_at_once_and_nothing_else_is_blamed() {
    let done = faultless("done");
    drop(crate::support::commit(slice::from_ref(&done)));
    let names = ["arity", "slow", "types", "writers"];
    let [arity, slow, types, writers] = names.map(|name| create_dag().name(name).clone());
    arity.register_periodic_subtask(|| (1, 2_u8), vec!["number"], PERIOD, named("source"));
    let middle = |(number,): (i32,)| (number,);
    let inputs = vec!["number", "surplus"];
    arity.register_subtask(middle, inputs, vec!["next", "surplus"], named("middle"));
    arity.register_sink_subtask(|_: (i32,)| (), vec!["next"], PERIOD, named("sink"));
    // One more than 64 bits have room for.
    let long = Duration::from_nanos(u64::MAX) + Duration::from_nanos(1);
    slow.offset(long);
    slow.register_periodic_subtask(|| (1,), vec!["late"], long, named("source").wcet(long));
    slow.register_sink_subtask(|_: (i32,)| (), vec!["late"], long, named("sink"));
    let steering = faultless("steering");
    steering.on_fault(&create_dag().sporadic(PERIOD));
    types.register_periodic_subtask(|| (1_i32,), vec!["y"], PERIOD, named("source"));
    types.register_sink_subtask(|_: (u64,)| (), vec!["y"], PERIOD, named("sink"));
    writers.register_periodic_subtask(|| (1,), vec!["a"], PERIOD, named("source"));
    for name in ["near", "far"] {
        writers.register_subtask(|(a,): (i32,)| (a,), vec!["a"], vec!["b"], named(name));
    }
    writers.register_sink_subtask(|_: (i32,)| (), vec!["b"], PERIOD, named("sink"));
    assert_refused(
        &[done, arity, slow, steering, types, writers, create_dag()],
        &[
            "dag `done` ",
            "subtask `source` of dag `arity` returns 2 outputs but lists 1 output topic;",
            "subtask `middle` of dag `arity` takes 1 input but lists 2 input topics;",
            "subtask `middle` of dag `arity` returns 1 output but lists 2 output topics;",
            "the offset of dag `slow` ",
            "the WCET of subtask `source` of dag `slow` ",
            "the period of subtask `source` of dag `slow` ",
            "the relative deadline of subtask `sink` of dag `slow` ",
            "subtask `source` of dag `steering` may raise the signal of a dag that is not in",
            "subtask `middle` of dag `arity` reads topic `surplus`, which it writes itself;",
            "topic `y` of dag `types` is written as `i32`",
            "topic `b` of dag `writers` has 2 writers",
            "dag `6` has no subtask",
        ],
    );
}

/// Each use is noted of its own subtask, wherever that comes.
#[test]
fn builders_may_be_registered_in_another_order() {
    let (dag, gain) = (create_dag(), Parameter::new("gain", 0.5, 0.0..=2.0));
    let read = (dag.period(PERIOD).using(gain.reading())).source(|gain: f64| (gain,));
    let show = dag.subtask(|_: (f64,)| ()).reads(&["gain"]).due(PERIOD);
    show.register(named("show"));
    read.writes(&["gain"]).register(named("read"));
    drop(crate::support::commit(&[dag]));
}

#[test]
fn what_is_never_registered_is_no_subtask() {
    let (dag, gain) = (faultless("done"), Parameter::new("gain", 0.5, 0.0..=2.0));
    drop(dag.using(gain.reading()).source(|_gain: f64| ()));
    drop(crate::support::commit(&[dag]));
}
