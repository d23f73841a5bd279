//! Reading a file of any of the formats.

use std::path::Path;

use dag_file::{DagFile, Length, Malformed, check, parse};
use sched_dag::Policy;

use super::{rd_gen, stg};
use crate::files;

/// How a file is read.
#[derive(Clone, Debug)]
pub struct Import {
    /// The length of a unit, for formats whose numbers have none.
    pub unit_ns: u64,
    /// The one graph wanted of a set of task graphs.
    pub graph: Option<String>,
    /// The number of cores that it will run on.
    pub cores: u32,
    /// For how long it will run.
    pub length: Length,
}

/// Reads a file: RD-Gen's YAML if its name ends in `.yaml` or `.yml`, a set of
/// task graphs if in `.json`, otherwise our own format. It is then checked as its
/// commit will be.
///
/// # Errors
///
/// Lines for people, each beginning with the file and mostly the line.
pub fn load(path: &Path, import: &Import) -> Result<DagFile, Vec<String>> {
    let place = files::place(path);
    let located = |faults: Vec<Malformed>| -> Vec<String> {
        let located = faults.into_iter();
        located
            .map(|Malformed { line, reason }| format!("{place}:{line}: {reason}"))
            .collect()
    };
    let bytes =
        files::read(path).map_err(|why| vec![format!("{place}: {why}; name another file")])?;
    let text = str::from_utf8(&bytes).map_err(|error| {
        let before = bytes[..error.valid_up_to()].iter();
        let line = 1 + before.filter(|byte| **byte == b'\n').count();
        vec![format!(
            "{place}:{line}: this is not UTF-8 text; is it a DAG file?"
        )]
    })?;
    let extension = path.extension().and_then(|extension| extension.to_str());
    let file = match extension {
        Some("yaml" | "yml") => {
            let stem = path.file_stem().map(|stem| stem.to_string_lossy());
            let name = stem.unwrap_or_default().replace(char::is_whitespace, "_");
            rd_gen::read(text, &name, import.unit_ns)
        }
        Some("json") => {
            stg::read(text, import.graph.as_deref(), import.unit_ns).map_err(|one| vec![one])
        }
        _ => parse(text).map_err(|one| vec![one]),
    };
    let file = file.map_err(located)?;
    if extension != Some("json")
        && let Some(graph) = &import.graph
    {
        return Err(vec![format!(
            "{place}: `--graph {graph}` is for a set of task graphs in JSON; leave it out"
        )]);
    }
    for set in &file.sets {
        // Static priorities ask for all that EDF does, and more.
        check(set, Policy::StaticPriority, import.cores, import.length).map_err(located)?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::{parse, rd_gen, stg};
    use crate::system::workspace;
    use dag_file::Malformed;

    /// Changes, drops or repeats a part of a text, differently for each number.
    fn damaged(text: &str, number: u64) -> String {
        // Two steps of a linear congruential generator (Knuth's MMIX).
        let next = |state: u64| {
            state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407)
        };
        let (one, other) = (next(number), next(next(number)));
        let below =
            |number: u64, most: usize| usize::try_from(number >> 33).unwrap_or(0) % most.max(1);
        let from = below(one, text.len());
        let to = (from + below(other, 12)).min(text.len());
        match number % 4 {
            0 => format!("{}{}", &text[..from], &text[to..]),
            1 => format!("{}{}{}", &text[..to], &text[from..to], &text[to..]),
            2 => format!(
                "{}{}{}",
                &text[..from],
                ["-", "#", "\n", "9", " ", "'"][below(other, 6)],
                &text[from..]
            ),
            _ => text[..from].into(),
        }
    }

    #[test]
    fn no_damage_makes_a_reader_panic_or_lose_its_line() {
        let data = workspace().join("tests/data");
        let yaml = std::fs::read_to_string(data.join("rd-gen/chain_03.yaml")).unwrap();
        let json = r#"{"graphs":[{"name":"g","c":[0,3,4,0],"edges":[[0,1],[1,2],[2,3]],"optimal":{"2":7}}]}"#;
        let ours = rd_gen::read(&yaml, "x", 1000).unwrap().to_string();
        let in_file = |faults: &[Malformed], text: &str, number: u64| {
            let lines = text.lines().count() + 1;
            let is_in = |fault: &Malformed| (1..=lines).contains(&fault.line);
            assert!(faults.iter().all(is_in), "damage {number}: {faults:?}");
        };
        for number in 0..4000 {
            let text = damaged(&yaml, number);
            if let Err(faults) = rd_gen::read(&text, "x", 1000) {
                in_file(&faults, &text, number);
            }
            let text = damaged(&ours, number);
            if let Err(fault) = parse(&text) {
                in_file(&[fault], &text, number);
            }
            let text = damaged(json, number);
            if let Err(fault) = stg::read(&text, None, 1000) {
                in_file(&[fault], &text, number);
            }
        }
    }
}
