//! Reference values of tables and lent cores: attempts, lists, busy times, groups and bounds.
//!
//! A case gives a set of DAGs and the division of the cores by an independent implementation;
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
//!
//! Tables of several DAGs (attempts 5 and 6) bring in other records:
//!
//! ```text
//! case NAME m ndags limit                         the most entries of a table
//! dag T D O p|s np nsub nedge nsink / wcet / edge / sink v D_v ..
//! failed d why ..                                 the DAG may be -
//! table H c N tries i ..                          then for each of c cores:
//! list k i j v start finish depth ..
//! busy k w B ..                                   in windows of H / 7, H / 2 (ceiling), H, 4 H / 3
//! bound i R .. / sinkbound i v R ..               then `own` to `guest`
//! ```

use sched_dag::analysis::{CoreOwner, CoreSupply, LendingAnswer, TableTerms, Task, lend};
use sched_dag::{CoreList, Table, TableEntry};
use text::{Line, Lines, Malformed, cases};

use super::FileOracle;
use super::bounds::parse_task;

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

/// A set of DAGs with the expected division of the cores.
#[derive(Debug)]
pub struct AssignmentCase {
    /// The case's name.
    pub name: String,
    /// The number of cores.
    pub(crate) cores: u32,
    /// The largest number of entries of a table; `None`: the case has only lent cores.
    pub(crate) limit: Option<usize>,
    /// The DAGs.
    pub(crate) tasks: Vec<Task>,
    records: Vec<String>,
}

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that deviates from the description above.
pub fn parse(text: &str) -> Result<Vec<AssignmentCase>, Malformed> {
    cases(text, |header, lines| parse_case(header, lines, true))
}

/// Works like [`parse`], for files whose cases may end after the DAGs.
///
/// # Errors
///
/// As [`parse`].
pub(crate) fn parse_sets(text: &str) -> Result<Vec<AssignmentCase>, Malformed> {
    cases(text, |header, lines| parse_case(header, lines, false))
}

/// Reads a case. Unless the case `is_answered`, the expected records may be missing.
fn parse_case(
    header: &Line<'_>,
    lines: &mut Lines<'_>,
    is_answered: bool,
) -> Result<AssignmentCase, Malformed> {
    let limit = header.words.get(3).map(|word| header.number(word));
    let limit = limit.transpose()?;
    let words = header.exactly(3 + usize::from(limit.is_some()))?;
    let (name, cores, count) = (
        words[0],
        header.cores(words[1])?,
        header.at_least_one(words[2])?,
    );
    let tasks = (0..count).map(|_| match limit {
        Some(_) => parse_attributes(lines),
        None => parse_task(lines),
    });
    let tasks = tasks.collect::<Result<Vec<_>, Malformed>>()?;
    let mut records = Vec::new();
    if is_answered || lines.clone().next_if("attempt").is_some() {
        for kind in ["attempt", "failed"] {
            records.push(record(&lines.expect(kind)?, limit.is_some())?);
        }
        let kinds = "table list bound sinkbound own order busy guest".split(' ');
        let kinds: Vec<_> = kinds.skip(if limit.is_some() { 0 } else { 4 }).collect();
        while let Some(line) = kinds.iter().find_map(|kind| lines.next_if(kind)) {
            records.push(record(&line, limit.is_some())?);
        }
    }
    lines.expect("end")?.exactly(0)?;
    Ok(AssignmentCase {
        name: name.to_owned(),
        cores,
        limit,
        tasks,
        records,
    })
}

