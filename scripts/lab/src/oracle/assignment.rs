//! Reference values of lent cores: attempts, clusters, orders, busy times, groups and bounds.
//!
//! A case gives a set of DAGs and what an independent implementation divides the cores into;
//! [`check`] computes the same with `sched_dag::analysis::lend` and compares record by record.
//!
//! ```text
//! case NAME m ndags
//! then for each DAG:  dag T D nsub nedge / wcet c_0 .. / edge u v ..
//! attempt A           0 to 4, or -: none proves all DAGs
//! failed d_0 d_1 ..   the DAG without a place in each attempt that failed
//! own DAG R FIRST C   an owner, its bound, its first core and how many it has; by position, each
//!                     followed by records of its cores:
//! order K v s v s ..  the subtasks of core K with their starts
//! busy K r B r B r B  the most time that the owner takes in windows of T / 3 (ceiling), T, 3 T / 2
//! guest DAG R k k ..  a member, its bound and the cores of its group; by position
//! end
//! ```

use sched_dag::analysis::{CoreOwner, LendingAnswer, LendingPlan, Task, lend};
use text::{Line, Lines, Malformed, cases};

use super::FileOracle;
use super::bounds::{list, parse_task};

/// The kind `assignment`.
pub(super) static ORACLE: FileOracle<AssignmentCase> = FileOracle {
    invocation: "./scripts/oracle assignment",
    about: "Compares how cores are divided among DAGs that own and DAGs that share them, with \
            orders, busy times and bounds, with the division by lent cores.",
    parse,
    check,
    name: |case| &case.name,
    schedules: None,
};

/// One set of DAGs with the division expected of it.
#[derive(Debug)]
pub struct AssignmentCase {
    /// The case's name.
    pub name: String,
    /// The number of cores.
    pub(crate) cores: u32,
    /// The DAGs.
    pub(crate) tasks: Vec<Task>,
    records: Vec<String>,
}

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described above.
pub fn parse(text: &str) -> Result<Vec<AssignmentCase>, Malformed> {
    cases(text, |header, lines| parse_case(header, lines, true))
}

/// Works like [`parse`] for a file in which a case may end after its DAGs.
///
/// # Errors
///
/// As [`parse`].
pub(crate) fn parse_sets(text: &str) -> Result<Vec<AssignmentCase>, Malformed> {
    cases(text, |header, lines| parse_case(header, lines, false))
}

/// Reads a case, which may lack what is expected of it unless it `is_answered`.
fn parse_case(
    header: &Line<'_>,
    lines: &mut Lines<'_>,
    is_answered: bool,
) -> Result<AssignmentCase, Malformed> {
    let [name, cores, count] = header.fixed()?;
    let (cores, count) = (header.cores(cores)?, header.at_least_one(count)?);
    let tasks = (0..count).map(|_| parse_task(lines));
    let tasks = tasks.collect::<Result<Vec<_>, Malformed>>()?;
    let mut records = Vec::new();
    if is_answered || lines.clone().next_if("attempt").is_some() {
        for kind in ["attempt", "failed"] {
            records.push(record(&lines.expect(kind)?)?);
        }
        let kinds = ["own", "order", "busy", "guest"];
        while let Some(line) = kinds.iter().find_map(|kind| lines.next_if(kind)) {
            records.push(record(&line)?);
        }
    }
    lines.expect("end")?.exactly(0)?;
    Ok(AssignmentCase {
        name: name.to_owned(),
        cores,
        tasks,
        records,
    })
}

/// Checks the form of a record, and returns it in normal form: spellings such as `007` are equal.
fn record(line: &Line<'_>) -> Result<String, Malformed> {
    if line.kind == "attempt" && line.words == ["-"] {
        return Ok("attempt -".to_owned());
    }
    let words = line.words.len();
    let (is_right, form) = match line.kind {
        "attempt" => (words == 1, "attempt A"),
        "failed" => (words <= 5, "failed d_0 d_1 .."),
        "own" => (words == 4, "own DAG R FIRST C"),
        "order" => (words % 2 == 1, "order K v s v s .."),
        "busy" => (words == 7, "busy K r B r B r B"),
        _ => (words >= 3, "guest DAG R k k .."),
    };
    match is_right {
        true => Ok(shown(line.kind, &line.numbers(words)?)),
        false => Err(line.malformed(format!("expected `{form}`, found {words} words"))),
    }
}

fn shown(kind: &str, numbers: &[u64]) -> String {
    format!("{kind} {}", list(numbers)).trim_end().to_owned()
}

/// Computes and compares the records of a case.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &AssignmentCase) -> Result<(), String> {
    let tasks: Vec<&Task> = case.tasks.iter().collect();
    let answer =
        lend(&tasks, case.cores).ok_or("D exceeds T, which the analysis does not cover")?;
    let computed = records(&tasks, &answer);
    let ends = [case.records.len(), computed.len()];
    for place in 0..ends.into_iter().max().unwrap_or(0) {
        let of = |records: &[String]| records.get(place).map_or("end", |record| record).to_owned();
        let (expected, computed) = (of(&case.records), of(&computed));
        if expected != computed {
            return Err(format!("expected `{expected}`, computed `{computed}`"));
        }
    }
    Ok(())
}

