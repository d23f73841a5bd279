//! Reference values of the analysis at commit: lengths, widths, bounds, verdicts.
//!
//! A case holds a task set and the results of independent implementations for the set; [`check`]
//! computes the same with `sched_dag::analysis` and compares every quantity. There are three kinds
//! of cases. All have the form
//!
//! ```text
//! case NAME m ntasks
//! then for each DAG:  dag T D nsub nedge / wcet c_0 .. / edge u v .. / wait .. / its quantities
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
//! and, for subtasks with waits, in blocks of `waiting.txt` that begin with `bounds` instead of
//! `case`
//!
//! ```text
//! of a DAG:    len / vol / span / width / cov (by chains, waits as work)
//!              alone M A peel P least L spread X ..
//! of the set:  dm_order wait_gfp_dm wait_gfp_dm_best wait_np_gfp_dm
//!              wait_gedf wait_gedf_best wait_np_gedf
//! ```
//!
//! Bounds under fixed priorities are in the order of `dm_order`. A lone `-` marks a test that does
//! not accept the set or does not apply. `older_bounds` holds those bounds of the first kind that
//! multi-path bounds have replaced. `alone`, `peel` and `spread` bound a single job alone: by one
//! path, by reserved chains, and with waits counted as execution. No choice of chains gives less
//! than `least`, so neither `alone` nor `peel` may be smaller. The waits of a subtask are on a line
//! of their own:
//!
//! ```text
//! wait V n C_0 W_1 C_1 ..     subtask V has n >= 1 waits of the limits W between segments of the
//!                             WCETs C, which sum up to that of the subtask
//! ```

use sched_dag::analysis::{
    Federation, InterferenceBound, SubtaskWaits, Task, WaitingForm, alone_forms, covers, federated,
    multi_path, multi_path_edf, multi_path_fp, waiting_edf, waiting_fp, width,
};

use text::{Line, Lines, Malformed, cases, quoted};

use super::FileOracle;
use super::older_bounds as older;

/// The kind `bounds`.
pub(super) static ORACLE: FileOracle<BoundsCase> = FileOracle {
    invocation: "./scripts/oracle bounds",
    about: "Compares lengths, widths, response-time bounds and verdicts with those of the analysis \
            at commit.",
    parse,
    check,
    name: |case| &case.name,
    schedules: None,
};

/// A task set with its expected values.
#[derive(Debug)]
pub struct BoundsCase {
    /// The case's name.
    pub name: String,
    cores: u32,
    dags: Vec<(Task, Quantities)>,
    quantities: Quantities,
}

/// Quantities: the name in the file, and the value.
type Quantities = Vec<(String, String)>;

/// The names of the quantities of a DAG and of a set.
type Form = [&'static [&'static str]; 2];

