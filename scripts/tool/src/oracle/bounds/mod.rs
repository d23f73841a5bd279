//! Reference values of the analysis at commit: lengths, widths, bounds, verdicts.
//!
//! A case gives task sets and what independent implementations computed for
//! them; [`check`] computes the same with `sched_dag::analysis` and compares
//! every quantity. The record types are those of `bounds.txt`:
//!
//! ```text
//! case NAME m ntasks
//! then for each DAG:  dag T D nsub nedge / wcet c_0 .. / edge u v .. / len / vol /
//!                     bottom_level (by subtask) / single M graham R long_paths R ..
//! then for the set:   dm_order width melani_gfp_dm gfp_dm_width np_safe_gfp_dm
//!                     melani_gedf gedf_capacity bonifaci_gedf federated
//! end
//! ```
//!
//! Bounds under fixed priorities are in the order of `dm_order`. A lone `-`
//! says that a test does not accept or does not apply.

use sched_dag::analysis::{
    Federation, Task, bonifaci_edf, federated, gedf_capacity, graham, long_paths, melani_edf,
    melani_fp, melani_fp_width, np_safe_fp, width,
};

use replay::lines::{Line, Lines, Malformed, cases, quoted};
use replay::repeated;

/// One task set with the values expected of it.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    cores: u32,
    dags: Vec<ExpectedDag>,
    /// The quantities of the set: name and words, in the order of the file.
    quantities: Vec<(&'static str, Vec<String>)>,
}

#[derive(Debug)]
struct ExpectedDag {
    task: Task,
    length_ns: u64,
    volume_ns: u64,
    bottom_levels_ns: Vec<u64>,
    /// Cores, Graham's bound, long-paths bound.
    singles: Vec<(u32, u64, u64)>,
}

/// The quantities of a set; each case has each of them once.
const QUANTITIES: [&str; 9] = [
    "dm_order",
    "width",
    "melani_gfp_dm",
    "gfp_dm_width",
    "np_safe_gfp_dm",
    "melani_gedf",
    "gedf_capacity",
    "bonifaci_gedf",
    "federated",
];

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described above.
pub fn parse(text: &str) -> Result<Vec<Case>, Malformed> {
    cases(text, parse_case)
}

/// Computes and compares each quantity of a case.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &Case) -> Result<(), String> {
    for (index, expected) in case.dags.iter().enumerate() {
        check_dag(expected).map_err(|difference| format!("dag {index}: {difference}"))?;
    }
    let tasks: Vec<&Task> = case.dags.iter().map(|dag| &dag.task).collect();
    for (name, expected) in &case.quantities {
        let computed = compute(name, &tasks, case.cores);
        compare(name, &expected.join(" "), &computed)?;
    }
    Ok(())
}

fn check_dag(expected: &ExpectedDag) -> Result<(), String> {
    let task = &expected.task;
    compare("len", &expected.length_ns, &task.length_ns())?;
    compare("vol", &expected.volume_ns, &task.volume_ns())?;
    let (expected_levels, levels) = (&expected.bottom_levels_ns, task.bottom_levels());
    compare("bottom_level", &list(expected_levels), &list(&levels))?;
    for &(cores, by_graham, by_long_paths) in &expected.singles {
        let compare = |what: &str, expected: u64, computed: Option<u64>| {
            let computed = computed.map_or("-".to_owned(), |bound| bound.to_string());
            compare(
                &format!("single {cores} {what}"),
                &expected.to_string(),
                &computed,
            )
        };
        compare("graham", by_graham, graham(task, cores))?;
        compare("long_paths", by_long_paths, long_paths(task, cores))?;
    }
    Ok(())
}

