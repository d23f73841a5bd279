//! Scenarios: runs that are stated as text, once for all platforms.
//!
//! A scenario has DAGs, what their functions do, and what the record must show. It is built with
//! `fass` and run by whatever platform is installed. In virtual time the record is compared event
//! by event; in real time, on Linux and on the machine, by what holds however long anything
//! takes: counts, and the laws R1 to R4. `tests/scenarios/*.txt` are the suite.
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
//! | `scenario TITLE` | begins one |
//! | `cores N` | on so many; 1 if not said |
//! | `clusters N,N` | which are divided so |
//! | `policy WORD` | instead of static priorities |
//! | `core N: DAG.SUBTASK ...` | the list of a core, as `docs/dag-file.md` says |
//! | `preemption off` | nobody loses its core |
//! | `mode NAME DAG DAG` | a mode, in which these DAGs run |
//! | `dag NAME WORDS` | a DAG, see [`dag::DagText`] |
//! | `  NAME TIMES WORDS` | a subtask of it, see [`dag::SubtaskText`] |
//! | `TIME EVENT, EVENT` | what happens then, in virtual time. Only events of the kinds that are
//! named somewhere in the scenario are compared; `core N` may be left out. |
//! | `never KIND` | no such event happens, in virtual time |
//! | `DAG: COUNTER=N ...` | a DAG's statistics, in virtual time |
//! | `everywhere DAG: COUNTER=N ...` | its statistics, on every platform |
//! | `refused CODE CODE` | the commit is refused, for these faults |

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

/// The DAG that runs next to a scenario in a cluster.
const BYSTANDER: &str = "bystander";

/// A run as it is stated.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Its title: the rule that it shows.
    pub title: String,
    /// On how many cores it runs.
    pub cores: u32,
    /// The sizes of clusters, if it has several.
    pub clusters: Vec<u32>,
    /// How ready instances are ordered.
    pub policy: fass::Policy,
    /// Whether a started instance may lose its core.
    pub preemption: fass::Preemption,
    /// Modes, with the names of their DAGs.
    pub modes: Vec<(String, Vec<String>)>,
    /// Its DAGs.
    pub dags: Vec<DagText>,
    /// The lists of cores.
    pub lists: Vec<String>,
    /// The events in virtual time, an instant a line.
    pub timeline: Vec<String>,
    /// Kinds of events that do not happen.
    pub never: Vec<String>,
    /// Statistics of DAGs in virtual time.
    pub exactly: Vec<String>,
    /// Statistics of DAGs on every platform.
    pub everywhere: Vec<String>,
    /// The faults of its commit.
    pub refused: Vec<String>,
    /// The functions' counts since the last commit.
    pub(crate) calls: Arc<Calls>,
}

/// How the calls of all functions of a run have ended.
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
    /// The line that is none, and what is wrong with it.
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

    /// Returns the scenarios of the suite, and each that is undivided in a cluster next to
    /// another one, too.
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

    /// Returns the scenario on a cluster of its own, next to one whose DAG neither disturbs it nor
    /// is disturbed.
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
