//! The chains of a run that cross DAGs: which are measured, and what is said of them.
//!
//! What the times mean is in [`sched_dag::chains`].

use std::fmt::Write;

use sched_dag::DagId;
use sched_dag::chains::{Chain, Place};
use sched_dag::law::Distribution;

use super::report::{distribution, microseconds, object};
use super::view::View;
use crate::json::{Object, quoted};
use crate::options::{Parsed, nearest};
use crate::record::Run;

/// The most chains that are shown of a run, unless one is named.
const SHOWN: usize = 8;

/// The times of a chain in a run, and their bounds.
pub(super) struct Measured {
    names: Vec<String>,
    output_age: (Distribution, Result<u64, DagId>),
    data_age: (Distribution, Result<u64, DagId>),
    reaction: (Distribution, Result<u64, DagId>),
}

/// Measures the chains that the options name, or else all.
///
/// # Errors
///
/// In words: there is no such subtask, or no chain between the two.
pub(super) fn measure(run: &Run, options: &Parsed) -> Result<Vec<Measured>, String> {
    let samplings = &run.samplings;
    let ends = (options.text("from"), options.text("to"));
    let chains = match ends {
        (None, None) => Chain::all(&run.task_set, samplings),
        (Some(from), Some(to)) => {
            let ends = (place(run, "from", from)?, place(run, "to", to)?);
            let chains = Chain::between(&run.task_set, samplings, ends.0, ends.1);
            if chains.is_empty() {
                return Err(format!(
                    "run {}: no edges and samples lead from `{from}` to `{to}`; \
                     `./scripts/run --dot FILE` draws which there are",
                    run.number
                ));
            }
            chains
        }
        _ => return Err("give both `--from` and `--to`, or neither for all chains".into()),
    };
    let view = View::new(run);
    let events: Vec<_> = view.in_the_order_of_the_log().collect();
    let measured = |chain: &Chain| {
        let times = chain.latencies(&run.task_set, events.iter().copied());
        let bounds = &run.bounds_ns;
        let reaction = chain.reaction_bound_ns(&run.task_set, bounds);
        let names = chain.names(&run.task_set).map(|name| name.to_string());
        Measured {
            names: names.collect(),
            output_age: (
                Distribution::new(times.output_age_ns),
                chain.output_age_bound_ns(&run.task_set, bounds),
            ),
            data_age: (Distribution::new(times.data_age_ns), reaction),
            reaction: (Distribution::new(times.reaction_ns), reaction),
        }
    };
    Ok(chains.iter().map(measured).collect())
}

/// Finds the subtask that an option names.
fn place(run: &Run, option: &str, name: &str) -> Result<Place, String> {
    Chain::place(&run.task_set, name).ok_or_else(|| {
        let dags = (0..).map(DagId).zip(run.task_set.dags());
        let all: Vec<String> = dags
            .flat_map(|(dag, model)| {
                let of_dag = match model.name() {
                    "" => dag.0.to_string(),
                    name => name.to_string(),
                };
                let subtasks = model.subtasks().iter();
                subtasks.map(move |subtask| format!("{of_dag}/{}", subtask.name()))
            })
            .collect();
        let names: Vec<&str> = all.iter().map(String::as_str).collect();
        let hint = match nearest(name, &names) {
            Some(nearest) => format!("did you mean `{nearest}`?"),
            None => format!("its subtasks are {}", names.join(", ")),
        };
        let number = run.number;
        format!("`--{option} {name}`: run {number} has no such subtask; {hint}")
    })
}

/// Returns the lines for people.
pub(super) fn table(run: &Run, chains: &[Measured], is_named: bool) -> String {
    let mut text = String::new();
    let shown = if is_named { chains.len() } else { SHOWN };
    for chain in chains.iter().take(shown) {
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "  chain {}", chain.names.join(" > "));
        for (name, (times, bound)) in [
            ("age of an output", &chain.output_age),
            ("data age", &chain.data_age),
            ("reaction time", &chain.reaction),
        ] {
            let bound = match bound {
                Ok(ns) => format!("bound {}", microseconds(*ns)),
                Err(dag) => match run.task_set.dag(*dag) {
                    model if model.is_sporadic() => {
                        format!("no bound, as dag `{}` is sporadic", model.name())
                    }
                    model => format!("no bound, as dag `{}` has none", model.name()),
                },
            };
            let _ = writeln!(text, "    {name:30}{} ({bound})", distribution(times));
        }
    }
    if chains.len() > shown {
        let more = chains.len() - shown;
        let _ = writeln!(
            text,
            "  and {more} chains more; `--from DAG/SUBTASK --to DAG/SUBTASK` shows those between \
             two subtasks"
        );
    }
    text
}

/// Returns the machine line of kind `chain`.
pub(super) fn machine_line(file: &str, run: &Run, chain: &Measured) -> String {
    let bound = |of: &Result<u64, DagId>| of.map_or("null".into(), |ns| ns.to_string());
    Object::new()
        .text("kind", "chain")
        .text("file", file)
        .number("run", run.number)
        .list("path", chain.names.iter().map(|name| quoted(name)))
        .json("output_age_ns", &object(&chain.output_age.0))
        .json("data_age_ns", &object(&chain.data_age.0))
        .json("reaction_ns", &object(&chain.reaction.0))
        .json("output_age_bound_ns", &bound(&chain.output_age.1))
        .json("reaction_bound_ns", &bound(&chain.reaction.1))
        .end()
}
