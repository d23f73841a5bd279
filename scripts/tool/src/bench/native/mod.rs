//! What the scheduler costs on the host's own processors.
//!
//! The same engine that the kernel has, on threads of Linux that poll, with the
//! graphs of `bench hand-off` with empty bodies. Nothing here is emulated, so the
//! figures can be compared with those of libraries that run task graphs on threads.
//!
//! Other work on the host shows in them. Therefore each figure is measured in many
//! short *rounds*, spread over several passes, and given as minimum, median and 99th
//! percentile: the minimum is what the code costs, the others are what the host makes
//! of it.
//!
//! - `graphs`: the graphs, as bodies that do nothing;
//! - `throughput`: rounds of jobs, and what one step of them takes;
//! - `join`: from the last return to the sink's start, across cores;
//! - `clusters`: what two clusters of one core do, next to one core.

mod clusters;
mod graphs;
mod join;
mod throughput;

use std::ffi::OsString;
use std::process::ExitCode;

use graphs::Graph;
use replay::shown::quoted;

use super::frame::{Figure, Table, by_plan};
use crate::json::Object;
use crate::options::{Command, Parsed, Takes, options};
use crate::progress::Progress;

static TABLE: Command = Command {
    invocation: "./scripts/bench native",
    about: "Measures the scheduler on this host's own processors, with empty bodies.",
    positional: None,
    options: options! {
        /// How many rounds of about 20,000 instances each figure has.
        "rounds": Takes::number(10..=100_000), or "300";
        /// The jobs whose joins across cores are measured.
        "jobs": Takes::number(100..=10_000_000), or "20000";
        /// The workloads, with commas between: chain-64, fork-join-2, fork-join-4, fork-join-6,
        /// layered-1000, dags-1000, join, clusters; all.
        "only": Takes::Text("NAMES");
    },
    notes: "\
`floor` calls the bodies in topological order, in a loop; `closures` are functions under
the scheduler, without values, on one and two workers; `typed` are functions with a u64 on each edge (not of
layered-1000 and dags-1000). `static` and `edf` are the policies.
`clusters` runs a graph in each of two clusters of one core, next to one on one core alone.

Prints a table and a JSON object for each figure. Times depend on the host and on what
else it does; compare figures of one run.

Exit code: 0 measured; 1 a run did not complete its jobs; 2 the command line is refused.
",
};

/// The name of the joins across cores among the workloads.
const JOIN: &str = "join";

/// The name of two clusters next to one core.
const CLUSTERS: &str = "clusters";

/// Runs `bench native` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&TABLE, words, Plan::read, measure)
}

/// What is to be measured.
struct Plan {
    rounds: usize,
    jobs: u64,
    graphs: Vec<Graph>,
    with_join: bool,
    with_clusters: bool,
}

/// The numbers of workers, each a thread with a processor of its own.
const WORKERS: [u32; 2] = [1, 2];

impl Plan {
    fn read(options: &Parsed) -> Result<Self, String> {
        options.check_distinct(&["only"])?;
        let names = Graph::ALL.iter().map(|graph| graph.name);
        let known: Vec<&str> = names.chain([JOIN, CLUSTERS]).collect();
        let chosen = options.text("only").map(|names| names.split(',').collect());
        let wanted: Vec<&str> = chosen.unwrap_or_else(|| known.clone());
        if let Some(name) = wanted.iter().find(|name| !known.contains(name)) {
            let (name, known) = (quoted(name), known.join(", "));
            return Err(format!(
                "`--only`: no workload is called {name}; there are {known}"
            ));
        }
        let number = |name| options.number(name).unwrap_or(0);
        let is_wanted = |graph: &Graph| wanted.contains(&graph.name);
        Ok(Self {
            rounds: usize::try_from(number("rounds")).unwrap_or(usize::MAX),
            jobs: number("jobs"),
            graphs: Graph::ALL.into_iter().filter(is_wanted).collect(),
            with_join: wanted.contains(&JOIN),
            with_clusters: wanted.contains(&CLUSTERS),
        })
    }
}

