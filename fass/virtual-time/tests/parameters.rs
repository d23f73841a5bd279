//! Parameters in virtual time: when a value takes effect, and that it is recorded and replayed.

mod support;

use fass::finish_create_dags_with;
use fass::{ConstructionPolicy, Fault, Parameter, Tunable, create_dag, finish_create_dags};
use support::sharing::{Seen, ms, named, taking, work};
use virtual_time::VirtualTime;

/// Commits a DAG of 5 jobs every 10 ms, whose source reads the parameter, works for 4 ms and sends
/// the value to two others that work, too; the last one keeps what both give.
fn commit(gain: &Parameter<f64>) -> Seen<(f64, f64)> {
    let dag = create_dag();
    dag.name("loop").jobs(5).record::<f64>("gain");
    let read = |gain: f64| {
        work(4);
        (gain,)
    };
    let source = dag.period(ms(10)).using(gain.reading()).source(read);
    source.writes(&["gain"]).register(taking("read", 4));
    for side in ["left", "right"] {
        let pass = |(gain,): (f64,)| {
            work(2);
            (gain,)
        };
        dag.register_subtask(pass, vec!["gain"], vec![side], taking(side, 2));
    }
    let (seen, keep) = Seen::shared();
    let sink = move |both: (f64, f64)| keep.add(both);
    dag.register_sink_subtask(sink, vec!["left", "right"], ms(10), named("sink"));
    finish_create_dags(&[dag]).expect("a sound DAG");
    seen
}

fn gain() -> Parameter<f64> {
    Parameter::new("gain", 1.0, 0.0..=2.0)
}

#[test]
fn a_job_has_the_value_that_was_set_before_its_source_started() {
    let machine = VirtualTime::new().cores(2);
    let gain = gain();
    let seen = commit(&gain);
    let _ = machine.run_for(ms(9)); // job 0 is over
    gain.set(1.5).unwrap();
    let _ = machine.run_for(ms(5)); // at 14, the source of job 1 has just finished
    gain.set(0.25).unwrap();
    let _ = machine.run_for(ms(8)); // at 22, the source of job 2 works
    gain.set(0.75).unwrap();
    machine.run();
    let both = |value: f64| (value, value);
    assert_eq!(seen.all(), [1.0, 1.5, 0.25, 0.75, 0.75].map(both));
}

#[test]
fn a_replay_has_the_values_that_were_recorded_whatever_is_set() {
    let machine = VirtualTime::new().cores(2);
    let tuned = gain();
    let recorded = commit(&tuned);
    let _ = machine.run_for(ms(15));
    tuned.set(2.0).unwrap();
    machine.run();
    let recording = machine.recording();

    let machine = VirtualTime::new().replay(&recording).expect("it is whole");
    let other = gain();
    other.set(0.125).unwrap();
    let replayed = commit(&other);
    let report = machine.run();
    assert_eq!(report.divergence, None);
    assert_eq!(replayed.all(), recorded.all());
    assert_ne!(recorded.all()[0], recorded.all()[4]);
}

#[test]
fn a_value_beyond_the_range_or_of_another_type_changes_nothing() {
    let gain = gain();
    let of_gain: &dyn Tunable = &gain;
    for text in ["2.5", "-0.001", "NaN", "inf", "fast", "", "1,5"] {
        assert!(!of_gain.set_text(text), "{text}");
        let said = of_gain.refusal(text).to_string();
        let expected = format!("`gain={text}`: parameter `gain` takes f64 from 0 to 2");
        assert_eq!(said, expected);
    }
    assert!(gain.set(f64::NAN).is_err());
    assert_eq!(gain.value().to_bits(), 1.0_f64.to_bits());
    assert!(of_gain.set_text("2e0") && gain.value() > 1.9);

    let count = Parameter::new("count", -3_i32, -5..=5);
    let of_count: &dyn Tunable = &count;
    assert!(!of_count.set_text("2.0") && !of_count.set_text("6"));
    assert!(of_count.set_text("-5"));
    assert_eq!(count.value(), -5);
    assert_eq!(
        of_count.shown().to_string(),
        "-5 (i32 from -5 to 5, at first -3)"
    );
}

#[test]
fn what_would_give_a_job_two_values_is_refused_by_the_commit() {
    let _machine = VirtualTime::new();
    let gain = gain();
    let dag = create_dag();
    for name in ["one", "other"] {
        let source = |gain: f64| (gain,);
        let source = dag.period(ms(10)).using(gain.reading()).source(source);
        source.writes(&[name]).register(named(name));
    }
    let sink = |_: f64, _: (f64, f64)| ();
    let sink = dag.using(gain.reading()).subtask(sink);
    sink.reads(&["one", "other"])
        .due(ms(10))
        .register(named("sink"));
    // It has no topics, but follows the sink.
    let using = dag.using(gain.reading());
    let untyped = using.register_untyped_subtask(|_: f64, _job| (), named("untyped"));
    dag.precede(
        &dag.register_untyped_subtask(|_job| (), named("before")),
        &untyped,
    );
    let error = finish_create_dags_with(&[dag], ConstructionPolicy::any_graph());
    let faults: Vec<_> = error
        .unwrap_err()
        .faults()
        .iter()
        .map(Fault::code)
        .collect();
    assert_eq!(
        faults,
        ["taken_twice", "taken_by_no_source", "taken_by_no_source"]
    );
}
