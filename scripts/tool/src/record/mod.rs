//! The record of a boot, read: its commits, the events of its runs, and what they took.
//!
//! It comes as a file, or as lines of a serial log, each with some of the file's bytes. All that
//! is shown, judged, drawn or computed of a run is a view of what is here.

pub mod bound;
pub mod model;
mod run;
#[cfg(test)]
pub(crate) mod tests;

use std::borrow::Cow;
use std::collections::BTreeMap;

use recording::{Chunk, Events, MAGIC, Recording, Times};
use sched_dag::journal::{Event, What};
use sched_dag::{ClusterId, CoreId};

use crate::protocol::{Transcript, read_line};
use model::Committed;

pub use run::Run;

/// The record that a boot has left.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// The machine lines, as far as the record has them.
    pub lines: String,
    /// The commits, one after the other.
    pub commits: Vec<Committed>,
    /// The runs. The last one may have died.
    pub runs: Vec<Run>,
    /// The times of each run that has ended, and the place of its commit.
    pub times: Vec<(usize, Times)>,
}

/// Events of a run that is being read, by cluster.
#[derive(Default)]
struct Open {
    clusters: Vec<Vec<Event>>,
    /// How many were lost so far.
    lost: u64,
    /// How many each journal has taken so far.
    taken: Vec<u64>,
}

/// Returns the bytes of the record that is in a log, and nothing if there is none.
///
/// # Errors
///
/// A line of the record is damaged: which one.
pub fn bytes_of_log(log: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    for (number, text) in (1..).zip(log.lines()) {
        if let Some(Ok(line)) = read_line(number, text)
            && line.kind == "record"
        {
            let text = line.text_at("bytes").and_then(of_base64);
            let damaged = || format!("serial line {number}: its bytes are not in base 64");
            bytes.extend(text.ok_or_else(damaged)?);
        }
    }
    Ok(bytes)
}

/// Returns what stands for these bytes as RFC 4648 has it, section 4.
fn of_base64(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut bytes = Vec::new();
    for four in text.as_bytes().chunks(4) {
        let pad = four.iter().rev().take_while(|byte| **byte == b'=').count();
        let digits = four.iter().take(four.len() - pad).map(|byte| digit(*byte));
        let digits: Vec<u8> = digits.collect::<Option<_>>()?;
        if four.len() != 4 || pad > 2 {
            return None;
        }
        let bits = (0..4).fold(0_u32, |bits, place| {
            bits << 6 | u32::from(digits.get(place).copied().unwrap_or(0))
        });
        bytes.extend(&bits.to_be_bytes()[1..4 - pad]);
    }
    Some(bytes)
}

impl Record {
    /// Reads a record, or the log that has one in its lines. Of a boot that died it is what was
    /// sent until then.
    ///
    /// # Errors
    ///
    /// In words: what is wrong with it, and where.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        if bytes.starts_with(&MAGIC) {
            let recording = Recording::read(bytes).map_err(|malformed| malformed.to_string())?;
            return Self::of(&recording, String::new());
        }
        // A person's line may be damaged; a machine line then is found to be.
        Self::of_log(&String::from_utf8_lossy(bytes))
    }

    /// Reads the record that stands in a log.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn of_log(log: &str) -> Result<Self, String> {
        Self::sent(&bytes_of_log(log)?, log)
    }

    /// Reads what was sent by a guest that may have died, and has printed this log.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn sent(bytes: &[u8], log: &str) -> Result<Self, String> {
        let mut whole = Cow::Borrowed(bytes);
        if bytes.is_empty() {
            whole = Cow::Owned(recording::Writer::begin(Vec::new()).end());
        } else if Recording::read(bytes).is_err() {
            let mended = recording::mended(bytes);
            whole = Cow::Owned(mended.map_err(|malformed| format!("the record, {malformed}"))?);
        }
        let recording = Recording::read(&whole);
        let recording = recording.map_err(|malformed| format!("the record, {malformed}"))?;
        Self::of(&recording, log.into())
    }

    /// Takes a recording apart, with lines that are known besides.
    ///
    /// # Errors
    ///
    /// In words: what is not as a run leaves it.
    pub fn of(recording: &Recording<'_>, lines: String) -> Result<Self, String> {
        let mut record = Self {
            lines,
            ..Self::default()
        };
        let mut open = Open::default();
        for chunk in recording.chunks() {
            match chunk {
                Chunk::Header(_) | Chunk::Entry(_) => {}
                Chunk::Text(text) => record.lines += text,
                Chunk::Commit(commit) => {
                    let committed = Committed::new(record.commits.len(), commit)?;
                    record.commits.push(committed);
                }
                Chunk::Events(events) => {
                    let run = record.runs.len();
                    let add = |committed| open.add(&events, committed);
                    let added = record.commits.last().ok_or("no commit is before it".into());
                    added
                        .and_then(add)
                        .map_err(|why| format!("events of run {run}: {why}"))?;
                }
                Chunk::Times(times) => {
                    record.end_run(std::mem::take(&mut open), Some(&times))?;
                    record.times.push((record.commits.len() - 1, times));
                }
            }
        }
        if !open.taken.is_empty() {
            record.end_run(open, None)?;
        }
        let transcript = Transcript::read(&record.lines);
        if let Some(boot) = transcript.of_kind("boot").next() {
            let usual_bound_ns = bound::usual_ns(boot);
            record
                .runs
                .iter_mut()
                .for_each(|run| run.usual_bound_ns = usual_bound_ns);
        }
        Ok(record)
    }

    fn end_run(&mut self, mut open: Open, times: Option<&Times>) -> Result<(), String> {
        let number = self.runs.len() as u64;
        let Some(committed) = self.commits.last() else {
            return Err(format!("run {number} has no commit before it"));
        };
        for (cluster, written) in times
            .iter()
            .flat_map(|times| times.written.iter().enumerate())
        {
            let taken = open.taken.get(cluster).copied().unwrap_or(0);
            open.lost += written.saturating_sub(taken);
        }
        let first = open.clusters.into_iter().reduce(merged);
        let run = Run {
            number,
            options: committed.options(),
            usual_bound_ns: bound::REAL_NS,
            task_set: committed.task_set.clone(),
            samplings: committed.samplings(),
            bounds_ns: committed.told.dags.iter().map(|dag| dag.bound_ns).collect(),
            events: first.unwrap_or_default(),
            lost: open.lost,
            complete: times.is_some(),
        };
        in_order(&run).map_err(|core| {
            let core = core.0;
            format!(
                "time goes back in the events of core {core} of run {number}; each core's must be \
                 in the order of time"
            )
        })?;
        self.runs.push(run);
        Ok(())
    }

    /// Returns what was committed, whose bounds are those that the analysis gives here.
    ///
    /// # Errors
    ///
    /// In words: one is another.
    pub fn proven(&self) -> Result<&[Committed], String> {
        self.commits.iter().try_for_each(Committed::check_bounds)?;
        Ok(&self.commits)
    }

    /// Returns the machine lines that the record has.
    #[must_use]
    pub fn transcript(&self) -> Transcript {
        Transcript::read(&self.lines)
    }
}

