//! Bounds of DAGs whose subtasks wait.
//!
//! A block gives a set of DAGs and the results of independent implementations for it; [`check`]
//! computes the same with `sched_dag::analysis` and compares every quantity.
//!
//! ```text
//! bounds NAME m ntasks
//! then for each DAG:  dag T D nsub nedge / wcet c_0 .. / edge u v .. / wait ..
//!                     len / vol / span / width / cov (by chains, waits as work)
//!                     alone M A peel P least L spread X, by numbers of cores M
//! then for the set:   dm_order / wait_gfp_dm / wait_gfp_dm_best / wait_np_gfp_dm (in that order)
//!                     wait_gedf / wait_gedf_best / wait_np_gedf
//! end
//! ```
//!
//! `alone`, `peel` and `spread` bound one job alone: by one path, by reserved chains, and with
//! waits that are executed. No choice of chains gives less than `least`, so neither `alone` nor
//! `peel` may be below it. A lone `-` says that a test does not accept.

use replay::lines::{Line, Lines, Malformed};
use sched_dag::analysis::{
    SubtaskWaits, Task, WaitingForm, alone_forms, covers, waiting_edf, waiting_fp, width,
};

use crate::oracle::bounds::{Quantities, compare, list, parse_task};

/// One task set with the values expected of it.
#[derive(Debug)]
pub struct WaitingBounds {
    /// The case's name.
    pub name: String,
    cores: u32,
    dags: Vec<DagCase>,
    quantities: Quantities,
}

/// One DAG with the values expected of it.
#[derive(Debug)]
struct DagCase {
    task: Task,
    quantities: Quantities,
    alone: Vec<AloneCase>,
}

/// The bounds of one job alone on some number of cores.
#[derive(Debug)]
struct AloneCase {
    cores: u32,
    alone: u64,
    peel: u64,
    least: u64,
    spread: u64,
}

/// The quantities of a set, in their order, after the order of the DAGs.
const OF_SET: [&str; 6] = [
    "wait_gfp_dm",
    "wait_gfp_dm_best",
    "wait_np_gfp_dm",
    "wait_gedf",
    "wait_gedf_best",
    "wait_np_gedf",
];

