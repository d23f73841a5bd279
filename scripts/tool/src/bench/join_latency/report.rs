//! The table that is printed when all conditions are measured.

use std::fmt::Write;

use super::condition::Policy;
use super::figures::Figures;

/// Returns the figures of each policy and N as a table.
pub(super) fn table(rows: &[(Policy, usize, Figures)]) -> String {
    let mut text = format!(
        "{:>2} {:<22}{:>9}{:>8}{:>8}{:>9}{:>12}{:>12}{:>12}{:>12}{:>12}\n",
        "N",
        "joined by",
        "joins/job",
        "one job",
        "across",
        "missing",
        "latency",
        "p99",
        "cover",
        "p99",
        "response"
    );
    for (policy, subtasks, figures) in rows {
        let [latency, cover, _, response] = [0, 1, 2, 3].map(|metric| figures.distribution(metric));
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "{subtasks:>2} {:<22}{:>9.3}{:>8}{:>8}{:>9}{:>12}{:>12}{:>12}{:>12}{:>12}",
            policy.title(),
            figures.joins_per_job(),
            figures.same_index,
            figures.cross_index,
            figures.missing,
            ns(latency.median()),
            ns(latency.p99()),
            ns(cover.median()),
            ns(cover.p99()),
            ns(response.median())
        );
    }
    text
}

/// Returns nanoseconds as people read them.
fn ns(ns: u64) -> String {
    let value = ns as f64;
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => format!("{:.2} µs", value / 1e3),
        1_000_000..1_000_000_000 => format!("{:.2} ms", value / 1e6),
        _ => format!("{:.2} s", value / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::ns;

    #[test]
    fn times_have_a_fitting_unit() {
        let texts = [614, 1_874, 36_500_000, 22_644_000_000].map(ns);
        assert_eq!(texts, ["614 ns", "1.87 µs", "36.50 ms", "22.64 s"]);
    }
}
