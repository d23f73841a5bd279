//! Reference values of one core: response times attained by some run, and published ones.
//!
//! ```text
//! case NAME edf(0/1) ndags
//! dag T D 0 nsub nedge / sub C priority keeps(0/1) .. / edge u v .. / sink v D_v .. / wait v n C_0 W_1 C_1 ..
//! kind exact|bound
//! r DAG least most         the bound of the job is in between
//! f DAG SUB least most     that of a sink
//! w DAG joint sum best most      of a set with waits: that of the job is no more, if not `-`
//! end
//! ```
//!
//! or a line for each set of sequential DAGs, the most urgent DAG first
//!
//! ```text
//! edf C,T,D .. -> least .. | most ..
//! npfp C,T .. -> least .. | most ..
//! waits C,T .. | C_0 W_1 C_1 .. -> most | sum joint      the last one waits
//! ```
//!
//! Under static priorities a response time does not depend on the deadlines; nor does it under EDF
//! if all deadlines are later by the same time. So a set is first compared with later deadlines, to
//! keep bounds within the deadlines. Then the set is compared as stated: a bound may be missing if
//! another bound is late, but none may be below or above the expected range. Pinned DAGs are
//! refused: nothing here pins.

use sched_dag::analysis::{AnalysisSettings, Overheads, answer};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, Priority, SchedulerOptions,
    SubtaskSpec, Wait, verify,
};

use text::{Line, Lines, Malformed, cases};

use super::FileOracle;
use super::bounds::parse_wait;

/// The kind `one-core`.
pub(super) static ORACLE: FileOracle<OneCoreCase> = FileOracle {
    invocation: "./scripts/oracle one-core",
    about: "Compares response times on one core, under static priorities and under EDF, with those \
            that some run attains and with published ones.",
    parse,
    check,
    name: |case| &case.name,
    schedules: None,
};

/// The time by which all deadlines are later than in a case, in nanoseconds.
const LATER_NS: u64 = 10_000;

/// A set of DAGs with its expected response times.
#[derive(Debug)]
pub struct OneCoreCase {
    /// The case's name.
    pub name: String,
    policy: Policy,
    dags: Vec<DagSpec>,
    /// The DAG, the sink in the case of a sink's bound, and the least and largest expected value.
    expected: Vec<(usize, Option<usize>, [u64; 2])>,
}

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that deviates from the description above.
pub fn parse(text: &str) -> Result<Vec<OneCoreCase>, Malformed> {
    let code = |line| {
        if str::starts_with(line, '#') {
            ""
        } else {
            line
        }
    };
    let text = &text.lines().map(code).collect::<Vec<_>>().join("\n");
    let mut lines = Lines::new(text);
    if lines
        .clone()
        .next_line()
        .is_none_or(|line| line.kind == "case")
    {
        return cases(text, parse_case);
    }
    let mut sets = Vec::new();
    while let Some(line) = lines.next_line() {
        sets.push(match line.kind {
            "waits" => parse_waits(&line),
            _ => parse_line(&line),
        }?);
    }
    Ok(sets)
}

const fn policy(by_deadline: bool) -> Policy {
    if by_deadline {
        Policy::Edf
    } else {
        Policy::StaticPriority
    }
}

fn dag(period_ns: u64, deadline_ns: u64) -> DagSpec {
    DagSpec {
        period_ns: Some(period_ns),
        relative_deadline_ns: Some(deadline_ns + LATER_NS),
        in_flight: u32::try_from((deadline_ns + LATER_NS).div_ceil(period_ns)).ok(),
        ..DagSpec::default()
    }
}

fn subtask(wcet_ns: u64, priority: u32, non_preemptive: bool) -> SubtaskSpec {
    SubtaskSpec {
        wcet_ns: Some(wcet_ns),
        priority: Some(Priority(priority)),
        non_preemptive,
        ..SubtaskSpec::default()
    }
}

fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<OneCoreCase, Malformed> {
    let [name, by_deadline, count] = header.fixed()?;
    let mut case = OneCoreCase {
        name: name.to_owned(),
        policy: policy(header.flag(by_deadline)?),
        dags: Vec::new(),
        expected: Vec::new(),
    };
    for _ in 0..header.at_least_one(count)? {
        case.dags.push(parse_dag(lines)?);
    }
    lines.expect("kind")?.exactly(1)?;
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("end"))?;
        let numbers = || line.numbers::<usize>(line.words.len());
        let values = |numbers: &[usize]| [numbers[0] as u64, numbers[1] as u64];
        let (dag, subtask, range) = match line.kind {
            "end" => return Ok(case),
            "r" if line.words.len() == 3 => {
                let of = numbers()?;
                (of[0], None, values(&of[1..]))
            }
            "f" if line.words.len() == 4 => {
                let of = numbers()?;
                (of[0], Some(of[1]), values(&of[2..]))
            }
            // A bound of a set with waits may be any value up to `most`.
            "w" if line.words.len() == 5 => match line.words[4] {
                "-" => continue,
                most => (line.number(line.words[0])?, None, [0, line.number(most)?]),
            },
            _ => return Err(line.malformed("expected `r`, `f`, `w` or `end`")),
        };
        if case
            .dags
            .get(dag)
            .is_none_or(|of| subtask >= Some(of.subtasks.len()))
        {
            return Err(line.malformed("there is no such DAG or subtask"));
        }
        case.expected.push((dag, subtask, range));
    }
}

