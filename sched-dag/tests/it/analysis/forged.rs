//! Forged witnesses: each number of a true one altered, with the old hashes and with new ones.
//!
//! With the old hashes the checker must refuse every one. With new ones it may accept another
//! proof of the same bounds, say by another chain of the same length. The statement may be
//! altered, too: then the bounds are of other DAGs, and they must hold for these.

use std::collections::BTreeSet;
use std::fs;

use sched_dag::analysis::{AnalysisSettings, Overheads, answer};
use sched_dag::{DagSpec, OverrunPolicy, Policy, Preemption, Priority, SubtaskSpec, TaskSet, Wait};

use super::random::Sample;
use super::simulate::spec;
use super::witnesses::{accepted, lines_about, output};

/// Forges a witness in all ways. Returns how many are refused, how many prove the same, and how
/// many prove bounds of other DAGs.
pub(crate) fn refused(file: &str) -> [usize; 3] {
    let original = fs::read_to_string(file).expect("it was written");
    let (statement, _) = original.split_once("hash ").expect("a hash");
    let proven = lines_about(file, &accepted(&[file.into()]));
    let altered = altered(&original);
    let hashed_anew = altered.iter().map(|text| hashed(text));
    let all: Vec<String> = altered.iter().cloned().chain(hashed_anew).collect();
    let others = all.iter().filter(|text| **text != original);
    let files: Vec<(String, &String)> = (0..)
        .zip(others)
        .map(|(number, text)| (format!("{file}.{number}"), text))
        .collect();
    for (name, text) in &files {
        fs::write(name, text).expect("the folder takes it");
    }
    let names: Vec<String> = files.iter().map(|(name, _)| name.clone()).collect();
    let said = String::from_utf8(output(&names).stdout).expect("UTF-8");
    let mut counts = [0; 3];
    for (name, text) in &files {
        let lines = lines_about(name, &said);
        let kind = if lines.len() == 1 && lines[0].starts_with("refused: ") {
            0
        } else if **text == hashed(text) && text.starts_with(statement) && lines == proven {
            1
        } else {
            let flaw = (**text != hashed(text)).then(|| String::from("wrong hashes"));
            let flaw = flaw.or_else(|| unsound(text, &lines));
            assert_eq!(flaw, None, "{original}\naltered:\n{text}{lines:?}");
            2
        };
        counts[kind] += 1;
    }
    counts
}

/// Returns the text with each number one more, one less, 0, and below 0; and with all WCETs, priorities
/// or marks of keeping the core alike; and with a table more.
pub(crate) fn altered(text: &str) -> Vec<String> {
    let mut all: Vec<String> = (1..=3)
        .flat_map(|column| ["0", "1"].map(|value| with_column(text, column, value)))
        .collect();
    // A feature that its bounds may not cover.
    all.push(text.replacen("\nhash ", "\ntable 1\nlist 0 0 0 0 0 1 0\nhash ", 1));
    let mut at = 0;
    for word in text.split_inclusive([' ', '\n']) {
        let (before, after) = (&text[..at], &text[at + word.trim_end().len()..]);
        if let Ok(number) = word.trim_end().parse::<i128>() {
            let others = [number + 1, number - 1, 0, -number];
            all.extend(others.map(|other| format!("{before}{other}{after}")));
        }
        at += word.len();
    }
    all
}

/// Returns the text with one of the numbers of each subtask replaced.
fn with_column(text: &str, column: usize, value: &str) -> String {
    let line = |line: &str| {
        let mut words: Vec<&str> = line.split(' ').collect();
        if words[0] == "subtask" {
            words[column] = value;
        }
        words.join(" ") + "\n"
    };
    text.lines().map(line).collect()
}

/// Returns the text with the hashes that it should have.
pub(crate) fn hashed(text: &str) -> String {
    let hash = |text: &str| {
        text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
    };
    let (statement, rest) = text.split_once("hash ").expect("a hash");
    let (_, proofs) = rest.split_once('\n').expect("proofs");
    let (proofs, _) = proofs.split_once("seal ").expect("a seal");
    let sealed = format!("{statement}hash {}\n{proofs}", hash(statement));
    format!("{sealed}seal {}\n", hash(&sealed))
}

/// Returns why bounds do not hold for the DAGs that a witness states: the analysis, which virtual
/// time judges in [`together`](super::together), does not prove as much.
pub(crate) fn unsound(text: &str, lines: &[String]) -> Option<String> {
    let (task_set, settings) = stated(text)?;
    let analysed = answer(&task_set, &settings);
    for line in lines {
        let words: Vec<&str> = line.split([' ', ':']).collect();
        let Some(at) = words.iter().position(|&word| word == "most") else {
            continue;
        };
        let number = |at: usize| words[at].parse::<u64>().expect("a number");
        let dag = usize::try_from(number(1)).expect("an index");
        let bound_ns = match words[at - 4] {
            "sink" => {
                let mut sinks = task_set.dags()[dag].sinks().iter();
                let place = sinks.position(|sink| u64::from(sink.0) == number(at - 3));
                analysed.sinks_ns[dag][place.expect("a sink")]
            }
            _ => analysed.bounds[dag].map(|bound| bound.bound_ns),
        };
        if bound_ns.is_none_or(|bound_ns| bound_ns > number(at + 1)) {
            return Some(format!("`{line}` is accepted, and proven is {bound_ns:?}"));
        }
    }
    None
}

