//! What `check-trace` says about a run: a table for people and a machine line.

use std::fmt::Write;

use sched_dag::law::Distribution;
use sched_dag::{Policy, Preemption};

use super::Findings;
use crate::json::Object;
use crate::record::Run;

/// Returns the text for people: at most `shown` breaches, then the figures.
#[must_use]
pub fn table(file: &str, run: &Run, findings: &Findings, bound_ns: u64, shown: usize) -> String {
    let mut text = String::new();
    let Findings { breaches, figures } = findings;
    let policy = match run.options.policy {
        Policy::StaticPriority => "static",
        Policy::Edf => "edf",
    };
    let preemption = match run.options.preemption {
        Preemption::Enabled => "on",
        Preemption::Disabled => "off",
    };
    let (number, cores) = (run.number, run.options.cores);
    let mut say = |line: &str| {
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{line}");
    };
    say(&format!(
        "{file}: run {number}, policy {policy}, preemption {preemption}, {cores} cores"
    ));
    for breach in breaches.iter().take(shown) {
        say(&format!("  breach {}", breach.with_names(&run.task_set)));
    }
    if breaches.len() > shown {
        say(&format!("  and {} breaches more", breaches.len() - shown));
    }
    if run.lost > 0 {
        say(&format!(
            "  {} events were lost: only what came from {} ns on is judged",
            run.lost, figures.from_ns
        ));
    }
    let mut row = |name: &str, value: &str| say(&format!("  {name:32}{value}"));
    row("events", &figures.events.to_string());
    row("instances started", &figures.instances.to_string());
    row("preemptions", &figures.preemptions.to_string());
    row(
        "finish to ready, largest",
        &microseconds(figures.finish_to_ready_max_ns),
    );
    row(
        "ready to start, a core idle",
        &distribution(&figures.ready_to_start),
    );
    row("preemption latency", &distribution(&figures.preemption));
    row(
        "longest inversion",
        &format!(
            "{} (bound {})",
            microseconds(figures.longest_inversion_ns),
            microseconds(bound_ns)
        ),
    );
    let loads = figures.load_permille.iter();
    let loads: Vec<String> = loads
        .map(|load| format!("{}.{} %", load / 10, load % 10))
        .collect();
    row("load by core", &loads.join("  "));
    row("breaches", &breaches.len().to_string());
    text
}

/// Returns the machine line of kind `trace_check`.
#[must_use]
pub fn machine_line(file: &str, run: &Run, findings: &Findings) -> String {
    let Findings { breaches, figures } = findings;
    Object::new()
        .text("kind", "trace_check")
        .text("file", file)
        .number("run", run.number)
        .number("events", figures.events as u64)
        .number("lost", run.lost)
        .number("judged_from_ns", figures.from_ns)
        .number("span_ns", figures.span_ns)
        .number("instances", figures.instances as u64)
        .number("preemptions", figures.preemptions)
        .number("breaches", breaches.len() as u64)
        .number("finish_to_ready_max_ns", figures.finish_to_ready_max_ns)
        .json("ready_to_start_ns", &object(&figures.ready_to_start))
        .json("preemption_latency_ns", &object(&figures.preemption))
        .number("longest_inversion_ns", figures.longest_inversion_ns)
        .list("load_permille", &figures.load_permille)
        .end()
}

pub(super) fn microseconds(ns: u64) -> String {
    format!("{}.{:03} us", ns / 1000, ns % 1000)
}

pub(super) fn distribution(of: &Distribution) -> String {
    if of.count() == 0 {
        return "none".into();
    }
    format!(
        "median {}, p99 {}, max {} of {}",
        microseconds(of.median()),
        microseconds(of.p99()),
        microseconds(of.max()),
        of.count()
    )
}

pub(super) fn object(of: &Distribution) -> String {
    format!(
        "{{\"count\":{},\"median\":{},\"p99\":{},\"max\":{}}}",
        of.count(),
        of.median(),
        of.p99(),
        of.max()
    )
}