/// Reads a DAG with its offset, the deadlines of sinks, and whether the DAG is sporadic or
/// non-preemptive.
fn parse_attributes(lines: &mut Lines<'_>) -> Result<Task, Malformed> {
    let header = lines.expect("dag")?;
    let [period, deadline, terms @ ..] = header.fixed::<8>()?;
    let [offset, kind, keeps, subtasks, edges, sinks] = terms;
    let subtasks = header.at_least_one(subtasks)? as usize;
    let (sinks, offset_ns) = (header.number::<usize>(sinks)?, header.number(offset)?);
    let wcets_ns = lines.expect("wcet")?.numbers(subtasks)?;
    let edges = lines.edges(header.number(edges)?, subtasks)?;
    let sinks = (0..sinks).map(|_| {
        let line = lines.expect("sink")?;
        let [sink, deadline] = line.fixed()?;
        Ok((
            line.index("subtask", sink, subtasks)?,
            line.number(deadline)?,
        ))
    });
    let terms = TableTerms {
        sink_deadlines_ns: sinks.collect::<Result<_, Malformed>>()?,
        non_preemptive: (0..if header.flag(keeps)? { subtasks } else { 0 }).collect(),
        offset_ns: match kind {
            "p" => Some(offset_ns),
            "s" => None,
            _ => return Err(header.malformed("expected `p` or `s`")),
        },
    };
    let (period_ns, deadline_ns) = (header.number(period)?, header.number(deadline)?);
    let task = Task::new(period_ns, deadline_ns, wcets_ns, &edges);
    let task = task.map_err(|error| header.malformed(error.to_string()))?;
    Ok(task.with_table_terms(terms))
}

/// Checks a record's form, and returns the record in normal form: spellings such as `007` are
/// equal.
fn record(line: &Line<'_>, has_tables: bool) -> Result<String, Malformed> {
    if line.kind == "attempt" && line.words == ["-"] {
        return Ok("attempt -".to_owned());
    }
    let words = line.words.len();
    let (is_right, form) = match line.kind {
        "attempt" => (words == 1, "attempt A"),
        "failed" if has_tables => (words.is_multiple_of(2), "failed d why .."),
        "failed" => (words <= 5, "failed d_0 d_1 .."),
        "table" => (words >= 5, "table H c N tries i .."),
        "list" => (words % 6 == 1, "list k i j v start finish depth .."),
        "bound" => (words == 2, "bound i R"),
        "sinkbound" => (words == 3, "sinkbound i v R"),
        "own" => (words == 4, "own DAG R FIRST C"),
        "order" => (words % 2 == 1, "order K v s v s .."),
        "busy" => (words == 7 || words == 9 && has_tables, "busy K r B r B r B"),
        _ => (words >= 3, "guest DAG R k k .."),
    };
    match is_right {
        true if line.kind == "failed" && has_tables => Ok(failed(&line.words)),
        true => {
            let number = |word: &&str| match word.strip_prefix('-') {
                // A job begun in an earlier lap has a negative number.
                Some(word) if line.kind == "list" => Ok(-line.number::<i128>(word)?),
                _ => line.number::<i128>(word),
            };
            let numbers = line.words.iter().map(number);
            Ok(shown(line.kind, &numbers.collect::<Result<Vec<_>, _>>()?))
        }
        false => Err(line.malformed(format!("expected `{form}`, found {words} words"))),
    }
}

fn failed(words: &[impl std::borrow::Borrow<str>]) -> String {
    format!("failed {}", words.join(" ")).trim_end().to_owned()
}

fn shown(kind: &str, numbers: &[i128]) -> String {
    let words: Vec<String> = numbers.iter().map(i128::to_string).collect();
    format!("{kind} {}", words.join(" ")).trim_end().to_owned()
}