/// Computes one quantity of a set, in the words of the file.
fn compute(name: &str, tasks: &[&Task], cores: u32) -> String {
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    order.sort_by_key(|&dag| (tasks[dag].relative_deadline_ns(), dag));
    let by_deadline: Vec<&Task> = order.iter().map(|&dag| tasks[dag]).collect();
    let accepted = |yes: bool| u8::from(yes).to_string();
    let bounds = |bounds: Option<Vec<u64>>| bounds.map(|bounds| list(&bounds));
    let computed = match name {
        "dm_order" => Some(list(&order)),
        "width" => {
            let widths: Option<Vec<u64>> = tasks.iter().map(|task| width(task)).collect();
            bounds(widths)
        }
        "melani_gfp_dm" => bounds(melani_fp(&by_deadline, cores).ok()),
        "gfp_dm_width" => bounds(melani_fp_width(&by_deadline, cores).ok()),
        "np_safe_gfp_dm" => bounds(np_safe_fp(&by_deadline, cores).ok()),
        "melani_gedf" => bounds(melani_edf(tasks, cores).ok()),
        "gedf_capacity" => gedf_capacity(tasks, cores).map(accepted),
        "bonifaci_gedf" => Some(accepted(bonifaci_edf(tasks, cores))),
        "federated" => federated(tasks, cores).map(|federation| words_of(&federation)),
        _ => None,
    };
    computed.unwrap_or_else(|| "-".to_owned())
}

fn words_of(federation: &Federation) -> String {
    let heavy = federation.heavy.iter();
    let heavy = heavy.map(|(dag, cores)| format!(" {dag}:{cores}"));
    format!("{}{}", federation.light.len(), heavy.collect::<String>())
}

fn list<T: ToString>(values: &[T]) -> String {
    let words: Vec<String> = values.iter().map(T::to_string).collect();
    words.join(" ")
}

fn compare<T: PartialEq + std::fmt::Display>(
    what: &str,
    expected: &T,
    computed: &T,
) -> Result<(), String> {
    if expected == computed {
        Ok(())
    } else {
        Err(format!("{what}: expected {expected}, computed {computed}"))
    }
}

fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<Case, Malformed> {
    let words = header.exactly(3)?;
    let cores = header.cores(words[1])?;
    let count: u32 = at_least_one(header, words[2])?;
    let mut dags = Vec::new();
    let mut line = lines.expect("dag")?;
    let mut following = parse_dag(&line, lines, &mut dags)?;
    for _ in 1..count {
        line = following;
        if line.kind != "dag" {
            let reason = format!("expected {count} `dag` records, found {}", dags.len());
            return Err(line.malformed(reason));
        }
        following = parse_dag(&line, lines, &mut dags)?;
    }
    let mut quantities: Vec<(&'static str, Vec<String>)> = Vec::new();
    line = following;
    while line.kind != "end" {
        let Some(name) = QUANTITIES.iter().find(|name| **name == line.kind) else {
            let reason = format!("a set of DAGs has no quantity {}", quoted(line.kind));
            return Err(line.malformed(reason));
        };
        if quantities.iter().any(|(known, _)| known == name) {
            return Err(line.malformed(format!("`{name}` stands here twice")));
        }
        quantities.push((name, parse_quantity(&line, dags.len())?));
        line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
    }
    line.exactly(0)?;
    let has = |name: &str| quantities.iter().any(|(known, _)| *known == name);
    if let Some(missing) = QUANTITIES.iter().find(|name| !has(name)) {
        return Err(line.malformed(format!("the case ends without `{missing}`")));
    }
    Ok(Case {
        name: words[0].to_owned(),
        cores,
        dags,
        quantities,
    })
}

/// Reads a DAG and returns the first record after it.
fn parse_dag<'a>(
    header: &Line<'_>,
    lines: &mut Lines<'a>,
    dags: &mut Vec<ExpectedDag>,
) -> Result<Line<'a>, Malformed> {
    let words = header.exactly(4)?;
    let (period_ns, deadline_ns) = (header.number(words[0])?, header.number(words[1])?);
    let subtasks: u32 = at_least_one(header, words[2])?;
    let edge_count: u32 = header.number(words[3])?;
    let subtasks =
        usize::try_from(subtasks).map_err(|error| header.malformed(error.to_string()))?;
    let wcets_ns = lines.expect("wcet")?.numbers(subtasks)?;
    let mut edges = Vec::new();
    for _ in 0..edge_count {
        let edge = lines.expect("edge")?;
        let ends: Vec<usize> = edge.numbers(2)?;
        if let Some(end) = ends.iter().find(|&&end| end >= subtasks) {
            return Err(edge.malformed(format!("there is no subtask {end}")));
        }
        edges.push((ends[0], ends[1]));
    }
    let task = Task::new(period_ns, deadline_ns, wcets_ns, &edges)
        .map_err(|error| header.malformed(error.to_string()))?;
    let length_ns = lines.expect("len")?.numbers(1)?[0];
    let volume_ns = lines.expect("vol")?.numbers(1)?[0];
    let bottom_levels_ns = lines.expect("bottom_level")?.numbers(subtasks)?;
    let mut singles: Vec<(u32, u64, u64)> = Vec::new();
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
        if line.kind == "single" {
            let single = parse_single(&line)?;
            if singles.iter().any(|&(cores, ..)| cores == single.0) {
                let reason = format!("`single {}` stands here twice", single.0);
                return Err(line.malformed(reason));
            }
            singles.push(single);
        } else if singles.is_empty() {
            return Err(line.malformed("the dag before this has no `single` record"));
        } else {
            dags.push(ExpectedDag {
                task,
                length_ns,
                volume_ns,
                bottom_levels_ns,
                singles,
            });
            return Ok(line);
        }
    }
}

