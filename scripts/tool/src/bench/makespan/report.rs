//! Tables and files of makespans.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::Makespan;

/// Writes a row a graph with a column a number of cores, and what follows from all.
pub(super) fn table(all: &[Makespan]) -> String {
    let cores: BTreeSet<u64> = all.iter().map(|one| one.cores).collect();
    let mut graphs: Vec<&str> = all.iter().map(|one| one.graph.as_str()).collect();
    graphs.sort_unstable();
    graphs.dedup();
    // Writing into a `String` cannot fail.
    let mut text = format!("{:<16}", "graph");
    for cores in &cores {
        let _ = write!(text, "{:>22}", format!("{cores} cores"));
    }
    text.push('\n');
    for graph in graphs {
        let _ = write!(text, "{graph:<16}");
        for cores in &cores {
            let found = all
                .iter()
                .find(|one| one.graph == graph && one.cores == *cores);
            let cell = found.map_or("-".into(), |one| {
                format!("{} / {} = {:.3}", one.units, one.optimal, one.ratio())
            });
            let _ = write!(text, "{cell:>22}");
        }
        text.push('\n');
    }
    for cores in &cores {
        let of: Vec<&Makespan> = all.iter().filter(|one| one.cores == *cores).collect();
        let optimal = of.iter().filter(|one| one.units == one.optimal).count();
        let largest = of.iter().map(|one| one.ratio()).fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "{cores} cores: {optimal} of {} optimal, makespan over optimum {:.4} on average, {largest:.4} at most",
            of.len(),
            mean(&of)
        );
    }
    text
}

#[expect(clippy::cast_precision_loss, reason = "it counts graphs")]
fn mean(all: &[&Makespan]) -> f64 {
    all.iter().map(|one| one.ratio()).sum::<f64>() / all.len() as f64
}

/// Writes comma-separated values with a heading.
pub(super) fn csv(all: &[Makespan]) -> String {
    let mut text = String::from("graph,cores,makespan,optimal,ratio\n");
    for one in all {
        let Makespan {
            graph,
            cores,
            units,
            optimal,
        } = one;
        let _ = writeln!(text, "{graph},{cores},{units},{optimal},{:.6}", one.ratio());
    }
    text
}

/// Writes one JSON object a line.
pub(super) fn json_lines(all: &[Makespan]) -> String {
    let mut text = String::new();
    for one in all {
        let graph = one.graph.replace(['"', '\\'], "?");
        let _ = writeln!(
            text,
            "{{\"kind\":\"makespan\",\"graph\":\"{graph}\",\"cores\":{},\"makespan\":{},\"optimal\":{},\"ratio\":{:.6}}}",
            one.cores,
            one.units,
            one.optimal,
            one.ratio()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{Makespan, csv, json_lines, table};
    use crate::json;

    #[test]
    fn figures_are_written_for_people_and_programs() {
        let makespan = |cores, units| Makespan {
            graph: "50/a".into(),
            cores,
            units,
            optimal: 100,
        };
        let all = [makespan(2, 100), makespan(4, 125)];
        let text = table(&all);
        assert!(
            text.contains("100 / 100 = 1.000     125 / 100 = 1.250"),
            "{text}"
        );
        assert!(text.contains("2 cores: 1 of 1 optimal"), "{text}");
        assert!(text.ends_with(
            "4 cores: 0 of 1 optimal, makespan over optimum 1.2500 on average, 1.2500 at most\n"
        ));
        assert_eq!(csv(&all).lines().nth(2), Some("50/a,4,125,100,1.250000"));
        assert!(
            json_lines(&all)
                .lines()
                .all(|line| json::parse(line).is_ok())
        );
    }
}
