//! Times as text, in a fitting unit.

/// Formats a time in the largest unit not above the time, with three decimals (none for ns).
pub fn shown(ns: u64) -> String {
    let units = [(1_000_000_000, "s"), (1_000_000, "ms"), (1_000, "us")];
    match units.into_iter().find(|(unit, _)| ns >= *unit) {
        None => format!("{ns} ns"),
        // `unit / 1000` scales the rest to thousandths of the unit.
        Some((unit, name)) => format!("{}.{:03} {name}", ns / unit, ns % unit / (unit / 1000)),
    }
}

/// Formats a time as [`shown`] does, without trailing zeros.
pub fn briefly(ns: u64) -> String {
    let text = shown(ns);
    match text.split_once(' ') {
        Some((number, unit)) if number.contains('.') => {
            let number = number.trim_end_matches('0').trim_end_matches('.');
            format!("{number} {unit}")
        }
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::{briefly, shown};

    #[test]
    fn times_have_a_fitting_unit() {
        let times = [999, 1_500, 2_000_000_000, 1_234_567_890];
        let expected = ["999 ns", "1.500 us", "2.000 s", "1.234 s"];
        assert_eq!(times.map(shown), expected);
        assert_eq!(times.map(briefly), ["999 ns", "1.5 us", "2 s", "1.234 s"]);
        assert_eq!(briefly(40), "40 ns");
    }
}