/// Reads a block from its header on.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described above.
pub fn parse(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<WaitingBounds, Malformed> {
    let [name, cores, count] = header.fixed()?;
    let (cores, count) = (header.cores(cores)?, header.at_least_one(count)?);
    let dags = (0..count).map(|_| parse_dag(lines));
    let dags = dags.collect::<Result<Vec<_>, Malformed>>()?;
    let mut quantities = Quantities::new();
    for name in ["dm_order"].into_iter().chain(OF_SET) {
        let line = lines.expect(name)?;
        let value = match &line.words[..] {
            ["-"] if name != "dm_order" => "-".to_owned(),
            _ => list(&line.numbers::<u64>(dags.len())?),
        };
        quantities.push((name.to_owned(), value));
    }
    lines.expect("end")?.exactly(0)?;
    Ok(WaitingBounds {
        name: name.to_owned(),
        cores,
        dags,
        quantities,
    })
}

fn parse_dag(lines: &mut Lines<'_>) -> Result<DagCase, Malformed> {
    let task = parse_task(lines)?;
    let task = parse_waits(lines, task)?;
    let mut quantities = Quantities::new();
    for name in ["len", "vol", "span", "width", "cov"] {
        let line = lines.expect(name)?;
        let count = match name {
            "cov" => line.words.len(),
            _ => 1,
        };
        quantities.push((name.to_owned(), list(&line.numbers::<u64>(count)?)));
    }
    let mut alone: Vec<AloneCase> = Vec::new();
    while let Some(line) = lines.next_if("alone") {
        let of_cores = parse_alone(&line)?;
        if alone.iter().any(|other| other.cores == of_cores.cores) {
            let reason = format!("`alone {}` stands here twice", of_cores.cores);
            return Err(line.malformed(reason));
        }
        alone.push(of_cores);
    }
    if alone.is_empty() {
        // The next line tells which record stands there instead.
        return Err(lines
            .expect("alone")
            .err()
            .unwrap_or(lines.ended("`alone`")));
    }
    Ok(DagCase {
        task,
        quantities,
        alone,
    })
}

fn parse_alone(line: &Line<'_>) -> Result<AloneCase, Malformed> {
    let [cores, alone, "peel", peel, "least", least, "spread", spread] = line.fixed()? else {
        return Err(line.malformed("expected `alone M A peel P least L spread X`"));
    };
    Ok(AloneCase {
        cores: line.cores(cores)?,
        alone: line.number(alone)?,
        peel: line.number(peel)?,
        least: line.number(least)?,
        spread: line.number(spread)?,
    })
}

/// Reads the waits of a DAG's subtasks, if it has any.
fn parse_waits(lines: &mut Lines<'_>, task: Task) -> Result<Task, Malformed> {
    let unsuspended = task.wcets_ns().iter().map(|&wcet_ns| SubtaskWaits {
        count: 0,
        limits_ns: 0,
        longest_segment_ns: wcet_ns,
    });
    let mut waits: Vec<SubtaskWaits> = unsuspended.collect();
    let mut last = None;
    while let Some(line) = lines.next_if("wait") {
        let [subtask, count, times @ ..] = &line.words[..] else {
            return Err(line.malformed("expected `wait V n C_0 W_1 C_1 ..`"));
        };
        let subtask = line.index("subtask", subtask, waits.len())?;
        let count = line.at_least_one(count)?;
        if times.len() as u64 != 2 * u64::from(count) + 1 {
            let reason = format!(
                "{count} waits take twice as many times and one, found {}",
                times.len()
            );
            return Err(line.malformed(reason));
        }
        if waits[subtask].count > 0 {
            return Err(line.malformed(format!("the waits of subtask {subtask} stand here twice")));
        }
        let times = times.iter().map(|time| line.number(time));
        let times = times.collect::<Result<Vec<u64>, Malformed>>()?;
        let sum = |first| {
            times
                .iter()
                .skip(first)
                .step_by(2)
                .try_fold(0, |sum: u64, &time| sum.checked_add(time))
        };
        let segments = times.iter().step_by(2);
        let wcet_ns = task.wcets_ns()[subtask];
        if sum(0) != Some(wcet_ns) || segments.clone().any(|&segment| segment == 0) {
            let reason = format!("expected segments of at least 1 that sum up to {wcet_ns}");
            return Err(line.malformed(reason));
        }
        waits[subtask] = SubtaskWaits {
            count,
            limits_ns: sum(1).ok_or_else(|| line.malformed("the limits are too large"))?,
            longest_segment_ns: segments.copied().max().unwrap_or(wcet_ns),
        };
        last = Some(line);
    }
    match last {
        None => Ok(task),
        Some(line) => (task.with_waits(waits)).map_err(|error| line.malformed(error.to_string())),
    }
}

/// Computes and compares each quantity of a case.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &WaitingBounds) -> Result<(), String> {
    for (index, dag) in case.dags.iter().enumerate() {
        compare(&dag.quantities, |what| compute_of_dag(what, &dag.task))
            .and_then(|()| {
                dag.alone
                    .iter()
                    .try_for_each(|of| check_alone(&dag.task, of))
            })
            .map_err(|difference| format!("dag {index}: {difference}"))?;
    }
    let tasks: Vec<&Task> = case.dags.iter().map(|dag| &dag.task).collect();
    compare(&case.quantities, |what| compute(what, &tasks, case.cores))
}

