//! Certificates at a commit: their bounds against runs and against the checker, and texts that somebody
//! has altered.

use std::fs;

use random::Random;
use sched_dag::analysis::{
    AnalysisResult, NotClosed, NotProvenReason, SchedulabilityTest, answer, certify, witness,
};
use sched_dag::{Policy, Preemption, TaskSet};

use super::abstraction::{Draws, GraphSample};
use super::forged::hashed;
use super::simulate::{commit, spec};
use super::witnesses::{accepted, lines, lines_about, output};

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

#[test]
fn certified_bounds_hold_in_runs_and_before_the_checker_and_no_altered_text_proves_less() {
    let mut random = Random::new(63);
    let folder = std::env::temp_dir().join(format!("certificates-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (mut files, mut expected, mut by_graph) = (Vec::new(), Vec::new(), 0);
    let mut altered = [0; 2];
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
        assert!(
            found.is_proven() || task_set.dags().iter().any(|dag| dag.in_flight() < 3),
            "{number}: {found:?}"
        );
        let tests = found.bounds.iter().flatten();
        by_graph += tests
            .filter(|bound| bound.test == SchedulabilityTest::Graph)
            .count();
        let runs = Draws::ALL.map(|draws| sample.in_virtual_time(draws, 300, &mut random));
        for seen in &runs {
            assert!(
                !is_beyond(seen, &task_set, &found),
                "{number}: {sample:?} {seen:?} {found:?}"
            );
        }
        let path = folder.join(number.to_string());
        let proof = witness(&task_set, &settings);
        fs::write(&path, &proof).unwrap();
        files.push(path.to_string_lossy().into_owned());
        expected.push(lines(&task_set, &found));
        // A number of a state more or less, in the certificate and in the witness.
        let places = ["certificate", "witness"];
        for place in &places[..1 + usize::from(number % 8 == 0)] {
            let place = *place;
            let text = if place == "witness" { &proof } else { &text };
            let at = text.find("\nstate ").expect("it has states");
            let digits: Vec<usize> = text
                .match_indices(|c: char| c.is_ascii_digit())
                .map(|of| of.0)
                .filter(|of| *of > at)
                .collect();
            let digit = digits[random.index(digits.len())];
            let other = random.one_of(&["0", "1", "5", "9", "-1"]);
            let forged = format!("{}{other}{}", &text[..digit], &text[digit + 1..]);
            if place == "certificate" {
                let found = answer(&fixed(&task_set, &forged), &settings);
                let is_wrong = runs.iter().any(|seen| is_beyond(seen, &task_set, &found));
                assert!(!is_wrong, "{number}: {sample:?} {forged}");
                altered[usize::from(
                    found
                        .bounds
                        .iter()
                        .flatten()
                        .any(|of| of.test == SchedulabilityTest::Graph),
                )] += 1;
            } else {
                let path = folder.join("forged");
                fs::write(&path, hashed(&forged)).unwrap();
                let path = path.to_string_lossy().into_owned();
                let said = String::from_utf8(output(&[path.clone()]).stdout).unwrap();
                for (said, expected) in lines_about(&path, &said)
                    .iter()
                    .zip(&expected[expected.len() - 1])
                {
                    assert!(
                        said.starts_with("refused")
                            || said.starts_with(expected)
                            || !said.contains("graph"),
                        "{number}: {said} {expected}"
                    );
                }
            }
        }
    }
    let said = accepted(&files);
    for (file, expected) in files.iter().zip(&expected) {
        let said = lines_about(file, &said);
        let agree = said.iter().zip(expected);
        let agree = agree.filter(|(said, it)| said.starts_with(*it)).count();
        assert_eq!(
            agree,
            expected.len().max(said.len()),
            "{file}: {said:?} {expected:?}"
        );
    }
    println!(
        "{} certified, {by_graph} bounds by them; altered {altered:?}",
        files.len()
    );
    assert!(
        files.len() > 60 && by_graph > 100 && altered[0] > 30,
        "{by_graph} {altered:?}"
    );
    fs::remove_dir_all(&folder).unwrap();
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