/// Computes and compares the records of a case.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &AssignmentCase) -> Result<(), String> {
    let tasks: Vec<&Task> = case.tasks.iter().collect();
    let answer = lend(&tasks, case.cores, case.limit.unwrap_or(0)).ok_or("it does not apply")?;
    let computed = records(&tasks, &answer, case.limit.is_some());
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
fn records(tasks: &[&Task], answer: &LendingAnswer, has_tables: bool) -> Vec<String> {
    let attempt = answer.plan.as_ref().map(|plan| plan.attempt as u64);
    let attempt = attempt.map_or("-".to_owned(), |attempt| attempt.to_string());
    let words = answer.failed.iter().flat_map(|(dag, why)| {
        let dag = dag.map_or("-".to_owned(), |dag| dag.to_string());
        let why = has_tables.then(|| format!("{why:?}").to_lowercase());
        [Some(dag), why]
    });
    // Without tables there are five attempts.
    let words = words.flatten().take(if has_tables { 14 } else { 5 });
    let words: Vec<String> = words.collect();
    let mut records = vec![format!("attempt {attempt}"), failed(&words)];
    if let Some(plan) = &answer.plan {
        let mut owners: Vec<&CoreOwner> = plan.owners.iter().collect();
        if plan.attempt as u64 >= 5 {
            records.extend(of_family(owners.remove(0), tasks));
        }
        owners.sort_by_key(|owner| owner.dags[0]);
        for owner in owners {
            records.extend(of_owner(owner, tasks));
        }
        let mut members = Vec::new();
        for group in &plan.groups {
            members.extend(group.members.iter().map(|member| (member, &group.cores)));
        }
        members.sort_by_key(|((dag, _), _)| *dag);
        for (&(dag, bound_ns), cores) in members {
            let cores = cores.iter().map(|&core| core as i128);
            let numbers = [bound_ns.into()].into_iter().chain(cores);
            records.push(counted("guest", dag, numbers));
        }
    }
    records
}

fn of_owner(owner: &CoreOwner, tasks: &[&Task]) -> Vec<String> {
    let (first, table) = (owner.first_core, &owner.table);
    let (dag, period_ns) = (owner.dags[0], table.lap_ns);
    let finishes_ns = table.entries().map(|of| of.start_ns + of.length_ns);
    let bound_ns = i128::from(finishes_ns.max().unwrap_or(0));
    let own = [dag as i128, bound_ns, first as i128, owner.cores as i128];
    let mut records = vec![shown("own", &own)];
    let windows_ns = [period_ns.div_ceil(3), period_ns, period_ns + period_ns / 2];
    for core in first..first + owner.cores {
        let entries = list(table, core).map_or(&[][..], |list| &list.entries);
        let starts = entries.iter();
        let starts = starts.flat_map(|of| [of.subtask.0.into(), of.start_ns.into()]);
        records.push(counted("order", core, starts));
        records.push(busy(table, core, tasks, &windows_ns));
    }
    records
}

