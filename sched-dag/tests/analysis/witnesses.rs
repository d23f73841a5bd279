//! Witnesses against the checker that shares no code with the analysis.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use sched_dag::analysis::{answer, witness};
use sched_dag::{ClusterId, Clusters, Policy, Preemption};

use crate::random::{Random, Sample, sample};
use crate::simulate::spec;
use crate::{number_from, settings};

/// How many witnesses get each of their numbers altered, of those that add something.
const ALTERED: usize = 12;

fn output(script: &str, files: &[String]) -> Output {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts");
    let mut command = Command::new("python3");
    let output = command.arg(path.join(script)).args(files).output();
    output.expect("python3 checks witnesses; install it")
}

fn run(script: &str, files: &[String]) -> String {
    let output = output(script, files);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{script} {files:?}: {said}{complaint}"
    );
    said
}

#[test]
fn every_bound_has_a_witness_and_no_altered_one_passes() {
    let folder = std::env::temp_dir().join(format!("witnesses-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let mut by_test: BTreeMap<String, u64> = BTreeMap::new();
    let mut files = Vec::new();
    let mut with_sinks = Vec::new();
    let mut to_alter = Vec::new();
    for seed in 0..=number_from("WITNESS_SETS", 1_000) {
        let mut random = Random::new(seed);
        let mut sample = match seed {
            0 => full_core(),
            _ => sample(&mut random),
        };
        let mut options = sched_dag::CommitOptions::new(sample.policy, sample.cores)
            .with_construction(sched_dag::ConstructionPolicy::any_graph());
        let is_divided = seed % 4 == 3 && sample.cores > 1;
        if is_divided {
            options = options.with_clusters(Clusters::Of(vec![1, sample.cores - 1]));
            for (spec, cluster) in sample.specs.iter_mut().zip([0, 1].into_iter().cycle()) {
                spec.cluster = Some(ClusterId(cluster));
            }
        }
        let Ok(verified) = sched_dag::verify(&sample.specs, &options) else {
            continue;
        };
        let mut settings = settings((sample.policy, sample.preemption), sample.cores);
        settings.overheads.dispatch_ns = random.within(0, 2.min(seed));
        let path = folder.join(seed.to_string());
        fs::write(&path, witness(&verified.task_set, &settings)).unwrap();
        let file = path.to_string_lossy().into_owned();
        // A job may be bounded and its sinks not, which is not the witness's affair.
        let mut subtasks = sample.specs.iter().flat_map(|dag| &dag.subtasks);
        if subtasks.any(|subtask| subtask.relative_deadline_ns.is_some()) {
            with_sinks.push(file);
            continue;
        }
        let mut is_new = false;
        for bound in answer(&verified.task_set, &settings)
            .bounds
            .iter()
            .flatten()
        {
            let count = by_test.entry(bound.test.to_string()).or_default();
            *count += 1;
            is_new |= *count <= 2;
        }
        // What is altered is one witness.
        if is_new && !is_divided && to_alter.len() < ALTERED {
            to_alter.push(file.clone());
        }
        files.push(file);
    }
    assert!(run("check-witness", &with_sinks).contains("at most"));
    let said = run("check-witness", &files);
    let proven: u64 = by_test.values().sum();
    let checked = said.lines().filter(|line| line.contains("at most")).count();
    assert_eq!(u64::try_from(checked), Ok(proven), "{said}");
    println!("{} witnesses pass; bounds: {by_test:?}", files.len());
    println!("{}", run("alter-witness", &to_alter).trim());
    assert!(by_test.len() >= 8, "some test was never used: {by_test:?}");
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_witness_that_lacks_a_cluster_is_refused() {
    let sample = full_core();
    let mut specs = sample.specs;
    for (spec, cluster) in specs.iter_mut().zip(0..) {
        spec.cluster = Some(ClusterId(cluster));
    }
    let options = sched_dag::CommitOptions::new(sample.policy, 2)
        .with_construction(sched_dag::ConstructionPolicy::any_graph())
        .with_clusters(Clusters::Of(vec![1, 1]));
    let task_set = sched_dag::verify(&specs, &options).unwrap().task_set;
    let text = witness(&task_set, &settings((sample.policy, sample.preemption), 2));
    let second = text.rfind("machine ").unwrap();
    let (first, second) = text.split_at(second);
    let path = std::env::temp_dir().join(format!("witness-{}", std::process::id()));
    let is_accepted = |parts: &[&str]| {
        fs::write(&path, parts.concat()).unwrap();
        let file = path.to_string_lossy().into_owned();
        output("check-witness", &[file]).status.success()
    };
    assert!(is_accepted(&[first, second]));
    let wrong: [&[&str]; 4] = [&[first], &[second], &[second, first], &[first, first]];
    for parts in wrong {
        assert!(!is_accepted(parts), "{parts:?}");
    }
    fs::remove_file(&path).unwrap();
}

/// Two DAGs that nearly use up one core, which only the utilisation proves.
fn full_core() -> Sample {
    let specs = [spec(6, 6, &[3], &[], 0), spec(9, 9, &[4], &[], 0)];
    Sample {
        specs: specs.to_vec(),
        policy: Policy::Edf,
        preemption: Preemption::Enabled,
        cores: 1,
    }
}
