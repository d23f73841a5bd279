//! From a condition's raw times to metrics, and from samples to figures and files.
//!
//! The file of a condition begins with a comment that states everything the times depend on. A file
//! with a different first line is another condition's, and is measured anew.
//!
//! *Publication* i of a topic is the publication of job i. The *last publication* of i is the time
//! when all parallel subtasks have published i. `docs/paper.md` explains the metrics, and which of
//! them can be compared.

use std::collections::BTreeMap;
use std::fmt::Write;

use join_latency::{CompletedJoin, ExecutionSpan, RunSamples};
use sched_dag::law::Distribution;

use super::{JoinCondition, JoinSetup};
use tool::output::Table;
use views::json::{Object, Value};
use views::protocol::Transcript;
use views::units::shown;

/// The columns. `subtask` 0 is the source, 1 to N are the parallel ones, N + 1 is the join.
const COLUMNS: &str = "what,subtask,index,ready_ns,start_ns,finish_ns,joined_indices";

/// Returns the times printed by a guest, as CSV under a first line `# {statement}`.
///
/// # Errors
///
/// In words: a line is malformed, or the number of jobs is wrong.
pub(super) fn write(
    transcript: &Transcript,
    statement: &str,
    subtasks: usize,
    jobs: u64,
) -> Result<String, String> {
    let sink = subtasks as u64 + 1;
    let mut text = format!("# {statement}\n{COLUMNS}\n");
    let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
    let lines = transcript.machine.iter();
    for line in lines.filter(|line| ["executions", "joins"].contains(&&*line.kind)) {
        let number = line.number;
        let damaged = || format!("serial line {number} has no times as it should");
        let subtask = match &*line.kind {
            "joins" => sink,
            _ => line.number_at("subtask").ok_or_else(damaged)?,
        };
        let index = counts.entry(subtask).or_default();
        // Batches are numbered, so a lost line does not go unnoticed.
        if line.number_at("first") != Some(*index) {
            return Err(format!("a batch before serial line {number} is missing"));
        }
        for times in line.value.get("times").ok_or_else(damaged)?.elements() {
            let numbers = times.elements().iter().filter_map(Value::as_u64);
            // Writing into a `String` cannot fail.
            let _ = match numbers.collect::<Vec<_>>()[..] {
                [start_ns, finish_ns] if subtask < sink => {
                    writeln!(text, "execution,{subtask},{index},,{start_ns},{finish_ns},")
                }
                [ready_ns, start_ns, finish_ns, ref joined @ ..] if joined.len() == subtasks => {
                    let joined: Vec<String> = joined.iter().map(u64::to_string).collect();
                    let joined = joined.join(" ");
                    writeln!(
                        text,
                        "join,{sink},{index},{ready_ns},{start_ns},{finish_ns},{joined}"
                    )
                }
                _ => return Err(damaged()),
            };
            *index += 1;
        }
    }
    match counts.get(&0).copied().unwrap_or_default() {
        all if all == jobs => Ok(text),
        some => Err(format!("the guest printed {some} of {jobs} jobs")),
    }
}

/// Reads the output of [`write()`]; `None` if the statement differs or anything is damaged.
pub(super) fn read(text: &str, statement: &str, subtasks: usize) -> Option<RunSamples> {
    let mut lines = text.lines();
    let is_its_own = lines.next()?.strip_prefix("# ")? == statement && lines.next()? == COLUMNS;
    // Without its last line end the file was cut off.
    if !is_its_own || !text.ends_with('\n') {
        return None;
    }
    let mut samples = RunSamples {
        parallel: vec![Vec::new(); subtasks],
        ..RunSamples::default()
    };
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let [what, subtask, _, ready_ns, start_ns, finish_ns, joined] = cells[..] else {
            return None;
        };
        let span = ExecutionSpan {
            start_ns: start_ns.parse().ok()?,
            finish_ns: finish_ns.parse().ok()?,
        };
        if what == "join" {
            let joined = joined.split(' ').map(|index| index.parse().ok());
            samples
                .indices
                .extend(joined.collect::<Option<Vec<u64>>>()?);
            let ready_ns = ready_ns.parse().ok()?;
            samples.joins.push(CompletedJoin { ready_ns, span });
        } else {
            match subtask.parse::<usize>().ok()? {
                0 => samples.source.push(span),
                parallel => samples.parallel.get_mut(parallel - 1)?.push(span),
            }
        }
    }
    Some(samples)
}

/// The time between two releases, in nanoseconds.
pub(super) const PERIOD_NS: u64 = 25_000_000;

/// The names of the metrics.
pub(super) const METRICS: [&str; 4] = ["join_latency", "cover_delay", "join_to_start", "response"];

