//! Acceptance by utilization: the share of random sets for which a method finds room.
//!
//! For each number of cores, for deadlines equal to periods and below them, and for each
//! utilization, the same random sets are given to all methods. No time is measured, so the results
//! are the same on every host. They are a table, a CSV file and a picture. Sets of a file can be
//! counted in the same way, in the form of the oracle's reference files.
//!
//! - here: points, and what is written of them;
//! - `methods`: the methods; `sets`: how sets are drawn; `picture`: the curves.

mod methods;
mod picture;
mod sets;

use std::fmt::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::Mutex;
use std::sync::mpsc::channel;
use std::thread;

use common::random::{Random, nth};

use crate::files;
use crate::oracle::{self, assignment};
use crate::output::Table;
use crate::progress::Progress;
use methods::{METHODS, accepted};
use sets::{Deadlines, draw};

/// The utilizations of the points, in percent of the cores, and their distance.
const PERCENTS: Range<u64> = 20..100;
const STEP: usize = 5;

/// By method, how many sets it accepts.
type Counts = [u64; METHODS.len()];

/// Sets of one kind.
#[derive(Debug)]
struct Point {
    cores: u32,
    deadlines: Deadlines,
    /// The utilization in percent of the cores.
    percent: u64,
    sets: u64,
    accepted: Counts,
}

/// Counts sets at all points, writes `acceptance.csv` and `acceptance.svg` into a folder, and
/// returns a table.
///
/// # Errors
///
/// In words: a file cannot be written.
pub(super) fn measure(cores: &[u32], sets: u64, seed: u64, out: &Path) -> Result<String, String> {
    let mut points = points(cores, sets);
    count(&mut points, seed);
    files::write(&out.join("acceptance.csv"), csv(&points))?;
    files::write(&out.join("acceptance.svg"), picture::draw(&points))?;
    Ok(table(&points))
}

/// Returns the points in the order of their cores, utilizations and deadlines, nothing counted yet.
fn points(cores: &[u32], sets: u64) -> Vec<Point> {
    let kinds = PERCENTS.step_by(STEP);
    let kinds = kinds.flat_map(|percent| Deadlines::ALL.map(|deadlines| (percent, deadlines)));
    let of_cores = |&cores: &u32| {
        kinds.clone().map(move |(percent, deadlines)| Point {
            cores,
            deadlines,
            percent,
            sets,
            accepted: Counts::default(),
        })
    };
    cores.iter().flat_map(of_cores).collect()
}

/// Counts sets at each point, on all processors.
fn count(points: &mut [Point], seed: u64) {
    let mut progress = Progress::new(points.len() as u64, "points");
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let left = Mutex::new(points.iter_mut());
    let (done, each) = channel();
    thread::scope(|scope| {
        for _ in 0..threads {
            let (done, left) = (done.clone(), &left);
            let next = || left.lock().ok()?.next();
            scope.spawn(move || {
                while let Some(point) = next() {
                    point.count(seed);
                    // An error is ignored: nobody is left to be told.
                    let _ = done.send(());
                }
            });
        }
        drop(done);
        (1..).zip(each).for_each(|(over, ())| progress.show(over));
    });
    progress.wipe();
}

impl Point {
    /// Draws the sets and counts them. They depend on the seed and on the kind of the point, not on
    /// what other points there are.
    fn count(&mut self, seed: u64) {
        let kind = u64::from(self.cores) << 16 | self.percent << 8 | self.deadlines as u64;
        let mut random = Random::new(nth(seed, kind));
        for _ in 0..self.sets {
            let set = draw(&mut random, self.cores, self.percent, self.deadlines);
            // Their deadlines are at most their periods, so all methods apply.
            add(
                &mut self.accepted,
                accepted(&set, self.cores).unwrap_or_default(),
            );
        }
    }
}

fn add(counts: &mut Counts, accepted: [bool; METHODS.len()]) {
    for (count, accepted) in counts.iter_mut().zip(accepted) {
        *count += u64::from(accepted);
    }
}

/// Returns a row for each point: numbers of sets.
fn csv(points: &[Point]) -> String {
    let methods = METHODS.map(|(name, _)| name).join(",");
    let mut text = format!("cores,deadlines,utilization,sets,{methods}\n");
    for point in points {
        let (cores, deadlines, sets) = (point.cores, point.deadlines.names().0, point.sets);
        let utilization = point.percent as f64 / 100.0;
        let counts = point.accepted.map(|count| count.to_string()).join(",");
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{cores},{deadlines},{utilization:.2},{sets},{counts}");
    }
    text
}

/// Returns a row for each number of cores and utilization: shares of the sets.
fn table(points: &[Point]) -> String {
    let title = "random sets accepted, in percent: D = T on the left, D <= T on the right\n";
    let columns = format!("cores:6|U / m:7.2|{0}|{0}", columns(10));
    let mut table = Table::new(title, &columns);
    for row in points.chunks(Deadlines::ALL.len()) {
        let cells = [
            row[0].cores.to_string(),
            format!("{:.2}", row[0].percent as f64 / 100.0),
        ];
        let shares = row
            .iter()
            .flat_map(|point| shares(point.accepted, point.sets, 0));
        table.cells(cells.into_iter().chain(shares));
    }
    table.text()
}

/// Returns the columns of the methods.
fn columns(width: usize) -> String {
    METHODS.map(|(name, _)| format!("{name}:{width}")).join("|")
}

