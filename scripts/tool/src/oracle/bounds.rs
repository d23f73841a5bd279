//! Reference values of the analysis at commit: lengths, widths, bounds, verdicts.
//!
//! A case gives task sets and what independent implementations computed for
//! them; [`check`] computes the same with `sched_dag::analysis` and compares
//! every quantity. There are two kinds of files, and a case is of one of them. In both it is
//!
//! ```text
//! case NAME m ntasks
//! then for each DAG:  dag T D nsub nedge / wcet c_0 .. / edge u v .. / its quantities
//! then for the set:   its quantities
//! end
//! ```
//!
//! with the quantities, in `bounds.txt`,
//!
//! ```text
//! of a DAG:    len / vol / bottom_level (by subtask) / single M graham R long_paths R ..
//! of the set:  dm_order width melani_gfp_dm gfp_dm_width np_safe_gfp_dm
//!              melani_gedf gedf_capacity bonifaci_gedf federated
//! ```
//!
//! and in `multi_path.txt`
//!
//! ```text
//! of a DAG:    cov (by chains) / multi_path M R ..
//! of the set:  dm_order mp_gfp_dm mp_gfp_dm_clip mp_gedf mp_gedf_clip
//! ```
//!
//! Bounds under fixed priorities are in the order of `dm_order`. A lone `-`
//! says that a test does not accept or does not apply. The bounds of the first kind that
//! the multi-path ones have replaced are in `older_bounds`.

use sched_dag::analysis::{
    Clip, Federation, Task, bonifaci_edf, covers, federated, gedf_capacity, multi_path,
    multi_path_edf, multi_path_fp, width,
};

use replay::lines::{Line, Lines, Malformed, cases, quoted};
use replay::repeated;

use super::older_bounds as older;

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
    /// What is computed, in the words of the file, and its value.
    quantities: Vec<(String, String)>,
}

/// The quantities of one kind of file; each case has each of them once.
struct Form {
    /// Those of a DAG, the first by which the kind is known, the last once a number of cores.
    of_dag: &'static [&'static str],
    of_set: &'static [&'static str],
}

