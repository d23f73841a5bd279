//! The results of a measurement: `samples.csv` and `summary.json` for programs, a table for people.

use std::fmt::Write;

use super::condition::Condition;
use super::figures::{COUNTS, Figures, METRICS};
use super::setting::Setting;
use crate::bench::frame::Table;
use crate::json::Object;

/// The conditions measured so far, in the order of the plan.
type Measured = [(Condition, Figures)];

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

/// Returns the figures of each policy and N, seeds pooled, in the order of the plan: with its
/// first condition. What is not measured yet is left out.
fn pooled(measured: &Measured) -> impl Iterator<Item = (Condition, Figures)> {
    let of = |condition: &Condition| (condition.subtasks, condition.policy);
    let alike = measured.chunk_by(move |(one, _), (other, _)| of(one) == of(other));
    alike.map(|seeds| {
        let mut sum = Figures::default();
        seeds.iter().for_each(|(_, figures)| sum.add(figures));
        (seeds[0].0, sum)
    })
}

/// Returns the summary, a line for each policy and N.
pub(super) fn summary_json(setting: &Setting<'_>, measured: &Measured) -> String {
    let plan = setting.plan;
    let results = pooled(measured).map(|(condition, figures)| result_json(condition, &figures));
    let results = results.collect::<Vec<_>>().join(",\n");
    let summary = Object::new()
        .text("qemu", &setting.version)
        .text("commit", &setting.commit)
        .text("image", &setting.checksum)
        .text("mode", setting.mode_name())
        .text("time", setting.meaning())
        .number("cores", plan.cores)
        .number("memory_mib", plan.memory_mib)
        .number("jobs", plan.jobs)
        .number("queue", plan.queue)
        .list("seeds", &plan.seeds)
        .number("conditions", plan.conditions.len() as u64)
        .number("conditions_measured", measured.len() as u64)
        .json("results", &format!("[\n{results}\n]"));
    summary.end() + "\n"
}

fn result_json(condition: Condition, figures: &Figures) -> String {
    let mut result = Object::new()
        .text("policy", &condition.policy.to_string())
        .number("subtasks", condition.subtasks as u64);
    for (name, count) in COUNTS.iter().zip(figures.counts) {
        result = result.number(name, count as u64);
    }
    result = result.json("joins_per_job", &format!("{:.4}", figures.joins_per_job()));
    for (position, metric) in METRICS.iter().enumerate() {
        let of = figures.distribution(position);
        let distribution = Object::new()
            .number("count", of.count())
            .number("median", of.median())
            .json("mean", &figures.mean_ns(position).to_string())
            .number("p99", of.p99())
            .number("max", of.max());
        result = result.json(&format!("{metric}_ns"), &distribution.end());
    }
    result.end()
}

/// Returns the figures of each policy and N as a table.
pub(super) fn table(measured: &Measured) -> String {
    let columns = [
        ("N", 2, 0),
        (" joined by", -23, 0),
        ("joins/job", 9, 3),
        ("one job", 8, 0),
        ("across", 8, 0),
        ("missing", 9, 0),
        ("latency", 12, 0),
        ("p99", 12, 0),
        ("cover", 12, 0),
        ("p99", 12, 0),
        ("response", 12, 0),
    ];
    let mut table = Table::new("", &columns);
    for (condition, figures) in pooled(measured) {
        let [latency, cover, _, response] = [0, 1, 2, 3].map(|metric| figures.distribution(metric));
        let [_, _, same_index, cross_index, missing, _] = figures.counts;
        table.row(&[
            &condition.subtasks,
            &format!(" {}", condition.policy.title()),
            &figures.joins_per_job(),
            &same_index,
            &cross_index,
            &missing,
            &ns(latency.median()),
            &ns(latency.p99()),
            &ns(cover.median()),
            &ns(cover.p99()),
            &ns(response.median()),
        ]);
    }
    table.text()
}

/// Returns nanoseconds as people read them.
fn ns(ns: u64) -> String {
    let value = ns as f64;
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => format!("{:.2} µs", value / 1e3),
        1_000_000..1_000_000_000 => format!("{:.2} ms", value / 1e6),
        _ => format!("{:.2} s", value / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::ns;

    #[test]
    fn times_have_a_fitting_unit() {
        let texts = [614, 1_874, 36_500_000, 22_644_000_000].map(ns);
        assert_eq!(texts, ["614 ns", "1.87 µs", "36.50 ms", "22.64 s"]);
    }
}