fn check_alone(task: &Task, expected: &AloneCase) -> Result<(), String> {
    let &AloneCase {
        cores,
        alone,
        peel,
        least,
        spread,
    } = expected;
    let bounds = alone_forms(task, cores).ok_or("there are no cores")?;
    let found = [bounds.one_path_ns, bounds.reserved_ns, bounds.oblivious_ns];
    if found != [alone, peel, spread] {
        let shown =
            |[alone, peel, spread]: [u64; 3]| format!("{alone} peel {peel} spread {spread}");
        let (expected, computed) = (shown([alone, peel, spread]), shown(found));
        return Err(format!(
            "alone {cores}: expected {expected}, computed {computed}"
        ));
    }
    if bounds.one_path_ns.min(bounds.reserved_ns) < least {
        return Err(format!(
            "alone {cores}: {} is below the least, {least}",
            bounds.reserved_ns
        ));
    }
    Ok(())
}

fn compute_of_dag(name: &str, task: &Task) -> String {
    match name {
        "len" => task.length_ns().to_string(),
        "vol" => task.volume_ns().to_string(),
        "span" => task.span_ns().to_string(),
        "width" => width(task).map_or("-".to_owned(), |width| width.to_string()),
        _ => list(&covers(task.oblivious(), usize::MAX)),
    }
}

fn compute(name: &str, tasks: &[&Task], cores: u32) -> String {
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    // Ties go to the DAG that comes first.
    order.sort_by_key(|&dag| (tasks[dag].relative_deadline_ns(), dag));
    let by_deadline: Vec<&Task> = order.iter().map(|&dag| tasks[dag]).collect();
    let by_priority = |form| waiting_fp(&by_deadline, cores, form);
    let by_edf = |form| waiting_edf(tasks, cores, form);
    let bounds = match name {
        "wait_gfp_dm" => by_priority(WaitingForm::OnePath),
        "wait_gfp_dm_best" => by_priority(WaitingForm::Best),
        "wait_np_gfp_dm" => by_priority(WaitingForm::NonPreemptive),
        "wait_gedf" => by_edf(WaitingForm::OnePath),
        "wait_gedf_best" => by_edf(WaitingForm::Best),
        "wait_np_gedf" => by_edf(WaitingForm::NonPreemptive),
        _ => return list(&order),
    };
    bounds.map_or("-".to_owned(), |bounds| list(&bounds))
}

#[cfg(test)]
mod tests {
    use super::super::{WaitingCase, parse};
    use super::check;

    const FILE: &str = include_str!("../../../../../tests/oracle/waiting.txt");

    /// Checks the sets of a text, and returns the differences.
    fn differences(text: &str) -> Vec<String> {
        let sets = parse(text).unwrap().into_iter();
        let checked = sets.filter_map(|case| match case {
            WaitingCase::Bounds(case) => check(&case).err(),
            WaitingCase::Schedule(_) => None,
        });
        checked.collect()
    }

    #[test]
    fn all_public_sets_agree() {
        let is_set = |case: &&WaitingCase| matches!(case, WaitingCase::Bounds(_));
        let cases = parse(FILE).unwrap();
        assert_eq!((cases.len(), cases.iter().filter(is_set).count()), (80, 40));
        assert_eq!(differences(FILE), Vec::<String>::new());
    }

    /// Returns the cells of each row, and the first public set with its first cell replaced by
    /// the second, in which `\n` is the end of a line.
    fn altered(rows: &str) -> impl Iterator<Item = (Vec<&str>, String)> {
        let begin = FILE.find("bounds wb000").unwrap();
        let first = FILE[begin..].split_inclusive("end\n").next().unwrap();
        rows.lines().map(move |row| {
            let cells: Vec<&str> = row.split(" | ").collect();
            let [from, to] = [cells[0], cells[1]].map(|cell| cell.replace(r"\n", "\n"));
            assert!(first.contains(&from), "{from}");
            (cells, first.replacen(&from, &to, 1))
        })
    }

