//! The checker that Coq has proven right, alone: altered witnesses, past what `check-witness`
//! would refuse of their proofs, against the analysis.
//!
//! A bound that is proven of an altered one must hold for the DAGs that this one states. So each
//! number has to reach the theorem.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use random::Random;
use sched_dag::TaskSet;
use sched_dag::analysis::{AnalysisSettings, witness};

use super::forged::{altered, hashed, unsound};
use super::random::{mask, sample_with};
use super::witnesses::drawn;
use crate::support::number;

/// Prints of each file the DAGs with a bound that the proven checker accepts, and the bounds. Of
/// what `check-witness` requires only the statement, and how late releases are, is looked at.
const WITHOUT_CHECKS: &str = "
import sys
space = {'__name__': 'checker', '__file__': sys.argv[1]}
exec(open(sys.argv[1]).read(), space)
Witness, check, relations = space['Witness'], space['require'], space['Witness'].relations
kept, strict, found = ('how late', 'there is no', 'two bounds', 'no number'), True, []
def require(condition, what):
    check(condition or not strict and not any(words in what for words in kept), what)
def lenient(self):
    global strict
    strict = False
    relations(self)
space['require'], Witness.relations = require, lenient
for name in sys.argv[2:]:
    strict = True
    try:
        witness = Witness(open(name).read())
        space['of_sinks'](witness, range(len(witness.dags)), 1)
        [space['of_table'](witness, table) for table in witness.tables]
        space['of_core'](witness, range(len(witness.dags)))
        found.append(witness)
    except Exception:
        found.append(None)
answers = iter(space['judged']([witness for witness in found if witness]))
for witness in found:
    lines = []
    for n, kind in sorted(next(answers)) if witness else ():
        dag, own = witness.dags[n], {}
        if kind == 'job':
            lines.append(f'dag {n} x: at most {dag.bound} ns')
        elif kind == 'sinks':
            own = dag.own_sinks()
        else:
            own = {v: of[0] for v, of in dag.core_sinks.items()}
        own = {v: r for v, r in own.items() if v in dag.due or not dag.successors()[v]}
        lines += [f'dag {n} x: sink {v}: at most {r} ns' for v, r in own.items()]
    print(*lines, sep=';')
";

/// Prints of each bound of each file why no theorem proves the bound, an empty line if one does.
const REASONS: &str = "
import sys
space = {'__name__': 'checker', '__file__': sys.argv[1]}
exec(open(sys.argv[1]).read(), space)
found = []
for name in sys.argv[2:]:
    parts = space['of_clusters'](open(name).read())
    found += [space['Witness'](part) for part in parts]
for witness, proven in zip(found, space['judged'](found)):
    for number in range(len(witness.dags)):
        if space['is_bounded'](witness, number):
            print(space['without_theorem'](witness, number, proven) or '')
";