/// Returns the priority for a number of a witness's policy: these may be larger than priorities
/// are, and their order is all that counts.
fn ranks(text: &str) -> impl Fn(&str) -> u32 {
    let number = |word: &str| word.parse::<u128>().expect("a number");
    let subtasks = text
        .lines()
        .filter_map(|line| line.strip_prefix("subtask "));
    let numbers = subtasks.filter_map(|line| line.split(' ').nth(1));
    let numbers: BTreeSet<u128> = numbers.map(number).collect();
    move |word| {
        let below = numbers.range(..number(word)).count();
        u32::try_from(below).expect("a small number")
    }
}

/// Returns the list of a core as a commit takes it.
fn list(words: &[&str]) -> String {
    let (mut text, mut depth) = (format!("core {}:", words[0]), 0);
    for entry in words[1..].chunks(6) {
        let numbers: Vec<i64> = entry
            .iter()
            .map(|word| word.parse().expect("a number"))
            .collect();
        let deeper = usize::try_from(numbers[5]).expect("a depth");
        text += &" (".repeat(deeper.saturating_sub(depth));
        text += &" )".repeat(depth.saturating_sub(deeper));
        depth = deeper;
        let length = numbers[4] - numbers[3];
        text += &format!(
            " {}.{}#{}@{}+{length}",
            numbers[0], numbers[2], numbers[1], numbers[3]
        );
    }
    text + &" )".repeat(depth)
}

/// Returns the DAGs that a witness states, and on what they run; if verification takes them.
fn stated(text: &str) -> Option<(TaskSet, AnalysisSettings)> {
    let (rank, mut dags) = (ranks(text), Vec::<DagSpec>::new());
    let (mut machine, mut costs) = ((0, Policy::Edf), Overheads::default());
    let mut lists = Vec::new();
    for line in text.lines().take_while(|line| !line.starts_with("hash ")) {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |at: usize| words[at].parse::<u64>().expect("a number");
        let index = |at: usize| usize::try_from(number(at)).expect("an index");
        let small = |at: usize| u32::try_from(number(at)).expect("a small number");
        match (words[0], dags.last_mut()) {
            ("machine", _) => {
                // `any` is the word of no policy, but the order of most.
                let policy = Policy::of_word(words[2]).unwrap_or(Policy::Fifo);
                machine = (small(1), policy);
                costs.dispatch_ns = number(3);
            }
            ("bursts", _) => costs.ready_ns = number(1),
            ("moves", _) => costs.interrupt_ns = number(1),
            ("device", _) => [costs.device_ns, costs.device_distance_ns] = [1, 2].map(number),
            ("queue", Some(dag)) if number(1) == 0 => dag.overrun = OverrunPolicy::Skip,
            ("queue", Some(dag)) => dag.overrun = OverrunPolicy::Abort,
            ("dag", _) => dags.push(DagSpec {
                in_flight: Some(small(4)),
                ..spec(number(2), number(3), &[], &[], 0)
            }),
            ("subtask", Some(dag)) => dag.subtasks.push(SubtaskSpec {
                wcet_ns: Some(number(1)).filter(|&ns| ns > 0),
                priority: Some(Priority(rank(words[2]))),
                non_preemptive: number(3) > 0,
                ..SubtaskSpec::default()
            }),
            ("edge", Some(dag)) => dag.edges.push((index(1), index(2))),
            ("wait", Some(dag)) => {
                let waits = (3..words.len()).step_by(2).map(|at| Wait {
                    limit_ns: number(at),
                    segment_ns: Some(number(at + 1)).filter(|&ns| ns > 0),
                });
                dag.subtasks[index(1)].waits = waits.collect();
            }
            ("grid", Some(dag)) => dag.offset_ns = number(1),
            ("table", _) => {}
            ("list", _) => lists.push(list(&words[1..])),
            ("affinity", Some(dag)) => dag.affinity = (1..words.len()).map(small).collect(),
            ("due", Some(dag)) => dag.subtasks[index(1)].relative_deadline_ns = Some(number(2)),
            _ => panic!("{line}"),
        }
    }
    let sample = Sample {
        specs: dags,
        policy: machine.1,
        preemption: Preemption::Enabled,
        cores: machine.0,
        clusters: sched_dag::CoreDivision::Undivided,
        is_lent: false,
        lists,
        dispatch_ns: 0,
    };
    // Only a shared state makes a sink precede another subtask.
    let task_set = sample.task_set()?;
    let mut settings = sample.settings();
    // What a move takes is a part of the charge.
    costs.dispatch_ns -= costs.interrupt_ns;
    settings.overheads = costs;
    Some((task_set, settings))
}
