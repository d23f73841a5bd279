//! Certificates at a commit: their bounds against runs and against the checker, and texts that somebody
//! has altered.

use std::path::Path;
use std::{fs, slice};

use random::Random;
use sched_dag::analysis::{
    AnalysisResult, NotClosed, NotProvenReason, SchedulabilityTest, answer, certify, witness,
};
use sched_dag::{Policy, Preemption, TaskSet};

use super::abstraction::{Draws, GraphSample};
use super::forged::hashed;
use super::simulate::{commit, spec};
use super::witnesses::{assert_says, lines, lines_about, output};

fn fixed(task_set: &TaskSet, certificate: &str) -> TaskSet {
    let mut task_set = task_set.clone();
    task_set.fix(certificate);
    task_set
}

fn is_beyond(seen: &[Vec<u64>], task_set: &TaskSet, bounds: &AnalysisResult) -> bool {
    let dags = task_set.dags().iter().zip(seen).zip(&bounds.sinks_ns);
    let mut sinks = dags.flat_map(|((dag, seen), bounds)| {
        dag.sinks()
            .iter()
            .zip(bounds)
            .map(|(sink, bound)| (seen[sink.index()], *bound))
    });
    sinks.any(|(seen, bound)| bound.is_some_and(|bound| seen > bound))
}

/// Replaces a digit behind the first state.
fn forged(text: &str, random: &mut Random) -> String {
    let at = text.find("\nstate ").expect("it has states");
    let digits = text.match_indices(|of: char| of.is_ascii_digit());
    let digits: Vec<usize> = digits.map(|of| of.0).filter(|of| *of > at).collect();
    let digit = digits[random.index(digits.len())];
    let other = random.one_of(&["0", "1", "5", "9", "-1"]);
    format!("{}{other}{}", &text[..digit], &text[digit + 1..])
}

fn of_graph(found: &AnalysisResult) -> usize {
    let tests = found.bounds.iter().flatten();
    tests
        .filter(|bound| bound.test == SchedulabilityTest::Graph)
        .count()
}

/// The checker refuses a forged witness, or it proves the same.
fn check_forged(path: &Path, text: &str, expected: &[String]) {
    fs::write(path, hashed(text)).expect("the folder takes it");
    let path = path.to_string_lossy().into_owned();
    let said = String::from_utf8(output(slice::from_ref(&path)).stdout).expect("UTF-8");
    let said = lines_about(&path, &said);
    assert!(!said.is_empty(), "the checker says nothing of {text}");
    for (said, expected) in said.iter().zip(expected) {
        let is_same = said.starts_with("refused") || said.starts_with(expected);
        // A line of a bound may be hit, too.
        let is_of_graph = said.contains("graph");
        assert!(is_same || !is_of_graph, "{text}: {said} {expected}");
    }
}

