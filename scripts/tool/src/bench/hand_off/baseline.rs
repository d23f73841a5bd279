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
use crate::json::{self, Object};

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

/// Reports whether a figure has grown since the baseline.
pub(super) fn has_grown(now: &Figure, before: &Figure) -> bool {
    let (percent, instructions) = margin(now);
    let grows = |now_is: u64, was: u64| {
        // Both for the same number of steps.
        let was = u128::from(was) * u128::from(now.per) / u128::from(before.per);
        let growth = u128::from(now_is).saturating_sub(was);
        growth > u128::from(now.per) * instructions && growth * 100 > was * percent
    };
    grows(now.median, before.median) || (now.cores == 1 && grows(now.p99, before.p99))
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
        let _ = writeln!(text, "{}{end}", figure.json(Object::new()));
    }
    text + "]}\n"
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
        let folder = std::env::temp_dir().join(format!("hand-off-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let file = folder.join("baseline.json");
        let figures = [figure([1, 2, 3]), figure([4, 5, 6])];
        write(&file, &figures).unwrap();
        let before = read(&file).unwrap();
        assert_eq!(before, figures);
        assert_eq!(missing(&[], &before).count(), 2);
        assert_eq!(missing(&figures, &before).count(), 0);
        fs::write(&file, "{}").unwrap();
        assert!(read(&file).unwrap_err().contains("holds no figures"));
        fs::remove_dir_all(folder).unwrap();
        assert!(read(&file).unwrap_err().contains("--save-baseline"));
    }
}
