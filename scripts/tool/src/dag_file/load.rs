//! Reading a file of any of the formats.

use std::path::Path;

use dag_file::{DagFile, Length, Malformed, check, is_name, parse};
use replay::shown::{is_seen, shown};
use sched_dag::{Clusters, CommitOptions, Policy};

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
    /// How they are divided.
    pub clusters: Clusters,
    /// For how long it will run.
    pub length: Length,
}

/// The formats that a file may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// Our own.
    Ours,
    /// RD-Gen's YAML.
    RdGen,
    /// A set of task graphs in JSON.
    TaskGraphs,
}

impl Format {
    /// Returns the format that a file's name tells, in small or in capital letters;
    /// `None` if its ending is none of those that are known.
    pub(super) fn of(path: &Path) -> Option<Format> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "dag" => Some(Format::Ours),
            "yaml" | "yml" => Some(Format::RdGen),
            "json" => Some(Format::TaskGraphs),
            _ => None,
        }
    }
}

/// Returns a name for the DAGs of a file: its own without the ending, with `_` in place
/// of what no name may have.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let plain = |character: char| match character.is_whitespace() || !is_seen(character) {
        true => '_',
        false => character,
    };
    let name: String = stem.chars().map(plain).collect();
    match is_name(&name) {
        true => name,
        false => format!("_{name}"),
    }
}

/// Reads a file of the format that its name tells, our own if it tells none. It is then
/// checked as its commit will be.
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
    let text = files::read_text(path).map_err(|line| vec![line])?;
    let text = text.as_str();
    let format = Format::of(path);
    let file = match format {
        Some(Format::RdGen) => rd_gen::read(text, &name_of(path), import.unit_ns),
        Some(Format::TaskGraphs) => {
            stg::read(text, import.graph.as_deref(), import.unit_ns).map_err(|one| vec![one])
        }
        Some(Format::Ours) => parse(text).map_err(|one| vec![one]),
        None => parse(text).map_err(|Malformed { line, reason }| {
            let hint = "read as our format; a name in .yaml or .yml tells RD-Gen's, in .json a task \
                        graph set";
            let reason = format!("{reason} ({hint})");
            vec![Malformed { line, reason }]
        }),
    };
    let file = file.map_err(located)?;
    if format != Some(Format::TaskGraphs)
        && let Some(graph) = &import.graph
    {
        return Err(vec![format!(
            "{place}: `--graph {}` is for a set of task graphs in JSON; leave it out",
            shown(graph)
        )]);
    }
    // Static priorities ask for all that EDF does, and more.
    let options = CommitOptions::new(Policy::StaticPriority, import.cores)
        .with_clusters(import.clusters.clone());
    for set in &file.sets {
        check(set, &options, import.length).map_err(located)?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::{Format, name_of, parse, rd_gen, stg};
    use crate::system::workspace;
    use common::random::Random;
    use dag_file::{DagFile, Malformed, is_name};
    use std::path::Path;

    #[test]
    fn every_file_name_becomes_a_name_and_its_ending_tells_the_format() {
        for (file, name, format) in [
            ("a/gnp_01.yaml", "gnp_01", Some(Format::RdGen)),
            ("a b.Yml", "a_b", Some(Format::RdGen)),
            ("#h.YAML", "_#h", Some(Format::RdGen)),
            ("->.dag", "_->", Some(Format::Ours)),
            ("{x.JSON", "_{x", Some(Format::TaskGraphs)),
            ("a\u{1b}\u{202e}b.txt", "a__b", None),
            ("yaml", "yaml", None),
        ] {
            assert_eq!(name_of(Path::new(file)), name);
            assert!(is_name(name), "{name}");
            assert_eq!(Format::of(Path::new(file)), format, "{file}");
        }
    }

    /// Changes, drops or repeats a part of a text, differently for each number.
    fn damaged(text: &str, number: u64) -> String {
        let mut random = Random::new(number);
        let mut below = |most: usize| random.index(most);
        let from = below(text.len());
        let to = (from + below(12)).min(text.len());
        let (before, part, rest) = (&text[..from], &text[from..to], &text[to..]);
        match below(4) {
            0 => [before, rest].concat(),
            1 => [before, part, part, rest].concat(),
            2 => {
                let other = ["-", "#", "\n", "9", " ", "'"][below(6)];
                [before, other, part, rest].concat()
            }
            _ => before.into(),
        }
    }

    #[test]
    fn no_damage_makes_a_reader_panic_or_lose_its_line_or_differ_from_the_guests() {
        let data = workspace().join("apps/dag-file/examples");
        let yaml = std::fs::read_to_string(data.join("rd-gen/chain_03.yaml")).unwrap();
        let json = r#"{"graphs":[{"name":"g","c":[0,3,4,0],"edges":[[0,1],[1,2],[2,3]],"optimal":{"2":7}}]}"#;
        let ours = rd_gen::read(&yaml, "x", 1000).unwrap().to_string();
        type Read = fn(&str) -> Result<DagFile, Vec<Malformed>>;
        let readers: [(&str, Read); 3] = [
            (&yaml, |text| rd_gen::read(text, "x", 1000)),
            (&ours, |text| parse(text).map_err(|fault| vec![fault])),
            (json, |text| {
                stg::read(text, None, 1000).map_err(|fault| vec![fault])
            }),
        ];
        for number in 0..4000 {
            for (text, read) in readers {
                let text = damaged(text, number);
                match read(&text) {
                    // What is accepted here is written for the guest, whose reader is ours.
                    Ok(file) => {
                        let refused = parse(&file.to_string()).err();
                        assert_eq!(refused, None, "damage {number}:\n{file}");
                    }
                    Err(faults) => {
                        let lines = 1..=text.lines().count() + 1;
                        let is_in = |fault: &Malformed| lines.contains(&fault.line);
                        assert!(faults.iter().all(is_in), "damage {number}: {faults:?}");
                    }
                }
            }
        }
    }
}
