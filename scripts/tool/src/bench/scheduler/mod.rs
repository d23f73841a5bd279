//! What the scheduler's own work costs, and the answer at commit.
//!
//! Two ratios are the same on every host that is idle: a commit costs at most 20 times
//! a plain depth-first walk of the same graph, and the cost of a dispatched instance
//! grows no faster than the logarithm of the number of ready instances. A figure above
//! that is pointed out and is no failure, for what else a host does moves both: shared
//! caches alone have made 29 walks of 15. Each time is the shortest of several rounds.

mod commit;
mod dispatch;
mod sets;

use std::ffi::OsString;
use std::process::ExitCode;

use crate::options::Command;

/// How many depth-first walks a commit costs at most on an idle host.
const MOST_WALKS: f64 = 20.0;

static TABLE: Command = Command {
    invocation: "./scripts/bench scheduler",
    about: "Measures the commit of a large DAG and of many, and the cost of a dispatched instance.",
    positional: None,
    options: &[],
    notes: "\
Prints a table and a JSON object for each figure.

A figure above what an idle host gives is pointed out at the end.

Exit code: 0 measured; 2 the command line is refused.
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
    let sets = sets::measure();
    print!("{}", sets::table(&sets));
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
    sets.iter().for_each(|set| println!("{}", set.line()));
    for remark in remarks(&commits, &dispatches) {
        println!("{remark}; on an idle host it does not");
    }
    ExitCode::SUCCESS
}

fn remarks(commits: &[commit::Figure], dispatches: &[dispatch::Figure]) -> Vec<String> {
    let mut remarks = Vec::new();
    for commit in commits.iter().filter(|commit| commit.is_limited) {
        if commit.walks > MOST_WALKS {
            let (what, walks) = (commit.what, commit.walks);
            remarks.push(format!(
                "`{what}` takes {walks:.1} walks, more than {MOST_WALKS}"
            ));
        }
    }
    for dispatch in dispatches {
        if dispatch.growth > dispatch.log_growth {
            remarks.push(format!(
                "with {} ready instances an instance takes {:.2} times as long as with {}, \
                 more than the logarithm's {:.2}",
                dispatch.ready,
                dispatch.growth,
                dispatch::FEWEST,
                dispatch.log_growth
            ));
        }
    }
    remarks
}

fn micros(time: std::time::Duration) -> f64 {
    time.as_secs_f64() * 1e6
}

#[cfg(test)]
mod tests {
    use super::{commit, dispatch, remarks};
    use std::time::Duration;

    #[test]
    fn what_a_busy_host_moves_is_said_and_is_no_failure() {
        let commit = |walks| commit::Figure {
            what: "commit, edges",
            time: Duration::from_micros(1),
            walks,
            is_limited: true,
        };
        let dispatch = |growth| dispatch::Figure {
            ready: 100,
            nanoseconds: 1.0,
            growth,
            log_growth: 2.0,
        };
        assert_eq!(remarks(&[commit(20.0)], &[dispatch(2.0)]), [""; 0]);
        let said = remarks(&[commit(29.04)], &[dispatch(2.5)]);
        assert_eq!(said[0], "`commit, edges` takes 29.0 walks, more than 20");
        assert!(said[1].starts_with("with 100 ready instances"), "{said:?}");
    }
}
