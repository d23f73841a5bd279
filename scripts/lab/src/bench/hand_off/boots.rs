//! The measuring boots: the guest, its cores, and the reading of its figures.
//!
//! The workloads also run with growing numbers of cores and of subtasks. With counted time all
//! cores share one clock, advanced by each instruction of any core. So a figure is the number of
//! instructions executed by *all* cores in between, waiting for a lock included; halted cores
//! execute none. A figure measures work, not time: how much more there is to do for each instance.

use std::iter;
use std::path::Path;
use std::time::Duration;

use crate::bench::frame::{Figure, judged};
use tool::image;
use tool::outcome::boot;
use tool::output::Table;
use tool::qemu::{Mode, Qemu};
use views::json::Object;

/// The limit of a boot in wall time.
pub(super) const LIMIT: Duration = Duration::from_secs(300);

/// The workloads for the runs on several cores, and the most subtasks among them.
pub(super) const WORKLOADS: &str = "part=workloads chain=64 branches=16 layered=1000";
pub(super) const MOST_SUBTASKS: u64 = 1000;

/// More cores than a host is sure to have: with so many, figures of time mean nothing.
const MANY: u64 = 8;

/// The measuring guest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The app.
    Figures,
    /// A guest of the tests, recorded, for the cost of recording.
    Recorded,
    /// The same guest with divided cores.
    Divided,
}

/// One boot, and its part of the measurement.
#[derive(Clone, Debug)]
pub(super) struct HandOffBoot {
    kind: Kind,
    pub(super) cores: u64,
    memory_mib: u64,
    words: String,
}

/// Returns the boots of a complete measurement in a mode.
pub(super) fn of_mode(mode: Mode) -> Vec<HandOffBoot> {
    let all = [
        (Kind::Figures, 1, "part=hand-off"),
        (Kind::Recorded, 1, "test=values keep=1024"),
        (Kind::Figures, 2, "part=elsewhere"),
        (Kind::Figures, MANY, WORKLOADS),
        (Kind::Figures, 64, WORKLOADS),
    ];
    let is_counted = mode == Mode::Deterministic;
    let boots = all.into_iter();
    // Figures of time need a core of the host for each of the guest's.
    let boots = boots.filter(|&(_, cores, _)| is_counted || cores < MANY);
    boots
        .map(|(kind, cores, words)| HandOffBoot::new(kind, cores, MOST_SUBTASKS, words))
        .collect()
}

/// Returns the machine line for a figure.
pub(super) fn machine_line(figure: &Figure, mode: Mode) -> String {
    let begun = Object::new().text("kind", "hand_off");
    figure.json(begun.text("mode", mode.name()))
}

impl HandOffBoot {
    /// Describes a boot with DAGs of up to `subtasks` subtasks. Each subtask needs a stack, each
    /// core two, and the kernel sets a quarter of the memory aside for stacks.
    pub(super) fn new(kind: Kind, cores: u64, subtasks: u64, words: impl Into<String>) -> Self {
        Self {
            kind,
            cores,
            memory_mib: 256.max((subtasks + 2 * cores) * 3 / 10),
            words: words.into(),
        }
    }

    /// Returns the description of the guest.
    pub(super) fn qemu(&self, mode: Mode) -> Qemu {
        Qemu {
            mode,
            cores: self.cores,
            memory_mib: self.memory_mib,
            guest_words: format!("mode={mode} {}", self.words),
            // The values themselves are not wanted, only the cost of recording them.
            records: (self.kind == Kind::Recorded).then(|| "/dev/null".into()),
            ..Qemu::default()
        }
    }

    /// Boots once and reads the figures.
    pub(super) fn measure(&self, mode: Mode, image: &Path) -> Result<Vec<Figure>, String> {
        let cores = self.cores;
        let image = match self.kind {
            Kind::Figures => image.to_path_buf(),
            Kind::Recorded | Kind::Divided => image::build("guest-tests")?,
        };
        judged(
            format_args!("the guest on {cores} cores, mode {mode},"),
            "hand-off",
            |log| boot(&self.qemu(mode), &image, log, LIMIT, |_| {}),
            |outcome| match Figure::read_all(&outcome.transcript, cores)? {
                figures if figures.is_empty() => Err("it printed no figures".into()),
                figures => Ok(figures),
            },
        )
    }
}

/// The workload, figure and heading of each column.
type BootColumns = &'static [(&'static str, &'static str, &'static str)];

const BY_CORES: BootColumns = &[
    ("chain-64", "hop", "chain-64 hop"),
    ("fork-join-16", "return_to_start", "fj-16 return->sink"),
    ("fork-join-16", "source_to_sink", "fj-16 source->sink"),
    ("layered-1000", "instance", "layered instance"),
    ("layered-1000", "locks", "locks/instance"),
    ("chain-64", "release_to_start", "release->start"),
];

const BY_SUBTASKS: BootColumns = &[
    ("layered", "instance", "instance"),
    ("layered", "release_to_start", "release->start"),
    ("layered", "locks", "locks/instance"),
    ("layered", "commit", "commit/subtask"),
];

