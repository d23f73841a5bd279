//! The report for people: what came out, pictures, conditions, how to read it.
//!
//! Every number in it comes from the samples; its sentences are put together
//! from them too, so that a report of another run does not tell of this one.

use std::fmt::Write;

use super::condition::Policy;
use super::figures::{Figures, METRICS};
use super::files::{Measured, pooled};
use super::page::{self, escaped, ns};
use super::plan::{Plan, Provenance};
use super::plots::{self, PICTURES};

/// Figures of one policy and N.
type Row = (Policy, usize, Figures);

const HEADS: [&str; 10] = [
    "N",
    "joined by",
    "joins per job",
    "of one job",
    "across jobs",
    "never happened",
    "join latency, literal",
    "cover delay",
    "join to start",
    "response",
];

/// Returns the figures as a table for a terminal.
pub(super) fn table(rows: &[Row]) -> String {
    let mut text = format!(
        "{:>2} {:<22}{:>9}{:>8}{:>8}{:>9}{:>12}{:>12}{:>12}{:>12}{:>12}\n",
        "N",
        "joined by",
        "joins/job",
        "one job",
        "across",
        "missing",
        "latency",
        "p99",
        "cover",
        "p99",
        "response"
    );
    for (policy, subtasks, figures) in rows {
        let [latency, cover, _, response] = [0, 1, 2, 3].map(|metric| figures.distribution(metric));
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "{subtasks:>2} {:<22}{:>9.3}{:>8}{:>8}{:>9}{:>12}{:>12}{:>12}{:>12}{:>12}",
            policy.title(),
            figures.joins_per_job(),
            figures.same_index,
            figures.cross_index,
            figures.missing,
            ns(latency.median_ns),
            ns(latency.p99_ns),
            ns(cover.median_ns),
            ns(cover.p99_ns),
            ns(response.median_ns)
        );
    }
    text
}

/// Returns the page. `no_plots` says why there are none, if so.
pub(super) fn page(
    plan: &Plan,
    provenance: &Provenance,
    measured: &Measured,
    no_plots: Option<&str>,
) -> String {
    let rows = pooled(plan, measured);
    let mut body = String::from("<h1>Join latency: a DAG against publish and subscribe</h1>\n");
    let _ = writeln!(
        body,
        "<p class=\"lead\">One source, N parallel subtasks, one join, every 25 ms; each parallel \
         subtask executes 1 to 50 ms. {} jobs a condition, the same execution times for every \
         policy, on one bare-metal kernel with {} cores.</p>",
        plan.jobs * plan.seeds.len() as u64,
        plan.cores
    );
    body.push_str(&cards(&rows));
    body.push_str("<h2>Figures</h2>\n");
    body.push_str(&page::table(&HEADS, &table_rows(&rows)));
    body.push_str(
        "<p>Times: median / 99th percentile, over the joins that happened (cover delay and \
                   response: over the jobs that a join covers). Mean and maximum are in \
                   <code>summary.json</code>, every sample in <code>samples.csv</code>.</p>\n",
    );
    body.push_str("<h2>Pictures</h2>\n");
    match no_plots {
        Some(why) => {
            let _ = writeln!(body, "<p class=\"note\">{}</p>", escaped(why));
        }
        None => {
            for (file, title, caption) in PICTURES {
                let address = plots::data_address(&plan.out, file);
                let figure = address.map(|address| page::figure(&address, title, caption));
                body.extend(figure);
            }
        }
    }
    body.push_str(&reading());
    body.push_str(&conditions(plan, provenance, measured));
    page::html("Join latency", &body)
}

/// The first thing that one sees: a sentence for each kind of policy.
fn cards(rows: &[Row]) -> String {
    let mut text = String::from("<div class=\"cards\">\n");
    let mut policies: Vec<Policy> = Vec::new();
    for (policy, ..) in rows {
        if !policies.contains(policy) {
            policies.push(*policy);
        }
    }
    for policy in policies {
        let own: Vec<&Row> = rows.iter().filter(|(other, ..)| *other == policy).collect();
        let sum = |of: fn(&Figures) -> usize| own.iter().map(|(.., f)| of(f)).sum::<usize>();
        let (jobs, same_index) = (sum(|f| f.jobs), sum(|f| f.same_index));
        let percent = same_index as f64 * 100.0 / jobs.max(1) as f64;
        let medians = own.iter().map(|(_, subtasks, figures)| {
            format!(
                "{} at N = {subtasks}",
                ns(figures.distribution(1).median_ns)
            )
        });
        let class = if policy == Policy::Fass {
            "card dag"
        } else {
            "card"
        };
        let _ = writeln!(
            text,
            "<div class=\"{class}\">{}<b>{}</b><span>of {jobs} jobs joined with their own values; \
             {} joins across jobs, {} joins never happened. Cover delay, median: {}.</span></div>",
            escaped(policy.title()),
            percent_text(percent),
            sum(|f| f.cross_index),
            sum(|f| f.missing),
            medians.collect::<Vec<_>>().join(", ")
        );
    }
    text.push_str("</div>\n");
    text
}