fn parse_dag(lines: &mut Lines<'_>) -> Result<DagSpec, Malformed> {
    let header = lines.expect("dag")?;
    let [period, deadline, pinned, subtasks, edges] = header.fixed()?;
    if header.flag(pinned)? {
        return Err(header.malformed("pinned DAGs are not compared"));
    }
    let mut spec = dag(
        header.at_least_one(period)?.into(),
        header.at_least_one(deadline)?.into(),
    );
    for _ in 0..header.at_least_one(subtasks)? {
        let line = lines.expect("sub")?;
        let [wcet, priority, keeps] = line.fixed()?;
        let wcet_ns = line.at_least_one(wcet)?.into();
        spec.subtasks
            .push(subtask(wcet_ns, line.number(priority)?, line.flag(keeps)?));
    }
    let count = spec.subtasks.len();
    spec.edges = lines.edges(header.number(edges)?, count)?;
    while let Some(line) = lines.next_if("sink") {
        let [sink, deadline] = line.fixed()?;
        let deadline_ns = u64::from(line.at_least_one(deadline)?) + LATER_NS;
        spec.subtasks[line.index("subtask", sink, count)?].relative_deadline_ns = Some(deadline_ns);
    }
    while let Some(line) = lines.next_if("wait") {
        let (subtask, _, times) = parse_wait(&line, count)?;
        spec.subtasks[subtask].waits = waits(&times);
    }
    Ok(spec)
}

/// Returns a subtask's waits, from the WCETs of its segments and the limits in between.
fn waits(times: &[u64]) -> Vec<Wait> {
    let waits = times[1..].chunks_exact(2).map(|of| Wait {
        limit_ns: of[0],
        segment_ns: Some(of[1]),
    });
    waits.collect()
}

fn parse_waits(line: &Line<'_>) -> Result<OneCoreCase, Malformed> {
    let fault = || line.malformed("expected `waits C,T .. | C_0 W_1 C_1 .. -> most | sum joint`");
    let words = line.words.join(" ");
    let (above, rest) = words.split_once(" | ").ok_or_else(fault)?;
    let (times, values) = rest.split_once(" -> ").ok_or_else(fault)?;
    let (most, _) = values.split_once(" | ").ok_or_else(fault)?;
    let mut case = parse_line_of(line, false, above)?;
    let times = numbers(line, times, ' ')?;
    if times.len().is_multiple_of(2) {
        return Err(fault());
    }
    let place = case.dags.len();
    let wcet_ns = times.iter().step_by(2).sum();
    let mut spec = dag(LATER_NS, LATER_NS);
    spec.subtasks.push(SubtaskSpec {
        waits: waits(&times),
        ..subtask(wcet_ns, priority_of(place), false)
    });
    case.dags.push(spec);
    case.expected.push((place, None, [0, line.number(most)?]));
    Ok(case)
}

fn numbers(line: &Line<'_>, words: &str, separator: char) -> Result<Vec<u64>, Malformed> {
    let words = words.split(separator);
    words.map(|word| line.number(word)).collect()
}

fn parse_line(line: &Line<'_>) -> Result<OneCoreCase, Malformed> {
    let fault =
        || line.malformed("expected `edf C,T,D ..` or `npfp C,T ..`, then `-> least .. | most ..`");
    let words = line.words.join(" ");
    let (sets, values) = words.split_once(" -> ").ok_or_else(fault)?;
    let (least, most) = values.split_once(" | ").ok_or_else(fault)?;
    let (least, most) = (numbers(line, least, ' ')?, numbers(line, most, ' ')?);
    let mut case = parse_line_of(line, line.kind != "edf", sets)?;
    for place in 0..case.dags.len() {
        let range = least.get(place).zip(most.get(place)).ok_or_else(fault)?;
        case.expected.push((place, None, [*range.0, *range.1]));
    }
    Ok(case)
}

/// Reads sequential DAGs, still without expectations.
fn parse_line_of(line: &Line<'_>, keeps: bool, sets: &str) -> Result<OneCoreCase, Malformed> {
    let mut case = OneCoreCase {
        name: format!("line {}", line.number),
        policy: policy(line.kind == "edf"),
        dags: Vec::new(),
        expected: Vec::new(),
    };
    for (place, words) in sets.split(' ').enumerate() {
        let of = numbers(line, words, ',')?;
        let (&[wcet_ns, period_ns] | &[wcet_ns, period_ns, _]) = &of[..] else {
            return Err(line.malformed("expected C,T or C,T,D of each DAG"));
        };
        let mut spec = dag(period_ns, of.get(2).copied().unwrap_or(period_ns));
        let own = subtask(wcet_ns, priority_of(place), keeps);
        spec.subtasks.push(own);
        case.dags.push(spec);
    }
    Ok(case)
}

