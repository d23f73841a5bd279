//! Parameters in virtual time: when a value takes effect, and that it is recorded and replayed.
//! (Who may read them, the page of errors tells.)

use crate::support::{Seen, every, ms, named, taking, work};
use fass::shared::{Parameter, Tunable};
use virtual_time::VirtualTime;

/// Commits a DAG of 5 jobs every 10 ms, whose source reads the parameter, works for 4 ms and sends
/// the value to two others that work, too; the last one keeps what both give.
fn commit(gain: &Parameter<f64>) -> Seen<(f64, f64)> {
    let dag = every(10, "loop");
    dag.jobs(5).record::<f64>("gain");
    let read = |gain: f64| {
        work(4);
        (gain,)
    };
    let source = dag.using(gain.reading()).source(read).writes(&["gain"]);
    source.register(taking("read", 4));
    for side in ["left", "right"] {
        let pass = |(gain,): (f64,)| {
            work(2);
            (gain,)
        };
        dag.register_subtask(pass, vec!["gain"], vec![side], taking(side, 2));
    }
    let (seen, keep) = Seen::shared();
    let sink = move |both: (f64, f64)| keep.add(both);
    dag.register_subtask(sink, vec!["left", "right"], vec![], named("sink"));
    crate::support::commit(&[dag]);
    seen
}

fn gain() -> Parameter<f64> {
    Parameter::new("gain", 1.0, 0.0..=2.0)
}

#[test]
fn a_job_has_the_value_that_was_set_before_its_source_started() {
    let machine = VirtualTime::new().cores(2);
    let tuned = gain();
    let seen = commit(&tuned);
    let _ = machine.run_for(ms(9)); // job 0 is over
    tuned.set(1.5).unwrap();
    let _ = machine.run_for(ms(5)); // at 14, the source of job 1 has just finished
    tuned.set(0.25).unwrap();
    let _ = machine.run_for(ms(8)); // at 22, the source of job 2 works
    tuned.set(0.75).unwrap();
    machine.run();
    let both = |value: f64| (value, value);
    assert_eq!(seen.all(), [1.0, 1.5, 0.25, 0.75, 0.75].map(both));

    // A replay has these values, whatever is set.
    let recording = machine.recording();
    let machine = VirtualTime::new().replay(&recording).expect("it is whole");
    let other = gain();
    other.set(0.125).unwrap();
    let replayed = commit(&other);
    assert_eq!(machine.run().divergence, None);
    assert_eq!(replayed.all(), seen.all());
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
    let shown = of_count.shown().to_string();
    assert_eq!(shown, "-5 (i32 from -5 to 5, at first -3)");
}
