//! The figures kept in the repository, their comparison with new figures, and the tables.
//!
//! A baseline holds counted instructions, which repeat exactly on one core: a difference comes from
//! a change of the code, of the compiler or of the counting. On several cores a rare interrupt may
//! come some nanoseconds later; there the margin is wider and the p99 does not count.
//! [`MARGIN_RULE`] says when a figure has *grown*.

use std::fs;
use std::iter;
use std::path::Path;

use crate::bench::frame::Figure;
use crate::golden::GoldenText;
use tool::files;
use tool::output::Table;
use tool::qemu::Mode;
use tool::system;
use views::json::{self, Object};

/// Figures kept in the repository.
pub(super) struct Baseline {
    /// The path, relative to the workspace's root.
    pub(super) file: &'static str,
    /// The command for writing the file anew.
    pub(super) saved_by: &'static str,
}

/// The rule for grown figures, in words; [`margin`] implements the rule.
const MARGIN_RULE: &str = "grown: median or p99 larger by more than 3 % and 4 \
     instructions, the jitter by 20; a commit by more than 10 %; on several cores the median \
     by more than 10 % and 40";

/// Returns the margin of a figure: in per cent, and in instructions a step. A figure has grown only
/// if it exceeds both, since one instruction of a few is many per cent.
fn margin(figure: &Figure) -> (u128, u128) {
    match &*figure.figure {
        // A single count more in each step is a change.
        _ if figure.is_count() => (3, 0),
        _ if figure.cores > 1 => (10, 40),
        "commit" => (10, 0),
        // The jitter is a difference of two times, each with a margin.
        "release_jitter" => (3, 20),
        _ => (3, 4),
    }
}

/// Reports whether a figure has grown since the baseline.
fn has_grown(now: &Figure, before: &Figure) -> bool {
    let (percent, instructions) = margin(now);
    let grows = |now_is: u64, was: u64| {
        // Scaled to the same number of steps.
        let was = u128::from(was) * u128::from(now.per) / u128::from(before.per);
        let growth = u128::from(now_is).saturating_sub(was);
        growth > u128::from(now.per) * instructions && growth * 100 > was * percent
    };
    // On several cores the p99 varies from run to run.
    grows(now.median, before.median) || (now.cores == 1 && grows(now.p99, before.p99))
}

impl Baseline {
    /// Reads the figures.
    ///
    /// # Errors
    ///
    /// In words: the file cannot be read, or holds something else.
    pub(super) fn read(&self) -> Result<Vec<Figure>, String> {
        let Self { file, saved_by } = self;
        let text = fs::read_to_string(system::workspace().join(file));
        let text = text.map_err(|error| error.to_string());
        text.and_then(|text| figures(&text))
            .map_err(|why| format!("the baseline `{file}`: {why}; `{saved_by}` writes it anew"))
    }

    /// Compares new figures with those before, if any, in a table, and keeps the new ones if
    /// `saves` says so. Reports whether no figure has grown.
    ///
    /// # Errors
    ///
    /// In words: the file cannot be written.
    pub(super) fn judge(
        &self,
        now: &[Figure],
        before: Option<&[Figure]>,
        saves: bool,
    ) -> Result<bool, String> {
        let complaints = before.map_or_else(Vec::new, |before| self.comparison(now, before));
        if saves {
            let file = system::workspace().join(self.file);
            files::write(&file, text(now))?;
            println!("written: {}", file.display());
        }
        Ok(complaints.is_empty())
    }

    /// Compares new figures with the baseline, and prints a table. If figures have grown and there is
    /// a `list` of rewritten files, rewrites the baseline.
    ///
    /// # Errors
    ///
    /// In words: there is no baseline, or the figures that have grown.
    pub(super) fn check(&self, now: &[Figure], list: Option<&Path>) -> Result<(), String> {
        let before = self.read()?;
        match (&self.comparison(now, &before)[..], list) {
            ([], _) => Ok(()),
            (complaints, None) => Err(complaints.join("; ")),
            (_, Some(_)) => {
                let (file, below, before) = (self.file, "", text(&before));
                let golden = GoldenText {
                    file,
                    below,
                    text: &before,
                };
                golden.compare(&text(now), list)
            }
        }
    }
}

