//! Makespans of task graphs, compared with the shortest that are possible.
//!
//! A *makespan* is the time from a job's release to its completion. For the graphs
//! of Kasahara's Standard Task Graph Set the shortest makespans without preemption
//! are published. Here each graph runs as a DAG of one job, without preemption, on
//! the machine: the subtask with the longest remaining path first, which is the
//! priority that a commit derives from WCETs. What is compared is thus the kernel's
//! own list schedule with the optimum, in the graphs' units of time.
//!
//! No schedule can be shorter than the optimum, and no list schedule on m cores
//! longer than 2 - 1/m times that (R. L. Graham, SIAM J. Appl. Math. 17, 1969,
//! doi 10.1137/0117039). Either is a limit: breaking it is a failure.
//!
//! - [`measure()`]: boots, one a number of cores, with all graphs;
//! - `report`: tables and files of them.

mod measure;
mod report;

use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

pub use measure::{Makespan, measure};

use replay::shown::quoted;

use crate::dag_file::stg::{TaskGraph, read_graphs};
use crate::files;
use crate::options::{Command, Opt, Parsed, Takes};
use crate::progress::Progress;
use crate::qemu::MOST_CORES;
use crate::system;

static TABLE: Command = Command {
    invocation: "./scripts/bench makespan",
    about: "Runs task graphs on the bare machine in QEMU and compares their makespans with the \
            published optima.",
    positional: None,
    options: &[
        Opt::new(
            "file",
            Takes::File("FILE"),
            "The set of task graphs; apps/dag-file/examples/stg50.json.",
        ),
        Opt::new(
            "cores",
            Takes::numbers(1..=MOST_CORES),
            "The numbers of cores; the file must have optima for them.",
        )
        .or("2,4,8,16"),
        Opt::new(
            "graphs",
            Takes::Text("NAMES"),
            "The graphs, with commas between; all of the file.",
        ),
        Opt::new(
            "out",
            Takes::File("FILE"),
            "Write the figures, too: as CSV, or as JSON Lines if the name ends in .json.",
        ),
    ],
    notes: "\
Deterministic mode; execution ends on whole units of time, as in the model of the
published optima. Printed are makespan and optimum of every graph, and for each
number of cores how many graphs reach the optimum, and the mean and largest ratio.

Exit code: 0 all is well; 1 a run failed, or a makespan is below the optimum or above
Graham's bound; 2 the command line or the file is refused.
",
};

/// Runs `bench makespan` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    let options = match TABLE.read(words) {
        Ok(options) => options,
        Err(code) => return code,
    };
    let cores: Vec<u64> = (options.text("cores").unwrap_or_default().split(','))
        .filter_map(|number| number.parse().ok())
        .collect();
    let graphs = match graphs(&options, &cores) {
        Ok(graphs) => graphs,
        Err(line) => return TABLE.refuse(&line),
    };
    let out = options.path("out");
    let mut all = Vec::new();
    let mut progress = Progress::new(cores.len() as u64, "boots");
    for (cores, over) in cores.into_iter().zip(1..) {
        match measure(&graphs, cores) {
            Ok(makespans) => all.extend(makespans),
            Err(line) => return TABLE.fail(&line),
        }
        progress.show(over);
    }
    progress.end();
    print!("{}", report::table(&all));
    if let Some(out) = out {
        let as_json = out.extension().is_some_and(|extension| extension == "json");
        let text = if as_json {
            report::json_lines(&all)
        } else {
            report::csv(&all)
        };
        if let Err(error) = fs::write(out, text) {
            return TABLE.fail(&format!("`--out {}`: {error}", files::place(out)));
        }
    }
    let broken: Vec<String> = all.iter().filter_map(Makespan::complaint).collect();
    if broken.is_empty() {
        return ExitCode::SUCCESS;
    }
    TABLE.fail(&broken.join("\n"))
}

/// Reads the graphs that are wanted, with an optimum for each number of cores.
fn graphs(options: &Parsed, cores: &[u64]) -> Result<Vec<TaskGraph>, String> {
    options.check_distinct(&["cores", "graphs"])?;
    files::check(&options.named(&["file"]), &options.named(&["out"]))?;
    let usual = || system::workspace().join("apps/dag-file/examples/stg50.json");
    let path = options.path("file").map_or_else(usual, PathBuf::from);
    let place = files::place(&path);
    let graphs = read_graphs(&files::read_text(&path)?)
        .map_err(|malformed| format!("{place}:{}: {}", malformed.line, malformed.reason))?;
    let wanted: Option<Vec<&str>> = options
        .text("graphs")
        .map(|names| names.split(',').collect());
    for name in wanted.iter().flatten() {
        if !graphs.iter().any(|graph| graph.name == *name) {
            return Err(format!(
                "`--graphs`: {place} has no graph {}; name one of its own",
                quoted(name)
            ));
        }
    }
    let mut graphs = graphs;
    graphs.retain(|graph| {
        let names = wanted.as_ref();
        names.is_none_or(|names| names.contains(&graph.name.as_str()))
    });
    for graph in &graphs {
        if let Some(cores) = cores
            .iter()
            .find(|cores| !graph.optimal.contains_key(cores))
        {
            let (line, name) = (graph.line, &graph.name);
            return Err(format!(
                "{place}:{line}: graph `{name}` has no optimum for {cores} cores; choose others"
            ));
        }
    }
    Ok(graphs)
}
