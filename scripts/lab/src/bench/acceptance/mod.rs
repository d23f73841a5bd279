//! Acceptance by utilization: the share of random sets for which a method finds room.
//!
//! For each number of cores, for deadlines equal to periods and below them, and for each
//! utilization, the same random sets are given to all methods. No time is measured, so the results
//! are the same on every host: a table, a CSV file and a picture. Sets of a file can be counted in
//! the same way, in the form of the oracle's reference files.
//!
//! - here: points, and their output;
//! - `methods`: the methods; `sets`: how sets are drawn; `picture`: the curves.

mod melani;
mod methods;
mod picture;
mod sets;

use std::fmt::Write;
use std::ops::Range;
use std::path::Path;

use random::{Random, nth};
use sched_dag::analysis::Task;

use crate::oracle;
use crate::oracle::assignment::{self, AssignmentCase};
use methods::{HE, METHODS};
pub(super) use sets::Generator;
use sets::{Deadlines, draw};
use tool::files;
use tool::output::Table;
use tool::progress::Progress;

/// The utilizations of the points, in percent of the cores, and their distance.
const PERCENTS: Range<u64> = 20..100;
const STEP: usize = 5;

/// The number of counted sets, and of sets accepted by each method.
#[derive(Clone, Debug, PartialEq, Eq)]
struct AcceptanceCounts {
    sets: u64,
    /// In the order of the methods; the last methods may be left out.
    accepted: Vec<u64>,
}

impl AcceptanceCounts {
    /// Returns zero counts for all methods, or for all but the ceiling, which takes the most time.
    fn none(has_ceiling: bool) -> Self {
        Self {
            sets: 0,
            accepted: vec![0; METHODS.len() - usize::from(!has_ceiling)],
        }
    }

    /// Returns the names of the counted methods, a column each.
    fn columns(&self, column: impl Fn(&str) -> String) -> String {
        let counted = METHODS[..self.accepted.len()].iter();
        counted.map(|method| column(method.name)).collect()
    }

    /// Counts a set without any DAG of `D > T`.
    fn add(&mut self, tasks: &[Task], cores: u32) {
        let tasks: Vec<&Task> = tasks.iter().collect();
        self.sets += 1;
        for (count, method) in self.accepted.iter_mut().zip(METHODS) {
            *count += u64::from((method.accepts)(&tasks, cores));
        }
    }

    /// Returns the shares of the sets in percent, as cells of a table.
    fn shares(&self) -> impl Iterator<Item = String> {
        let share = |count: u64| format!("{:.1}", 100.0 * count as f64 / self.sets as f64);
        self.accepted.iter().map(move |&count| share(count))
    }
}

/// Sets of one kind.
#[derive(Debug)]
struct AcceptancePoint {
    cores: u32,
    deadlines: Deadlines,
    /// The utilization in percent of the cores.
    percent: u64,
    counts: AcceptanceCounts,
}

/// Counts sets at all points, writes `acceptance.csv` and `acceptance.svg` into a folder, and
/// returns a table.
///
/// # Errors
///
/// In words: a file cannot be written.
pub(super) fn measure(
    (generator, cores): (Generator, &[u32]),
    has_ceiling: bool,
    sets: u64,
    seed: u64,
    out: &Path,
) -> Result<String, String> {
    let mut points = points(cores, has_ceiling);
    let mut progress = Progress::new(points.len() as u64, "points");
    for (done, point) in (0..).zip(&mut points) {
        progress.show(done);
        point.count(generator, sets, seed);
    }
    progress.wipe();
    files::write(&out.join("acceptance.csv"), csv(&points))?;
    let has_he = generator == Generator::Small && cores == [4];
    let told = if has_he { &HE[..] } else { &[] };
    files::write(&out.join("acceptance.svg"), picture::draw(&points, told))?;
    Ok(table(&points))
}