fn of_family(owner: &CoreOwner, tasks: &[&Task]) -> Vec<String> {
    let (table, lap_ns) = (&owner.table, owner.table.lap_ns);
    let count = table.entries().count();
    let sizes = [owner.cores as i128, count as i128, owner.tries.into()];
    let dags = owner.dags.iter().map(|&dag| dag as i128);
    let sizes = [lap_ns.into()].into_iter().chain(sizes);
    let mut records = vec![shown("table", &sizes.chain(dags).collect::<Vec<_>>())];
    let parts_ns = [lap_ns.div_ceil(7), lap_ns.div_ceil(2)];
    let windows_ns = [parts_ns[0], parts_ns[1], lap_ns, lap_ns + lap_ns / 3];
    // Records count from the grid, even where a table counts from the release of its only DAG.
    let is_alone = owner.dags.len() == 1;
    let on_grid = |entry: &TableEntry| {
        let task = tasks[entry.dag.index()];
        let offset_ns = task.table_terms().offset_ns.unwrap_or(0);
        let (phase_ns, first) = match is_alone {
            true => (offset_ns % task.period_ns(), 0),
            false => (0, offset_ns / task.period_ns()),
        };
        let start_ns = entry.start_ns + phase_ns;
        let jobs = i128::from(start_ns / lap_ns * (lap_ns / task.period_ns()));
        let job = i128::from(entry.job) + i128::from(first) - jobs;
        (start_ns % lap_ns, job, *entry)
    };
    for core in 0..owner.cores {
        let entries = list(table, core).map_or(&[][..], |list| &list.entries);
        let mut entries: Vec<_> = entries.iter().map(on_grid).collect();
        entries.sort_by_key(|(start_ns, ..)| *start_ns);
        let entries = entries.into_iter().flat_map(|(start_ns, job, of)| {
            let (dag, subtask, depth) = (of.dag.0.into(), of.subtask.0.into(), of.depth.into());
            let finish_ns = i128::from(start_ns + of.length_ns);
            [dag, job, subtask, start_ns.into(), finish_ns, depth]
        });
        records.push(counted("list", core, entries));
        records.push(busy(table, core, tasks, &windows_ns));
    }
    let bound = |dag: usize, sink: Option<usize>| {
        let own = table.entries().filter(|of| of.dag.index() == dag);
        let own = own.filter(|of| sink.is_none_or(|sink| of.subtask.index() == sink));
        let responses_ns = own.map(|of| {
            let release_ns = tasks[dag].release_in_lap_ns(of.job, is_alone);
            i128::from(of.start_ns + of.length_ns) - i128::from(release_ns)
        });
        responses_ns.max().unwrap_or(0)
    };
    for &dag in &owner.dags {
        records.push(shown("bound", &[dag as i128, bound(dag, None)]));
    }
    for &dag in &owner.dags {
        let task = tasks[dag];
        let is_sink = |sink: &usize| task.successors(*sink).len() == 0;
        if !task.table_terms().sink_deadlines_ns.is_empty() {
            for sink in (0..task.subtask_count()).filter(is_sink) {
                let numbers = [dag as i128, sink as i128, bound(dag, Some(sink))];
                records.push(shown("sinkbound", &numbers));
            }
        }
    }
    records
}

fn list(table: &Table, core: usize) -> Option<&CoreList> {
    table.list(u32::try_from(core).ok()?)
}

fn busy(table: &Table, core: usize, tasks: &[&Task], windows_ns: &[u64]) -> String {
    let list = list(table, core);
    let supply = list.map(|list| CoreSupply::of_list(table, list, |dag| tasks[dag.index()], 0));
    let busy = |&window_ns: &u64| {
        let busy_ns = supply.as_ref().map_or(0, |of| of.busy_ns(window_ns));
        [window_ns.into(), busy_ns.into()]
    };
    counted("busy", core, windows_ns.iter().flat_map(busy))
}

/// Returns a record beginning with a number.
fn counted(kind: &str, number: usize, others: impl Iterator<Item = i128>) -> String {
    let numbers = [number as i128].into_iter().chain(others);
    shown(kind, &numbers.collect::<Vec<_>>())
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
        assert_agree(
            &ORACLE,
            include_str!("../../../../tests/oracle/table.txt"),
            60,
        );
    }

    fn first() -> &'static str {
        FILE.split_inclusive("end\n").next().unwrap()
    }

    /// A part of the first case, its replacement, and the resulting difference.
    const WRONG: &str = r"attempt 3 | attempt 4 | expected `attempt 4`, computed `attempt 3`
failed 1 0 0 | failed 1 0 | expected `failed 1 0`, computed `failed 1 0 0`
order 4 0 0 | order 4 0 1 | expected `order 4 0 1`, computed `order 4 0 0`
busy 4 271 27 811 | busy 4 271 28 811 | expected `busy 4 271 28 811 27 1216 54`, computed `busy 4 271 27 811 27 1216 54`
own 4 219 | own 4 220 | expected `own 4 220 0 3`, computed `own 4 219 0 3`
guest 3 3420 7 4\n |  | expected `end`, computed `guest 3 3420 7 4`
\nend\n | \nguest 3 1 1\nend\n | expected `guest 3 1 1`, computed `end`
dag 834 178 | dag 177 178 | expected `attempt 3`, computed `attempt -`";

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