    /// A part of the first set, its replacement, and the difference that it makes.
    const WRONG: &str = "\
len 35 | len 36 | dag 1: len: expected 36, computed 35
vol 102 | vol 101 | dag 1: vol: expected 101, computed 102
span 71 | span 70 | dag 1: span: expected 70, computed 71
width 6 | width 7 | dag 1: width: expected 7, computed 6
cov 71 96 114 | cov 71 96 115 | dag 1: cov: expected 71 96 115 131 144 151, computed 71 96 114 131 144 151
alone 2 104 peel 104 | alone 2 103 peel 104 | dag 1: alone 2: expected 103 peel 104 spread 111, computed 104 peel 104 spread 111
alone 2 104 peel 104 | alone 2 104 peel 103 | dag 1: alone 2: expected 104 peel 103 spread 111, computed 104 peel 104 spread 111
least 104 spread 111 | least 105 spread 111 | dag 1: alone 2: 104 is below the least, 105
least 104 spread 111 | least 104 spread 112 | dag 1: alone 2: expected 104 peel 104 spread 112, computed 104 peel 104 spread 111
dm_order 0 2 1 | dm_order 0 1 2 | dm_order: expected 0 1 2, computed 0 2 1
wait_gfp_dm 53 60 156 | wait_gfp_dm 53 61 156 | wait_gfp_dm: expected 53 61 156, computed 53 60 156
wait_gfp_dm_best 53 50 | wait_gfp_dm_best 53 51 | wait_gfp_dm_best: expected 53 51 156, computed 53 50 156
wait_np_gfp_dm - | wait_np_gfp_dm 53 60 156 | wait_np_gfp_dm: expected 53 60 156, computed -
wait_gedf_best - | wait_gedf_best 53 60 156 | wait_gedf_best: expected 53 60 156, computed -
wait 5 2 1 7 1 10 1 | wait 5 2 1 7 1 9 1 | dag 0: span: expected 53, computed 52";

    #[test]
    fn a_difference_names_the_quantity() {
        for (cells, text) in altered(WRONG) {
            assert_eq!(differences(&text), [cells[2]]);
        }
    }

    /// The same for refusals, with the line and the reason.
    const MALFORMED: &str = r"bounds wb000 2 3 | bound wb000 2 3 | 1 | expected a `case` or `bounds` record, found `bound`
bounds wb000 2 3 | bounds wb000 0 3 | 1 | expected 1 to 64 cores
wait 0 1 1 4 1 | wait 6 1 1 4 1 | 9 | there is no subtask 6
wait 0 1 1 4 1 | wait 0 0 1 4 1 | 9 | needs at least 1
wait 0 1 1 4 1 | wait 0 2 1 4 1 | 9 | 2 waits take twice as many times and one, found 3
wait 0 1 1 4 1 | wait 0 1 2 4 1 | 9 | segments of at least 1 that sum up to 2
wait 0 1 1 4 1 | wait 0 1 2 4 0 | 9 | segments of at least 1 that sum up to 2
wait 0 1 1 4 1 | wait 3 1 2 4 1 | 10 | the waits of subtask 3 stand here twice
wait 0 1 1 4 1 | wait 0 1 1 18446744073709551615 1 | 11 | the limits of waits exceeds 64 bits
alone 1 53 peel | alone 1 53 paths | 17 | expected `alone M A peel P least L spread X`
alone 2 53 peel | alone 1 53 peel | 18 | `alone 1` stands here twice
span 53 | len 53 | 14 | expected a `span` record, found `len`
wait_np_gedf -\n |  | 60 | expected a `wait_np_gedf` record, found `end`
\nend\n | \n | 61 | the file ends";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        for (cells, text) in altered(MALFORMED) {
            let error = parse(&text).unwrap_err();
            assert_eq!(error.line.to_string(), cells[2], "{}: {error}", cells[1]);
            assert!(
                error.reason.contains(cells[3]),
                "{error}\n  not: {}",
                cells[3]
            );
        }
    }
}
