//! Bounds of a run, recomputed on the host, and shown next to the observed times.
//!
//! A record contains everything needed to derive bounds: the graphs with WCETs and priorities, the
//! policy, the cores, the charge on each instance, and the guest's bounds. From these data the host
//! runs the same analysis. So the host also gets results too large for the guest, such as a witness
//! or the parts of a bound. A disagreement between host and guest about a bound is an error.
//!
//! This module also measures the execution times of the runs and the platform's own overheads
//! ([`observed`]). The longest calls, with a margin, become WCETs for later commits; the longest
//! responses are shown next to the bounds.
//!
//! To attribute the slack of a bound, the host repeats the analysis with less and less: without the
//! platform's overheads, then with every subtask preemptible, then with the DAG alone. Each step
//! leaves out one part, and the difference it makes is the size of that part:
//!
//! ```text
//! bound = overheads + blocking + interference + own order + longest path
//! ```
//!
//! *Own order* is the delay of the longest path by the DAG's other subtasks; *overheads* are the
//! overheads of all DAGs. The rest, from the longest observed response up to the longest path at
//! its WCETs, is the pessimism of the WCETs.
//!
//! The witnesses of a guest's bounds go to files, to be checked by `./scripts/check-witness`.

pub mod observed;

use std::path::{Path, PathBuf};

use sched_dag::analysis::{self, AnalysisSettings, Overheads};
use sched_dag::{CoreDivision, Dag, DagId, DagSpec, Preemption};

use crate::files;
use crate::output::Table;
use observed::ObservedDag;
use views::json::Object;
use views::record::{self, CommittedDags};
use views::units::shown;

/// The row of a proof for one DAG in one commit: bound, longest response, and slack.
#[derive(Clone, Debug)]
pub struct ProofRow {
    /// The file with the DAG, if there are several files.
    file: Option<String>,
    commit: usize,
    dag: String,
    bound_ns: Option<u64>,
    longest_ns: u64,
    slack: Slack,
}

/// Puts the bounds of commits next to the longest responses of their DAGs.
///
/// # Errors
///
/// In words: a DAG was committed but has not run.
pub fn rows(commits: &[CommittedDags], observed: &[ObservedDag]) -> Result<Vec<ProofRow>, String> {
    let mut rows = Vec::new();
    for commit in commits {
        for (number, dag) in (0..).map(DagId).zip(&commit.told.dags) {
            let of_dag = observed.iter().find(|observed| observed.hash == dag.hash);
            let longest_ns = of_dag.and_then(|dag| dag.longest_responses_ns.get(&commit.number));
            let longest_ns = longest_ns.ok_or_else(|| {
                let (name, commit) = (&dag.name, commit.number);
                format!("dag `{name}` of commit {commit} has not run")
            })?;
            rows.push(ProofRow {
                file: None,
                commit: commit.number,
                dag: dag.name.clone(),
                bound_ns: dag.bound_ns,
                longest_ns: *longest_ns,
                slack: slack(commit, number),
            });
        }
    }
    Ok(rows)
}

impl ProofRow {
    /// Returns the row with the name of the DAG's file.
    pub fn of_file(self, name: &str) -> Self {
        Self {
            file: Some(name.into()),
            ..self
        }
    }

    fn name(&self) -> String {
        match &self.file {
            Some(file) => format!("{file}: {}", self.dag),
            None => self.dag.clone(),
        }
    }

    fn exceeds(&self) -> bool {
        self.bound_ns
            .is_some_and(|bound_ns| self.longest_ns > bound_ns)
    }

    /// Returns the longest response in thousandths of the bound.
    fn permille(&self) -> Option<u64> {
        // In 128 bits, since a response of 213 days times 1000 exceeds 64 bits.
        let permille = u128::from(self.longest_ns) * 1000 / u128::from(self.bound_ns?.max(1));
        u64::try_from(permille).ok()
    }

    /// Returns the row as a machine line.
    pub fn line(&self) -> String {
        let mut line = Object::new().text("kind", "proof");
        if let Some(file) = &self.file {
            line = line.text("file", file);
        }
        line = line
            .number("commit", self.commit as u64)
            .text("dag", &self.dag)
            .number("longest_ns", self.longest_ns);
        let permille = [
            ("bound_ns", self.bound_ns),
            ("tightness_permille", self.permille()),
        ];
        let parts = PARTS.into_iter().zip(self.slack);
        for (name, number) in permille.into_iter().chain(parts) {
            // Parts without a bound would add up to nothing.
            if let (Some(number), true) = (number, self.bound_ns.is_some()) {
                line = line.number(name, number);
            }
        }
        line.into_text()
    }
}

/// Returns the rows as a table for people.
pub fn table(rows: &[ProofRow]) -> String {
    let names = rows.iter().map(|row| row.name().chars().count() + 1);
    let width = names.max().unwrap_or(0).max(20);
    let title = format!("\n{:1$}   where the bound is from:\n", "", width + 33);
    let columns = format!(
        "dag:<{width}|bound:12|longest:12|ratio:9|path:12|own order:12|others:12|blocking:12|\
         overheads:12"
    );
    let mut table = Table::new(&title, &columns);
    for row in rows {
        let bound = row.bound_ns.map_or("not proven".into(), shown);
        let whole = [
            row.name(),
            bound,
            shown(row.longest_ns),
            ratio(row.permille()),
        ];
        let parts = row.slack.map(|part| part.map_or("-".into(), shown));
        let parts = parts.into_iter().filter(|_| row.bound_ns.is_some());
        table.cells(whole.into_iter().chain(parts));
    }
    table.text()
}

