//! Faults that `fass` itself finds, besides one of each code, whose texts `docs/errors.md`
//! shows, and that all faults of all DAGs come at once.

mod support;

use core::time::Duration;
use std::slice;

use fass::{CommitError, ConstructionPolicy, Count, Dag, Fault};
use fass::{create_dag, finish_create_dags, finish_create_dags_with};
use support::{PERIOD, named, panic_message};

fn refuse(dags: &[Dag]) -> CommitError {
    support::install();
    finish_create_dags(dags).expect_err("the commit is refused")
}

fn codes(error: &CommitError) -> Vec<&'static str> {
    error.faults().iter().map(Fault::code).collect()
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
fn a_topic_of_values_has_one_writer_under_any_construction_policy() {
    support::install();
    let dag = create_dag();
    dag.register_periodic_subtask(|| (1,), vec!["a"], PERIOD, named("source"));
    for name in ["near", "far"] {
        dag.register_subtask(|(a,): (i32,)| (a,), vec!["a"], vec!["b"], named(name));
    }
    dag.register_sink_subtask(|_: (i32,)| (), vec!["b"], PERIOD, named("sink"));
    let construction = ConstructionPolicy {
        writers: Count::Several,
        ..ConstructionPolicy::paper()
    };
    let error = finish_create_dags_with(&[dag], construction).expect_err("two writers");
    assert_eq!(codes(&error), ["several_writers"]);
}

#[test]
fn arity_faults_name_subtask_and_both_numbers_and_nothing_else_is_blamed() {
    let dag = create_dag();
    dag.name("demo");
    dag.register_periodic_subtask(|| (1, 2_u8), vec!["number"], PERIOD, named("source"));
    let middle = |(number,): (i32,)| (number,);
    let inputs = vec!["number", "surplus"];
    dag.register_subtask(middle, inputs, vec!["next", "surplus"], named("middle"));
    dag.register_sink_subtask(|_: (i32,)| (), vec!["next"], PERIOD, named("sink"));
    let error = refuse(&[dag]);
    let texts: Vec<String> = error.faults().iter().map(ToString::to_string).collect();
    for (text, numbers) in texts.iter().zip([
        "subtask `source` of dag `demo` returns 2 outputs but lists 1 output topic;",
        "subtask `middle` of dag `demo` takes 1 input but lists 2 input topics;",
        "subtask `middle` of dag `demo` returns 1 output but lists 2 output topics;",
    ]) {
        assert!(text.starts_with(numbers), "{text}");
    }
    // The surplus topic really is written by its own reader; no type is blamed.
    assert!(!codes(&error).contains(&"type_mismatch"), "{error}");
}

#[test]
fn a_duration_beyond_64_bits_of_nanoseconds_is_a_fault_and_never_wraps() {
    let fits = Duration::from_nanos(u64::MAX);
    let long = fits + Duration::from_nanos(1);
    let dag = create_dag();
    dag.name("slow").offset(long);
    dag.register_periodic_subtask(|| (1,), vec!["number"], long, named("source").wcet(long));
    dag.register_sink_subtask(|_: (i32,)| (), vec!["number"], long, named("sink"));
    let error = refuse(&[dag]);
    assert_eq!(codes(&error), ["duration_too_long"; 4]);
    let texts = error.to_string();
    for (text, what) in texts.lines().zip([
        "the offset of dag `slow` ",
        "the WCET of subtask `source` of dag `slow` ",
        "the period of subtask `source` of dag `slow` ",
        "the relative deadline of subtask `sink` of dag `slow` ",
    ]) {
        assert!(text.starts_with(what), "{text}");
    }
}

#[test]
fn two_periods_are_a_fault_and_two_deadlines_are_none() {
    let dag = faultless("twice");
    let other = Duration::from_millis(20);
    dag.register_periodic_subtask(|| (1,), vec!["more"], other, named("second source"));
    dag.register_sink_subtask(|_: (i32,)| (), vec!["more"], other, named("second sink"));
    let error = refuse(&[dag]);
    let codes = codes(&error);
    for code in ["periods_differ", "several_sources", "several_sinks"] {
        assert!(codes.contains(&code), "{code} is missing in:\n{error}");
    }
    assert!(
        codes.iter().all(|code| !code.contains("deadline")),
        "{error}"
    );
}

