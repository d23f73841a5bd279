//! What a condition prints: all times in batches, and a summary.

use alloc::format;
use alloc::string::String;
use core::fmt::{self, Display};

use join_latency::{Samples, Span};
use kernel::report::{Distribution, Ns};
use kernel::{json, println};

/// How many executions or joins one line holds.
const BATCH: usize = 32;

/// What became of a condition.
pub(crate) struct Outcome {
    pub(crate) samples: Samples,
    /// Allocations while it ran.
    pub(crate) allocations: u64,
    /// Breaches of the scheduler's rules, and joins of a DAG that mix jobs.
    pub(crate) violations: u64,
}

impl Outcome {
    /// Says what makes the condition worthless, if anything does.
    pub(crate) fn complaint(&self, jobs: u64) -> Option<String> {
        let Self {
            samples,
            allocations,
            violations,
        } = self;
        if *violations > 0 {
            return Some(format!("{violations} semantic violations"));
        }
        if samples.lost_inputs > 0 {
            return Some(format!(
                "subscriptions dropped {} messages; give them a greater `depth`",
                samples.lost_inputs
            ));
        }
        let mut all = samples.parallel.iter().chain([&samples.source]);
        if let Some(spans) = all.find(|spans| spans.len() as u64 != jobs) {
            return Some(format!("only {} of {jobs} jobs were executed", spans.len()));
        }
        (*allocations > 0).then(|| format!("{allocations} allocations while running"))
    }
}

/// Prints the times of all executions and joins.
pub(crate) fn emit_samples(samples: &Samples) {
    let subtasks = core::iter::once(&samples.source).chain(&samples.parallel);
    for (subtask, spans) in (0u64..).zip(subtasks) {
        for (batch, spans) in spans.chunks(BATCH).enumerate() {
            json::emit("executions", |line| {
                let values = spans.iter().map(|span| Times(span, None, &[]));
                line.number("subtask", subtask)
                    .number("first", (batch * BATCH) as u64)
                    .list("times", values);
            });
        }
    }
    for (batch, joins) in samples.joins.chunks(BATCH).enumerate() {
        json::emit("joins", |line| {
            let values = joins.iter().enumerate().map(|(offset, joined)| {
                let indices = samples.indices_of(batch * BATCH + offset);
                Times(&joined.span, Some(joined.ready_ns), indices)
            });
            line.number("first", (batch * BATCH) as u64)
                .list("times", values);
        });
    }
}

/// A list: the time of readiness if any, start, finish, then numbers if any.
struct Times<'a>(&'a Span, Option<u64>, &'a [u64]);

impl Display for Times<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(span, ready_ns, numbers) = self;
        f.write_str("[")?;
        if let Some(ready_ns) = ready_ns {
            write!(f, "{ready_ns},")?;
        }
        write!(f, "{},{}", span.start_ns, span.finish_ns)?;
        numbers
            .iter()
            .try_for_each(|number| write!(f, ",{number}"))?;
        f.write_str("]")
    }
}

/// Prints the counts and distributions, as a machine line and for people.
pub(crate) fn emit_summary(name: &str, outcome: &Outcome) {
    let samples = &outcome.samples;
    let record = samples.record();
    let [joins, same_index, cross_index, missing] = [
        record.sets.len(),
        record.same_index_sets(),
        record.cross_index_sets(),
        record.missing_joins(),
    ];
    let literal = Distribution::new(record.join_latencies_ns());
    let cover = Distribution::new(record.cover_delays_ns());
    json::emit("join_latency", |line| {
        line.text("policy", name)
            .number("subtasks", samples.parallel.len() as u64)
            .number("jobs", samples.source.len() as u64)
            .number("joins", joins as u64)
            .number("same_index", same_index as u64)
            .number("cross_index", cross_index as u64)
            .number("missing", missing as u64)
            .number("lost_inputs", samples.lost_inputs)
            .number("violations", outcome.violations)
            .number("allocations", outcome.allocations)
            .distribution("join_latency_ns", &literal)
            .distribution("cover_delay_ns", &cover);
    });
    println!(
        "{joins} joins: {same_index} of one job, {cross_index} across jobs; {missing} joins never \
         happened"
    );
    for (name, of) in [("join latency", literal), ("cover delay", cover)] {
        println!(
            "  {name:<14} median {:>12}  p99 {:>12}  max {:>12}",
            Ns(of.median()),
            Ns(of.p99()),
            Ns(of.max())
        );
    }
}