/// Asks of texts, by a program in Python that uses `check-witness`.
fn asked(program: &str, folder: &Path, texts: &[String]) -> String {
    let checker = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/check-witness");
    let mut python = Command::new("python3");
    python.args(["-c", program]).arg(checker);
    for (number, text) in texts.iter().enumerate() {
        let path = folder.join(number.to_string());
        fs::write(&path, text).expect("the folder takes it");
        python.arg(path);
    }
    let output = python.output().expect("python3 runs");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{complaint}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Returns what is proven of each text.
fn proven(folder: &Path, texts: &[String]) -> Vec<Vec<String>> {
    let said = asked(WITHOUT_CHECKS, folder, texts);
    assert_eq!(said.lines().count(), texts.len(), "{said}");
    let of_text = |line: &str| line.split_terminator(';').map(String::from).collect();
    said.lines().map(of_text).collect()
}

/// The proven checker accepts each bound whose form has a theorem, if all that the bound rests on
/// has one.
#[test]
fn no_witness_is_judged_differently() {
    let folder = std::env::temp_dir().join(format!("judged-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    let mut reasons = BTreeMap::<String, u32>::new();
    let numbers: Vec<u64> = (0..number("PROVEN_SETS", 800)).collect();
    for some in numbers.chunks(400) {
        let sets = some.iter().filter_map(|&number| drawn(number));
        let texts: Vec<String> = sets
            .map(|(set, settings)| witness(&set, &settings))
            .collect();
        for why in asked(REASONS, &folder, &texts).lines() {
            assert!(!why.contains("does not accept"), "{why}: {some:?}");
            *reasons.entry(why.to_owned()).or_default() += 1;
        }
    }
    println!("{reasons:#?}");
    assert!(reasons[""] > 300, "too few are proven");
    fs::remove_dir_all(&folder).expect("it was made");
}

/// The words of forms with a theorem, of bounds of sinks, and of losses.
const FORMS: [&str; 14] = [
    " paths ",
    " waiting ",
    " sharp ",
    " widths\n",
    " windows\n",
    " reserved ",
    " blocked ",
    " lent ",
    " sequence ",
    " core ",
    " table\n",
    "\nsink ",
    "\nsooner ",
    "\nbursts ",
];

/// Sets of `drawn` with short witnesses: bounds of sinks on several cores, the last three as widths
/// fit; then windows.
const SHORT: [u64; 12] = [
    99, 309, 754, 784, 851, 1_091, 1_394, 788, 960, 1_232, 36, 881,
];

fn small(number: u64) -> Option<(TaskSet, AnalysisSettings)> {
    let wanted = mask(&[("waits", number % 4 == 1), ("tables", number % 4 == 3)]);
    let mut sample = sample_with(wanted, &mut Random::new(number));
    if number % 5 == 2 {
        sample.cores = 1;
    }
    let mut settings = sample.settings();
    settings.overheads.ready_ns = number % 3 / 2;
    Some((sample.charged(&settings)?, settings))
}

/// Short witnesses of such sets, of which bounds along a path are rare.
fn small_witnesses() -> impl Iterator<Item = String> {
    let numbers = (0..80).chain([269, 789, 1557, 2185]);
    let sets = numbers
        .map(small)
        .chain(SHORT.into_iter().map(drawn))
        .flatten();
    let texts = sets.map(|(set, settings)| witness(&set, &settings));
    texts.filter(|text| {
        let most = if text.contains(" core ") { 60 } else { 40 };
        text.lines().count() <= most && text.matches("machine ").count() == 1
    })
}

/// Short witnesses of further forms, each part as of a machine of its own.
fn more_witnesses() -> impl Iterator<Item = String> {
    let sets = (0..3_000).filter_map(drawn);
    let texts = sets.map(|(set, settings)| witness(&set, &settings));
    let parts = texts.flat_map(|text| {
        let parts = text.replace("\nmachine ", "\n\0machine ");
        let parts = parts.split('\0').map(|part| {
            let lines = part.lines().filter(|line| !line.starts_with("cluster "));
            hashed(&lines.map(|line| line.to_owned() + "\n").collect::<String>())
        });
        parts.collect::<Vec<String>>()
    });
    let more = [" waiting ", " sharp ", " lent ", " sequence "];
    more.into_iter().flat_map(move |form| {
        let of_form = parts.clone().filter(move |text| text.contains(form));
        of_form.filter(|text| text.lines().count() <= 35).take(3)
    })
}

/// The text, and what it becomes by another number or without a line, such as one of another DAG
/// that delays.
fn alterations(text: &str) -> Vec<String> {
    let mut others = altered(text);
    let inner = text
        .lines()
        .filter(|line| !line.starts_with(['m', 'h']) && !line.starts_with("se"));
    others.extend(inner.map(|line| text.replacen(&format!("{line}\n"), "", 1)));
    let is_sane = |text: &String| !text.split("hash ").next().unwrap_or("").contains(" -");
    let others = others.iter().map(|text| hashed(text)).filter(is_sane);
    [text.to_owned()].into_iter().chain(others).collect()
}

#[test]
fn what_it_proves_of_altered_witnesses_holds() {
    let folder = std::env::temp_dir().join(format!("proven-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    let (mut of_form, mut fewer, mut sound) = ([0; FORMS.len()], 0, 0);
    for text in small_witnesses().chain(more_witnesses()) {
        if !FORMS.iter().any(|form| text.contains(form)) {
            continue;
        }
        let texts = alterations(&text);
        let found = proven(&folder, &texts);
        for (form, count) in FORMS.iter().zip(&mut of_form) {
            *count += usize::from(text.contains(form) && !found[0].is_empty());
        }
        for (lines, altered) in found.iter().zip(&texts) {
            let flaw = (!lines.is_empty())
                .then(|| unsound(altered, lines))
                .flatten();
            assert_eq!(flaw, None, "{text}\naltered:\n{altered}{lines:?}");
            let count = if lines.len() < found[0].len() {
                &mut fewer
            } else {
                &mut sound
            };
            *count += 1;
        }
    }
    println!("altered: {fewer} prove less, {sound} hold; of {FORMS:?} {of_form:?}");
    assert!(of_form.iter().all(|&count| count > 0), "{of_form:?}");
    assert!(fewer > 1_000, "{fewer}");
    fs::remove_dir_all(&folder).expect("it was made");
}
