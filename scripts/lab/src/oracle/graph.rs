//! Reference verdicts of schedule-abstraction graphs, and bounds of sinks.
//!
//! ```text
//! case NAME CORES EDF DAGS
//! dag PERIOD DEADLINE OFFSET JITTER SUBTASKS EDGES
//! sub WCET PRIORITY BEST
//! edge FROM TO
//! sink SUBTASK DEADLINE               of one that is due before its job
//! verdict proven STATES               or `late`, or `limit`, of 300 states
//! f DAG SUBTASK BOUND SEEN            of each sink of a proven set: the longest response of some runs
//! end
//! ```
//!
//! The reference's number of states depends on its order of merging, and is not compared.

use std::collections::BTreeMap;

use sched_dag::analysis::{
    AbstractionDag, AbstractionSet, AbstractionSubtask, NotClosed, check_closed, explore,
};
use text::{Line, Lines, Malformed, cases};

use super::{FileOracle, equal};

/// The limit of states in the reference.
const STATES: usize = 300;

/// The kind `graph`.
pub(super) static ORACLE: FileOracle<GraphCase> = FileOracle {
    invocation: "./scripts/oracle graph",
    about: "Compares verdicts and bounds of schedule-abstraction graphs, whose closed lists are \
            checked besides.",
    parse,
    check,
    name: |case| &case.name,
    schedules: None,
};

/// A set with its expected verdict.
#[derive(Debug)]
pub(super) struct GraphCase {
    name: String,
    cores: u32,
    is_edf: bool,
    dags: Vec<AbstractionDag>,
    verdict: String,
    /// For each sink: DAG, subtask, bound, and the longest response of some runs.
    sinks: Vec<[u64; 4]>,
}

fn parse(text: &str) -> Result<Vec<GraphCase>, Malformed> {
    cases(text, |header, lines| {
        let [name, cores, is_edf, count] = header.fixed()?;
        let is_edf = header.flag(is_edf)?;
        let dags = (0..header.at_least_one(count)?).map(|_| parse_dag(lines, is_edf));
        let dags = dags.collect::<Result<Vec<_>, Malformed>>()?;
        let verdict = lines.expect("verdict")?;
        let word = verdict.words.first().copied().unwrap_or_default();
        match word {
            "late" | "limit" => _ = verdict.fixed::<1>()?,
            "proven" => _ = verdict.number::<u64>(verdict.fixed::<2>()?[1])?,
            _ => return Err(verdict.malformed("expected `proven N`, `late` or `limit`")),
        }
        let mut sinks = Vec::new();
        while let Some(line) = lines.next_if("f") {
            let numbers: Vec<u64> = line.numbers(4)?;
            let [dag, subtask, ..] = line.fixed::<4>()?;
            let dag = line.index("dag", dag, dags.len())?;
            line.index("subtask", subtask, dags[dag].subtasks.len())?;
            sinks.push([numbers[0], numbers[1], numbers[2], numbers[3]]);
        }
        lines.expect("end")?.exactly(0)?;
        Ok(GraphCase {
            name: name.to_owned(),
            cores: header.cores(cores)?,
            is_edf,
            dags,
            verdict: word.to_owned(),
            sinks,
        })
    })
}

