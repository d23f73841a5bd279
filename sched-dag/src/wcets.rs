//! WCETs from a file, observed in runs of the same graph.
//!
//! The file is text, one record a line; `#` begins a comment. `./scripts/recording --observe`
//! writes the file, and a commit reads it back:
//!
//! ```text
//! margin PERCENT                 what was added to the longest call
//! dag HASH NAME                  of the DAG whose subtasks follow
//! wcet NANOSECONDS NUMBER NAME   of a subtask, in the order of registration
//! end
//! ```
//!
//! The hash covers names and edges, to distinguish WCETs of another graph. WCETs missing from the
//! file stay as stated by the app. The WCET of a subtask with waits covers all its segments
//! together, and replaces all stated values. Nothing here trusts the file.

use core::fmt;

use crate::fnv::{EMPTY, fnv_1a};
use crate::spec::DagSpec;

/// The source of a WCET.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WcetSource {
    /// There is no WCET.
    None,
    /// The app or the DAG file states the WCET.
    Stated,
    /// The WCET is the longest call of a run, plus a margin.
    Observed {
        /// The margin, in percent of the longest call.
        margin_percent: u32,
    },
}

/// A line of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WcetRecord<'t> {
    /// The margin added to each longest call, in percent.
    Margin(u32),
    /// A DAG begins.
    Dag {
        /// The hash of the DAG's names and edges.
        hash: u64,
        /// The name of the DAG.
        name: &'t str,
    },
    /// A WCET of the latest DAG.
    Wcet {
        /// The WCET, in nanoseconds, at least 1.
        wcet_ns: u64,
        /// The subtask's number.
        subtask: usize,
        /// The name of the subtask.
        name: &'t str,
    },
    /// The file ends.
    End,
}

/// The reason why a commit rejects a file of WCETs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WcetFault {
    /// The line, counted from 1.
    pub line: usize,
    /// Fact and remedy.
    pub problem: &'static str,
}

const NO_RECORD: &str =
    "this is no record of a file of WCETs; have one written by `./scripts/recording --observe`";
const ZERO: &str = "a WCET of 0; give at least 1 ns, or leave the line out";
const UNKNOWN: &str = "the DAG has no such subtask; observe it again";
const FOREIGN: &str = "the DAG of this name has another graph now; observe it again";

/// Returns the records of a file with their lines, counted from 1.
pub fn records(text: &str) -> impl Iterator<Item = Result<(usize, WcetRecord<'_>), WcetFault>> {
    let lines = (1..).zip(text.lines());
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    lines.map(|(line, text)| match record(text) {
        Some(WcetRecord::Wcet { wcet_ns: 0, .. }) => Err(WcetFault {
            line,
            problem: ZERO,
        }),
        Some(record) => Ok((line, record)),
        None => Err(WcetFault {
            line,
            problem: NO_RECORD,
        }),
    })
}

fn record(line: &str) -> Option<WcetRecord<'_>> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    let (number, name) = rest.split_once(' ').unwrap_or((rest, ""));
    let number: Option<u64> = number.parse().ok();
    Some(match word {
        "margin" => WcetRecord::Margin(u32::try_from(number?).ok()?),
        "dag" => WcetRecord::Dag {
            hash: number?,
            name,
        },
        "wcet" => {
            let (subtask, name) = name.split_once(' ').unwrap_or((name, ""));
            WcetRecord::Wcet {
                wcet_ns: number?,
                subtask: subtask.parse().ok()?,
                name,
            }
        }
        "end" => WcetRecord::End,
        _ => return None,
    })
}

/// Gives the subtasks of a DAG their WCETs from a file.
///
/// # Errors
///
/// The first line that is no record, or states a WCET of 0; the first record naming a subtask
/// missing in the DAG; or the line of the DAG of this name, if the file has it only with another
/// graph.
pub fn apply(text: &str, spec: &mut DagSpec) -> Result<(), WcetFault> {
    let own = graph_hash(spec);
    let (mut margin_percent, mut is_own, mut was_found, mut foreign) = (0, false, false, None);
    for record in records(text) {
        let (line, record) = record?;
        match record {
            WcetRecord::Margin(percent) => margin_percent = percent,
            WcetRecord::Dag { hash, name } => {
                is_own = hash == own;
                was_found |= is_own;
                if name == spec.name {
                    foreign = foreign.or(Some(line));
                }
            }
            WcetRecord::Wcet {
                wcet_ns,
                subtask,
                name,
            } if is_own => {
                let found = spec.subtasks.get_mut(subtask);
                // The hash covers names, too, so another name here means an edited file.
                let found = found.filter(|subtask| subtask.name == name);
                let problem = UNKNOWN;
                let found = found.ok_or(WcetFault { line, problem })?;
                found.wcet_ns = Some(wcet_ns);
                found.wcet_margin_percent = Some(margin_percent);
                // The sum covers all segments: nothing follows for a single segment, and the stated
                // values of the later segments would not be parts of the sum.
                for wait in &mut found.waits {
                    wait.segment_ns = None;
                }
            }
            WcetRecord::Wcet { .. } | WcetRecord::End => {}
        }
    }
    match foreign {
        Some(line) if !was_found => Err(WcetFault {
            line,
            problem: FOREIGN,
        }),
        _ => Ok(()),
    }
}