fn figures(text: &str) -> Result<Vec<Figure>, String> {
    let value = json::parse(text).map_err(|error| error.to_string())?;
    let figures = value.get("figures").map_or(&[][..], |list| list.elements());
    let figures: Option<Vec<Figure>> = figures.iter().map(Figure::from_json).collect();
    let figures = figures.filter(|figures| !figures.is_empty());
    figures.ok_or_else(|| "it holds no figures".into())
}

/// Returns a baseline's text, one line for each figure.
fn text(figures: &[Figure]) -> String {
    let lines = figures.iter().map(|figure| figure.json(Object::new()));
    let lines: Vec<String> = lines.collect();
    let lines = lines.join(",\n");
    format!("{{\"counts\":\"instructions\",\"figures\":[\n{lines}\n]}}\n")
}

/// The figures, with their names for people.
const NAMES: &str = "\
reading | reading the clock
stamp | a body's stamp
return_to_ready | last return -> successor ready
ready_to_start | ready -> first instruction
return_to_start | last return -> first instruction
return_to_start_recorded | the same, if the value is recorded
recording | recording a value
hop | start -> start, per hop
source_to_sink | source start -> sink start
instance | source start -> sink start, per instance
release_to_start | release -> first instruction
release_jitter | release jitter above its minimum
commit | commit, per subtask
allocations | heap allocations, per job
locks | takings of the scheduler's lock, per instance
sink_wakeups | times the sink was made ready, per job
request_to_suspended | preemption request -> the preempted suspended
suspended_to_start | suspended -> preemptor started: switch of contexts
finish_to_resumed | preemptor finished -> the preempted resumed
preempted_to_start | preempted -> preemptor's first instruction
return_to_resumed | preemptor's return -> the preempted goes on";

/// Returns the name of a figure for people.
fn name(figure: &Figure) -> &str {
    let mut names = NAMES.lines().filter_map(|line| line.split_once(" | "));
    let named = names.find(|(of, _)| *of == figure.figure);
    named.map_or(&figure.figure, |(_, name)| name)
}

fn heading(figure: &Figure) -> String {
    match figure.cores {
        1 => figure.workload.clone(),
        cores => format!("{}, {cores} cores", figure.workload),
    }
}

/// Adds a row for each figure, below its workload.
fn add_rows(table: &mut Table, figures: &[Figure], mut cells: impl FnMut(&Figure) -> Vec<String>) {
    let mut before = String::new();
    for figure in figures {
        let heading = heading(figure);
        if heading != before {
            table.line(&heading);
            before = heading;
        }
        table.cells(iter::once(format!("  {}", name(figure))).chain(cells(figure)));
    }
}

/// Returns the table of all figures, with the modes in columns.
pub(super) fn table(measured: &[(Mode, Vec<Figure>)]) -> String {
    let mut units = format!("{:60}", "");
    let mut columns = String::from(":<60");
    for (mode, _) in measured {
        let unit = match mode {
            Mode::Deterministic => "instructions".into(),
            _ => format!("nanoseconds, {mode}"),
        };
        units += &format!("  {unit:^32}");
        columns += "|median:12|p99:11|max:11";
    }
    let mut table = Table::new(&(units + "\n"), &columns);
    let first = measured.first().map_or(&[][..], |(_, figures)| figures);
    add_rows(&mut table, first, |figure| {
        let of_mode = |(_, figures): &(Mode, Vec<Figure>)| {
            let one = figures.iter().find(|other| other.is_same(figure));
            one.map_or_else(Default::default, |one| {
                [one.median, one.p99, one.max].map(|number| one.one(number))
            })
        };
        measured.iter().flat_map(of_mode).collect()
    });
    table.text()
}