fn parse_dag(lines: &mut Lines<'_>, is_edf: bool) -> Result<AbstractionDag, Malformed> {
    let header = lines.expect("dag")?;
    let [period, deadline, offset, jitter, count, edges] = header.fixed()?;
    let count = header.at_least_one(count)? as usize;
    let deadline_ns: u64 = header.number(deadline)?;
    let subtask = |line: &Line<'_>| {
        let [wcet, priority, best] = line.fixed()?;
        Ok(AbstractionSubtask {
            wcet_ns: line.at_least_one(wcet)?.into(),
            best_ns: line.number(best)?,
            number: line.number(priority)?,
            deadline_ns: Some(deadline_ns),
        })
    };
    let subtasks = (0..count).map(|_| subtask(&lines.expect("sub")?));
    let mut subtasks = subtasks.collect::<Result<Vec<_>, Malformed>>()?;
    let edges = lines.edges(header.number(edges)?, count)?;
    while let Some(line) = lines.next_if("sink") {
        let [sink, deadline] = line.fixed()?;
        let deadline_ns = line.number(deadline)?;
        subtasks[line.index("subtask", sink, count)?].deadline_ns = Some(deadline_ns);
    }
    // The deadlines travel from the sinks to the sources, one edge a round: edges need not lead to
    // larger numbers.
    let mut dues: Vec<u64> = subtasks.iter().filter_map(|of| of.deadline_ns).collect();
    for &(from, _) in &edges {
        dues[from] = u64::MAX;
        subtasks[from].deadline_ns = None;
    }
    for _ in 0..count {
        for &(from, to) in &edges {
            dues[from] = dues[from].min(dues[to]);
        }
    }
    if is_edf {
        for (of, due) in subtasks.iter_mut().zip(dues) {
            of.number = due;
        }
    }
    Ok(AbstractionDag {
        jobs: None,
        period_ns: header.number(period)?,
        offset_ns: header.number(offset)?,
        jitter_ns: header.number(jitter)?,
        subtasks,
        edges,
    })
}

fn check(case: &GraphCase) -> Result<(), String> {
    let set = AbstractionSet::new(case.cores, &case.dags, case.is_edf, false);
    let found = set.and_then(|set| Ok((explore(&set, STATES)?, set)));
    let verdict = match found {
        Ok(_) => "proven",
        Err(NotClosed::Late { .. }) => "late",
        Err(_) => "limit",
    };
    if verdict != case.verdict {
        return Err(format!("expected {}, found {verdict}", case.verdict));
    }
    let Ok((states, set)) = found else {
        return Ok(());
    };
    let bounds = check_closed(&set, &states);
    let bounds = bounds.map_err(|why| format!("the list is not closed: {why:?}"))?;
    let mut found = BTreeMap::new();
    for (dag, subtasks) in (0_u64..).zip(&bounds) {
        let bounds = (0_u64..)
            .zip(subtasks)
            .filter(|(_, bound_ns)| **bound_ns > 0);
        found.extend(bounds.map(|(subtask, &bound_ns)| ((dag, subtask), bound_ns)));
    }
    equal("set", "sinks", case.sinks.len() as u64, found.len() as u64)?;
    for &[dag, subtask, bound_ns, seen_ns] in &case.sinks {
        let found_ns = found.get(&(dag, subtask)).copied().unwrap_or(0);
        let place = format!("dag {dag}, subtask {subtask}");
        equal(&place, "bound", bound_ns, found_ns)?;
        if found_ns < seen_ns {
            return Err(format!("{place}: {seen_ns} was seen, beyond {found_ns}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::judged::{assert_agree, assert_differs};
    use super::*;

    const TEXT: &str = include_str!("../../../../tests/oracle/sag.txt");

    #[test]
    fn graphs_agree_with_the_reference() {
        assert_agree(&ORACLE, TEXT, 64);
    }

    /// The first proven set, with differences: a part, another in its place, what is found.
    const WRONG: &str = "\
verdict proven 8 | verdict late | expected late, found proven
f 1 1 7 7 | f 1 1 6 6 | dag 1, subtask 1: bound: expected 6, found 7
f 1 1 7 7 | f 1 1 7 8 | dag 1, subtask 1: 8 was seen, beyond 7
f 0 0 8 8 | # | set: sinks: expected 2, found 3";

    #[test]
    fn a_difference_is_named() {
        let proven = TEXT.find("verdict proven").expect("one is proven");
        let first = &TEXT[TEXT[..proven].rfind("case ").expect("its beginning")..];
        assert_differs(&ORACLE, first, WRONG);
    }

    #[test]
    fn a_malformed_line_is_refused() {
        for (from, to) in [
            ("verdict late", "verdict never"),
            ("verdict late", "verdict late 3"),
            ("sub 5 0 1", "sub 0 0 1"),
            ("edge 0 2", "edge 0 4"),
            ("case s1 3 0 3", "case s1 3 2 3"),
        ] {
            assert!(parse(&TEXT.replacen(from, to, 1)).is_err(), "{to}");
        }
    }
}