const FORMS: [Form; 2] = [
    Form {
        of_dag: &["len", "vol", "bottom_level", "single"],
        of_set: &[
            "dm_order",
            "width",
            "melani_gfp_dm",
            "gfp_dm_width",
            "np_safe_gfp_dm",
            "melani_gedf",
            "gedf_capacity",
            "bonifaci_gedf",
            "federated",
        ],
    },
    Form {
        of_dag: &["cov", "multi_path"],
        of_set: &[
            "dm_order",
            "mp_gfp_dm",
            "mp_gfp_dm_clip",
            "mp_gedf",
            "mp_gedf_clip",
        ],
    },
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

fn check_dag(dag: &ExpectedDag) -> Result<(), String> {
    for (what, expected) in &dag.quantities {
        compare(what, expected, &compute_of_dag(what, &dag.task))?;
    }
    Ok(())
}

/// Computes one quantity of a DAG, in the words of the file.
fn compute_of_dag(what: &str, task: &Task) -> String {
    let words: Vec<&str> = what.split(' ').collect();
    let cores = |word: &str| word.parse().expect("a number of cores, as was read");
    let bound = match words[..] {
        ["len"] => Some(task.length_ns()),
        ["vol"] => Some(task.volume_ns()),
        ["bottom_level"] => return list(&task.bottom_levels()),
        ["cov"] => return list(&covers(task, usize::MAX)),
        ["multi_path", m] => multi_path(task, cores(m)),
        ["single", m, "graham"] => Some(older::graham(task, cores(m))),
        ["single", m, "long_paths"] => Some(older::long_paths(task, cores(m))),
        _ => None,
    };
    bound.map_or("-".to_owned(), |bound| bound.to_string())
}

/// Computes one quantity of a set, in the words of the file.
fn compute(name: &str, tasks: &[&Task], cores: u32) -> String {
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    order.sort_by_key(|&dag| (tasks[dag].relative_deadline_ns(), dag));
    let by_deadline: Vec<&Task> = order.iter().map(|&dag| tasks[dag]).collect();
    let accepted = |yes: bool| u8::from(yes).to_string();
    let bounds = |bounds: Option<Vec<u64>>| bounds.map(|bounds| list(&bounds));
    let is_constrained = |task: &&Task| task.relative_deadline_ns() <= task.period_ns();
    let by_priority = |clip: Clip| {
        let bounds = multi_path_fp(&by_deadline, cores, clip).ok();
        bounds.filter(|_| tasks.iter().all(is_constrained))
    };
    let computed = match name {
        "dm_order" => Some(list(&order)),
        "width" => {
            let widths: Option<Vec<u64>> = tasks.iter().map(|task| width(task)).collect();
            bounds(widths)
        }
        "melani_gfp_dm" => bounds(older::melani_fp(&by_deadline, cores, older::Width::Ignored)),
        "gfp_dm_width" => bounds(older::melani_fp(&by_deadline, cores, older::Width::Used)),
        "np_safe_gfp_dm" => bounds(older::np_safe_fp(&by_deadline, cores)),
        "melani_gedf" => bounds(older::melani_edf(tasks, cores, older::Width::Ignored)),
        "mp_gfp_dm" => bounds(by_priority(Clip::Window)),
        "mp_gfp_dm_clip" => bounds(by_priority(Clip::Waiting)),
        "mp_gedf" => bounds(multi_path_edf(tasks, cores, Clip::Window).ok()),
        "mp_gedf_clip" => bounds(multi_path_edf(tasks, cores, Clip::Waiting).ok()),
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

fn compare(what: &str, expected: &str, computed: &str) -> Result<(), String> {
    match expected == computed {
        true => Ok(()),
        false => Err(format!("{what}: expected {expected}, computed {computed}")),
    }
}

fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<Case, Malformed> {
    let words = header.exactly(3)?;
    let cores = header.cores(words[1])?;
    let count: u32 = at_least_one(header, words[2])?;
    let mut dags = Vec::new();
    let mut line = lines.expect("dag")?;
    let (mut following, form) = parse_dag(&line, lines, &FORMS, &mut dags)?;
    for _ in 1..count {
        line = following;
        if line.kind != "dag" {
            let reason = format!("expected {count} `dag` records, found {}", dags.len());
            return Err(line.malformed(reason));
        }
        let forms = std::slice::from_ref(form);
        (following, _) = parse_dag(&line, lines, forms, &mut dags)?;
    }
    let mut quantities: Vec<(&'static str, Vec<String>)> = Vec::new();
    line = following;
    while line.kind != "end" {
        let Some(name) = form.of_set.iter().find(|name| **name == line.kind) else {
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
    if let Some(missing) = form.of_set.iter().find(|name| !has(name)) {
        return Err(line.malformed(format!("the case ends without `{missing}`")));
    }
    Ok(Case {
        name: words[0].to_owned(),
        cores,
        dags,
        quantities,
    })
}

/// Reads a DAG of one of the forms and returns the first record after it, and the form.
fn parse_dag<'a, 'f>(
    header: &Line<'_>,
    lines: &mut Lines<'a>,
    forms: &'f [Form],
    dags: &mut Vec<ExpectedDag>,
) -> Result<(Line<'a>, &'f Form), Malformed> {
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
    let mut line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
    let Some(form) = forms.iter().find(|form| form.of_dag[0] == line.kind) else {
        let names = forms.iter().map(|form| format!("`{}`", form.of_dag[0]));
        let names = names.collect::<Vec<_>>().join(" or ");
        return Err(line.malformed(format!("expected {names}, found {}", quoted(line.kind))));
    };
    let (once, by_cores) = form.of_dag.split_at(form.of_dag.len() - 1);
    let mut quantities = Vec::new();
    for name in once {
        if line.kind != *name {
            return Err(line.malformed(format!("expected `{name}`, found {}", quoted(line.kind))));
        }
        let values = match *name {
            "bottom_level" => line.numbers::<u64>(subtasks)?,
            "cov" => line.numbers::<u64>(line.words.len())?,
            _ => line.numbers::<u64>(1)?,
        };
        quantities.push(((*name).to_owned(), list(&values)));
        line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
    }
    let mut seen = Vec::new();
    while line.kind == by_cores[0] {
        let (cores, values) = parse_by_cores(&line)?;
        if seen.contains(&cores) {
            let reason = format!("`{} {cores}` stands here twice", line.kind);
            return Err(line.malformed(reason));
        }
        seen.push(cores);
        quantities.extend(values);
        line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
    }
    if seen.is_empty() {
        let reason = format!("the DAG before this has no `{}` record", by_cores[0]);
        return Err(line.malformed(reason));
    }
    dags.push(ExpectedDag { task, quantities });
    Ok((line, form))
}

/// Reads what a DAG takes alone on a number of cores.
fn parse_by_cores(line: &Line<'_>) -> Result<(u32, Vec<(String, String)>), Malformed> {
    let quantity = |what: &str, cores: u32, word: &str| {
        let what = format!("{} {cores}{what}", line.kind);
        Ok((what, line.number::<u64>(word)?.to_string()))
    };
    if line.kind == "multi_path" {
        let words = line.exactly(2)?;
        let cores = line.cores(words[0])?;
        return Ok((cores, vec![quantity("", cores, words[1])?]));
    }
    let words = line.exactly(5)?;
    if words[1] != "graham" || words[3] != "long_paths" {
        return Err(line.malformed("expected `single M graham R long_paths R`"));
    }
    let cores = line.cores(words[0])?;
    let graham = quantity(" graham", cores, words[2])?;
    Ok((
        cores,
        vec![graham, quantity(" long_paths", cores, words[4])?],
    ))
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
mod tests {
    use super::{check, parse};

    const FILE: &str = include_str!("../../../../tests/oracle/bounds.txt");
    const MULTI_PATH: &str = include_str!("../../../../tests/oracle/multi_path.txt");

    #[test]
    fn all_public_cases_agree() {
        for file in [FILE, MULTI_PATH] {
            let cases = parse(file).unwrap();
            assert_eq!(cases.len(), 60);
            for case in &cases {
                assert_eq!(check(case), Ok(()), "{}", case.name);
            }
        }
    }

    /// Returns the cells of each row, and the first public case with the second cell, in which `\n`
    /// is the end of a line and `\x` turns what follows, in place of the first.
    fn altered(rows: &str) -> impl Iterator<Item = (Vec<&str>, String)> {
        let first = FILE.split_inclusive("end\n").next().unwrap();
        rows.lines().map(move |row| {
            let cells: Vec<&str> = row.split(" | ").collect();
            let told = |cell: &str| cell.replace(r"\n", "\n").replace(r"\x", "\u{202e}");
            let [from, to] = [cells[0], cells[1]].map(told);
            assert!(first.contains(&from), "{from}");
            (cells, first.replacen(&from, &to, 1))
        })
    }

    /// What stands in the first case, what is put in its place, and the difference that makes.
    const WRONG: &str = r"\nlen 41 | \nlen 42 | dag 1: len: expected 42, computed 41
graham 50 long_paths 46 | graham 50 long_paths 47 | dag 2: single 7 long_paths: expected 47, computed 46
melani_gedf 11 44 60 | melani_gedf - | melani_gedf: expected -, computed 11 44 60
federated 7 | federated 6 0:1 | federated: expected 6 0:1, computed 7";

    #[test]
    fn a_difference_names_the_quantity() {
        for (cells, text) in altered(WRONG) {
            let cases = parse(&text).unwrap();
            assert_eq!(check(&cases[0]), Err(cells[2].to_owned()));
        }
    }

    /// The same of what is refused: with its line, and the reason if it is worth its words.
    const MALFORMED: &str = r"dag 31 31 | dag 0 31 | 2
wcet 2 8 1 | wcet 2 8 | 3 | `wcet` takes 3 words, found 2
edge 1 2 | edge 1 3 | 6 | there is no subtask 3
edge 0 1 | edge 2 1 | 2 | cycle
dag 31 31 3 3 | dag 31 31 3 2 | 6
dag 31 31 3 3 | dag 31 31 4294967296 3 | 2
wcet 2 8 1 | wcet 2 8 18446744073709551616 | 3
wcet 2 8 1 | wcet 2 8 18446744073709551615 | 2
case bpub000 7 3 | case bpub000 0 3 | 1
case bpub000 7 3 | case bpub000 7 4 | 28
case bpub000 7 3 | case bpub000 4294967295 3 | 1 | expected 1 to 64 cores, found 4294967295
case bpub000 7 3 | case b\x 7 3 | 1 | case `b\u{202e}`: a name must be seen; rename it
single 7 graham 41 long_paths 41\n |  | 17 | the DAG before this has no `single` record
single 7 graham 41 long_paths 41\n | single 7 graham 41 long_paths 41\nsingle 7 graham 41 long_paths 41\n | 18 | `single 7` stands here twice
single 7 graham 41 | single 65 graham 41 | 17
dm_order 0 1 2 | dm_order 0 1 3 | 28 | expected each DAG from 0 to 2 once
dm_order 0 1 2 | dm_order 0 1 1 | 28 | expected each DAG from 0 to 2 once
dm_order 0 1 2 | dm_order 0 1 4294967296 | 28 | expected each DAG from 0 to 2 once
federated 7 | federated 7 \x | 36 | expected dag:cores, found `\u{202e}`
width 1 1 2\n |  | 36
bonifaci_gedf 0 | bonifaci_gedf 2 | 35
federated 7 | federated 7 0 | 36
\nend\n | \n | 37";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        for (cells, text) in altered(MALFORMED) {
            let error = parse(&text).unwrap_err();
            assert_eq!(error.line.to_string(), cells[2], "{}: {error}", cells[1]);
            let reason = cells.get(3).unwrap_or(&"");
            assert!(error.reason.contains(reason), "{error}\n  not: {reason}");
        }
        assert_eq!(parse("").unwrap_err().line, 1);
        assert_eq!(parse("\nfoo\n").unwrap_err().line, 2);
        let first = FILE.split_inclusive("end\n").next().unwrap();
        let error = parse(&first.repeat(2)).unwrap_err();
        let reason = "case `bpub000` stands here twice, first on line 1; rename one";
        assert_eq!((error.line, error.reason.as_str()), (38, reason));
    }
}
