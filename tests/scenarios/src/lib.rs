//! Scenarios: runs as text, written once for all platforms.
//!
//! A scenario states DAGs, the acts of their functions, and the expected record. It is built with
//! `fass` and run by any installed platform. In virtual time the record is compared event by event.
//! In real time, on Linux and on the machine, only timing-independent properties are compared:
//! counts, and the laws R1 to R4. `tests/scenarios/*.txt` are the suite.
//!
//! ```text
//! scenario A join waits for all its predecessors
//! cores 2
//! dag fork period 100
//!   source 1
//!   left 2 after source
//!   right 7 after source
//!   join 1 after left right
//! 1 ready left[0], ready right[0]
//! 8 ready join[0]
//! everywhere fork: completed=1
//! ```
//!
//! A time is a whole number of milliseconds. `#` begins a comment. The lines of a scenario:
//!
//! | line | meaning |
//! | --- | --- |
//! | `scenario TITLE` | begins a scenario |
//! | `cores N` | the number of cores; 1 if not given |
//! | `clusters N,N` | the sizes of clusters, which divide the cores |
//! | `policy WORD` | instead of static priorities |
//! | `core N: DAG.SUBTASK ...` | the list of a core, as in `docs/dag-file.md` |
//! | `preemption off` | no instance loses its core |
//! | `mode NAME DAG DAG` | a mode, in which these DAGs run |
//! | `dag NAME WORDS` | a DAG, see [`dag::DagText`] |
//! | `  NAME TIMES WORDS` | a subtask of the DAG, see [`dag::SubtaskText`] |
//! | `TIME EVENT, EVENT` | the events at this time, in virtual time; see below |
//! | `never KIND` | no such event happens, in virtual time |
//! | `DAG: COUNTER=N ...` | a DAG's statistics, in virtual time |
//! | `everywhere DAG: COUNTER=N ...` | a DAG's statistics, on every platform |
//! | `refused CODE CODE` | the commit is refused, for these faults |
//!
//! Only events of kinds named somewhere in the scenario are compared; an event's `core N` may be
//! left out.

#![no_std]

extern crate alloc;

pub mod build;
pub mod dag;
pub mod judge;
mod random;
mod waiting;

use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use alloc::{format, vec};
use core::sync::atomic::AtomicU64;

use dag::{DagText, Use};

pub use waiting::ScenarioDevice;

/// The unit of times in a scenario: a millisecond.
pub const UNIT_NS: u64 = 1_000_000;

/// The suite: each text with its name.
pub const SUITE: &[(&str, &str)] = &[
    ("clusters", include_str!("../clusters.txt")),
    ("ending", include_str!("../ending.txt")),
    ("faults", include_str!("../faults.txt")),
    ("lifecycle", include_str!("../lifecycle.txt")),
    ("modes", include_str!("../modes.txt")),
    ("overrun", include_str!("../overrun.txt")),
    ("rules", include_str!("../rules.txt")),
    ("sharing", include_str!("../sharing.txt")),
    ("tables", include_str!("../tables.txt")),
    ("waits", include_str!("../waits.txt")),
];

/// The DAG running next to a scenario's cluster.
const BYSTANDER: &str = "bystander";

/// A run as stated by its text.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The title: the rule shown.
    pub title: String,
    /// The number of cores.
    pub cores: u32,
    /// The sizes of clusters, if there are several.
    pub clusters: Vec<u32>,
    /// The order of ready instances.
    pub policy: fass::Policy,
    /// Whether a started instance may lose its core.
    pub preemption: fass::Preemption,
    /// Modes, with the names of their DAGs.
    pub modes: Vec<(String, Vec<String>)>,
    /// The DAGs.
    pub dags: Vec<DagText>,
    /// The lists of cores.
    pub lists: Vec<String>,
    /// The events in virtual time, an instant a line.
    pub timeline: Vec<String>,
    /// Kinds of events not happening.
    pub never: Vec<String>,
    /// Statistics of DAGs in virtual time.
    pub exactly: Vec<String>,
    /// Statistics of DAGs on every platform.
    pub everywhere: Vec<String>,
    /// The expected faults of the commit.
    pub refused: Vec<String>,
    /// The functions' counts since the last commit.
    pub(crate) calls: Arc<Calls>,
}

/// The numbers of returned and of failed calls, for all functions of a run.
#[derive(Debug, Default)]
pub(crate) struct Calls {
    pub(crate) returned: AtomicU64,
    pub(crate) failed: AtomicU64,
}