/// Returns the records of an answer.
fn records(tasks: &[&Task], answer: &LendingAnswer) -> Vec<String> {
    let attempt = answer.plan.as_ref().map(|plan| plan.attempt as u64);
    let attempt = attempt.map_or("-".to_owned(), |attempt| attempt.to_string());
    let failed: Vec<u64> = answer.failed.iter().map(|&dag| dag as u64).collect();
    let mut records = vec![format!("attempt {attempt}"), shown("failed", &failed)];
    if let Some(plan) = &answer.plan {
        let mut owners: Vec<&CoreOwner> = plan.owners.iter().collect();
        owners.sort_by_key(|owner| owner.dag);
        for owner in owners {
            records.extend(of_owner(owner, plan, tasks[owner.dag].period_ns()));
        }
        let mut members = Vec::new();
        for group in &plan.groups {
            members.extend(group.members.iter().map(|member| (member, &group.cores)));
        }
        members.sort_by_key(|((dag, _), _)| *dag);
        for (&(dag, bound_ns), cores) in members {
            let cores = cores.iter().map(|&core| core as u64);
            let numbers: Vec<u64> = [dag as u64, bound_ns].into_iter().chain(cores).collect();
            records.push(shown("guest", &numbers));
        }
    }
    records
}

fn of_owner(owner: &CoreOwner, plan: &LendingPlan, period_ns: u64) -> Vec<String> {
    let lists = &owner.schedule.cores;
    let (dag, first) = (owner.dag as u64, owner.first_core as u64);
    let own = [dag, owner.schedule.length_ns(), first, lists.len() as u64];
    let mut records = vec![shown("own", &own)];
    let windows_ns = [period_ns.div_ceil(3), period_ns, period_ns + period_ns / 2];
    for (core, list) in (owner.first_core..).zip(lists) {
        let starts = list.iter().flat_map(|of| [of.subtask as u64, of.start_ns]);
        let numbers: Vec<u64> = [core as u64].into_iter().chain(starts).collect();
        records.push(shown("order", &numbers));
        let supply = &plan.supplies[core];
        let busy = windows_ns.map(|window_ns| [window_ns, supply.busy_ns(window_ns)]);
        let numbers = [core as u64].into_iter().chain(busy.into_iter().flatten());
        records.push(shown("busy", &numbers.collect::<Vec<u64>>()));
    }
    records
}

#[cfg(test)]
mod tests {
    use super::{ORACLE, parse, parse_sets};
    use crate::oracle::judged::{assert_agree, assert_differs};
    use crate::tests::{altered, assert_malformed};

    const FILE: &str = include_str!("../../../../tests/oracle/lent.txt");

    #[test]
    fn all_public_cases_agree() {
        assert_agree(&ORACLE, FILE, 60);
    }

    fn first() -> &'static str {
        FILE.split_inclusive("end\n").next().unwrap()
    }

    /// A part of the first case, its replacement, and the difference that it makes.
    const WRONG: &str = r"attempt 3 | attempt 4 | expected `attempt 4`, computed `attempt 3`
failed 1 0 0 | failed 1 0 | expected `failed 1 0`, computed `failed 1 0 0`
order 4 0 0 | order 4 0 1 | expected `order 4 0 1`, computed `order 4 0 0`
busy 4 271 27 811 | busy 4 271 28 811 | expected `busy 4 271 28 811 27 1216 54`, computed `busy 4 271 27 811 27 1216 54`
own 4 219 | own 4 220 | expected `own 4 220 0 3`, computed `own 4 219 0 3`
guest 3 3420 7 4\n |  | expected `end`, computed `guest 3 3420 7 4`
\nend\n | \nguest 3 1 1\nend\n | expected `guest 3 1 1`, computed `end`
dag 834 178 | dag 177 178 | D exceeds T, which the analysis does not cover";

    #[test]
    fn a_difference_names_the_record() {
        assert_differs(&ORACLE, first(), WRONG);
        assert_agree(
            &ORACLE,
            &altered(first(), ["guest 0 114", "guest 00 0114"]),
            1,
        );
    }

    /// The same for refusals, with the line and the reason.
    const MALFORMED: &str = r"attempt 3\n |  | 52 | expected a `attempt` record, found `failed`
attempt 3 | attempt | 52 | expected `attempt A`, found 0 words
attempt 3 | attempt x | 52 | `x` is not a whole number
failed 1 0 0 | failed - - - | 53 | `-` is not a whole number
own 4 219 0 3 | own 4 219 0 | 64 | expected `own DAG R FIRST C`, found 3 words
order 4 0 0 | order 4 0 | 62 | expected `order K v s v s ..`, found 2 words
1216 54 | 1216 | 63 | expected `busy K r B r B r B`, found 6 words
guest 0 114 7 4 | guest 0 114 | 71 | expected `guest DAG R k k ..`, found 2 words
\nend\n | \nlent\n | 73 | expected a `end` record, found `lent`";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        assert_malformed(parse, first(), MALFORMED);
    }

    #[test]
    fn a_set_needs_no_answer_where_none_is_compared() {
        let set = "case a 2 1\ndag 9 8 1 0\nwcet 3\n";
        let sets = parse_sets(&format!("{set}end\n")).unwrap();
        assert_eq!((sets.len(), sets[0].cores, sets[0].tasks.len()), (1, 2, 1));
        for end in ["", "own 0 1 0 1\nend\n", "attempt 0\nend\n"] {
            let error = parse_sets(&format!("{set}{end}")).unwrap_err();
            let line = 4 + usize::from(end.starts_with("attempt"));
            assert_eq!(error.line, line, "{end}");
        }
    }
}