const BY_CLUSTERS: BootColumns = &[
    ("layered-100", "instance", "layered instance"),
    ("layered-100", "locks", "locks/instance"),
];

const CORES_OF_A_CLUSTER: u64 = 4;

/// The subtasks of each cluster's graph; all of them have stacks at one time.
const OF_A_CLUSTER: u64 = 100;

/// The largest growth of an instance's cost with more clusters, in per cent.
const MOST_GROWTH_PERCENT: u64 = 3;

/// Counts and prints the cost of more cores, more subtasks and more clusters.
///
/// # Errors
///
/// In words: a guest failed, or an instance costs more than allowed.
pub(super) fn measure_scale(image: &Path) -> Result<(), String> {
    let count = |sizes: &[u64], boot: &dyn Fn(u64) -> HandOffBoot| {
        let counted = sizes.iter().map(|&size| {
            let figures = boot(size).measure(Mode::Deterministic, image)?;
            for figure in &figures {
                println!("{}", machine_line(figure, Mode::Deterministic));
            }
            Ok((size, figures))
        });
        counted.collect::<Result<Vec<_>, String>>()
    };
    let by_cores = count(&[1, 2, 4, 8, 16, 32, 64], &|cores| {
        HandOffBoot::new(Kind::Figures, cores, MOST_SUBTASKS, WORKLOADS)
    })?;
    let by_subtasks = count(&[10, 100, 1000, 10_000], &|subtasks| {
        let words = format!("part=workloads chain=2 branches=2 layered={subtasks}");
        HandOffBoot::new(Kind::Figures, 1, subtasks, words)
    })?;
    let by_clusters = count(&[1, 2, 4, 8, 16], &|clusters| {
        let sizes = (0..clusters).map(|_| CORES_OF_A_CLUSTER.to_string());
        let sizes: Vec<String> = sizes.collect();
        let words = format!("test=cluster_scale jobs=200 clusters={}", sizes.join(","));
        let (cores, subtasks) = (clusters * CORES_OF_A_CLUSTER, clusters * OF_A_CLUSTER);
        HandOffBoot::new(Kind::Divided, cores, subtasks, words)
    })?;
    println!("medians of the instructions that all cores together executed:");
    print!("{}", table("cores", BY_CORES, &by_cores));
    println!("layered random graphs on one core:");
    print!("{}", table("subtasks", BY_SUBTASKS, &by_subtasks));
    println!("a layered random graph in each cluster of {CORES_OF_A_CLUSTER} cores:");
    check_clusters(&by_clusters)?;
    print!("{}", table("clusters", BY_CLUSTERS, &by_clusters));
    Ok(())
}

/// Makes sure that an instance costs hardly more with more clusters.
///
/// # Errors
///
/// In words: the cost grows too much, from which number to which.
fn check_clusters(rows: &[(u64, Vec<Figure>)]) -> Result<(), String> {
    let cost = |figures: &[Figure]| {
        let one = figures.iter().find(|figure| figure.figure == "instance")?;
        Some((one.median, one.per))
    };
    let alone = rows.first().and_then(|(_, figures)| cost(figures));
    for (clusters, figures) in rows {
        if let (Some((is, per)), Some((was, of))) = (cost(figures), alone)
            // Both medians times the other's steps, in 128 bits: exact, without a division.
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
    Ok(())
}

/// Returns a table with a row for each size; the workload `layered` stands for the graph of the
/// row's size.
fn table(what: &str, of: BootColumns, rows: &[(u64, Vec<Figure>)]) -> String {
    let of_figures = of.iter().map(|(_, _, heading)| format!("|{heading}:20"));
    let columns = format!("{what}:8") + &of_figures.collect::<String>();
    let mut table = Table::new("", &columns);
    for (size, figures) in rows {
        let sized = format!("layered-{size}");
        let median = |&(workload, name, _): &(&str, &str, _)| {
            let workload = if workload == "layered" {
                &sized
            } else {
                workload
            };
            let is_it = |one: &&Figure| one.workload == workload && one.figure == name;
            let found = figures.iter().find(is_it);
            found.map_or_else(String::new, |one| one.one(one.median))
        };
        table.cells(iter::once(size.to_string()).chain(of.iter().map(median)));
    }
    table.text()
}

#[cfg(test)]
mod tests {
    use super::{BY_CLUSTERS, Figure, check_clusters, table};

    fn figures(median: u64) -> Vec<Figure> {
        vec![Figure::new((4, "layered-100", "instance"), 100, [median])]
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
        check_clusters(&rows(82_400)).expect("within 3 %");
        let table = table("clusters", BY_CLUSTERS, &rows(82_400));
        assert_eq!(table.lines().count(), 4, "{table}");
        let complaint = check_clusters(&rows(82_401)).expect_err("beyond");
        assert!(complaint.starts_with("an instance takes more instructions in 16 clusters"));
    }
}
