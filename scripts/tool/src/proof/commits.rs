//! The commits of a guest, as its lines of kind `graph` tell them.

use sched_dag::TaskSet;
use sched_dag::analysis::{self, Overheads, Settings};

use crate::json::Value;
use crate::protocol::Transcript;
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
    let lines: Vec<Line<'_>> = transcript.of_kind("graph").map(Line).collect();
    let number = |line: &Line<'_>| line.0.number_at("commit");
    let commits = lines.chunk_by(|a, b| number(a) == number(b));
    commits
        .map(|lines| commit(lines).map_err(say)?.agreed())
        .collect()
}

/// Reads the lines of one commit, a line a DAG.
fn commit(lines: &[Line<'_>]) -> Result<Commit, Malformed> {
    let first = &lines[0];
    let number = first.number("commit")?;
    let options = dag::options(first)?;
    let clusters = dag::clusters(first)?;
    // Two numbers are all that the analysis makes of them: an instance's, and for each that
    // becomes ready.
    let overheads = Overheads {
        dispatch_ns: number_at(first, "overhead_ns", 0)?.unwrap_or(u64::MAX),
        ready_ns: number_at(first, "overhead_ns", 1)?.unwrap_or(0),
        ..Overheads::default()
    };
    let bounds_ns = lines.iter().map(|line| number_at(line, "bound_ns", 0));
    let bounds_ns = bounds_ns.collect::<Result<_, _>>()?;
    let dags = lines.iter().map(dag::spec).collect::<Result<Vec<_>, _>>()?;
    let hashes = lines.iter().map(|line| line.number("hash"));
    let hashes = hashes.collect::<Result<_, _>>()?;
    let numbers: Vec<usize> = lines.iter().map(|line| line.0.number).collect();
    Ok(Commit {
        number,
        task_set: dag::task_set("graph", (options, &clusters), &dags, &numbers)?,
        settings: Settings {
            policy: options.policy,
            preemption: options.preemption,
            cores: options.cores,
            overheads,
        },
        hashes,
        bounds_ns,
    })
}

/// Returns a number of a list, or `None` of a shorter one.
fn number_at(line: &Line<'_>, name: &str, place: usize) -> Result<Option<u64>, Malformed> {
    match line.elements(name)?.get(place) {
        None => Ok(None),
        Some(Value::Integer(number)) if *number >= 0 => Ok(u64::try_from(*number).ok()),
        _ => Err(line.malformed(format!("`{name}` is a list of numbers"))),
    }
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