/// The names of the counts: jobs released; joins that happened; joins of values of one job and of
/// several; missing joins (fewer than jobs); jobs covered by no join.
pub(super) const COUNTS: [&str; 6] = [
    "jobs",
    "joins",
    "same_index",
    "cross_index",
    "missing",
    "uncovered",
];

/// The figures of one condition, or of several of one kind.
#[derive(Clone, Debug, Default)]
pub(super) struct ConditionFigures {
    /// In the order of [`COUNTS`].
    pub(super) counts: [usize; COUNTS.len()],
    /// The samples of each metric, as (index, nanoseconds), in the order of
    /// [`METRICS`].
    pub(super) samples: [Vec<(usize, u64)>; METRICS.len()],
}

impl ConditionFigures {
    /// Computes the figures of one condition.
    pub(super) fn of(samples: &RunSamples) -> Self {
        let covering = samples.covering_joins();
        let published = |join: usize| {
            let topics = samples.parallel.iter().zip(samples.indices_of(join));
            topics
                .filter_map(|(spans, &index)| spans.get(usize::try_from(index).ok()?))
                .map(|span| span.finish_ns)
                .max()
        };
        let all = samples.joins.iter().enumerate();
        let join_to_start = all.filter_map(|(join, joined)| {
            Some((join, joined.span.start_ns.saturating_sub(published(join)?)))
        });
        let response = covering.iter().enumerate().map(|(job, &join)| {
            let finish_ns = samples.joins[join].span.finish_ns;
            // The nominal release of a job is its number times the period.
            (job, finish_ns.saturating_sub(job as u64 * PERIOD_NS))
        });
        let numbered = |values_ns: Vec<u64>| values_ns.into_iter().enumerate().collect();
        let jobs = samples.source.len();
        let [joins, same_index, cross_index, missing] = samples.counts();
        Self {
            counts: [
                jobs,
                joins,
                same_index,
                cross_index,
                missing,
                jobs - covering.len(),
            ],
            samples: [
                numbered(samples.join_latencies_ns()),
                numbered(samples.cover_delays_ns()),
                join_to_start.collect(),
                response.collect(),
            ],
        }
    }

    /// Adds the figures of another condition of the same kind.
    pub(super) fn add(&mut self, other: &Self) {
        for (own, others) in self.counts.iter_mut().zip(other.counts) {
            *own += others;
        }
        for (own, others) in self.samples.iter_mut().zip(&other.samples) {
            own.extend(others);
        }
    }

    /// Returns the distribution of a metric, by nearest rank like the guest's own.
    pub(super) fn distribution(&self, metric: usize) -> Distribution {
        let samples = self.samples[metric].iter();
        Distribution::new(samples.map(|(_, ns)| *ns))
    }

    /// Returns the mean of a metric in nanoseconds, rounded down; 0 without samples.
    pub(super) fn mean_ns(&self, metric: usize) -> u128 {
        let samples = &self.samples[metric];
        let sum: u128 = samples.iter().map(|(_, ns)| u128::from(*ns)).sum();
        sum / samples.len().max(1) as u128
    }

    /// Returns the joins per job.
    pub(super) fn joins_per_job(&self) -> f64 {
        let [jobs, joins, ..] = self.counts;
        joins as f64 / jobs.max(1) as f64
    }
}

/// The conditions measured so far, in the order of the plan.
type MeasuredConditions = [(JoinCondition, ConditionFigures)];

/// Returns each sample of each metric as a line of a table.
pub(super) fn samples_csv(measured: &MeasuredConditions) -> String {
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

/// Returns the pooled figures of all seeds for each policy and N, in the order of the plan, each
/// with its first condition. Conditions not measured yet are left out.
fn pooled(
    measured: &MeasuredConditions,
) -> impl Iterator<Item = (JoinCondition, ConditionFigures)> {
    let of = |condition: &JoinCondition| (condition.subtasks, condition.policy);
    let alike = measured.chunk_by(move |(one, _), (other, _)| of(one) == of(other));
    alike.map(|seeds| {
        let mut sum = ConditionFigures::default();
        seeds.iter().for_each(|(_, figures)| sum.add(figures));
        (seeds[0].0, sum)
    })
}

/// Returns the summary, with a line for each policy and N.
pub(super) fn summary_json(setting: &JoinSetup<'_>, measured: &MeasuredConditions) -> String {
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
    summary.into_text() + "\n"
}

fn result_json(condition: JoinCondition, figures: &ConditionFigures) -> String {
    let result = Object::new().text("policy", &condition.policy.to_string());
    let mut result = result.number("subtasks", condition.subtasks as u64);
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
        result = result.json(&format!("{metric}_ns"), &distribution.into_text());
    }
    result.into_text()
}

