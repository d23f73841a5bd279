//! Witnesses against the checker that shares no code with the analysis.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use random::Random;
use sched_dag::analysis::{AnalysisResult, AnalysisSettings, DagBound, answer, witness};
use sched_dag::{ClusterId, CoreDivision, Policy, Preemption, TaskSet};

use super::forged;
use super::random::{Sample, mask, sample_with};
use super::simulate::spec;
use crate::support::number;

pub(crate) fn output(files: &[String]) -> Output {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/check-witness");
    let output = Command::new("python3").arg(script).args(files).output();
    output.expect("python3 checks witnesses; install it")
}

/// Runs the checker, which must accept all files, and returns its lines.
pub(crate) fn accepted(files: &[String]) -> String {
    let output = output(files);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{files:?}: {said}{complaint}");
    said
}

/// Draws a set; of each four in turn one with waits, every other time on one core, one with lent
/// cores, and one with tables.
pub(super) fn drawn(number: u64) -> Option<(TaskSet, AnalysisSettings)> {
    let turn = number / 4 % 4;
    let wanted = mask(&[
        ("waits", turn == 1),
        ("one core", turn == 1 && number % 32 < 16),
        ("lent", turn == 2),
        ("tables", turn == 3),
    ]);
    let sample = match number {
        0 => full_core(),
        1 => behind_unknown(),
        _ => sample_with(wanted, &mut Random::new(number)),
    };
    let mut settings = sample.settings();
    settings.overheads.interrupt_ns = u64::from(number % 4 == 1);
    settings.overheads.ready_ns = u64::from(number % 4 == 2);
    if number % 4 == 3 || number % 16 == 2 {
        settings.overheads.device_ns = number % 3 + 1;
        settings.overheads.device_distance_ns = 20 + number % 7;
    }
    Some((sample.charged(&settings)?, settings))
}