impl Baseline {
    /// Prints the table of baseline, present figures and ratios, and returns a line for each grown
    /// or missing figure.
    fn comparison(&self, now: &[Figure], baseline: &[Figure]) -> Vec<String> {
        let columns = "instructions:<60|baseline:12|now:11|ratio:8|p99 was:12|p99 is:11|:0";
        let mut table = Table::new("", columns);
        let mut complaints = Vec::new();
        add_rows(&mut table, now, |figure| {
            let [is, p99_is] = [figure.median, figure.p99].map(|number| figure.one(number));
            let Some(before) = baseline.iter().find(|before| before.is_same(figure)) else {
                let (none, mark) = (String::new, "  new: save the baseline to keep it".into());
                return vec![none(), is, none(), none(), p99_is, mark];
            };
            let [was, p99_was] = [before.median, before.p99].map(|number| before.one(number));
            let ratio = match (figure.median, before.median) {
                (0, 0) => 1.0,
                (now, was) => figure.of_step(now) / before.of_step(was),
            };
            let mut mark = String::new();
            if has_grown(figure, before) {
                mark = "  GROWN".into();
                let (place, name) = (heading(figure), name(figure));
                complaints.push(format!(
                    "{place}, {name}: {is} (p99 {p99_is}) instead of {was} ({p99_was})"
                ));
            }
            vec![was, is, format!("{ratio:.3}"), p99_was, p99_is, mark]
        });
        let is_gone = |before: &&Figure| !now.iter().any(|now| now.is_same(before));
        // A figure that vanished could hide growth, so it counts as a complaint.
        for gone in baseline.iter().filter(is_gone) {
            let line = format!("{}, {}: not measured any more", heading(gone), name(gone));
            table.line(&line);
            complaints.push(line);
        }
        let verdict = match complaints.len() {
            0 => "nothing has grown".into(),
            some => format!("{some} GROWN OR MISSING"),
        };
        table.line(&format!(
            "{verdict} ({MARGIN_RULE}; `{}` accepts it)",
            self.saved_by
        ));
        print!("{}", table.text());
        complaints
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASELINE: Baseline = Baseline {
        file: "figures.json",
        saved_by: "a command",
    };

    /// Makes a figure of median, p99 and steps.
    fn figure([median, p99, per]: [u64; 3]) -> Figure {
        Figure {
            cores: 1,
            workload: "chain-64".into(),
            figure: "hop".into(),
            per,
            median,
            p99,
            max: p99,
            ..Figure::default()
        }
    }

    #[test]
    fn a_figure_has_grown_beyond_both_margins() {
        for (cores, name, now, before, expected) in [
            (1, "hop", [1030, 1030, 1], [1000, 1000, 1], false),
            (1, "hop", [1031, 1000, 1], [1000, 1000, 1], true),
            (1, "hop", [900, 1031, 1], [1000, 1000, 1], true),
            // 40 % of 10 instructions are 4.
            (1, "hop", [14, 14, 1], [10, 10, 1], false),
            (1, "hop", [15, 15, 1], [10, 10, 1], true),
            (2, "hop", [1100, 9000, 1], [1000, 1000, 1], false),
            (2, "hop", [1101, 1000, 1], [1000, 1000, 1], true),
            // From nothing.
            (1, "hop", [50, 50, 10], [0, 0, 10], true),
            (1, "allocations", [1, 1, 200], [0, 0, 200], true),
        ] {
            let [now, before] = [now, before].map(|numbers| Figure {
                cores,
                figure: name.into(),
                ..figure(numbers)
            });
            assert_eq!(has_grown(&now, &before), expected, "{now:?}, {before:?}");
        }
    }

    #[test]
    fn a_baseline_is_read_back_and_what_it_alone_has_is_found() {
        let other = Figure {
            figure: "instance".into(),
            ..figure([4, 5, 6])
        };
        let kept = [figure([1, 2, 3]), other];
        let before = figures(&text(&kept)).unwrap();
        assert_eq!(before, kept);
        let complaints = |now: &[Figure]| BASELINE.comparison(now, &before).len();
        assert_eq!([complaints(&[]), complaints(&kept)], [2, 0]);
        assert!(figures("{}").unwrap_err().contains("holds no figures"));
    }
}