fn priority_of(place: usize) -> u32 {
    u32::try_from(place).unwrap_or(u32::MAX)
}

/// Compares each bound with the expected range, first with later deadlines, then with the stated
/// ones.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &OneCoreCase) -> Result<(), String> {
    compare(case, &case.dags)?;
    let mut stated = case.dags.clone();
    for spec in &mut stated {
        let subtasks = spec.subtasks.iter_mut();
        let own = subtasks.map(|subtask| &mut subtask.relative_deadline_ns);
        for deadline_ns in own.chain([&mut spec.relative_deadline_ns]).flatten() {
            *deadline_ns = (*deadline_ns - LATER_NS).max(1);
        }
        let deadline_ns = spec.relative_deadline_ns.zip(spec.period_ns);
        spec.in_flight = deadline_ns
            .and_then(|(deadline, period)| u32::try_from(deadline.div_ceil(period)).ok());
    }
    compare(case, &stated)
}

/// Compares the bounds of DAGs with a case's expectations. Bounds may be missing only if some
/// expected value exceeds its deadline.
fn compare(case: &OneCoreCase, dags: &[DagSpec]) -> Result<(), String> {
    let is_in_time = |&(dag, subtask, [_, most]): &(usize, Option<usize>, [u64; 2])| {
        let of: &DagSpec = &dags[dag];
        let own = subtask.and_then(|subtask| of.subtasks[subtask].relative_deadline_ns);
        own.or(of.relative_deadline_ns)
            .is_none_or(|due| most <= due)
    };
    let all = case.expected.iter().all(is_in_time);
    let options = CommitOptions::new(case.policy, 1)
        .with_construction(ConstructionPolicy::any_graph())
        .with_instance_limit(u32::MAX);
    let verified = verify(dags, &options).map_err(|rejected| rejected.to_string())?;
    let scheduler = SchedulerOptions {
        policy: case.policy,
        preemption: Preemption::Enabled,
        cores: 1,
    };
    let settings = AnalysisSettings::new(scheduler, Overheads::default());
    let answer = answer(&verified.task_set, &settings);
    for &(dag, subtask, [least, most]) in &case.expected {
        let whole = answer.bounds[dag].map(|bound| bound.bound_ns);
        let found = match subtask {
            None => whole,
            Some(subtask) => {
                let mut sinks = verified.task_set.dags()[dag].sinks().iter();
                let place = sinks.position(|sink| sink.index() == subtask);
                place.and_then(|place| answer.sinks_ns[dag][place])
            }
        };
        let is_expected = |found| (least..=most).contains(&found);
        if !found.map_or(!all, is_expected) {
            let sink = subtask.map_or_else(String::new, |subtask| format!(", sink {subtask}"));
            let found = found.map_or_else(|| "none".into(), |found| found.to_string());
            return Err(format!(
                "dag {dag}{sink}: expected {least} to {most}, found {found}"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::judged::{assert_agree, assert_differs};
    use super::*;

    const TEXT: &str = include_str!("../../../../tests/oracle/one_core_exact.txt");
    const LINES: &str = include_str!("../../../../tests/oracle/one_core_lines.txt");

    #[test]
    fn responses_on_one_core_are_the_exact_ones() {
        assert_agree(&ORACLE, TEXT, 154);
        assert_agree(&ORACLE, LINES, 200);
    }

    /// The first set, with differences: a part, its replacement, and the found difference.
    const WRONG: &str = "\
r 0 2 2 | r 0 3 3 | dag 0: expected 3 to 3, found 2
r 2 4 4 | r 2 3 3 | dag 2: expected 3 to 3, found 4
f 1 0 1 1 | f 1 0 2 9 | dag 1, sink 0: expected 2 to 9, found 1";

    #[test]
    fn a_difference_is_named() {
        assert_differs(&ORACLE, TEXT, WRONG);
        assert_differs(
            &ORACLE,
            "npfp 2,9 3,9 -> 5 5 | 5 5\n",
            "-> 5 | -> 6 | dag 0: expected 6 to 5, found 5",
        );
        assert_differs(
            &ORACLE,
            "waits 1,11 3,12 | 1 2 2 -> 9 | 13 9\n",
            "-> 9 | -> 8 | dag 2: expected 0 to 8, found 9",
        );
        let waits = TEXT.find("case waits_1").expect("sets with waits");
        assert_differs(
            &ORACLE,
            &TEXT[waits..],
            "16 14 14 | 16 14 13 | dag 1: expected 0 to 13, found 14",
        );
    }

    #[test]
    fn a_malformed_line_is_refused() {
        for (from, to) in [
            ("kind exact", "kind"),
            ("dag 6 4 0 1 0", "dag 6 4 1 1 0"),
            ("sub 1 0 0", "sub 0 0 0"),
            ("r 2 4 4", "r 3 4 4"),
            ("f 0 0 2 2", "f 0 1 2 2"),
        ] {
            assert!(parse(&TEXT.replacen(from, to, 1)).is_err(), "{to}");
        }
    }
}