#[test]
fn every_bound_has_a_witness_and_no_altered_one_passes() {
    let folder = std::env::temp_dir().join(format!("witnesses-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (mut files, mut expected) = (Vec::new(), Vec::new());
    for number in 0..=number("WITNESS_SETS", 1_600) {
        let Some((task_set, settings)) = drawn(number) else {
            continue;
        };
        let path = folder.join(number.to_string());
        fs::write(&path, witness(&task_set, &settings)).unwrap();
        files.push(path.to_string_lossy().into_owned());
        expected.push(lines(&task_set, &answer(&task_set, &settings)));
    }
    assert_says(&files, &expected);
    let (seen, [refused, same, sound]) = alter_parts(&files);
    println!("{} pass, with {seen:?}", files.len());
    println!("altered: {refused} refused, {same} prove the same bounds, {sound} sound ones");
    // More of the same are numbers that the checker no longer computes.
    assert!(
        refused > 3_000 && same * 100 <= refused,
        "{refused}, {same}"
    );
    assert!(sound > 100, "no statement was altered: {sound}");
    for form in [
        "core", "sooner", "windows", "widths", "reached", "lent", "table", "sequence", "reserved",
        "blocked", "sharp",
    ] {
        assert!(seen[form] > 3, "{form} is rare");
    }
    // On one core most of its bounds are smaller by `core`.
    assert!(seen["demand"] > 0, "no bound is by demand");
    fs::remove_dir_all(&folder).unwrap();
}

/// Alters witnesses of one part each, two with each word that witnesses have. Returns how many
/// parts have which words, and what came of that.
fn alter_parts(files: &[String]) -> (BTreeMap<String, u32>, [usize; 3]) {
    let (mut seen, mut counts) = (BTreeMap::<String, u32>::new(), [0; 3]);
    for file in files {
        let text = fs::read_to_string(file).expect("it was written");
        for part in text.replace("\nmachine ", "\n\0machine ").split('\0') {
            let lines = part.lines().filter(|line| !line.starts_with("cluster "));
            let alone: String = lines.map(|line| line.to_owned() + "\n").collect();
            // Names are of no matter.
            let lines = part.lines().filter(|line| !line.starts_with("dag "));
            let words = lines.flat_map(|line| line.split(' '));
            let words = words.filter(|word| word.starts_with(char::is_alphabetic));
            let mut is_new = false;
            for word in BTreeSet::from_iter(words) {
                let count = seen.entry(word.to_owned()).or_default();
                *count += 1;
                is_new |= *count <= 2;
            }
            if is_new {
                fs::write(file, forged::hashed(&alone)).expect("it can be written");
                let more = counts.iter_mut().zip(forged::refused(file));
                more.for_each(|(sum, more)| *sum += more);
            }
        }
    }
    (seen, counts)
}

#[test]
fn a_witness_that_lacks_a_cluster_or_is_torn_is_refused() {
    let mut sample = full_core();
    for (spec, cluster) in sample.specs.iter_mut().zip(0..) {
        spec.cluster = Some(ClusterId(cluster));
    }
    (sample.cores, sample.clusters) = (2, CoreDivision::Of(vec![1, 1]));
    let text = witness(&sample.task_set().unwrap(), &sample.settings());
    let second = text.rfind("machine ").unwrap();
    let (first, second) = text.split_at(second);
    let path = std::env::temp_dir().join(format!("witness-{}", std::process::id()));
    let is_accepted = |parts: &[&str]| {
        fs::write(&path, parts.concat()).unwrap();
        let file = path.to_string_lossy().into_owned();
        output(&[file]).status.success()
    };
    assert!(is_accepted(&[first, second]));
    let lines = second.replace('\n', "\r\n");
    let long = second.replacen(' ', &format!(" {}", "2".repeat(5_000)), 1);
    let wrong: [&[&str]; 7] = [
        &[first],
        &[second],
        &[second, first],
        &[first, first],
        &[first, second, "more"],
        &[first, &lines],
        &[first, &long],
    ];
    for parts in wrong {
        assert!(!is_accepted(parts), "{parts:?}");
    }
    fs::remove_file(&path).unwrap();
}

/// Its command line is one of the family: help, and 2 for what is refused.
#[test]
fn the_checker_has_help_and_refuses_command_lines() {
    for (word, code, begin) in [
        ("--help", 0, "Checks what proves"),
        ("--jobs", 2, "check-witness: unknown option `--jobs`; "),
        ("/no/file", 2, "check-witness: `/no/file`: No such file"),
    ] {
        let output = output(&[word.into()]);
        let said = [output.stdout, output.stderr].concat();
        assert_eq!(output.status.code(), Some(code));
        assert!(said.starts_with(begin.as_bytes()), "{word}");
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/check-witness");
    let full = fs::File::create("/dev/full").unwrap();
    let mut help = Command::new("python3");
    help.arg(script).arg("--help");
    assert_eq!(help.stdout(full).status().unwrap().code(), Some(2));
}

/// Returns how the lines begin that the checker is to say.
pub(crate) fn lines(task_set: &TaskSet, answer: &AnalysisResult) -> Vec<String> {
    let mut lines = Vec::new();
    for cluster in task_set.clusters() {
        let place = match task_set.clusters().count() > 1 {
            true => format!("cluster {}: ", cluster.0),
            false => String::new(),
        };
        lines.push(format!("{place}statement "));
        let dags = task_set.dags().iter().zip(0..);
        let own = dags.filter(|(dag, _)| dag.cluster() == cluster);
        for (number, (model, dag)) in own.enumerate() {
            let begin = format!("{place}dag {number} {:?}: ", model.name());
            let Some(DagBound { bound_ns, .. }) = answer.bounds[dag] else {
                lines.push(begin + "not proven");
                continue;
            };
            lines.push(format!("{begin}at most {bound_ns} ns: "));
            let deadline_ns = model.relative_deadline_ns();
            for (sink, own_ns) in model.sinks().iter().zip(&answer.sinks_ns[dag]) {
                let due_ns = model.subtask(*sink).relative_deadline_ns();
                let own_ns = own_ns.expect("as its DAG has one");
                let is_inner = !model.successors(*sink).is_empty();
                if due_ns < deadline_ns || own_ns < bound_ns || is_inner {
                    lines.push(format!("{begin}sink {}: at most {own_ns} ns", sink.0));
                }
            }
        }
    }
    lines
}

/// The checker accepts all files, and says of each as many lines, which begin as expected.
pub(crate) fn assert_says(files: &[String], expected: &[Vec<String>]) {
    let said = accepted(files);
    for (file, expected) in files.iter().zip(expected) {
        let said = lines_about(file, &said);
        let agree = said.iter().zip(expected);
        let agree = agree.filter(|(said, it)| said.starts_with(*it)).count();
        let count = expected.len().max(said.len());
        assert_eq!(agree, count, "{file}: {said:?} {expected:?}");
    }
}

/// Returns what the checker says of a file.
pub(crate) fn lines_about(file: &str, said: &str) -> Vec<String> {
    let begin = format!("{file}: ");
    let lines = said.lines().filter_map(|line| line.strip_prefix(&begin));
    lines.map(String::from).collect()
}

/// A chain that is more urgent than subtasks of unknown WCETs, which it may preempt.
fn behind_unknown() -> Sample {
    let mut unknown = spec(100, 100, &[1, 1], &[], 1);
    for subtask in &mut unknown.subtasks {
        subtask.wcet_ns = None;
    }
    Sample {
        specs: vec![spec(100, 100, &[5, 5], &[(0, 1)], 0), unknown],
        policy: Policy::StaticPriority,
        cores: 2,
        ..full_core()
    }
}

/// Two DAGs that nearly use up one core, which only the demand proves.
fn full_core() -> Sample {
    let specs = [spec(6, 6, &[3], &[], 0), spec(9, 9, &[4], &[], 0)];
    Sample {
        specs: specs.to_vec(),
        policy: Policy::Edf,
        preemption: Preemption::Enabled,
        cores: 1,
        clusters: CoreDivision::Undivided,
        is_lent: false,
        lists: Vec::new(),
        dispatch_ns: 0,
    }
}

/// `low` waits for `high`, which is not of its group, but of its core.
const GROUPS_OVERLAP: &str = "\
machine 2 static 0
dag 0 100 100 1 1 0 low
subtask 10 5 0
affinity 0
dag 1 100 100 1 1 0 high
subtask 90 1 0
hash 0
graph 0 10 10
levels 10
cover 0
part 0
graph 1 90 90
levels 90
cover 0
part 0
bound 0 10 paths 1 1 0 0 0
chain 0
bound 1 90 paths 1 2 0 0 0
chain 0
seal 0
";

/// The last bound is below the WCET, so its job would wait for less than no time.
const BELOW_THE_PATH: &str = "\
machine 2 static 0
dag 0 10 10 1 1 0 a
subtask 1 0 0
dag 1 20 20 1 1 0 b
subtask 1 1 0
dag 2 1000 1000 1 1 0 x
subtask 900 2 0
hash 0
graph 0 1 1
levels 1
graph 1 1 1
levels 1
graph 2 900 900
levels 900
bound 0 1 paths 1 2 0 0 0
chain 0
bound 1 2 paths 1 2 0 0 1
chain 0
other 0 1 2 1
bound 2 1 waiting 1 2 1 0 -3595
chain 0
other 0 1 2 1 -1798
other 1 2 2 1 -1798
seal 0
";

/// Its earlier jobs are too many to be counted one by one.
const MANY_JOBS: &str = "\
machine 1 static 0
dag 0 1 1000000000000 1000000000000 1 0 late
subtask 1 5 0
hash 0
graph 0 1 1
levels 1
bound 0 900000000000 overlap 0
window 1 0
seal 0
";

/// A DAG that has two cores to itself.
const ALONE: &str = "\
machine 2 static 0
dag 0 100 100 1 1 0 alone
subtask 90 1 0
hash 0
graph 0 90 90
levels 90
cover 0
part 0
bound 0 90 paths 1 2 0 0 0
chain 0
seal 0
";

/// Any solution of the equations is a bound, not the least one alone.
#[test]
fn a_bound_above_the_least_is_proven_and_one_below_is_not() {
    let file = std::env::temp_dir().join(format!("above-{}", std::process::id()));
    for (bound_ns, is_proven) in [(89, false), (90, true), (91, true), (101, false)] {
        let text = ALONE.replace("bound 0 90", &format!("bound 0 {bound_ns}"));
        fs::write(&file, super::forged::hashed(&text)).expect("a file");
        let output = output(&[file.display().to_string()]);
        assert_eq!(output.status.success(), is_proven, "{bound_ns}");
    }
    fs::remove_file(&file).expect("it was written");
}

#[test]
fn what_is_forged_of_groups_or_too_large_is_refused() {
    let many_cores = GROUPS_OVERLAP.replace("machine 2", "machine 1000000000000");
    let other_digits = MANY_JOBS.replace("machine 1", "machine \u{661}");
    let forged = [
        (GROUPS_OVERLAP, "groups overlap"),
        (BELOW_THE_PATH, "dag 2: below its longest path"),
        (MANY_JOBS, "dag 0: its other jobs"),
        (&many_cores, "impossible numbers of the machine"),
        (&other_digits, "is no number of a witness"),
    ];
    let file = std::env::temp_dir().join(format!("forged-{}", std::process::id()));
    for (text, why) in forged {
        fs::write(&file, super::forged::hashed(text)).expect("a file");
        let output = output(&[file.display().to_string()]);
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(why), "{said}");
    }
    fs::remove_file(&file).expect("it was written");
}