/// The forms of the kinds of files without waits. Each case has each quantity once. Only the last
/// quantity of a DAG comes once for each number of cores.
const FORMS: [Form; 2] = [
    [
        &["len", "vol", "bottom_level", "single"],
        &[
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
    ],
    [
        &["cov", "multi_path"],
        &[
            "dm_order",
            "mp_gfp_dm",
            "mp_gfp_dm_clip",
            "mp_gedf",
            "mp_gedf_clip",
        ],
    ],
];

/// The form for subtasks with waits.
const WAITING: Form = [
    &["len", "vol", "span", "width", "cov", "alone"],
    &[
        "dm_order",
        "wait_gfp_dm",
        "wait_gfp_dm_best",
        "wait_np_gfp_dm",
        "wait_gedf",
        "wait_gedf_best",
        "wait_np_gedf",
    ],
];

/// Reads all cases of a file without waits.
///
/// # Errors
///
/// [`Malformed`] for the first record that deviates from the description above.
pub fn parse(text: &str) -> Result<Vec<BoundsCase>, Malformed> {
    cases(text, parse_case)
}

/// Reads a case, or a block of bounds, from its header on.
pub(super) fn parse_case(
    header: &Line<'_>,
    lines: &mut Lines<'_>,
) -> Result<BoundsCase, Malformed> {
    let [name, cores, count] = header.fixed()?;
    let (cores, count) = (header.cores(cores)?, header.at_least_one(count)?);
    let has_waits = header.kind == "bounds";
    let mut form = has_waits.then_some(WAITING);
    let mut dags = Vec::new();
    for _ in 0..count {
        let mut task = parse_task(lines)?;
        let mut size = task.wcets_ns().len();
        if has_waits {
            // No quantity of this form has a part for each subtask.
            (task, size) = (parse_waits(lines, task)?, 1);
        }
        // Only `multi_path.txt` begins with `cov`; the first DAG decides for the whole case.
        let is_multi_path = || lines.clone().next_if("cov").is_some();
        let [of_dag, _] = *form.get_or_insert_with(|| FORMS[usize::from(is_multi_path())]);
        let quantities = parse_quantities(lines, of_dag, size)?;
        dags.push((task, quantities));
    }
    let [_, of_set] = form.unwrap_or_default();
    let quantities = parse_quantities(lines, of_set, dags.len())?;
    lines.expect("end")?.exactly(0)?;
    Ok(BoundsCase {
        name: name.to_owned(),
        cores,
        dags,
        quantities,
    })
}

pub(super) fn parse_task(lines: &mut Lines<'_>) -> Result<Task, Malformed> {
    let header = lines.expect("dag")?;
    let [period, deadline, subtasks, edge_count] = header.fixed()?;
    let (period_ns, deadline_ns) = (header.number(period)?, header.number(deadline)?);
    let subtasks = header.at_least_one(subtasks)? as usize;
    let edge_count: u32 = header.number(edge_count)?;
    let wcets_ns = lines.expect("wcet")?.numbers(subtasks)?;
    let edges = lines.edges(edge_count, subtasks)?;
    Task::new(period_ns, deadline_ns, wcets_ns, &edges)
        .map_err(|error| header.malformed(error.to_string()))
}

/// Reads the waits of a DAG's subtasks, if any.
fn parse_waits(lines: &mut Lines<'_>, task: Task) -> Result<Task, Malformed> {
    let unsuspended = task.wcets_ns().iter().map(|&wcet_ns| SubtaskWaits {
        count: 0,
        limits_ns: 0,
        longest_segment_ns: wcet_ns,
    });
    let mut waits: Vec<SubtaskWaits> = unsuspended.collect();
    let mut last = None;
    while let Some(line) = lines.next_if("wait") {
        let (subtask, count, times) = parse_wait(&line, waits.len())?;
        if waits[subtask].count > 0 {
            return Err(line.malformed(format!("the waits of subtask {subtask} stand here twice")));
        }
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

/// Reads the waits of one of `subtasks` subtasks: its number, the number of waits, and segments and
/// limits in turn.
pub(super) fn parse_wait(
    line: &Line<'_>,
    subtasks: usize,
) -> Result<(usize, u32, Vec<u64>), Malformed> {
    let [subtask, count, times @ ..] = &line.words[..] else {
        return Err(line.malformed("expected `wait V n C_0 W_1 C_1 ..`"));
    };
    let subtask = line.index("subtask", subtask, subtasks)?;
    let count = line.at_least_one(count)?;
    if times.len() as u64 != 2 * u64::from(count) + 1 {
        let reason = format!(
            "{count} waits take twice as many times and one, found {}",
            times.len()
        );
        return Err(line.malformed(reason));
    }
    let times = times.iter().map(|time| line.number(time));
    Ok((subtask, count, times.collect::<Result<_, _>>()?))
}

/// Reads the named quantities, in any order, of a DAG or set with `size` parts.
fn parse_quantities(
    lines: &mut Lines<'_>,
    names: &[&str],
    size: usize,
) -> Result<Quantities, Malformed> {
    let mut quantities = Quantities::new();
    while let Some(line) = names.iter().find_map(|name| lines.next_if(name)) {
        let (what, value) = parse_quantity(&line, size)?;
        if quantities.iter().any(|(known, _)| *known == what) {
            return Err(line.malformed(format!("`{what}` stands here twice")));
        }
        quantities.push((what, value));
    }
    let has =
        |name: &str| (quantities.iter()).any(|(what, _)| what.split(' ').next() == Some(name));
    match names.iter().find(|name| !has(name)) {
        // The next line tells which record stands there instead.
        Some(missing) => Err(lines.expect(missing).err().unwrap_or(lines.ended(missing))),
        None => Ok(quantities),
    }
}

/// Checks a quantity's form, and returns its name and value in normal form.
fn parse_quantity(line: &Line<'_>, size: usize) -> Result<(String, String), Malformed> {
    // Numbers are printed again, so spellings such as `007` compare equal.
    let plain = |words: &[&str]| {
        let numbers = words.iter().map(|word| line.number::<u64>(word));
        Ok(list(&numbers.collect::<Result<Vec<_>, Malformed>>()?))
    };
    let on = |cores| Ok(format!("{} {}", line.kind, line.cores(cores)?));
    let mut what = line.kind.to_owned();
    let value = match (line.kind, &line.words[..]) {
        ("multi_path", &[cores, bound]) => {
            what = on(cores)?;
            plain(&[bound])?
        }
        ("single", &[cores, "graham", graham, "long_paths", long_paths]) => {
            what = on(cores)?;
            let (graham, long_paths) = (plain(&[graham])?, plain(&[long_paths])?);
            format!("graham {graham} long_paths {long_paths}")
        }
        ("alone", &[cores, alone, "peel", peel, "least", least, "spread", spread]) => {
            what = on(cores)?;
            let (alone, peel, spread) = (plain(&[alone])?, plain(&[peel])?, plain(&[spread])?);
            format!(
                "{alone} peel {peel} least {} spread {spread}",
                plain(&[least])?
            )
        }
        ("alone", _) => {
            return Err(line.malformed("expected `alone M A peel P least L spread X`"));
        }
        ("multi_path", _) => return Err(line.malformed("expected `multi_path M R`")),
        ("single", _) => {
            return Err(line.malformed("expected `single M graham R long_paths R`"));
        }
        ("len" | "vol" | "span", _) => plain(line.exactly(1)?)?,
        ("cov", words) => plain(words)?,
        ("bottom_level" | "width", _) => plain(line.exactly(size)?)?,
        ("dm_order", _) => {
            let order: Vec<usize> = line.numbers(size)?;
            if !(0..size).all(|dag| order.contains(&dag)) {
                let reason = format!("expected each DAG from 0 to {} once", size - 1);
                return Err(line.malformed(reason));
            }
            list(&order)
        }
        // From here on a quantity may be `-`: its test does not accept the set, or does not apply.
        (_, ["-"]) => "-".to_owned(),
        ("gedf_capacity" | "bonifaci_gedf", _) => {
            let [verdict] = line.fixed()?;
            u8::from(line.flag(verdict)?).to_string()
        }
        ("federated", [left, heavy @ ..]) => {
            let heavy = heavy.iter().map(|word| match word.split_once(':') {
                Some((dag, cores)) => Ok(format!(" {}:{}", plain(&[dag])?, plain(&[cores])?)),
                None => Err(line.malformed(format!("expected dag:cores, found {}", quoted(word)))),
            });
            plain(&[left])? + &heavy.collect::<Result<String, Malformed>>()?
        }
        _ => plain(line.exactly(size)?)?,
    };
    Ok((what, value))
}

/// Computes and compares each quantity of a case.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &BoundsCase) -> Result<(), String> {
    for (index, (task, quantities)) in case.dags.iter().enumerate() {
        compare(quantities, |what, expected| {
            compute_of_dag(what, expected, task)
        })
        .map_err(|difference| format!("dag {index}: {difference}"))?;
    }
    let tasks: Vec<&Task> = case.dags.iter().map(|(task, _)| task).collect();
    compare(&case.quantities, |what, _| {
        compute(what, &tasks, case.cores)
    })
}

fn compare(quantities: &Quantities, compute: impl Fn(&str, &str) -> String) -> Result<(), String> {
    for (what, expected) in quantities {
        let computed = compute(what, expected);
        if *expected != computed {
            return Err(format!("{what}: expected {expected}, computed {computed}"));
        }
    }
    Ok(())
}

/// Computes one quantity of a DAG.
fn compute_of_dag(what: &str, expected: &str, task: &Task) -> String {
    let (name, cores) = what.split_once(' ').unwrap_or((what, "1"));
    let cores = cores.parse().expect("a number of cores, as was read");
    match name {
        "len" => task.length_ns().to_string(),
        "vol" => task.volume_ns().to_string(),
        "bottom_level" => list(&task.bottom_levels()),
        "span" => task.span_ns().to_string(),
        "width" => width(task).map_or("-".to_owned(), |width| width.to_string()),
        "cov" => list(&covers(task.oblivious(), usize::MAX)),
        "alone" => compute_alone(expected, task, cores),
        "multi_path" => multi_path(task, cores).map_or("-".to_owned(), |bound| bound.to_string()),
        _ => {
            let (graham, long_paths) = (older::graham(task, cores), older::long_paths(task, cores));
            format!("graham {graham} long_paths {long_paths}")
        }
    }
}

/// Computes the bounds of a single job alone. The bounds only show whether the expected `least` is
/// possible.
fn compute_alone(expected: &str, task: &Task, cores: u32) -> String {
    let Some(bounds) = alone_forms(task, cores) else {
        return "-".to_owned();
    };
    let (alone, peel, spread) = (bounds.one_path_ns, bounds.reserved_ns, bounds.oblivious_ns);
    let least = expected
        .split(' ')
        .nth(4)
        .and_then(|least| least.parse().ok());
    let least = least.map_or(0, |least: u64| least.min(alone).min(peel));
    format!("{alone} peel {peel} least {least} spread {spread}")
}

/// Computes one quantity of a set.
fn compute(name: &str, tasks: &[&Task], cores: u32) -> String {
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    // Ties go to the earlier DAG.
    order.sort_by_key(|&dag| (tasks[dag].relative_deadline_ns(), dag));
    let by_deadline: Vec<&Task> = order.iter().map(|&dag| tasks[dag]).collect();
    let accepted = |yes: bool| u8::from(yes).to_string();
    let bounds = |bounds: Option<Vec<u64>>| bounds.map(|bounds| list(&bounds));
    // The multi-path bound under fixed priorities is for deadlines up to the period.
    let is_constrained = |task: &&Task| task.relative_deadline_ns() <= task.period_ns();
    let by_priority = |clip: InterferenceBound| {
        let bounds = multi_path_fp(&by_deadline, cores, clip);
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
        "melani_gedf" => bounds(older::melani_edf(tasks, cores)),
        "mp_gfp_dm" => bounds(by_priority(InterferenceBound::Window)),
        "mp_gfp_dm_clip" => bounds(by_priority(InterferenceBound::Waiting)),
        "mp_gedf" => bounds(multi_path_edf(tasks, cores, InterferenceBound::Window)),
        "mp_gedf_clip" => bounds(multi_path_edf(tasks, cores, InterferenceBound::Waiting)),
        "wait_gfp_dm" => bounds(waiting_fp(&by_deadline, cores, WaitingForm::OnePath)),
        "wait_gfp_dm_best" => bounds(waiting_fp(&by_deadline, cores, WaitingForm::Best)),
        "wait_np_gfp_dm" => bounds(waiting_fp(&by_deadline, cores, WaitingForm::NonPreemptive)),
        "wait_gedf" => bounds(waiting_edf(tasks, cores, WaitingForm::OnePath)),
        "wait_gedf_best" => bounds(waiting_edf(tasks, cores, WaitingForm::Best)),
        "wait_np_gedf" => bounds(waiting_edf(tasks, cores, WaitingForm::NonPreemptive)),
        "gedf_capacity" => older::li_edf(tasks, cores).map(accepted),
        "bonifaci_gedf" => Some(accepted(older::bonifaci_edf(tasks, cores))),
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

pub(super) fn list<T: ToString>(values: &[T]) -> String {
    let words: Vec<String> = values.iter().map(T::to_string).collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::{ORACLE, parse};
    use crate::oracle::judged::{assert_agree, assert_differs};
    use crate::tests::assert_malformed;

    const FILE: &str = include_str!("../../../../tests/oracle/bounds.txt");
    const MULTI_PATH: &str = include_str!("../../../../tests/oracle/multi_path.txt");

    #[test]
    fn all_public_cases_agree() {
        assert_agree(&ORACLE, FILE, 60);
        assert_agree(&ORACLE, MULTI_PATH, 60);
    }

    fn first() -> &'static str {
        FILE.split_inclusive("end\n").next().unwrap()
    }

    /// A part of the first case, its replacement, and the resulting difference.
    const WRONG: &str = r"\nlen 41 | \nlen 42 | dag 1: len: expected 42, computed 41
graham 50 long_paths 46 | graham 50 long_paths 47 | dag 2: single 7: expected graham 50 long_paths 47, computed graham 50 long_paths 46
melani_gedf 11 44 60 | melani_gedf - | melani_gedf: expected -, computed 11 44 60
federated 7 | federated 6 0:1 | federated: expected 6 0:1, computed 7";

    #[test]
    fn a_difference_names_the_quantity() {
        assert_differs(&ORACLE, first(), WRONG);
    }

    /// The same for refusals: with the line, and the reason where it is worth a test.
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
case bpub000 7 3 | case b\? 7 3 | 1 | case `b\u{202e}`: a name must be seen; rename it
single 7 graham 41 long_paths 41\n |  | 17 | expected a `single` record
single 7 graham 41 long_paths 41\n | single 7 graham 41 long_paths 41\nsingle 7 graham 41 long_paths 41\n | 18 | `single 7` stands here twice
single 7 graham 41 | single 65 graham 41 | 17
dm_order 0 1 2 | dm_order 0 1 3 | 28 | expected each DAG from 0 to 2 once
dm_order 0 1 2 | dm_order 0 1 1 | 28 | expected each DAG from 0 to 2 once
dm_order 0 1 2 | dm_order 0 1 4294967296 | 28 | expected each DAG from 0 to 2 once
federated 7 | federated 7 \? | 36 | expected dag:cores, found `\u{202e}`
width 1 1 2\n |  | 36
bonifaci_gedf 0 | bonifaci_gedf 2 | 35
federated 7 | federated 7 0 | 36
\nend\n | \n | 37";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        assert_malformed(parse, first(), MALFORMED);
        assert_eq!(parse("").unwrap_err().line, 1);
        assert_eq!(parse("\nfoo\n").unwrap_err().line, 2);
        let error = parse(&first().repeat(2)).unwrap_err();
        let reason = "case `bpub000` stands here twice, first on line 1; rename one";
        assert_eq!((error.line, error.reason.as_str()), (38, reason));
    }
}