#[test]
fn certified_bounds_hold_in_runs_and_before_the_checker_and_altered_texts_prove_nothing_false() {
    let mut random = Random::new(63);
    let folder = std::env::temp_dir().join(format!("certificates-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (mut files, mut expected) = (Vec::new(), Vec::new());
    let (mut by_graph, mut altered) = (0, [0; 2]);
    for number in 0..160 {
        let Some(sample) = GraphSample::new(&mut random) else {
            continue;
        };
        let mut settings = super::settings((sample.policy, Preemption::Disabled), sample.cores);
        settings.overheads.dispatch_ns = u64::from(number % 4 == 1);
        settings.overheads.ready_ns = u64::from(number % 16 == 3);
        let Ok(text) = certify(&sample.task_set, &settings) else {
            continue;
        };
        let task_set = fixed(&sample.task_set, &text);
        let found = answer(&task_set, &settings);
        by_graph += of_graph(&found);
        let other = answer(&fixed(&task_set, &forged(&text, &mut random)), &settings);
        altered[usize::from(of_graph(&other) > 0)] += 1;
        for draws in Draws::ALL {
            let seen = sample.in_virtual_time(draws, 300, &mut random);
            let is_wrong = |found| is_beyond(&seen, &task_set, found);
            assert!(!is_wrong(&found), "{number}: {sample:?} {seen:?} {found:?}");
            assert!(!is_wrong(&other), "{number}: {sample:?} {seen:?} {other:?}");
        }
        let path = folder.join(number.to_string());
        let proof = witness(&task_set, &settings);
        fs::write(&path, &proof).unwrap();
        files.push(path.to_string_lossy().into_owned());
        expected.push(lines(&task_set, &found));
        if number % 8 == 0 {
            let proof = forged(&proof, &mut random);
            check_forged(
                &folder.join("forged"),
                &proof,
                &expected[expected.len() - 1],
            );
        }
    }
    assert_says(&files, &expected);
    let count = files.len();
    println!("{count} certified, {by_graph} bounds by them; altered {altered:?}");
    assert!(count > 60 && by_graph > 100 && altered[0] > 30);
    fs::remove_dir_all(&folder).unwrap();
}

/// A step that is late by the charge sees both releases, and the urgent one goes first.
#[test]
fn a_charge_may_be_of_lateness_which_changes_the_order() {
    let urgent = |offset_ns, deadline_ns, priority| {
        let mut spec = spec(100, deadline_ns, &[10], &[], priority);
        spec.offset_ns = offset_ns;
        spec
    };
    let specs = [urgent(0, 15, 5), urgent(1, 40, 1)];
    let task_set = commit(&specs, Policy::StaticPriority, 1);
    let certified = |policy, charge_ns| {
        let mut settings = super::settings((policy, Preemption::Disabled), 1);
        settings.overheads.dispatch_ns = charge_ns;
        certify(&task_set, &settings)
    };
    assert!(certified(Policy::StaticPriority, 0).is_ok());
    let late = NotClosed::Late { dag: 0, subtask: 0 };
    assert_eq!(certified(Policy::StaticPriority, 2), Err(late));
    assert_eq!(
        certified(Policy::of_word("slack").expect("a policy"), 0),
        Err(NotClosed::NotCovered)
    );
}

/// Nasri, Brandenburg 2017, figure 1a.
#[test]
fn a_certificate_that_does_not_fit_costs_its_bounds_and_says_why() {
    let specs = [(10, 2), (30, 8), (60, 13)].map(|(period_ns, wcet_ns)| {
        let mut spec = spec(period_ns, period_ns, &[wcet_ns], &[], 0);
        spec.jobs = Some(360 / period_ns);
        spec
    });
    let task_set = commit(&specs, Policy::Edf, 2);
    let on = |cores| super::settings((Policy::Edf, Preemption::Disabled), cores);
    assert!(!answer(&task_set, &on(2)).is_proven());
    let text = certify(&task_set, &on(2)).expect("two cores suffice");
    assert!(matches!(
        certify(&task_set, &on(1)),
        Err(NotClosed::Late { .. })
    ));
    assert!(answer(&fixed(&task_set, &text), &on(2)).is_proven());
    let mut unlimited = specs.to_vec();
    unlimited.iter_mut().for_each(|spec| spec.jobs = None);
    let mut sporadic = specs.to_vec();
    sporadic[2].activation = sched_dag::Activation::Sporadic;
    let with = |specs: &[_], cores, text: &str| {
        answer(&fixed(&commit(specs, Policy::Edf, 2), text), &on(cores)).reasons[1]
    };
    let because = |fault| Some(NotProvenReason::NoCertificate(fault));
    let states: Vec<&str> = text.lines().collect();
    let cut = states[..states.len() - 1].join("\n");
    assert!(matches!(
        with(&specs, 2, &cut),
        Some(NotProvenReason::NoCertificate(NotClosed::Open { .. }))
    ));
    assert_eq!(with(&specs, 2, states[0]), because(NotClosed::NoFirst));
    assert_eq!(
        with(&specs, 2, &text.replace("state 0 ", "state 0 x ")),
        because(NotClosed::Malformed { state: 0 })
    );
    for (specs, cores) in [(&specs[..], 1), (&unlimited, 2)] {
        assert_eq!(with(specs, cores, &text), because(NotClosed::Foreign));
    }
    assert!(with(&sporadic, 2, &text).is_some());
    let long = format!("{}\n{}", states[0], [states[1]; 2_001].join("\n"));
    assert_eq!(with(&specs, 2, &long), because(NotClosed::Limit));
}