/// Returns a hash of a DAG's names and edges, and of nothing else.
pub fn graph_hash(spec: &DagSpec) -> u64 {
    // A byte that occurs in no name ends each word.
    let word = |hash, word: &str| fnv_1a(fnv_1a(hash, word.as_bytes()), &[0xff]);
    let mut hash = word(EMPTY, &spec.name);
    for subtask in &spec.subtasks {
        hash = word(hash, &subtask.name);
        for ports in [&subtask.inputs, &subtask.outputs] {
            hash = ports
                .iter()
                .fold(hash, |hash, port| word(hash, &port.topic));
            hash = fnv_1a(hash, &[0xfe]);
        }
    }
    for &(from, to) in &spec.edges {
        for end in [from, to] {
            hash = fnv_1a(hash, &(end as u64).to_le_bytes());
        }
    }
    hash
}

impl fmt::Display for WcetFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, problem } = self;
        write!(f, "line {line} of the WCETs: {problem}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{SubtaskSpec, Wait};

    fn spec(names: &str, edges: &[(usize, usize)]) -> DagSpec {
        let subtask = |name: &str| SubtaskSpec {
            name: name.into(),
            wcet_ns: Some(5),
            ..SubtaskSpec::default()
        };
        DagSpec {
            name: "a b".into(),
            subtasks: names.split(',').map(subtask).collect(),
            edges: edges.into(),
            ..DagSpec::default()
        }
    }

    fn file(of: &DagSpec, lines: &str) -> String {
        let hash = graph_hash(of);
        format!("# made\n\nmargin 20\ndag {hash} a b\n{lines}end\n")
    }

    #[test]
    fn a_dag_takes_what_its_own_graph_was_observed_to_need() {
        let (mut own, mut other) = (spec("x,y z", &[(0, 1)]), spec("x", &[]));
        let text = file(&own, "wcet 12 1 y z\n") + &file(&other, "wcet 8 0 x\n");
        assert_eq!(apply(&text, &mut own), Ok(()));
        let subtasks = own.subtasks.iter();
        let found = subtasks.map(|subtask| (subtask.wcet_ns, subtask.wcet_margin_percent));
        assert!(found.eq([(Some(5), None), (Some(12), Some(20))]));
        // Of two graphs of one name each takes its own.
        assert_eq!(apply(&text, &mut other), Ok(()));
        assert_eq!(other.subtasks[0].wcet_ns, Some(8));
        // One of another name is not spoken of.
        let mut unnamed = spec("x", &[]);
        unnamed.name = "b".into();
        assert_eq!(apply(&text, &mut unnamed), Ok(()));
        assert_eq!(unnamed.subtasks[0].wcet_ns, Some(5));
    }

    #[test]
    fn an_observed_sum_replaces_the_stated_segments() {
        let mut own = spec("x,y", &[]);
        let wait = |segment_ns| Wait {
            limit_ns: 7,
            segment_ns,
        };
        for subtask in &mut own.subtasks {
            subtask.waits = [wait(Some(2))].into();
        }
        assert_eq!(apply(&file(&own, "wcet 9 1 y\n"), &mut own), Ok(()));
        let [x, y] = [0, 1].map(|at| (own.subtasks[at].wcet_ns, &*own.subtasks[at].waits));
        assert_eq!(x, (Some(5), &[wait(Some(2))][..]));
        assert_eq!(y, (Some(9), &[wait(None)][..]));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let own = spec("x,y", &[(0, 1)]);
        let refused = |text: &str| {
            let fault = apply(text, &mut own.clone()).unwrap_err();
            (fault.line, fault.problem)
        };
        for (line, problem) in [
            ("wcet 12 2 z", UNKNOWN),
            ("wcet 12 1 x", UNKNOWN),
            ("wcet 0 1 y", ZERO),
            ("wcet 1", NO_RECORD),
            ("wcet -1 0 x", NO_RECORD),
            ("wcet 99999999999999999999 0 x", NO_RECORD),
            ("dag x", NO_RECORD),
            ("else", NO_RECORD),
        ] {
            let text = file(&own, &format!("{line}\n"));
            assert_eq!(refused(&text), (5, problem), "{line}");
        }
        for other in [spec("x,y", &[]), spec("x,z", &[(0, 1)]), spec("x", &[])] {
            assert_eq!(refused(&file(&other, "")), (4, FOREIGN));
        }
    }
}