fn parse_single(line: &Line<'_>) -> Result<(u32, u64, u64), Malformed> {
    let words = line.exactly(5)?;
    if words[1] != "graham" || words[3] != "long_paths" {
        return Err(line.malformed("expected `single M graham R long_paths R`"));
    }
    let cores = line.cores(words[0])?;
    Ok((cores, line.number(words[2])?, line.number(words[4])?))
}

/// Checks the form of a quantity's words and returns them in plain form.
fn parse_quantity(line: &Line<'_>, dags: usize) -> Result<Vec<String>, Malformed> {
    let plain = |word: &str| line.number::<u64>(word).map(|number| number.to_string());
    if line.words == ["-"] && line.kind != "dm_order" && line.kind != "width" {
        return Ok(vec!["-".to_owned()]);
    }
    match line.kind {
        "gedf_capacity" | "bonifaci_gedf" => match line.exactly(1)?[0] {
            verdict @ ("0" | "1") => Ok(vec![verdict.to_owned()]),
            other => Err(line.malformed(format!("expected 0, 1 or -, found {}", quoted(other)))),
        },
        "federated" => {
            let mut words = line.words.iter();
            let left = words
                .next()
                .ok_or_else(|| line.malformed("expected the cores left"))?;
            let heavy = words.map(|word| match word.split_once(':') {
                Some((dag, cores)) => Ok(format!("{}:{}", plain(dag)?, plain(cores)?)),
                None => Err(line.malformed(format!("expected dag:cores, found {}", quoted(word)))),
            });
            std::iter::once(plain(left)).chain(heavy).collect()
        }
        "dm_order" => {
            let order: Vec<usize> = line.numbers(dags)?;
            let all = 0..dags;
            if repeated(&order).is_some() || !order.iter().all(|dag| all.contains(dag)) {
                let reason = format!("expected each DAG from 0 to {} once", dags - 1);
                return Err(line.malformed(reason));
            }
            Ok(order.iter().map(usize::to_string).collect())
        }
        _ => line.exactly(dags)?.iter().map(|word| plain(word)).collect(),
    }
}

fn at_least_one(line: &Line<'_>, word: &str) -> Result<u32, Malformed> {
    match line.number(word)? {
        0 => Err(line.malformed(format!("`{}` needs at least 1 here, found 0", line.kind))),
        number => Ok(number),
    }
}

#[cfg(test)]
mod tests;