/// Returns the shares of sets in percent.
fn shares(counts: Counts, sets: u64, decimals: usize) -> [String; METHODS.len()] {
    counts.map(|count| format!("{:.decimals$}", 100.0 * count as f64 / sets.max(1) as f64))
}

/// Counts the sets of files, which are as the oracle's of assignments, with or without answers;
/// returns a table with a row for each file.
///
/// # Errors
///
/// In words: a file that cannot be read, or a set that no method is for.
pub(super) fn of_files<'f>(
    files: impl ExactSizeIterator<Item = &'f Path> + Clone,
) -> Result<String, String> {
    let mut table = Table::new(
        "sets accepted, in percent\n",
        &format!("sets:6|{}|  file:<8", columns(11)),
    );
    files::check_once(files.clone())?;
    for file in files {
        let sets = oracle::read([file].into_iter(), assignment::parse_sets)?;
        let mut counts = Counts::default();
        for set in &sets {
            let why = || {
                format!(
                    "{}: case {}: a DAG has D > T, which no method here covers",
                    files::shown_path(file),
                    set.name
                )
            };
            add(
                &mut counts,
                accepted(&set.tasks, set.cores).ok_or_else(why)?,
            );
        }
        let file = format!("  {}", files::shown_path(file));
        let cells = [sets.len().to_string()].into_iter();
        table.cells(
            cells
                .chain(shares(counts, sets.len() as u64, 1))
                .chain([file]),
        );
    }
    Ok(table.text())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENT: usize = 3;

    #[test]
    fn files_say_how_many_sets_are_accepted_at_each_point() {
        let mut points = points(&[2, 4], 3);
        assert_eq!(points.len(), 2 * 2 * 16);
        count(&mut points, 7);
        for point in &points {
            // A light load is always accepted, and no set by fewer than the whole of another one.
            let [graham, multi_path, ..] = point.accepted;
            assert!(point.accepted.iter().all(|count| *count <= 3), "{point:?}");
            assert!(graham <= multi_path, "{point:?}");
            if (point.deadlines, point.percent) == (Deadlines::Implicit, 20) {
                assert_eq!(point.accepted, [3; METHODS.len()], "{point:?}");
            }
        }
        let text = csv(&points);
        let mut lines = text.lines();
        let header = "cores,deadlines,utilization,sets,graham,multi_path,v_fed,lent,fluid";
        assert_eq!(lines.next(), Some(header));
        assert_eq!(lines.next(), Some("2,implicit,0.20,3,3,3,3,3,3"));
        assert_eq!(lines.clone().count(), points.len() - 1);
        for line in lines {
            let words: Vec<&str> = line.split(',').collect();
            assert_eq!(words.len(), header.split(',').count(), "{line}");
            assert!(["implicit", "constrained"].contains(&words[1]), "{line}");
            assert!(
                words[3..]
                    .iter()
                    .all(|word| word.parse::<u64>().is_ok_and(|of| of <= 3))
            );
        }
        // A title, a heading, and a row for both kinds of deadlines.
        let table = table(&points);
        assert_eq!(table.lines().count(), 2 + points.len() / 2);
        assert_eq!(
            table
                .lines()
                .nth(2)
                .map(|row| row.split_whitespace().count()),
            Some(12)
        );
        let picture = picture::draw(&points);
        assert_eq!(picture.matches("fill=\"none\"").count(), 4 * METHODS.len());
        for text in [
            "m = 2, D = T",
            "m = 4, D ≤ T",
            "utilization / m",
            "75 %",
            METHODS[LENT].1,
        ] {
            assert!(picture.contains(text), "{text}");
        }
    }

    #[test]
    fn a_point_depends_on_nothing_but_its_kind_and_the_seed() {
        let counts = |cores: &[u32], seed| {
            let mut points = points(cores, 2);
            points.retain(|point| (point.cores, point.percent) == (4, 80));
            count(&mut points, seed);
            csv(&points)
        };
        assert_eq!(counts(&[2, 4], 1), counts(&[4], 1));
        let drawn = |seed| draw(&mut Random::new(nth(seed, 0)), 4, 80, Deadlines::Implicit);
        assert_ne!(drawn(1)[0].wcets_ns(), drawn(2)[0].wcets_ns());
    }

    #[test]
    fn lent_cores_accept_the_sets_of_a_file_with_a_plan() {
        let text = include_str!("../../../../../tests/oracle/lent.txt");
        let expected = text.lines().filter(|line| line.starts_with("attempt"));
        let bare = text.lines().filter(|line| {
            let kinds = ["case", "dag", "wcet", "edge", "end"];
            line.split(' ')
                .next()
                .is_some_and(|kind| kinds.contains(&kind))
        });
        let bare = bare.collect::<Vec<_>>().join("\n");
        let (answered, bare) = (assignment::parse_sets(text), assignment::parse_sets(&bare));
        let (answered, bare) = (answered.unwrap(), bare.unwrap());
        assert_eq!((answered.len(), bare.len()), (60, 60));
        for ((set, bare), expected) in answered.iter().zip(&bare).zip(expected) {
            let accepts = accepted(&set.tasks, set.cores).unwrap();
            assert_eq!(accepts[LENT], expected != "attempt -", "{}", set.name);
            assert_eq!(
                accepted(&bare.tasks, bare.cores),
                Some(accepts),
                "{}",
                set.name
            );
        }
        let unfinished = assignment::parse_sets("case a 1 1\ndag 9 9 1 0\nwcet 1\nown 0 1 0 1\n");
        assert_eq!(unfinished.unwrap_err().line, 4);
    }
}