/// Returns the points in the order of their cores, deadlines and utilizations, nothing counted yet.
fn points(cores: &[u32], has_ceiling: bool) -> Vec<AcceptancePoint> {
    let mut points = Vec::new();
    for &cores in cores {
        for deadlines in Deadlines::ALL {
            points.extend(PERCENTS.step_by(STEP).map(|percent| AcceptancePoint {
                cores,
                deadlines,
                percent,
                counts: AcceptanceCounts::none(has_ceiling),
            }));
        }
    }
    points
}

impl AcceptancePoint {
    /// Draws sets and counts them. The sets depend on the seed and on the kind of the point, not on
    /// other points.
    fn count(&mut self, generator: Generator, sets: u64, seed: u64) {
        let kind = u64::from(self.cores) << 16 | self.percent << 8 | self.deadlines as u64;
        let mut random = Random::new(nth(seed, kind));
        for _ in 0..sets {
            let set = draw(
                &mut random,
                generator,
                self.cores,
                self.percent,
                self.deadlines,
            );
            self.counts.add(&set, self.cores);
        }
    }

    /// Returns the kind as the first columns of the file and of the table.
    fn kind(&self) -> [String; 3] {
        let utilization = format!("{:.2}", self.percent as f64 / 100.0);
        let deadlines = self.deadlines.names().0.into();
        [self.cores.to_string(), deadlines, utilization]
    }
}

/// Returns a row for each point: numbers of sets.
fn csv(points: &[AcceptancePoint]) -> String {
    let methods = points[0].counts.columns(|name| format!(",{name}"));
    let mut text = format!("cores,deadlines,utilization,sets{methods}\n");
    for point in points {
        let AcceptanceCounts { sets, accepted } = &point.counts;
        let counts = accepted.iter().map(|count| format!(",{count}"));
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "{},{sets}{}",
            point.kind().join(","),
            counts.collect::<String>()
        );
    }
    text
}

/// Returns a row for each point: shares of the sets.
fn table(points: &[AcceptancePoint]) -> String {
    let title = "random sets accepted, in percent\n";
    let methods = points[0].counts.columns(|name| format!("|{name}:12"));
    let mut table = Table::new(title, &format!("cores:5|deadlines:13|U / m:7{methods}"));
    for point in points {
        table.cells(point.kind().into_iter().chain(point.counts.shares()));
    }
    table.text()
}

/// The sets of a file in the form of the oracle's assignments, with or without answers.
pub(super) struct SetFile {
    name: String,
    sets: Vec<AssignmentCase>,
}

impl SetFile {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// In words: the file cannot be read, or has a set not covered by the methods.
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let name = files::shown_path(path);
        if path.is_dir() || path.extension().is_some_and(|of| of == "dag") {
            let remedy = "write its sets as in tests/oracle/lent.txt";
            let other = "`./scripts/run --on host --dag` counts what a commit proves";
            return Err(format!("{name}: cases are wanted; {remedy}, or {other}"));
        }
        let sets = oracle::read([path].into_iter(), assignment::parse_sets)?;
        let is_beyond = |task: &Task| task.relative_deadline_ns() > task.period_ns();
        match sets.iter().find(|set| set.tasks.iter().any(is_beyond)) {
            None => Ok(Self { name, sets }),
            Some(set) => Err(format!(
                "{name}: case {}: a DAG has D > T, which no method here covers; leave the case out",
                set.name
            )),
        }
    }
}

