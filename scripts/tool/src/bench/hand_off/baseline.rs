//! The figures that the repository keeps, and how new ones stand to them.
//!
//! A baseline holds counted instructions, which repeat exactly on one core: one that
//! differs comes from a change of the code, of the compiler or of QEMU. On several cores
//! a rare interrupt comes some nanoseconds later, so there the margin is wider and the
//! p99 does not count. [`MARGIN_RULE`] says when a figure has *grown*.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use super::figure::Figure;
use crate::json;

/// When a figure has grown, in words; [`margin`] says the same.
pub(super) const MARGIN_RULE: &str = "grown: median or p99 larger by more than 3 % and 4 \
     instructions, the jitter by 20; a commit by more than 10 %; on several cores the median \
     by more than 10 % and 40";

/// Returns by how much a figure may be larger: in per cent, and in any case in
/// instructions a step, since one of a few instructions is many per cent.
fn margin(figure: &Figure) -> (u128, u128) {
    match &*figure.figure {
        // One more in each step is a change.
        _ if figure.is_count() => (3, 0),
        _ if figure.cores > 1 => (10, 40),
        "commit" => (10, 0),
        // A difference of two times that have margins of their own.
        "release_jitter" => (3, 20),
        _ => (3, 4),
    }
}

fn has_grown(now: &Figure, before: &Figure) -> bool {
    let (percent, instructions) = margin(now);
    let grows = |now_is: u64, was: u64| {
        // Both for the same number of steps.
        let was = u128::from(was) * u128::from(now.per) / u128::from(before.per);
        let growth = u128::from(now_is).saturating_sub(was);
        growth > u128::from(now.per) * instructions && growth * 100 > was * percent
    };
    grows(now.median, before.median) || (now.cores == 1 && grows(now.p99, before.p99))
}

/// How a figure stands to its baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// There is none to compare with.
    New,
    /// As good as it was, or better.
    Kept,
    /// Worse by more than the margin.
    Grown,
}

/// Reads a baseline.
///
/// # Errors
///
/// In words: the file cannot be read, or holds something else.
pub(super) fn read(file: &Path) -> Result<Vec<Figure>, String> {
    let place = file.display();
    let again = "`./scripts/bench hand-off --save-baseline` writes it anew";
    let text = fs::read_to_string(file)
        .map_err(|error| format!("the baseline `{place}`: {error}; {again}"))?;
    let value =
        json::parse(&text).map_err(|error| format!("the baseline `{place}`: {error}; {again}"))?;
    let figures = value.get("figures").map_or(&[][..], |list| list.elements());
    let figures: Option<Vec<Figure>> = figures.iter().map(Figure::from_json).collect();
    figures
        .filter(|figures| !figures.is_empty())
        .ok_or_else(|| format!("the baseline `{place}` holds no figures; {again}"))
}

/// Writes a baseline.
///
/// # Errors
///
/// In words: the file cannot be written.
pub(super) fn write(file: &Path, figures: &[Figure]) -> Result<(), String> {
    let failed = |error| format!("cannot write the baseline `{}`: {error}", file.display());
    fs::write(file, text(figures)).map_err(failed)
}

/// Returns a baseline's text, a line a figure.
pub(super) fn text(figures: &[Figure]) -> String {
    let mut text = String::from("{\"counts\":\"instructions\",\"figures\":[\n");
    for (number, figure) in figures.iter().enumerate() {
        let end = if number + 1 < figures.len() { "," } else { "" };
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{{{}}}{end}", figure.json_members());
    }
    text + "]}\n"
}

/// Compares a figure with that of the baseline.
pub(super) fn standing(now: &Figure, baseline: &[Figure]) -> (Option<Figure>, Standing) {
    let Some(before) = baseline.iter().find(|before| before.is_same(now)) else {
        return (None, Standing::New);
    };
    let standing = if has_grown(now, before) {
        Standing::Grown
    } else {
        Standing::Kept
    };
    (Some(before.clone()), standing)
}

/// Returns the figures of a baseline that were not measured now.
pub(super) fn missing<'a>(
    now: &'a [Figure],
    baseline: &'a [Figure],
) -> impl Iterator<Item = &'a Figure> {
    let is_missing = |before: &&Figure| !now.iter().any(|now| now.is_same(before));
    baseline.iter().filter(is_missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(median: u64, p99: u64, per: u64) -> Figure {
        Figure {
            cores: 1,
            workload: "chain-64".into(),
            figure: "hop".into(),
            per,
            median,
            p99,
            max: p99,
        }
    }

    fn on(cores: u64, figure: Figure) -> Figure {
        Figure { cores, ..figure }
    }

    fn stands(now: &Figure, before: Figure) -> Standing {
        standing(now, &[before]).1
    }

    #[test]
    fn a_figure_has_grown_beyond_both_margins() {
        let before = || figure(1000, 1000, 1);
        assert_eq!(stands(&figure(1030, 1030, 1), before()), Standing::Kept);
        assert_eq!(stands(&figure(1031, 1000, 1), before()), Standing::Grown);
        assert_eq!(stands(&figure(900, 1031, 1), before()), Standing::Grown);
        // 40 % of 10 instructions are 4.
        assert_eq!(
            stands(&figure(14, 14, 1), figure(10, 10, 1)),
            Standing::Kept
        );
        assert_eq!(
            stands(&figure(15, 15, 1), figure(10, 10, 1)),
            Standing::Grown
        );
        let two = |median, p99| on(2, figure(median, p99, 1));
        assert_eq!(stands(&two(1100, 9000), two(1000, 1000)), Standing::Kept);
        assert_eq!(stands(&two(1101, 1000), two(1000, 1000)), Standing::Grown);
        // From nothing: an allocation in every job of ten.
        assert_eq!(
            stands(&figure(50, 50, 10), figure(0, 0, 10)),
            Standing::Grown
        );
        let allocations = |count| Figure {
            figure: "allocations".into(),
            ..figure(count, count, 200)
        };
        assert_eq!(stands(&allocations(1), allocations(0)), Standing::Grown);
        assert_eq!(standing(&figure(1, 1, 1), &[]).1, Standing::New);
    }

    #[test]
    fn a_baseline_is_read_back() {
        let folder = std::env::temp_dir().join(format!("hand-off-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let file = folder.join("baseline.json");
        let figures = [figure(1, 2, 3), figure(4, 5, 6)];
        write(&file, &figures).unwrap();
        assert_eq!(read(&file).unwrap(), figures);
        fs::write(&file, "{}").unwrap();
        assert!(read(&file).unwrap_err().contains("holds no figures"));
        fs::remove_dir_all(folder).unwrap();
        assert!(read(&file).unwrap_err().contains("--save-baseline"));
    }

    #[test]
    fn a_figure_that_is_no_longer_measured_is_found() {
        let before = [figure(1, 1, 1)];
        assert_eq!(missing(&[], &before).count(), 1);
        assert_eq!(missing(&before, &before).count(), 0);
    }
}
