//! What cores and subtasks cost: the same workloads on more and more of them.
//!
//! With counted time all cores share one clock, which each instruction of any of them
//! moves on. So a figure is the number of instructions that *all* cores have executed
//! in between, waiting for a lock included; halted cores execute none. It is work, not
//! time: what it says is how much more there is to do for each instance.

use std::fmt::Write;

use super::figure::Figure;

/// The sizes of the workloads when the cores vary.
pub(super) const SIZES: &str = "chain=64 branches=16 layered=1000";

/// The most subtasks among them.
pub(super) const LARGEST: u64 = 1000;

/// The columns: workload, figure, heading.
type Column = (&'static str, &'static str, &'static str);

const BY_CORES: &[Column] = &[
    ("chain-64", "hop", "chain-64 hop"),
    ("fork-join-16", "return_to_start", "fj-16 return->sink"),
    ("fork-join-16", "source_to_sink", "fj-16 source->sink"),
    ("layered-1000", "instance", "layered instance"),
    ("layered-1000", "locks", "locks/instance"),
    ("chain-64", "release_to_start", "release->start"),
];

const BY_SUBTASKS: &[Column] = &[
    ("layered", "instance", "instance"),
    ("layered", "release_to_start", "release->start"),
    ("layered", "locks", "locks/instance"),
    ("layered", "commit", "commit/subtask"),
];

/// The numbers of clusters, and the cores of each.
pub(super) const CLUSTERS: [u64; 5] = [1, 2, 4, 8, 16];
pub(super) const CORES_OF_A_CLUSTER: u64 = 4;

/// The subtasks of each cluster's graph; all of them have stacks at one time.
pub(super) const OF_A_CLUSTER: u64 = 100;

const BY_CLUSTERS: &[Column] = &[
    ("layered-100", "instance", "layered instance"),
    ("layered-100", "locks", "locks/instance"),
];

/// By how much an instance may cost more where there are more clusters, in per cent.
const MOST_GROWTH_PERCENT: u64 = 3;

/// Returns a table with a row for each number of clusters.
///
/// # Errors
///
/// In words: an instance costs more than it may where there are more clusters.
pub(super) fn by_clusters(rows: &[(u64, Vec<Figure>)]) -> Result<String, String> {
    let cost = |figures: &[Figure]| {
        let one = figures.iter().find(|figure| figure.figure == "instance")?;
        Some((one.median, one.per))
    };
    let alone = rows.first().and_then(|(_, figures)| cost(figures));
    for (clusters, figures) in rows {
        if let (Some((is, per)), Some((was, of))) = (cost(figures), alone)
            && u128::from(is) * u128::from(of) * 100
                > u128::from(was) * u128::from(per) * u128::from(100 + MOST_GROWTH_PERCENT)
        {
            return Err(format!(
                "an instance takes more instructions in {clusters} clusters than in one, by more \
                 than {MOST_GROWTH_PERCENT} %: {} instead of {}",
                is / per,
                was / of
            ));
        }
    }
    Ok(table("clusters", BY_CLUSTERS, rows))
}

/// Returns the sizes of the workloads for a layered graph of `subtasks` subtasks.
pub(super) fn sizes(subtasks: u64) -> String {
    format!("chain=2 branches=2 layered={subtasks}")
}

/// Returns a table with a row for each number of cores.
pub(super) fn by_cores(rows: &[(u64, Vec<Figure>)]) -> String {
    table("cores", BY_CORES, rows)
}

/// Returns a table with a row for each number of subtasks, on one core.
pub(super) fn by_subtasks(rows: &[(u64, Vec<Figure>)]) -> String {
    table("subtasks", BY_SUBTASKS, rows)
}

fn table(what: &str, columns: &[Column], rows: &[(u64, Vec<Figure>)]) -> String {
    let mut text = format!("{what:>8}");
    for (_, _, heading) in columns {
        // Writing into a `String` cannot fail.
        let _ = write!(text, "  {heading:>18}");
    }
    text.push('\n');
    for (size, figures) in rows {
        let _ = write!(text, "{size:>8}");
        let sized = format!("layered-{size}");
        for &(workload, name, _) in columns {
            let is_it = |figure: &&Figure| {
                (figure.workload == workload || (workload == "layered" && figure.workload == sized))
                    && figure.figure == name
            };
            let shown = figures.iter().find(is_it).map(|one| one.one(one.median));
            let _ = write!(text, "  {:>18}", shown.unwrap_or_default());
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{Figure, by_clusters};

    fn figures(median: u64) -> Vec<Figure> {
        let figure = Figure {
            cores: 4,
            workload: "layered-100".into(),
            figure: "instance".into(),
            per: 100,
            median,
            p99: median,
            max: median,
        };
        vec![figure]
    }

    #[test]
    fn an_instance_may_cost_a_little_more_in_more_clusters_and_no_more() {
        let rows = |last| {
            [
                (1, figures(80_000)),
                (4, figures(80_100)),
                (16, figures(last)),
            ]
        };
        let table = by_clusters(&rows(82_400)).expect("within 3 %");
        assert_eq!(table.lines().count(), 4, "{table}");
        let complaint = by_clusters(&rows(82_401)).expect_err("beyond");
        assert!(complaint.starts_with("an instance takes more instructions in 16 clusters"));
    }
}