impl Open {
    fn add(&mut self, events: &Events<'_>, committed: &Committed) -> Result<(), String> {
        let (cluster, task_set) = (usize::from(events.cluster), &committed.task_set);
        let clusters = task_set.clusters().count();
        if cluster >= clusters {
            return Err(format!(
                "they are of cluster {cluster}, and there are {clusters}"
            ));
        }
        self.clusters.resize(clusters, Vec::new());
        self.taken.resize(clusters, 0);
        let gap = events.before.checked_sub(self.taken[cluster]);
        self.lost += gap.ok_or("some stand twice, or out of their order")?;
        let all = task_set.cores_of(ClusterId(events.cluster.into()), committed.told.cores);
        // Journals that were merged before they were sent are those of cluster 0.
        let last = match cluster {
            0 => committed.told.cores,
            _ => all.end,
        };
        for words in events.words() {
            let event = Event::unpack(words).ok_or("one is none that is known")?;
            let core = CoreId(event.core.0.saturating_add(all.start));
            let dag = task_set.dags().get(event.dag.index());
            let subtasks = dag.map_or(0, |dag| dag.subtasks().len());
            let is_there = event
                .subtask
                .is_none_or(|subtask| subtask.index() < subtasks);
            if core.0 >= last || dag.is_none() || !is_there || event.time_ns == u64::MAX {
                return Err(format!("{event:?} is of nothing that was committed"));
            }
            self.clusters[cluster].push(Event { core, ..event });
        }
        self.taken[cluster] = events.before + events.words().count() as u64;
        Ok(())
    }
}

/// Merges the events of two clusters by time, those of the first one before others of the same
/// time, as a kernel does that ends a run.
fn merged(ours: Vec<Event>, theirs: Vec<Event>) -> Vec<Event> {
    let mut merged = Vec::with_capacity(ours.len() + theirs.len());
    let mut theirs = theirs.into_iter().peekable();
    for event in ours {
        while let Some(earlier) = theirs.next_if(|theirs| theirs.time_ns < event.time_ns) {
            merged.push(earlier);
        }
        merged.push(event);
    }
    merged.extend(theirs);
    merged
}

/// Makes sure that time does not go back on a core.
fn in_order(run: &Run) -> Result<(), CoreId> {
    let mut latest_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    for event in &run.events {
        // These two state another core, and another time, than those of their making.
        if matches!(event.what, What::Request | What::Due) {
            continue;
        }
        let latest_ns = latest_ns.entry(event.core).or_insert(0);
        if event.time_ns < *latest_ns {
            return Err(event.core);
        }
        *latest_ns = event.time_ns;
    }
    Ok(())
}