impl Scenario {
    /// Reads all scenarios of a text.
    ///
    /// # Errors
    ///
    /// The first malformed line, and its mistake.
    pub fn read_all(text: &str) -> Result<Vec<Self>, String> {
        let mut all: Vec<Self> = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.split(" #").next().unwrap_or_default().trim_end();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let told = |why: String| format!("line {number}: `{line}`: {why}");
            match (line.strip_prefix("scenario "), all.last_mut()) {
                (Some(title), _) => all.push(Self::new(title)),
                (None, Some(scenario)) => scenario.take(line).map_err(told)?,
                (None, None) => return Err(told("stands before the first scenario".into())),
            }
        }
        Ok(all)
    }

    /// Returns the scenarios of the suite, and each undivided scenario a second time, in a cluster
    /// next to another cluster.
    ///
    /// # Errors
    ///
    /// As [`read_all`](Self::read_all).
    pub fn suite() -> Result<Vec<Self>, String> {
        let mut all = vec![];
        for (_, text) in SUITE {
            for scenario in Self::read_all(text)? {
                if scenario.dags.iter().all(|dag| dag.cluster.is_none()) {
                    all.push(scenario.in_a_cluster()?);
                }
                all.push(scenario);
            }
        }
        Ok(all)
    }

    /// Returns the scenario in a cluster of its own. In a second cluster a bystander runs, with no
    /// effect on the first, and none from it.
    fn in_a_cluster(&self) -> Result<Self, String> {
        let mut divided = self.clone();
        divided.title += " (in a cluster)";
        divided.clusters = vec![self.cores, 1];
        divided.cores += 1;
        for dag in &mut divided.dags {
            dag.cluster = Some(0);
        }
        divided.take(&format!("dag {BYSTANDER} period 2 jobs 1 cluster 1"))?;
        divided.take(&format!(" {BYSTANDER} 1"))?;
        let mut subtasks = self.dags.iter().flat_map(|dag| &dag.subtasks);
        // Where a function ends the run, a busy host may hold the other cluster back until then.
        let ends_run = subtasks.any(|subtask| subtask.uses == Use::EndsRun);
        if self.refused.is_empty() && !ends_run {
            divided.take(&format!("everywhere {BYSTANDER}: completed=1"))?;
        }
        Ok(divided)
    }

    fn new(title: &str) -> Self {
        Self {
            title: title.into(),
            cores: 1,
            clusters: vec![],
            policy: fass::Policy::StaticPriority,
            preemption: fass::Preemption::Enabled,
            modes: vec![],
            dags: vec![],
            lists: vec![],
            timeline: vec![],
            never: vec![],
            exactly: vec![],
            everywhere: vec![],
            refused: vec![],
            calls: Arc::default(),
        }
    }

    fn take(&mut self, line: &str) -> Result<(), String> {
        if line.starts_with(' ') {
            let dag = self.dags.last_mut().ok_or("no dag is above it")?;
            return dag.take_subtask(line);
        }
        if line.starts_with(|first: char| first.is_ascii_digit()) {
            self.timeline.push(line.into());
            return Ok(());
        }
        let (first, rest) = line.split_once(' ').unwrap_or((line, ""));
        let words = || rest.split_whitespace().map(ToString::to_string);
        match (first, rest) {
            ("cores", _) => self.cores = number(rest)?,
            ("clusters", _) => {
                let sizes = rest.split(',').map(number);
                self.clusters = sizes.collect::<Result<_, _>>()?;
                self.cores = self.clusters.iter().sum();
            }
            ("policy", word) => {
                self.policy = fass::Policy::of_word(word).ok_or("there is no such policy")?;
            }
            ("preemption", "off") => self.preemption = fass::Preemption::Disabled,
            ("core", _) => self.lists.push(line.into()),
            ("mode", _) => {
                let (name, dags) = rest.split_once(' ').unwrap_or((rest, ""));
                let dags = dags.split_whitespace().map(ToString::to_string);
                self.modes.push((name.into(), dags.collect()));
            }
            ("dag", _) => self.dags.push(DagText::read(rest)?),
            ("never", _) => self.never.extend(words()),
            ("refused", _) => self.refused.extend(words()),
            ("everywhere", _) => self.everywhere.push(rest.into()),
            _ if first.ends_with(':') => self.exactly.push(line.into()),
            _ => return Err("is no line of a scenario".into()),
        }
        Ok(())
    }
}

/// Reads a number.
pub(crate) fn number<N: core::str::FromStr>(word: &str) -> Result<N, String> {
    let number = word.trim().parse();
    number.map_err(|_| format!("`{word}` is no such number"))
}
