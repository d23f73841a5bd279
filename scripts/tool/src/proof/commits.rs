//! The commits of a guest, as its lines of kind `graph` tell them.

use sched_dag::analysis::{self, Overheads, Settings};
use sched_dag::{Clusters, DagSpec, SchedulerOptions, TaskSet};

use crate::json::Value;
use crate::protocol::{MachineLine, Transcript};
use crate::trace::dag;
use crate::trace::line::Line;
use replay::lines::Malformed;

/// One commit: what was committed, and what it has proven.
#[derive(Clone, Debug)]
pub struct Commit {
    /// Its number within the boot, from 0.
    pub number: u64,
    /// The DAGs, by number.
    pub task_set: TaskSet,
    /// What the analysis takes for granted besides them.
    pub settings: Settings,
    /// The hash of each DAG's names and edges.
    pub hashes: Vec<u64>,
    /// What the guest has proven of each DAG, in nanoseconds.
    pub bounds_ns: Vec<Option<u64>>,
}

/// The lines of one commit, as far as they are read.
struct Open {
    number: u64,
    options: SchedulerOptions,
    clusters: Clusters,
    /// An instance's, and for each that becomes ready.
    overheads_ns: [u64; 2],
    dags: Vec<DagSpec>,
    lines: Vec<usize>,
    hashes: Vec<u64>,
    bounds_ns: Vec<Option<u64>>,
}

/// Reads all commits of a guest, in their order.
///
/// # Errors
///
/// In words, with the line: one that is not as `docs/serial-protocol.md` says, or a commit
/// whose bounds are not those that the analysis gives here.
pub fn read(transcript: &Transcript) -> Result<Vec<Commit>, String> {
    let say = |malformed: Malformed| {
        let Malformed { line, reason } = malformed;
        format!("serial line {line}: {reason}")
    };
    let mut open: Vec<Open> = Vec::new();
    for line in transcript.of_kind("graph") {
        add(line, &mut open).map_err(say)?;
    }
    let commits = open
        .into_iter()
        .map(|open| close(open).map_err(say)?.agreed());
    commits.collect()
}

fn add(line: &MachineLine, all: &mut Vec<Open>) -> Result<(), Malformed> {
    let line = Line(line);
    let number = line.number("commit")?;
    if all.last().is_none_or(|open| open.number != number) {
        all.push(Open {
            number,
            options: dag::options(&line)?,
            clusters: dag::clusters(&line)?,
            overheads_ns: [
                number_at(&line, "overhead_ns", 0)?.unwrap_or(u64::MAX),
                number_at(&line, "overhead_ns", 1)?.unwrap_or(0),
            ],
            dags: Vec::new(),
            lines: Vec::new(),
            hashes: Vec::new(),
            bounds_ns: Vec::new(),
        });
    }
    let bound_ns = number_at(&line, "bound_ns", 0)?;
    let (spec, hash) = (dag::spec(&line)?, line.number("hash")?);
    if let Some(open) = all.last_mut() {
        open.dags.push(spec);
        open.lines.push(line.0.number);
        open.hashes.push(hash);
        open.bounds_ns.push(bound_ns);
    }
    Ok(())
}

/// Returns a number of a list, or `None` of a shorter one.
fn number_at(line: &Line<'_>, name: &str, place: usize) -> Result<Option<u64>, Malformed> {
    match line.elements(name)?.get(place) {
        None => Ok(None),
        Some(Value::Integer(number)) if *number >= 0 => Ok(u64::try_from(*number).ok()),
        _ => Err(line.malformed(format!("`{name}` is a list of numbers"))),
    }
}

fn close(open: Open) -> Result<Commit, Malformed> {
    let SchedulerOptions {
        policy,
        preemption,
        cores,
    } = open.options;
    let options = (open.options, &open.clusters);
    Ok(Commit {
        number: open.number,
        task_set: dag::task_set("graph", options, &open.dags, &open.lines)?,
        settings: Settings {
            policy,
            preemption,
            cores,
            // Two numbers are all that the analysis makes of them.
            overheads: Overheads {
                dispatch_ns: open.overheads_ns[0],
                ready_ns: open.overheads_ns[1],
                ..Overheads::default()
            },
        },
        hashes: open.hashes,
        bounds_ns: open.bounds_ns,
    })
}

impl Commit {
    /// Makes sure that the analysis gives the same bounds here.
    fn agreed(self) -> Result<Commit, String> {
        let answer = analysis::answer(&self.task_set, &self.settings);
        for ((dag, guest), host) in
            (self.task_set.dags().iter().zip(&self.bounds_ns)).zip(&answer.bounds)
        {
            let host = host.map(|bound| bound.bound_ns);
            if *guest != host {
                let (name, number) = (dag.name(), self.number);
                return Err(format!(
                    "the bound of dag `{name}` in commit {number} is {guest:?} ns by the guest and \
                     {host:?} ns by the same analysis here; report this"
                ));
            }
        }
        Ok(self)
    }
}