#[test]
fn a_signal_of_a_fault_that_releases_nothing_is_a_fault() {
    let dag = faultless("steering");
    dag.on_fault(&create_dag().sporadic(PERIOD));
    let error = refuse(&[dag]);
    assert_eq!(codes(&error), ["signal_not_committed"]);
}

#[test]
fn a_dag_committed_before_is_a_fault_and_cannot_be_changed() {
    let dag = faultless("done");
    drop(support::commit(slice::from_ref(&dag)));
    let error = refuse(slice::from_ref(&dag));
    assert_eq!(codes(&error), ["already_committed"]);
    let late = || dag.register_sink_subtask(|()| (), vec![], PERIOD, named("late"));
    assert_eq!(
        panic_message(late),
        "dag `done` is committed and cannot be changed; build a new DAG and commit that"
    );
}

#[test]
fn a_dag_without_name_is_called_by_its_position_even_after_one_that_is_left_out() {
    let done = faultless("done first");
    drop(support::commit(slice::from_ref(&done)));
    let nameless = create_dag();
    nameless.register_periodic_subtask(|| (), vec!["surplus"], PERIOD, named("source"));
    let text = refuse(&[done, nameless]).to_string();
    let lines: Vec<&str> = text.lines().collect();
    assert!(
        lines[1].starts_with("subtask `source` of dag `1` returns 0 outputs"),
        "{text}"
    );
    assert!(
        lines[2..].iter().all(|line| line.contains("dag `1`")),
        "{text}"
    );
}

#[test]
fn a_refused_commit_changes_nothing() {
    let dag = create_dag();
    dag.name("unfinished");
    dag.register_periodic_subtask(|| (1,), vec!["number"], PERIOD, named("source"));
    let error = refuse(slice::from_ref(&dag));
    assert_eq!(codes(&error), ["missing_deadline"]);
    dag.register_sink_subtask(|_: (i32,)| (), vec!["number"], PERIOD, named("sink"));
    support::run_job(&mut support::commit(&[dag]), 0);
}

#[test]
fn a_platform_that_refuses_is_quoted() {
    support::install();
    finish_create_dags(&[faultless("first")]).expect("the platform keeps one plan");
    let error = refuse(&[faultless("second")]);
    assert_eq!(codes(&error), ["not_launched"]);
    let text = error.to_string();
    assert!(
        text.ends_with(": a plan is kept already; take it first"),
        "{text}"
    );
}

#[test]
fn all_faults_of_all_dags_come_at_once() {
    let committed = faultless("committed");
    drop(support::commit(slice::from_ref(&committed)));
    let arity = faultless("arity");
    arity.register_subtask(|()| (1,), vec![], vec![], named("extra"));
    let types = create_dag();
    types.name("types");
    types.register_periodic_subtask(|| (1_i32,), vec!["value"], PERIOD, named("source"));
    types.register_sink_subtask(|_: (u64,)| (), vec!["value"], PERIOD, named("sink"));
    let error = refuse(&[committed, arity, types, create_dag()]);
    let codes = codes(&error);
    for code in [
        "already_committed",
        "output_arity",
        "type_mismatch",
        "no_subtasks",
    ] {
        assert!(codes.contains(&code), "{code} is missing in:\n{error}");
    }
    assert_eq!(error.to_string().lines().count(), error.faults().len());
    let text = error.to_string();
    let mismatch = text
        .lines()
        .find(|line| line.contains("`types`"))
        .unwrap_or_default();
    for word in ["`source`", "`sink`", "i32", "u64", "`value`"] {
        assert!(mismatch.contains(word), "{word} is missing in: {mismatch}");
    }
}