/// A figure in nanoseconds, and what runs the bodies under which policy.
type Row = (Figure, &'static str);

/// Measures, and prints; returns that nothing has a limit.
fn measure(plan: &Plan) -> Result<bool, String> {
    if linux::processors() < 2 {
        return Err("this host has one processor for us; two are needed".into());
    }
    let total = throughput::passes(&plan.graphs, &WORKERS);
    let (mut progress, mut over) = (Progress::new(total, "passes"), 0);
    let mut show = || {
        over += 1;
        progress.show(over);
    };
    let mut rows = Vec::new();
    for &graph in &plan.graphs {
        let measured = throughput::measure(graph, &WORKERS, plan.rounds, &mut show)?;
        rows.extend(measured);
    }
    progress.end();
    if plan.with_join {
        rows.extend(join::measure(plan.jobs)?);
    }
    let together = match plan.with_clusters {
        true => clusters::measure(plan.rounds, &mut rows)?,
        false => Vec::new(),
    };
    print!("{}", table(&rows));
    for (graph, times) in &together {
        println!("{graph}: two clusters of one core each do {times:.2} times what one core does");
    }
    for row in &rows {
        println!("{}", machine_line(row));
    }
    for (graph, times) in &together {
        let line = Object::new().text("kind", "bench");
        let line = line.text("name", "native-clusters").text("workload", graph);
        let line = line.number("clusters", 2_u64);
        println!("{}", line.json("times", &format!("{times:.3}")).end());
    }
    Ok(true)
}

fn table(rows: &[Row]) -> String {
    let columns = [
        ("", -14, 0),
        ("ns", -38, 0),
        ("bodies, policy", -18, 0),
        ("workers", 8, 0),
        ("min", 10, 1),
        ("median", 10, 1),
        ("p99", 10, 1),
    ];
    let mut table = Table::new("", &columns);
    let mut before = "";
    for (figure, runner) in rows {
        let is_same = std::mem::replace(&mut before, &figure.workload) == figure.workload;
        let [min, median, p99] =
            [figure.min, figure.median, figure.p99].map(|ns| figure.of_step(ns));
        let name = if is_same { "" } else { before };
        table.row(&[
            &name,
            &figure.figure,
            runner,
            &figure.cores,
            &min,
            &median,
            &p99,
        ]);
    }
    table.text()
}

fn machine_line((figure, runner): &Row) -> String {
    let one = |ns| format!("{:.2}", figure.of_step(ns));
    Object::new()
        .text("kind", "bench")
        .text("name", "native")
        .text("workload", &figure.workload)
        .text("what", &figure.figure)
        .text("runner", runner)
        .number("workers", figure.cores)
        .number("samples", figure.samples)
        .json("min_ns", &one(figure.min))
        .json("median_ns", &one(figure.median))
        .json("p99_ns", &one(figure.p99))
        .end()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(line: &str) -> Result<Plan, String> {
        Plan::read(&TABLE.right(line))
    }

    #[test]
    fn workloads_are_chosen_by_name_and_unknown_ones_refused_with_those_there_are() {
        let chosen = plan("--only fork-join-2,chain-64").expect("right");
        assert_eq!(chosen.graphs, [Graph::CHAIN, Graph::JOIN]);
        assert!(!chosen.with_join && !chosen.with_clusters);
        let line = plan("--only chain-65").err().expect("refused");
        assert!(line.contains("called `chain-65`") && line.contains("chain-64, fork-join-2"));
    }

    /// One test, since only one thread of a program may measure at a time.
    #[test]
    fn a_short_run_measures_every_graph_alone_and_in_clusters() {
        for graph in Graph::ALL {
            let rows = throughput::measure(graph, &[1], 3, &mut || {}).expect("it runs");
            let expected = 3 + usize::from(graph.has_values());
            assert_eq!(rows.len(), expected, "{}", graph.name);
        }
        let mut rows = Vec::new();
        // On a host that never gives us both processors there is nothing to see.
        if linux::processors() > 1
            && let Ok(together) = clusters::measure(600, &mut rows)
        {
            assert_eq!((together.len(), rows.len()), (2, 4));
        }
    }
}