/// A percentage that is 100 only if it is exactly that.
fn percent_text(percent: f64) -> String {
    if percent == 100.0 || percent == 0.0 {
        return format!("{percent:.0} %");
    }
    format!("{:.2} %", percent.clamp(0.01, 99.99))
}

fn table_rows(rows: &[Row]) -> Vec<(bool, Vec<String>)> {
    let mut last = None;
    rows.iter()
        .map(|(policy, subtasks, figures)| {
            let starts_group = last.replace(*subtasks) != Some(*subtasks);
            let times = (0..METRICS.len()).map(|metric| {
                let of = figures.distribution(metric);
                match of.count {
                    0 => "none".into(),
                    _ => format!("{} / {}", ns(of.median_ns), ns(of.p99_ns)),
                }
            });
            let mut cells = vec![
                subtasks.to_string(),
                policy.title(),
                format!("{:.3}", figures.joins_per_job()),
                figures.same_index.to_string(),
                figures.cross_index.to_string(),
                figures.missing.to_string(),
            ];
            cells.extend(times);
            (starts_group, cells)
        })
        .collect()
}

fn reading() -> String {
    let mut text = String::from("<h2>How to read it</h2>\n<ul>\n");
    for (_, title, meaning) in METRICS {
        let _ = writeln!(
            text,
            "<li><b>{}</b>: {}.</li>",
            escaped(title),
            escaped(meaning)
        );
    }
    text.push_str(
        "<li>A join that is skipped leaves no sample. A policy that joins little can look good in \
         any latency, so read each together with the joins that never happened.</li>\n\
         <li>The literal join latency compares the i-th join with job i. Each skipped join shifts \
         all later ones by a job, so it grows with the number of jobs and is no property of the \
         policy alone.</li>\n\
         <li>The load of a parallel subtask is 25.5/25: backlogs grow, under every policy. That \
         is in the response, not in the other metrics.</li>\n</ul>\n",
    );
    text
}

fn conditions(plan: &Plan, provenance: &Provenance, measured: &Measured) -> String {
    let seeds: Vec<String> = plan.seeds.iter().map(u64::to_string).collect();
    let rows = [
        ("mode", format!("{}: {}", plan.mode_name(), plan.meaning())),
        ("machine", provenance.qemu.clone()),
        (
            "cores, memory",
            format!("{} cores, {} MiB", plan.cores, plan.memory_mib),
        ),
        ("commit", provenance.commit.clone()),
        ("image", format!("checksum {}", provenance.image)),
        ("seeds", seeds.join(", ")),
        (
            "jobs",
            format!("{} for each seed, a job every 25 ms", plan.jobs),
        ),
        (
            "stamps",
            "ExactTime: the source's, passed on. ApproximateTime: anew, when a parallel subtask \
             publishes"
                .into(),
        ),
        (
            "synchronizers",
            format!(
                "as message_filters 4.3.5 (ROS 2 Humble): queue size {}, age penalty 0.1, lower \
                 bounds 0",
                plan.queue
            ),
        ),
        (
            "execution",
            "simulated: a subtask holds its core while the processor halts".into(),
        ),
        (
            "complete",
            format!("{} of {} conditions", measured.len(), plan.conditions.len()),
        ),
    ];
    let mut text = String::from("<h2>Conditions</h2>\n<dl>\n");
    for (name, value) in rows {
        let _ = writeln!(text, "<dt>{name}</dt><dd>{}</dd>", escaped(value));
    }
    text.push_str("</dl>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::percent_text;

    #[test]
    fn only_all_is_a_hundred_percent() {
        let texts = [100.0, 99.999, 0.001, 0.0].map(percent_text);
        assert_eq!(texts, ["100 %", "99.99 %", "0.01 %", "0 %"]);
    }
}