/// Returns the table of the figures for each policy and N.
pub(super) fn table(measured: &MeasuredConditions) -> String {
    let columns = "N:2| joined by:<23|joins/job:9.3|one job:8|across:8|missing:9|\
                       latency:12|p99:12|cover:12|p99:12|start:12|response:12";
    let mut table = Table::new("", columns);
    for (condition, figures) in pooled(measured) {
        let [latency, cover, start, response] =
            [0, 1, 2, 3].map(|metric| figures.distribution(metric));
        let [_, _, same_index, cross_index, missing, _] = figures.counts;
        table.row(&[
            &condition.subtasks,
            &format!(" {}", condition.policy.title()),
            &figures.joins_per_job(),
            &same_index,
            &cross_index,
            &missing,
            &shown(latency.median()),
            &shown(latency.p99()),
            &shown(cover.median()),
            &shown(cover.p99()),
            &shown(start.median()),
            &shown(response.median()),
        ]);
    }
    table.text()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "\
{\"kind\":\"executions\",\"subtask\":0,\"first\":0,\"times\":[[0,1],[25,26]]}
{\"kind\":\"executions\",\"subtask\":1,\"first\":0,\"times\":[[2,9]]}
{\"kind\":\"executions\",\"subtask\":1,\"first\":1,\"times\":[[27,40]]}
{\"kind\":\"executions\",\"subtask\":2,\"first\":0,\"times\":[[3,8],[28,30]]}
{\"kind\":\"joins\",\"first\":0,\"times\":[[10,11,12,0,0],[41,42,43,1,1]]}
";

    #[test]
    fn times_survive_the_way_through_the_file() {
        let text = write(&Transcript::read(LOG), "jobs=2", 2, 2).unwrap();
        let samples = read(&text, "jobs=2", 2).unwrap();
        assert_eq!(samples.source[1].start_ns, 25);
        assert_eq!(samples.parallel[0][1].finish_ns, 40);
        assert_eq!(samples.joins[1].ready_ns, 41);
        assert_eq!(samples.indices, [0, 0, 1, 1]);
        assert_eq!(read(&text, "jobs=3", 2), None);
        let cut = &text[..text.len() - 4];
        assert_eq!(read(cut, "jobs=2", 2), None, "a cut file is not taken");
    }

    #[test]
    fn a_missing_batch_or_job_is_noticed() {
        let without: String = LOG.lines().filter(|line| !line.contains("[2,9]")).collect();
        let without = without.replace("}{", "}\n{");
        let message = write(&Transcript::read(&without), "", 2, 2).unwrap_err();
        assert_eq!(message, "a batch before serial line 2 is missing");
        let message = write(&Transcript::read(LOG), "", 2, 3).unwrap_err();
        assert_eq!(message, "the guest printed 2 of 3 jobs");
        let message = write(&Transcript::read(LOG), "", 3, 2).unwrap_err();
        assert_eq!(message, "serial line 5 has no times as it should");
    }

    /// Two parallel subtasks, three jobs; the only join has jobs 1 and 2.
    fn samples() -> RunSamples {
        let [first, second, third] = [0, PERIOD_NS + 10, 2 * PERIOD_NS + 10];
        let span = |start_ns, finish_ns| ExecutionSpan {
            start_ns,
            finish_ns,
        };
        let taking = |ns| [1, second, third].map(|start_ns| span(start_ns, start_ns + ns));
        RunSamples {
            source: [first, PERIOD_NS, third].map(|ns| span(ns, ns + 1)).into(),
            parallel: vec![taking(5).into(), taking(9).into()],
            joins: vec![CompletedJoin {
                ready_ns: third + 20,
                span: span(third + 21, third + 30),
            }],
            indices: vec![1, 2],
            lost_inputs: 0,
        }
    }

    #[test]
    fn metrics_are_what_they_are_defined_to_be_and_pooled() {
        let figures = ConditionFigures::of(&samples());
        assert_eq!(figures.counts, [3, 1, 0, 1, 2, 1]);
        let third = 2 * PERIOD_NS + 10;
        let expected = [
            vec![(0, third + 20 - 10)],
            vec![(0, third + 20 - 10), (1, third + 20 - (PERIOD_NS + 19))],
            vec![(0, 21 - 9)],
            vec![(0, third + 30), (1, third + 30 - PERIOD_NS)],
        ];
        assert_eq!(figures.samples, expected);
        let mut both = figures.clone();
        both.add(&figures);
        assert_eq!(both.counts, [6, 2, 0, 2, 4, 2]);
        assert_eq!((both.distribution(1).count(), both.mean_ns(2)), (4, 12));
    }
}