/// Counts the sets of files; returns a table with a row for each file.
pub(super) fn of_files(files: &[SetFile], has_ceiling: bool) -> String {
    let none = AcceptanceCounts::none(has_ceiling);
    let columns = none.columns(|name| format!("|{name}:12"));
    let columns = format!("sets:6{columns}|  file:<6");
    let mut table = Table::new("sets accepted, in percent\n", &columns);
    for SetFile { name, sets } in files {
        let mut counts = none.clone();
        for set in sets {
            counts.add(&set.tasks, set.cores);
        }
        let shares = counts.shares().chain([format!("  {name}")]);
        table.cells([counts.sets.to_string()].into_iter().chain(shares));
    }
    table.text()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sched_dag::analysis::{AnalysisSettings, Overheads, answer, assign};
    use sched_dag::{
        AssignmentReason, CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, verify,
    };

    const LENT: usize = 4;

    /// Points of 2 and 4 cores with counts of their own, of 200 sets.
    fn counted() -> Vec<AcceptancePoint> {
        let mut points = points(&[2, 4], true);
        for (nth, point) in (0..).zip(&mut points) {
            point.counts.sets = 200;
            point.counts.accepted = vec![nth, 2 * nth, 100, 120, 200 - nth, 150, 200, 190];
        }
        points
    }

    #[test]
    fn the_file_and_the_table_hold_what_was_counted() {
        let points = counted();
        let (text, table) = (csv(&points), table(&points));
        let (lines, rows): (Vec<_>, Vec<_>) = (text.lines().collect(), table.lines().collect());
        let header = "cores,deadlines,utilization,sets,graham,multi_path,v_fed,v_fed_p,lent,table,fluid,unrefuted";
        assert_eq!(
            (lines[0], lines.len(), rows.len()),
            (header, 1 + 64, 2 + 64)
        );
        assert_eq!(lines[1], "2,implicit,0.20,200,0,0,100,120,200,150,200,190");
        assert_eq!(
            lines[1 + 17],
            "2,constrained,0.25,200,17,34,100,120,183,150,200,190"
        );
        assert_eq!(
            lines[1 + 63],
            "4,constrained,0.95,200,63,126,100,120,137,150,200,190"
        );
        let cells: Vec<&str> = rows[2 + 17].split_whitespace().collect();
        let expected = "2 constrained 0.25 8.5 17.0 50.0 60.0 91.5 75.0 100.0 95.0";
        assert_eq!(cells.join(" "), expected);
    }

    #[test]
    fn the_picture_shows_what_was_counted() {
        let picture = picture::draw(&counted(), &[]);
        for method in &METHODS {
            assert!(picture.contains(&format!(">{}</text>", method.title)));
        }
        for title in [
            "m = 2, D = T",
            "m = 2, D ≤ T",
            "m = 4, D = T",
            "m = 4, D ≤ T",
        ] {
            assert_eq!(picture.matches(&format!(">{title}</text>")).count(), 1);
        }
        // The curves of a panel begin at 20 % and end at 95 %, each at the height of its share.
        let curves: Vec<&str> = picture.lines().filter(|line| line.contains(" L")).collect();
        assert_eq!(curves.len(), 4 * METHODS.len());
        let ends = |curve: &str| {
            let path = curve.split('"').nth(1).unwrap_or_default();
            let (first, last) = (path.split_once(" L"), path.rsplit_once(" L"));
            let (first, last) = (first.unwrap().0, last.unwrap().1);
            [first, last].map(|end| {
                let (x, y) = end.trim_start_matches('M').split_once(' ').unwrap();
                [x, y].map(|pixel| pixel.parse::<u64>().unwrap())
            })
        };
        let (left, top) = picture::CORNER;
        let (width, height) = picture::FIELD;
        let right = left + 75 * width / 80;
        // The widest is drawn first: 200 and 185 of 200, then 0 and 15.
        let y = |accepted: u64| top + height - (accepted * height + 100) / 200;
        assert_eq!(ends(curves[0]), [[left, y(200)], [right, y(185)]]);
        assert_eq!(ends(curves[1]), [[left, y(0)], [right, y(15)]]);
        assert_eq!(ends(curves[3]), [[left, y(100)], [right, y(100)]]);
        // Then come the constrained ones of 2 cores, below, and those of 4 cores, on the right.
        let below = ends(curves[METHODS.len() + 6]);
        let beside = ends(curves[2 * METHODS.len() + 6]);
        assert_eq!(
            below,
            [[left, top], [right, top]].map(|[x, y]| [x, y + picture::STEP.1])
        );
        let expected = [[left, top], [right, top]].map(|[x, y]| [x + picture::STEP.0, y]);
        assert_eq!(beside, expected);
        // The told curve is the last of a panel, and as long as it is known.
        let both = picture::draw(&counted(), &HE);
        let curves: Vec<&str> = both.lines().filter(|line| line.contains(" L")).collect();
        assert_eq!(curves.len(), 4 * METHODS.len() + 4);
        let y = |share: u64| top + height - (2 * share * height + 100) / 200;
        let [from, to] = [50, 70].map(|percent| left + (percent - 20) * width / 80);
        let expected = [[from, y(98)], [to, y(22)]];
        assert_eq!(ends(curves[METHODS.len()]), expected);
    }

    #[test]
    fn a_point_depends_on_nothing_but_its_kind_and_the_seed() {
        let drawn = |cores, percent, seed| {
            let mut points = points(cores, false);
            points.retain(|point| (point.cores, point.percent) == (4, percent));
            for point in &mut points {
                point.count(Generator::Ours, 6, seed);
            }
            points
                .into_iter()
                .map(|point| point.counts)
                .collect::<Vec<_>>()
        };
        assert_eq!(drawn(&[2, 4], 80, 1), drawn(&[4], 80, 1));
        assert_ne!(drawn(&[4], 80, 1), drawn(&[4], 80, 2));
        // All methods accept a light load.
        let all = AcceptanceCounts {
            sets: 6,
            accepted: vec![6; METHODS.len() - 1],
        };
        assert_eq!(drawn(&[4], 20, 1)[0], all);
    }

    /// Returns whether a commit divides cores by lending them, and proves all DAGs.
    fn is_committed(tasks: &[Task], cores: u32) -> bool {
        let specs: Vec<DagSpec> = tasks.iter().map(methods::spec).collect();
        let policy = Policy::StaticPriority;
        let options = CommitOptions::new(policy, cores);
        let options = options.with_construction(ConstructionPolicy::any_graph());
        let settings = AnalysisSettings {
            policy,
            preemption: Preemption::Enabled,
            cores,
            overheads: Overheads::default(),
        };
        let Ok(verified) = verify(&specs, &options) else {
            // A WCET is beyond its deadline.
            return false;
        };
        let mut task_set = verified.task_set;
        let is_assigned = assign(&mut task_set, &settings).is_ok();
        let is_lent = task_set.dags().iter().all(|dag| {
            use AssignmentReason::{Member, Owner, Whole};
            matches!(
                dag.why_there(),
                Some(Whole { .. } | Owner { .. } | Member { .. })
            )
        });
        is_assigned && is_lent && answer(&task_set, &settings).is_proven()
    }

    #[test]
    fn lent_cores_accept_the_sets_that_a_commit_proves() {
        let text = include_str!("../../../../../tests/oracle/lent.txt");
        let expected = text.lines().filter(|line| line.starts_with("attempt"));
        let kinds = ["case", "dag", "wcet", "edge", "end"];
        let is_bare = |line: &&str| {
            kinds
                .iter()
                .any(|kind| line.split(' ').next() == Some(kind))
        };
        let bare: Vec<&str> = text.lines().filter(is_bare).collect();
        let sets = assignment::parse_sets(text).unwrap();
        let bare = assignment::parse_sets(&bare.join("\n")).unwrap();
        assert_eq!((sets.len(), bare.len()), (60, 60));
        for ((set, bare), expected) in sets.iter().zip(&bare).zip(expected) {
            let mut counts = AcceptanceCounts::none(false);
            counts.add(&bare.tasks, bare.cores);
            let is_accepted = expected != "attempt -";
            assert_eq!(
                counts.accepted[LENT],
                u64::from(is_accepted),
                "{}",
                set.name
            );
            assert_eq!(
                is_committed(&set.tasks, set.cores),
                is_accepted,
                "{}",
                set.name
            );
        }
    }
}
