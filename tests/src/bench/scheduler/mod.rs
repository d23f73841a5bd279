//! What the scheduler's own work costs.
//!
//! Two limits hold on every host, because they are ratios: a commit costs at
//! most 20 times a plain depth-first walk of the same graph, and the cost of a
//! dispatched instance grows no faster than the logarithm of the number of ready
//! instances.

mod commit;
mod dispatch;

use std::ffi::OsString;
use std::process::ExitCode;

use crate::options::Command;

/// How many depth-first walks a commit may cost.
const MOST_WALKS: f64 = 20.0;

static TABLE: Command = Command {
    invocation: "./scripts/bench scheduler",
    about: "Measures the commit of a large DAG, and the cost of a dispatched instance.",
    positional: None,
    options: &[],
    notes: "\
Prints a table and a JSON object for each figure.

Exit code: 0 all limits hold; 1 one does not; 2 the command line is refused.
",
};

/// Measures, prints, and judges.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    if let Err(code) = TABLE.read(words) {
        return code;
    }
    let commits = commit::measure();
    println!(
        "commit of {} subtasks and {} edges",
        commit::SUBTASKS,
        commit::EDGES
    );
    println!("  {:28}{:>12}{:>12}", "", "time, us", "walks");
    for commit in &commits {
        println!(
            "  {:28}{:>12.1}{:>12.1}",
            commit.what,
            micros(commit.time),
            commit.walks
        );
    }
    let dispatches = dispatch::measure();
    println!("cost of a dispatched instance (completion, next dispatch) on one core, EDF");
    println!(
        "  {:28}{:>12}{:>12}{:>12}",
        "ready instances", "time, ns", "growth", "log growth"
    );
    for dispatch in &dispatches {
        println!(
            "  {:<28}{:>12.1}{:>12.2}{:>12.2}",
            dispatch.ready, dispatch.nanoseconds, dispatch.growth, dispatch.log_growth
        );
    }
    for commit in &commits {
        println!(
            "{{\"kind\":\"bench\",\"name\":\"commit\",\"what\":\"{}\",\"subtasks\":{},\"edges\":{},\
             \"time_ns\":{},\"walks\":{:.2}}}",
            commit.what,
            commit::SUBTASKS,
            commit::EDGES,
            commit.time.as_nanos(),
            commit.walks
        );
    }
    for dispatch in &dispatches {
        println!(
            "{{\"kind\":\"bench\",\"name\":\"dispatch\",\"ready\":{},\"instance_ns\":{:.1},\
             \"growth\":{:.3},\"log_growth\":{:.3}}}",
            dispatch.ready, dispatch.nanoseconds, dispatch.growth, dispatch.log_growth
        );
    }
    judge(&commits, &dispatches)
}

fn judge(commits: &[commit::Figure], dispatches: &[dispatch::Figure]) -> ExitCode {
    let mut failures = Vec::new();
    for commit in commits.iter().filter(|commit| commit.is_limited) {
        if commit.walks > MOST_WALKS {
            failures.push(format!(
                "the commit costs {:.1} walks, more than {MOST_WALKS}",
                commit.walks
            ));
        }
    }
    for dispatch in dispatches {
        if dispatch.growth > dispatch.log_growth {
            failures.push(format!(
                "with {} ready instances an instance costs {:.2} times as much as with {}, \
                 more than the logarithm's {:.2}",
                dispatch.ready,
                dispatch.growth,
                dispatch::FEWEST,
                dispatch.log_growth
            ));
        }
    }
    if failures.is_empty() {
        println!("all limits hold");
    }
    for failure in &failures {
        println!("{failure}");
    }
    ExitCode::from(u8::from(!failures.is_empty()))
}

fn micros(time: std::time::Duration) -> f64 {
    time.as_secs_f64() * 1e6
}
