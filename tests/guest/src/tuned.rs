//! A DAG without a limit of jobs whose source reads parameters, for a person to set.

use alloc::vec;
use core::slice;
use core::time::Duration;

use fass::{Parameter, SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine, json};

/// Runs until the console ends it, and prints each value that a job has found for the first time.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let gain = Parameter::new("gain", 0.5, 0.0..=2.0);
    let steps = Parameter::new("steps", 3_u32, 1..=9);
    machine.offer(&[&gain, &steps])?;
    machine.show_topics();
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let (dag, period) = (create_dag(), Duration::from_millis(5));
    dag.name("loop").record::<f64>("gain");
    let named = SubtaskAttributes::named;
    let read = |both: (f64, u32)| (both,);
    dag.period(period)
        .using((gain.reading(), steps.reading()))
        .source(read)
        .writes(&["both"])
        .register(named("read"));
    let part = |(both,): ((f64, u32),)| both;
    dag.register_subtask(part, vec!["both"], vec!["gain", "steps"], named("part"));
    let mut last = None;
    let show = move |now: (f64, u32)| {
        if last.replace(now) != Some(now) {
            json::emit("tuned", |line| {
                line.text("gain", now.0).number("steps", now.1);
            });
        }
    };
    dag.register_sink_subtask(show, vec!["gain", "steps"], period, named("show"));
    machine.spread(slice::from_ref(&dag));
    finish_create_dags(&[dag])?;
    machine.run()?;
    Err(Ending::Failure("the run has ended by itself".into()))
}
