//! The record of a boot, read: its commits, and the events and times of its runs.
//!
//! A record comes as a file, or as lines of a serial log containing the file's bytes. Every view of
//! a run (shown, judged, drawn or computed) is derived from the record.

mod hops;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use recording::{Chunk, Commit, CommittedDag, Events, MAGIC, Recording, Times};
use sched_dag::analysis::{self, AnalysisResult, AnalysisSettings, Overheads};
use sched_dag::chains::SampledEdge;
use sched_dag::journal::{Event, EventKind};
use sched_dag::law::JudgeOptions;
use sched_dag::{
    Activation, ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, CoreId, DagId, DagSpec,
    FaultLimit, LockUse, OnFault, OverrunPolicy, Policy, Preemption, Priority, SchedulerOptions,
    SubtaskId, SubtaskSpec, TaskSet, Wait, verify,
};

use text::MOST_CORES;

use crate::protocol::{MachineLine, Transcript, read_line};

// The tolerances: each is the longest time for which an instance may wait for a core owed to it by
// the rules. A decision takes effect only after an interrupt, and where a run's time is real, the
// host may do something else meanwhile. In mode `deterministic` the host cannot delay a run, so
// such a record is judged more strictly.

/// The tolerance in counted time. It covers time slices and the kernel's steps, and these grow with
/// the number of simultaneous events.
pub const COUNTED_TOLERANCE_NS: u64 = 50_000;

/// The tolerance in real time.
pub const REAL_TOLERANCE_NS: u64 = 1_000_000;

/// The tolerance on Linux by SCHED_FIFO, where interrupts and a hypervisor take time, too.
pub const FIFO_TOLERANCE_NS: u64 = 5_000_000;

/// The tolerance on Linux by `sched_ext`, where all real-time programs take precedence, too.
pub const SCHED_EXT_TOLERANCE_NS: u64 = 10_000_000;

/// The tolerance on Linux by ordinary threads, delayed by every program.
pub const NORMAL_TOLERANCE_NS: u64 = 100_000_000;

pub use hops::{Heard, Hop, Link, Machine};

/// The record of a boot.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// The machine lines, as far as the record contains them.
    pub lines: String,
    /// The commits, one after the other.
    pub commits: Vec<CommittedDags>,
    /// The runs. The last run may have died.
    pub runs: Vec<Run>,
    /// The times of each ended run, each with the index of its commit.
    pub times: Vec<(usize, Times)>,
    /// The messages heard by sources from other machines.
    pub heard: Vec<Heard>,
}

/// Events of a run still being read, by cluster.
#[derive(Default)]
struct OpenRun {
    clusters: Vec<Vec<Event>>,
    /// The number of events lost so far.
    lost: u64,
    /// The number of events written so far by each journal.
    taken: Vec<u64>,
}

/// Returns the bytes of the record in a log; none for a log without a record.
///
/// # Errors
///
/// In words: the damaged line of the record.
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

/// Decodes base 64 (RFC 4648, section 4); `None` if the text is malformed.
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
        // Four digits at a time; a shorter rest, or more than two pads, is no base 64.
        if four.len() != 4 || pad > 2 {
            return None;
        }
        let bits = (0..4).fold(0_u32, |bits, place| {
            bits << 6 | u32::from(digits.get(place).copied().unwrap_or(0))
        });
        // Each pad stands for a byte less.
        bytes.extend(&bits.to_be_bytes()[1..4 - pad]);
    }
    Some(bytes)
}