/// Formats thousandths as per cent with one decimal.
pub(crate) fn ratio(permille: Option<u64>) -> String {
    permille.map_or("-".into(), |permille| {
        format!("{}.{} %", permille / 10, permille % 10)
    })
}

/// Returns a sentence with the number of proven DAGs and of responses above their bounds.
pub fn summary(rows: &[ProofRow]) -> String {
    let proven = rows.iter().filter(|row| row.bound_ns.is_some()).count();
    let above = rows.iter().filter(|row| row.exceeds()).count();
    let dags = rows.len();
    format!("{proven} of {dags} DAGs proven, {above} responses above a bound")
}

/// Returns the complaint about a response above its bound, as such a response makes the proof
/// worthless.
pub fn complaint(rows: &[ProofRow]) -> Option<String> {
    let row = rows.iter().find(|row| row.exceeds())?;
    Some(format!(
        "dag `{}` of commit {} took {}, beyond its bound of {}; a WCET or an overhead is too small",
        row.name(),
        row.commit,
        shown(row.longest_ns),
        shown(row.bound_ns?)
    ))
}

/// The parts of a bound: the longest path at its WCETs, the DAG's own subtasks off that path, more
/// urgent instances of other DAGs, less urgent instances keeping their cores, and the platform's
/// overheads.
const PARTS: [&str; 5] = [
    "longest_path_ns",
    "own_order_ns",
    "interference_ns",
    "blocking_ns",
    "overheads_ns",
];

/// The sizes of these parts, in nanoseconds. A part, as the difference of two bounds, is `None` if
/// one of the two is not proven.
pub type Slack = [Option<u64>; PARTS.len()];

/// Splits the bound of a DAG of a commit into its parts.
pub fn slack(commit: &CommittedDags, dag: DagId) -> Slack {
    let bound = |dags: &[DagSpec], settings: &AnalysisSettings, dag: usize| -> Option<u64> {
        let task_set =
            record::task_set(settings.scheduler(), CoreDivision::Undivided, &[], dags).ok()?;
        let answer = analysis::answer(&task_set, settings);
        answer.bounds[dag].map(|bound| bound.bound_ns)
    };
    // DAGs of other clusters do not interfere.
    let task_set = &commit.task_set;
    let cluster = task_set.dag(dag).cluster();
    let is_here = |(_, model): &(usize, &Dag)| model.cluster() == cluster;
    let here = || task_set.dags().iter().enumerate().filter(is_here);
    let specs = here().map(|(place, _)| &commit.specs[place]);
    let mut all: Vec<DagSpec> = specs.cloned().collect();
    (all.iter_mut()).for_each(|dag| dag.cluster = None);
    // The DAG's index among the DAGs of its cluster.
    let index = here().take_while(|(place, _)| *place < dag.index()).count();
    let full = commit.told.dags[dag.index()].bound_ns;
    // Some effects belong to two steps; the order of the steps decides which part gets them.
    let mut settings = commit.settings();
    let cores = task_set.cores_of(cluster, settings.cores).len();
    settings.cores = u32::try_from(cores).unwrap_or(u32::MAX);
    settings.overheads = Overheads::default();
    let free = bound(&all, &settings, index);
    settings.preemption = Preemption::Enabled;
    for subtask in all.iter_mut().flat_map(|dag| &mut dag.subtasks) {
        subtask.non_preemptive = false;
    }
    let preemptible = bound(&all, &settings, index);
    let own = all.swap_remove(index);
    let alone = bound(std::slice::from_ref(&own), &settings, 0);
    // With a core for each subtask, nothing delays the longest path.
    settings.cores = u32::try_from(own.subtasks.len()).unwrap_or(u32::MAX).max(1);
    let length = bound(&[own], &settings, 0);
    // A time table fixes when its DAGs run and which time is left to others, so these parts do not
    // apply.
    let has_table = task_set.tables().iter().any(|of| of.cluster == cluster);
    let part = |whole: Option<u64>, rest: Option<u64>| match has_table {
        true => None,
        false => Some(whole?.saturating_sub(rest?)),
    };
    [
        length,
        part(alone, length),
        part(preemptible, alone),
        part(free, preemptible),
        part(full, free),
    ]
}

/// Writes the witness of each commit, and returns a line with the names of the files. Later commits
/// get files of their own, with the commit's number as the last extension.
///
/// # Errors
///
/// In words: nothing was committed, or a file cannot be written.
pub fn write(path: &Path, commits: &[CommittedDags]) -> Result<String, String> {
    let mut names = Vec::new();
    for commit in commits {
        let path = file(path, commit.number);
        let text = analysis::witness(&commit.task_set, &commit.settings());
        files::write_named("witness", &path, text)?;
        names.push(files::shown_path(&path));
    }
    match names.join(" ") {
        none if none.is_empty() => Err("the guest has committed no DAG".into()),
        names => Ok(format!(
            "{names}: what proves the bounds; `./scripts/check-witness {names}` checks it"
        )),
    }
}

fn file(path: &Path, commit: usize) -> PathBuf {
    match commit {
        0 => path.into(),
        later => {
            let mut name = path.as_os_str().to_owned();
            name.push(format!(".{later}"));
            name.into()
        }
    }
}

#[cfg(test)]
mod tests;
