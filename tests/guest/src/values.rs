//! The cost of recording a value of 64 bytes, for `bench hand-off`.
//!
//! In a chain every other value is recorded. So hops with and without a recorded value alternate in
//! the same run, and differ in nothing else. The cost is measured here because an image with a
//! recorded topic is larger by a fifth, and the app `hand-off` has no room for it.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use executive::machine::clock;
use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use hand_off::{BodyStamps, StampPen};
use kernel::report::Distribution;
use kernel::{AppError, Machine, json};

/// The number of subtasks; the hop from number 1 is the first with a recorded value.
const SUBTASKS: usize = 10;

/// The message of each edge.
type Value = [u64; 8];

/// Runs the chain, and prints hops of either kind, and the difference between a hop with a recorded
/// value and the next hop.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let jobs = machine.options().number("jobs", 2..=100_000, 200)?;
    machine.options().finish(&["test", "jobs"])?;
    let (dag, stamps) = build(jobs);
    finish_create_dags(&[dag])?;
    let run = machine.run()?;
    if let Some(violation) = run.violations().next() {
        return Err(AppError::Failure(format!("{violation}")));
    }
    let hop = |(job, from)| {
        let start = stamps.first(from + 1, job)?;
        start.checked_sub(stamps.last(from, job)?)
    };
    let hops = |is_meant: fn(usize) -> bool| {
        // The source's hop comes after a release, not after a hop.
        let from = (1..SUBTASKS - 1).filter(move |&subtask| is_meant(subtask));
        (0..jobs).flat_map(move |job| from.clone().map(move |from| (job, from)))
    };
    let plain = hops(|subtask| !is_recorded(subtask));
    let recorded = hops(is_recorded);
    let differences = recorded.clone().filter_map(|(job, from)| {
        let plain = hop((job, from + 1))?;
        Some(hop((job, from))?.saturating_sub(plain))
    });
    let workload = "64-byte values";
    emit(workload, "recording", 1, differences);
    emit(workload, "return_to_start", 1, plain.filter_map(hop));
    let recorded = recorded.filter_map(hop);
    emit(workload, "return_to_start_recorded", 1, recorded);
    emit(workload, "allocations", jobs, [run.allocations()]);
    Ok(())
}

/// Prints a figure in the form of the app `hand-off`.
pub(crate) fn emit(workload: &str, figure: &str, per: u64, samples: impl IntoIterator<Item = u64>) {
    let samples = Distribution::new(samples);
    json::emit("hand_off", |line| {
        line.text("workload", workload)
            .text("figure", figure)
            .number("per", per)
            .number("samples", samples.count())
            .distribution("value", &samples);
    });
}

/// Builds the chain, and the place for the times of its bodies.
fn build(jobs: u64) -> (Dag, BodyStamps) {
    let period = Duration::from_millis(4);
    let dag = create_dag();
    dag.name("values").jobs(jobs).in_flight(1);
    let mut stamps = BodyStamps::default();
    let topics: Vec<String> = (1..SUBTASKS).map(|number| format!("t{number}")).collect();
    let named = |number| SubtaskAttributes::named(&format!("s{number}"));
    let mut pen = stamps.pen(jobs);
    let source = move || (stamped([7; 8], &mut pen),);
    dag.register_periodic_subtask(source, [topics[0].as_str()], period, named(0));
    for (number, ends) in (1..).zip(topics.windows(2)) {
        let mut pen = stamps.pen(jobs);
        let between = move |(value,): (Value,)| (stamped(value, &mut pen),);
        dag.register_subtask(
            between,
            [ends[0].as_str()],
            [ends[1].as_str()],
            named(number),
        );
        if is_recorded(number) {
            dag.record::<Value>(&ends[1]);
        }
    }
    let mut pen = stamps.pen(jobs);
    let sink = move |(value,): (Value,)| {
        stamped(value, &mut pen);
    };
    let last = [topics[SUBTASKS - 2].as_str()];
    dag.register_sink_subtask(sink, last, period, named(SUBTASKS - 1));
    (dag, stamps)
}

/// Reports whether a subtask's value is recorded.
const fn is_recorded(subtask: usize) -> bool {
    subtask % 2 == 1
}

fn stamped(value: Value, pen: &mut StampPen) -> Value {
    // The times are not to be recorded.
    pen.put(clock::now_ns());
    pen.put(clock::now_ns());
    value
}