impl Record {
    /// Reads a record, or a log with a record in its lines. The record of a boot that died contains
    /// the part sent until then.
    ///
    /// # Errors
    ///
    /// In words: the fault and its position.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        if bytes.starts_with(&MAGIC) {
            let whole = recording::completed(bytes).map_err(|malformed| malformed.to_string())?;
            let recording = Recording::read(&whole).map_err(|malformed| malformed.to_string())?;
            return Self::of(&recording, String::new());
        }
        // A damaged line for people is no fault; a damaged machine line is found below.
        Self::of_log(&String::from_utf8_lossy(bytes))
    }

    /// Reads the record in a log.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn of_log(log: &str) -> Result<Self, String> {
        Self::sent(&bytes_of_log(log)?, log)
    }

    /// Reads the record sent by a guest, which may have died, together with the log printed by the
    /// guest.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn sent(bytes: &[u8], log: &str) -> Result<Self, String> {
        let mut whole = Cow::Borrowed(bytes);
        if bytes.is_empty() {
            // A boot that recorded nothing has no bytes.
            whole = Cow::Owned(recording::Writer::begin(Vec::new()).end());
        } else if Recording::read(bytes).is_err() {
            let mended = recording::mended(bytes);
            whole = Cow::Owned(mended.map_err(|malformed| format!("the record, {malformed}"))?);
        }
        let recording = Recording::read(&whole);
        let recording = recording.map_err(|malformed| format!("the record, {malformed}"))?;
        Self::of(&recording, log.into())
    }

    /// Reads the chunks of a recording, and adds known machine lines.
    ///
    /// # Errors
    ///
    /// In words: the first chunk or event impossible in a run.
    pub fn of(recording: &Recording<'_>, lines: String) -> Result<Self, String> {
        let mut record = Self {
            lines,
            ..Self::default()
        };
        let mut open = OpenRun::default();
        for chunk in recording.chunks() {
            match chunk {
                Chunk::Header(_) | Chunk::Entry(_) => {}
                Chunk::Text(text) => record.lines += text,
                Chunk::Commit(_) if !open.taken.is_empty() => {
                    return Err(format!("a commit within run {}", record.runs.len()));
                }
                Chunk::Commit(commit) => {
                    let committed = CommittedDags::new(record.commits.len(), commit)?;
                    record.commits.push(committed);
                }
                Chunk::Events(events) => {
                    let run = record.runs.len();
                    let add = |committed| open.add(&events, committed);
                    let added = record.commits.last().ok_or("no commit is before it".into());
                    let added = added.and_then(add);
                    added.map_err(|why| format!("events of run {run}: {why}"))?;
                }
                Chunk::Times(times) => {
                    // The times come last: they end the run whose events came before.
                    record.end_run(std::mem::take(&mut open), Some(&times))?;
                    record.times.push((record.commits.len() - 1, times));
                }
            }
        }
        // Events without times belong to a run that died.
        if !open.taken.is_empty() {
            record.end_run(open, None)?;
        }
        if let Some(commit) = record.commits.first() {
            record.heard = hops::heard(recording, &commit.told.dags);
        }
        let transcript = Transcript::read(&record.lines);
        // Only now, since the line may come in any chunk of text.
        if let Some(boot) = transcript.of_kind("boot").next() {
            let usual_bound_ns = usual_tolerance_ns(boot);
            let runs = record.runs.iter_mut();
            runs.for_each(|run| run.usual_bound_ns = usual_bound_ns);
        }
        Ok(record)
    }

    fn end_run(&mut self, mut open: OpenRun, times: Option<&Times>) -> Result<(), String> {
        let number = self.runs.len() as u64;
        let Some(committed) = self.commits.last() else {
            return Err(format!("run {number} has no commit before it"));
        };
        let written = times.iter().flat_map(|times| &times.written);
        for (cluster, written) in written.enumerate() {
            let taken = open.taken.get(cluster).copied().unwrap_or(0);
            // Events that were written and not sent are lost, too.
            open.lost += written.saturating_sub(taken);
        }
        let first = open.clusters.into_iter().reduce(merged);
        let run = Run {
            number,
            commit: Arc::new(committed.clone()),
            options: committed.options(),
            usual_bound_ns: REAL_TOLERANCE_NS,
            task_set: committed.task_set.clone(),
            samplings: committed.samplings(),
            machines: Vec::new(),
            links: Vec::new(),
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

    /// Returns the commits, after a check that the analysis here gives the same bounds.
    ///
    /// # Errors
    ///
    /// In words: the first bound that differs.
    pub fn proven(&self) -> Result<&[CommittedDags], String> {
        let mut commits = self.commits.iter();
        commits.try_for_each(|commit| commit.check_bounds().map(|_| ()))?;
        Ok(&self.commits)
    }

    /// Returns the machine lines in the record.
    pub fn transcript(&self) -> Transcript {
        Transcript::read(&self.lines)
    }
}

impl OpenRun {
    fn add(&mut self, events: &Events<'_>, committed: &CommittedDags) -> Result<(), String> {
        let (cluster, task_set) = (usize::from(events.cluster), &committed.task_set);
        let clusters = task_set.clusters().count();
        if cluster >= clusters {
            let there = format!("there are {clusters}");
            return Err(format!("they are of cluster {cluster}, and {there}"));
        }
        self.clusters.resize(clusters, Vec::new());
        self.taken.resize(clusters, 0);
        // A gap in the numbering means lost events; an overlap means a damaged record.
        let gap = events.before.checked_sub(self.taken[cluster]);
        self.lost += gap.ok_or("some stand twice, or out of their order")?;
        let all = task_set.cores_of(ClusterId(events.cluster.into()), committed.told.cores);
        // Journals merged before sending come as cluster 0, with events of all cores.
        let last = match cluster {
            0 => committed.told.cores,
            _ => all.end,
        };
        for words in events.words() {
            let event = Event::unpack(words).ok_or("one is none that is known")?;
            // A journal numbers the cores within its cluster.
            let core = CoreId(event.core.0.saturating_add(all.start));
            let dag = task_set.dags().get(event.dag.index());
            let subtasks = dag.map_or(0, |dag| dag.subtasks().len());
            let is_known = |subtask: SubtaskId| subtask.index() < subtasks;
            let is_there = event.subtask.is_none_or(is_known);
            if core.0 >= last || dag.is_none() || !is_there || event.time_ns == u64::MAX {
                return Err(format!("{event:?} is of nothing that was committed"));
            }
            self.clusters[cluster].push(Event { core, ..event });
        }
        self.taken[cluster] = events.before + events.words().count() as u64;
        Ok(())
    }
}

/// Merges the events of two clusters by time. At equal times the events of the first cluster come
/// first, as in a kernel that ends a run.
pub(crate) fn merged(ours: Vec<Event>, theirs: Vec<Event>) -> Vec<Event> {
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
        // These two kinds carry the core and the time of their subject, not of their writing.
        if matches!(event.what, EventKind::Request | EventKind::Due) {
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

/// DAGs committed together, and their bounds.
#[derive(Clone, Debug, Default)]
pub struct CommittedDags {
    /// The number within the boot, from 0.
    pub number: usize,
    /// The commit, as in the record.
    pub told: Commit,
    /// The commit as specifications.
    pub specs: Vec<DagSpec>,
    /// The commit as a model.
    pub task_set: TaskSet,
}

impl CommittedDags {
    /// Makes the model, as a commit does.
    ///
    /// # Errors
    ///
    /// The reasons for which a commit would refuse the DAGs.
    pub fn new(number: usize, told: Commit) -> Result<Self, String> {
        let in_commit = |why: String| format!("commit {number}: {why}");
        if !(1..=MOST_CORES).contains(&told.cores) {
            let possible = format!("1 to {MOST_CORES} are possible");
            return Err(in_commit(format!(
                "it is for {} cores; {possible}",
                told.cores
            )));
        }
        let known = Policy::WORDS;
        if usize::from(told.policy) >= known.len() {
            let (policy, known) = (told.policy, known.join(", "));
            let why = format!("its policy is number {policy}; known are {known}, from 0 on");
            return Err(in_commit(why));
        }
        let specs: Result<Vec<_>, String> = told.dags.iter().map(spec).collect();
        let mut specs = specs.map_err(in_commit)?;
        for &(dag, subtask, limit_ns, segment_ns) in &told.waits {
            let place = subtask_of(&mut specs, dag, subtask);
            let place = place.ok_or_else(|| in_commit("a wait is of no subtask".into()))?;
            let wait = Wait {
                limit_ns,
                segment_ns,
            };
            place.waits.push(wait);
        }
        if !told.pins.is_empty() {
            let why = "it has pins, which there are no more; read it by the version that wrote it";
            return Err(in_commit(why.into()));
        }
        for &(dag, core) in &told.affinities {
            let place = specs.get_mut(DagId(dag).index());
            let place = place.ok_or_else(|| in_commit("an affinity is of no dag".into()))?;
            place.affinity.push(core);
        }
        for (dag, subtask, lock, longest_ns, sections) in &told.locks {
            let place = subtask_of(&mut specs, *dag, *subtask);
            place.ok_or_else(|| in_commit("a lock is of no subtask".into()))?;
            specs[DagId(*dag).index()].locks.push(LockUse {
                subtask: SubtaskId(*subtask).index(),
                lock: lock.clone(),
                longest_ns: *longest_ns,
                sections: *sections,
                is_shared: false,
            });
        }
        let clusters = match &told.clusters[..] {
            [] => CoreDivision::Undivided,
            sizes => CoreDivision::Of(sizes.to_vec()),
        };
        let mut committed = Self {
            number,
            specs,
            task_set: TaskSet::default(),
            told,
        };
        let lists = &committed.told.lists;
        let task_set = task_set(committed.options(), clusters, lists, &committed.specs);
        committed.task_set = task_set.map_err(in_commit)?;
        Ok(committed)
    }

    /// Returns the options of the scheduler.
    pub fn options(&self) -> SchedulerOptions {
        SchedulerOptions {
            policy: Policy::ALL[usize::from(self.told.policy)],
            preemption: match self.told.is_preemptive {
                true => Preemption::Enabled,
                false => Preemption::Disabled,
            },
            cores: self.told.cores,
        }
    }

    /// Returns the assumptions of the analysis besides the DAGs.
    pub fn settings(&self) -> AnalysisSettings {
        let options = self.options();
        AnalysisSettings {
            policy: options.policy,
            preemption: options.preemption,
            cores: options.cores,
            // The record has only these numbers, and the analysis derives no others from overheads.
            overheads: Overheads {
                // `None` is a charge without an end: no bound must come out here either.
                dispatch_ns: (self.told.charge_ns)
                    .map_or(u64::MAX, |ns| ns.saturating_sub(self.told.move_ns)),
                interrupt_ns: self.told.move_ns,
                ready_ns: self.told.ready_ns,
                device_ns: self.told.device_ns[0],
                device_distance_ns: self.told.device_ns[1],
                ..Overheads::default()
            },
        }
    }

    /// Returns the answer of the analysis here, after a check that the bounds are the same.
    ///
    /// # Errors
    ///
    /// In words: the first bound that differs.
    pub fn check_bounds(&self) -> Result<AnalysisResult, String> {
        let answer = analysis::answer(&self.task_set, &self.settings());
        let here = answer.bounds.iter();
        let here = here.map(|bound| bound.map(|bound| bound.bound_ns));
        for (dag, host) in self.told.dags.iter().zip(here) {
            let guest = dag.bound_ns;
            if guest != host {
                return Err(format!(
                    "the bound of dag `{}` in commit {} is {guest:?} ns by the guest and {host:?} \
                     ns by the same analysis here; report this",
                    dag.name, self.number
                ));
            }
        }
        Ok(answer)
    }

    /// Returns the pairs of subtasks in which one samples the other's topic, as positions in the
    /// model.
    pub fn samplings(&self) -> Vec<SampledEdge> {
        let dags = (0..).map(DagId).zip(&self.told.dags);
        let sampling = |(dag, &(reader, writer, topic, _))| {
            let of_writer = self.told.dags.get(usize::try_from(writer).ok()?)?;
            let topic = of_writer.topics.get(usize::try_from(topic).ok()?)?;
            Some(SampledEdge {
                writer: self.subtask_ref(DagId(writer), topic.writer)?,
                reader: self.subtask_ref(dag, reader)?,
            })
        };
        dags.flat_map(|(id, dag)| dag.samples.iter().map(move |sample| (id, sample)))
            .filter_map(sampling)
            .collect()
    }

    fn subtask_ref(&self, dag: DagId, subtask: u32) -> Option<(DagId, SubtaskId)> {
        let model = self.task_set.dags().get(dag.index())?;
        let subtask = SubtaskId(subtask);
        (subtask.index() < model.subtasks().len()).then_some((dag, subtask))
    }
}

/// Makes a model of DAGs, as a commit does.
///
/// # Errors
///
/// The reasons for which a commit would refuse the DAGs.
pub fn task_set(
    options: SchedulerOptions,
    clusters: CoreDivision,
    lists: &[String],
    dags: &[DagSpec],
) -> Result<TaskSet, String> {
    if dags.is_empty() {
        return Ok(TaskSet::default());
    }
    let options = CommitOptions::new(options.policy, options.cores)
        .with_construction(ConstructionPolicy::any_graph())
        .with_clusters(clusters)
        .with_lists(lists)
        .with_instance_limit(u32::MAX);
    let verified = verify(dags, &options).map_err(|rejected| {
        let faults: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
        faults.join("; ")
    })?;
    Ok(verified.task_set)
}

fn subtask_of(specs: &mut [DagSpec], dag: u32, subtask: u32) -> Option<&mut SubtaskSpec> {
    let dag = specs.get_mut(DagId(dag).index())?;
    dag.subtasks.get_mut(SubtaskId(subtask).index())
}

fn spec(dag: &CommittedDag) -> Result<DagSpec, String> {
    let name = &dag.name;
    let mut subtasks: Vec<SubtaskSpec> = (dag.subtasks.iter())
        .map(|subtask| SubtaskSpec {
            name: subtask.name.clone(),
            wcet_ns: subtask.wcet_ns,
            priority: Some(Priority(subtask.priority)),
            non_preemptive: subtask.is_non_preemptive,
            ..SubtaskSpec::default()
        })
        .collect();
    let index = |subtask: u32| usize::try_from(subtask).unwrap_or(usize::MAX);
    let edges = dag.edges.iter().map(|&(from, to)| (index(from), index(to)));
    // With one sink the deadline is the DAG's own.
    for &(sink, deadline_ns) in dag.sinks.iter().filter(|_| dag.sinks.len() > 1) {
        // A deadline of a subtask with successors is no sink's; the record is damaged.
        let is_followed = dag.edges.iter().any(|(from, _)| *from == sink);
        let subtask = subtasks.get_mut(index(sink)).filter(|_| !is_followed);
        let subtask = subtask.ok_or_else(|| format!("dag `{name}` has no sink {sink}"))?;
        subtask.relative_deadline_ns = Some(deadline_ns);
    }
    Ok(DagSpec {
        cluster: dag.cluster.map(ClusterId),
        name: name.clone(),
        activation: match dag.is_sporadic {
            true => Activation::Sporadic,
            false => Activation::Periodic,
        },
        period_ns: Some(dag.period_ns),
        relative_deadline_ns: Some(dag.relative_deadline_ns),
        offset_ns: dag.offset_ns,
        in_flight: Some(dag.in_flight),
        // A table passes entries of later jobs.
        jobs: dag.jobs,
        overrun: match dag.overrun {
            0 => OverrunPolicy::Queue,
            1 => OverrunPolicy::Skip,
            2 => OverrunPolicy::Abort,
            other => {
                let remedy = "0 to 2 are known";
                return Err(format!("dag `{name}` has overrun policy {other}; {remedy}"));
            }
        },
        on_fault: match dag.survives {
            None => OnFault::EndDag,
            Some((faults, window, in_all)) => OnFault::DropJob(FaultLimit {
                faults,
                window,
                in_all,
            }),
        },
        subtasks,
        edges: edges.collect(),
        ..DagSpec::default()
    })
}

/// A run: its model, and its events.
#[derive(Clone, Debug)]
pub struct Run {
    /// The number within the boot, from 0.
    pub number: u64,
    /// The commit; for a joint run, the commit of the first machine.
    pub commit: Arc<CommittedDags>,
    /// The options by which the run was scheduled.
    pub options: SchedulerOptions,
    /// The tolerance for late decisions if none is given, in nanoseconds.
    pub usual_bound_ns: u64,
    /// The DAGs.
    pub task_set: TaskSet,
    /// The samplings of subtasks.
    pub samplings: Vec<SampledEdge>,
    /// The machines of a joint run.
    pub machines: Vec<Machine>,
    /// The links between the machines.
    pub links: Vec<Link>,
    /// The bound proven for each DAG.
    pub bounds_ns: Vec<Option<u64>>,
    /// The events, in the order of the journal.
    pub events: Vec<Event>,
    /// The number of lost events; a judge takes all of them for older than the others.
    pub lost: u64,
    /// Whether the run has ended in order, so no events are missing at its end.
    pub complete: bool,
}

impl Run {
    /// Returns the cores of each machine, with its name.
    pub fn cores(&self) -> Vec<(String, Range<u32>)> {
        let of = |it: &Machine| (format!("{}:", it.name), it.cores.clone());
        match &self.machines[..] {
            [] => vec![(String::new(), 0..self.options.cores)],
            machines => machines.iter().map(of).collect(),
        }
    }

    /// Returns the terms for judging the run, with a tolerance in nanoseconds.
    pub const fn terms(&self, bound_ns: u64) -> JudgeOptions {
        JudgeOptions {
            is_whole: self.lost == 0,
            is_complete: self.complete,
            tolerance_ns: bound_ns,
            late_ns: 0,
        }
    }
}

/// Returns the bound chosen by a person, or else the usual bound of the run.
pub fn tolerance_ns(run: &Run, bound_us: Option<u64>) -> u64 {
    bound_us.map_or(run.usual_bound_ns, |bound_us| bound_us.saturating_mul(1000))
}

/// Returns the usual bound of a boot's runs from its line of kind `boot`. The tool passes each
/// guest its mode, and a program on Linux says whether it can preempt, and by which mechanism.
fn usual_tolerance_ns(boot: &MachineLine) -> u64 {
    let words = boot.text_at("command_line").unwrap_or_default();
    let word = |name: &str| words.split(' ').find_map(|word| word.strip_prefix(name));
    match word("mode=") {
        Some("deterministic") => COUNTED_TOLERANCE_NS,
        _ if boot.text_at("clock") != Some("linux") => REAL_TOLERANCE_NS,
        // Without preemption an instance waits for others' whole executions.
        _ if !boot.text.contains("\"preemptive\":true") => NORMAL_TOLERANCE_NS,
        _ if word("mechanism=") == Some("sched_ext") => SCHED_EXT_TOLERANCE_NS,
        _ => FIFO_TOLERANCE_NS,
    }
}

#[cfg(test)]
pub(crate) mod tests;
