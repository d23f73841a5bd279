//! The files that programs read: `samples.csv` and `summary.json`.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use super::condition::{Condition, Policy};
use super::figures::{Figures, METRICS};
use super::plan::{Plan, Provenance};
use crate::json::quoted;

/// What has been measured so far, in the order of the plan.
pub(super) type Measured = Vec<(Condition, Figures)>;

/// Writes a file whole or not at all: an interruption leaves the old one.
pub(super) fn write_whole(path: &Path, text: &str) -> Result<(), String> {
    let fail = |error| format!("cannot write `{}`: {error}", path.display());
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(fail)?;
    }
    let unfinished = path.with_extension("unfinished");
    fs::write(&unfinished, text).map_err(fail)?;
    fs::rename(&unfinished, path).map_err(fail)
}

/// Returns each sample of each metric as a line.
pub(super) fn samples_csv(measured: &Measured) -> String {
    let mut text = String::from("policy,subtasks,seed,metric,index,value_ns\n");
    for (condition, figures) in measured {
        let (policy, subtasks, seed) = (condition.policy, condition.subtasks, condition.seed);
        for (metric, samples) in METRICS.iter().zip(&figures.samples) {
            for (index, value_ns) in samples {
                // Writing into a `String` cannot fail.
                let _ = writeln!(
                    text,
                    "{policy},{subtasks},{seed},{metric},{index},{value_ns}"
                );
            }
        }
    }
    text
}

/// Returns the figures of each policy and N, seeds pooled, in the order of the plan:
/// for each N all policies. What is not measured yet is left out.
pub(super) fn pooled(plan: &Plan, measured: &Measured) -> Vec<(Policy, usize, Figures)> {
    let mut all = Vec::new();
    for &subtasks in &plan.subtasks {
        for &policy in &plan.policies {
            let is_it = |condition: &Condition| {
                (condition.policy, condition.subtasks) == (policy, subtasks)
            };
            let of_it = measured.iter().filter(|(condition, _)| is_it(condition));
            let figures = of_it.map(|(_, figures)| figures.clone());
            let sum = figures.reduce(|mut sum, figures| {
                sum.add(figures);
                sum
            });
            all.extend(sum.map(|figures| (policy, subtasks, figures)));
        }
    }
    all
}

/// Returns the summary.
pub(super) fn summary_json(plan: &Plan, provenance: &Provenance, measured: &Measured) -> String {
    let seeds: Vec<String> = plan.seeds.iter().map(u64::to_string).collect();
    let mut text = String::from("{\n");
    // Writing into a `String` cannot fail.
    let _ = writeln!(text, "  \"qemu\": {},", quoted(&provenance.qemu));
    let _ = writeln!(text, "  \"commit\": {},", quoted(&provenance.commit));
    let _ = writeln!(text, "  \"image\": {},", quoted(&provenance.image));
    let _ = writeln!(text, "  \"mode\": {},", quoted(plan.mode_name()));
    let _ = writeln!(text, "  \"time\": {},", quoted(plan.meaning()));
    let _ = writeln!(text, "  \"cores\": {},", plan.cores);
    let _ = writeln!(text, "  \"memory_mib\": {},", plan.memory_mib);
    let _ = writeln!(text, "  \"jobs\": {},", plan.jobs);
    let _ = writeln!(text, "  \"queue\": {},", plan.queue);
    let _ = writeln!(text, "  \"seeds\": [{}],", seeds.join(", "));
    let _ = writeln!(text, "  \"conditions\": {},", plan.conditions.len());
    let _ = writeln!(text, "  \"conditions_measured\": {},", measured.len());
    let results: Vec<String> = pooled(plan, measured)
        .iter()
        .map(|(policy, subtasks, figures)| result_json(*policy, *subtasks, figures))
        .collect();
    let _ = write!(text, "  \"results\": [\n{}\n  ]\n}}\n", results.join(",\n"));
    text
}

fn result_json(policy: Policy, subtasks: usize, figures: &Figures) -> String {
    let mut text = format!("    {{\"policy\": \"{policy}\", \"subtasks\": {subtasks}");
    let counts = [
        ("jobs", figures.jobs),
        ("joins", figures.joins),
        ("same_index", figures.same_index),
        ("cross_index", figures.cross_index),
        ("missing", figures.missing),
        ("uncovered", figures.uncovered),
    ];
    for (name, count) in counts {
        let _ = write!(text, ", \"{name}\": {count}");
    }
    let _ = write!(text, ", \"joins_per_job\": {:.4}", figures.joins_per_job());
    for (position, metric) in METRICS.iter().enumerate() {
        let of = figures.distribution(position);
        let _ = write!(
            text,
            ",\n      \"{metric}_ns\": {{\"count\": {}, \"median\": {}, \"mean\": {}, \"p99\": {}, \
             \"max\": {}}}",
            of.count(),
            of.median(),
            figures.mean_ns(position),
            of.p99(),
            of.max()
        );
    }
    text.push('}');
    text
}
