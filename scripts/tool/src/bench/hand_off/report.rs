//! The tables for people.

use std::fmt::Write;

use super::baseline::{MARGIN_RULE, has_grown, missing};
use super::figure::Figure;
use crate::qemu::Mode;

/// A comparison as text, and what comes of it.
pub(super) struct Comparison {
    pub(super) text: String,
    /// What has grown or is missing, a line each.
    pub(super) complaints: Vec<String>,
}

/// Returns the table of all figures, with the modes side by side.
pub(super) fn table(measured: &[(Mode, Vec<Figure>)]) -> String {
    let mut text = String::new();
    let Some((_, first)) = measured.first() else {
        return text;
    };
    // Writing into a `String` cannot fail.
    let _ = write!(text, "{:60}", "");
    for (mode, _) in measured {
        let unit = match mode {
            Mode::Deterministic => "instructions".into(),
            _ => format!("nanoseconds, {mode}"),
        };
        let _ = write!(text, "  {unit:^32}");
    }
    let _ = write!(text, "\n{:60}", "");
    for _ in measured {
        let _ = write!(text, "  {:>10} {:>10} {:>10}", "median", "p99", "max");
    }
    text.push('\n');
    let mut workload = String::new();
    for figure in first {
        add_heading(&mut text, &mut workload, figure);
        let _ = write!(text, "  {:58}", figure.name());
        for (_, figures) in measured {
            let one = figures.iter().find(|other| other.is_same(figure));
            let shown = one.map_or_else(Default::default, |one| {
                [one.median, one.p99, one.max].map(|number| one.one(number))
            });
            let [median, p99, max] = shown;
            let _ = write!(text, "  {median:>10} {p99:>10} {max:>10}");
        }
        text.push('\n');
    }
    text
}

/// Returns the table of baseline, now and their ratio.
pub(super) fn comparison(now: &[Figure], baseline: &[Figure]) -> Comparison {
    let mut text = format!(
        "{:60}  {:>10} {:>10} {:>7}  {:>10} {:>10}\n",
        "instructions", "baseline", "now", "ratio", "p99 was", "p99 is"
    );
    let mut complaints = Vec::new();
    let mut workload = String::new();
    for figure in now {
        add_heading(&mut text, &mut workload, figure);
        let before = baseline.iter().find(|before| before.is_same(figure));
        let grown = before.is_some_and(|before| has_grown(figure, before));
        let mark = match before {
            None => "  new: save the baseline to keep it",
            Some(_) if grown => "  GROWN",
            Some(_) => "",
        };
        let (was, p99_was, ratio) = before.map_or_else(Default::default, |before| {
            let ratio = match (figure.median, before.median) {
                (0, 0) => 1.0,
                (now, was) => (now as f64 / figure.per as f64) / (was as f64 / before.per as f64),
            };
            (
                before.one(before.median),
                before.one(before.p99),
                format!("{ratio:.3}"),
            )
        });
        if grown {
            let place = &workload;
            let [now, p99] = [figure.median, figure.p99].map(|number| figure.one(number));
            complaints.push(format!(
                "{place}, {}: {now} (p99 {p99}) instead of {was} ({p99_was})",
                figure.name()
            ));
        }
        let _ = writeln!(
            text,
            "  {:58}  {was:>10} {:>10} {ratio:>7}  {p99_was:>10} {:>10}{mark}",
            figure.name(),
            figure.one(figure.median),
            figure.one(figure.p99),
        );
    }
    for gone in missing(now, baseline) {
        let line = format!("{}, {}: not measured any more", heading(gone), gone.name());
        let _ = writeln!(text, "{line}");
        complaints.push(line);
    }
    let verdict = match complaints.len() {
        0 => "nothing has grown".into(),
        some => format!("{some} GROWN OR MISSING"),
    };
    let _ = writeln!(
        text,
        "{verdict} ({MARGIN_RULE}; `./scripts/bench hand-off --save-baseline` accepts it)"
    );
    Comparison { text, complaints }
}

/// Adds the heading of a figure unless it is that of the one before.
fn add_heading(text: &mut String, before: &mut String, figure: &Figure) {
    let heading = heading(figure);
    if heading != *before {
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{heading}");
        *before = heading;
    }
}

fn heading(figure: &Figure) -> String {
    match figure.cores {
        1 => figure.workload.clone(),
        cores => format!("{}, {cores} cores", figure.workload),
    }
}
