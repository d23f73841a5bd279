//! The edge of a run: records values, or takes them from a recording.
//!
//! A *replay* does not call recorded sources, but takes their recorded values. Subtasks get their
//! recorded samples, answers of devices and clock readings, and signals come at their recorded
//! times. No job is lost on the way: releases queue, and a fault cuts the same instances as in the
//! recorded run. A job without recorded values and a cut instance are passed over, without calls of
//! their functions. All other recorded values are compared.

use std::cell::RefCell;

use fass::edge::{self, Replay};
use fass::edge::{LatestJobs, RecordedValue};
use fass::platform::Plan;
use recording::{Channel, Entry, EntryKind, Header, Malformed};
use sched_dag::engine::Run;
use sched_dag::journal::{self, Event};
use sched_dag::{DagId, Instance, TaskSet};

pub use fass::edge::Divergence;

use crate::VirtualTime;

/// The edge of one machine.
#[derive(Debug, Default)]
pub(crate) struct Edge {
    /// The header of this machine's recordings.
    header: RefCell<Header>,
    /// The values so far, in the order of their completion.
    values: RefCell<Vec<Kept>>,
    /// The clock readings given to the running instance in its turn, if they are recorded.
    told: RefCell<Vec<u64>>,
    /// The inputs of the last jobs, unless everything is kept.
    latest: RefCell<Option<LatestJobs>>,
    replay: RefCell<Option<Replay>>,
    /// The beginning of the record: the commit.
    pub(crate) committed: RefCell<Option<edge::BootRecord<Vec<u8>>>>,
}

/// An entry of the future recording, without its value, and the value.
#[derive(Debug)]
struct Kept {
    entry: Entry<'static>,
    bytes: Vec<u8>,
}

/// Returns an entry without its value, of a job whose release is not known yet.
fn entry(what: EntryKind, [dag, place]: [u16; 2], job: u64, at_ns: u64) -> Entry<'static> {
    Entry {
        what,
        dag,
        place,
        job,
        release_ns: at_ns,
        at_ns,
        value: &[],
    }
}

impl Kept {
    fn new(header: &Header, value: &RecordedValue<'_>) -> Self {
        let RecordedValue { channel, job, .. } = *value;
        let what = value.bytes.map_or(EntryKind::Lost, |_| EntryKind::Value);
        let of = [header.channels[usize::from(channel)].dag, channel];
        Self {
            entry: entry(what, of, job, value.completed_ns),
            bytes: value.bytes.unwrap_or_default().to_vec(),
        }
    }
}

impl VirtualTime {
    /// Replays a recording. The values of recorded sources ([`Dag::record`](fass::Dag::record))
    /// come from the recording instead of calls, and so do samples, recorded answers of devices and
    /// clock readings. Jobs without recorded values are passed over, and only recorded signals
    /// come, at their times. To be called before the commit. The commit is refused if the recording
    /// has another graph, other types or other release times, if other sources are recorded now, or
    /// if the recording has lost a source's value.
    ///
    /// Values written by other subtasks to recorded topics are compared, and so are recorded
    /// states: [`Report::compared`](crate::Report::compared) counts those, and
    /// [`Report::uncompared`](crate::Report::uncompared) the others, where the run is not over or
    /// the topic is not recorded any more. [`Report::divergence`](crate::Report::divergence) is the
    /// first difference.
    ///
    /// # Errors
    ///
    /// The bytes are not a recording, or have been altered.
    ///
    /// See [`Dag::record`](fass::Dag::record) for an example.
    pub fn replay(self, recording: &[u8]) -> Result<Self, Malformed> {
        self.machine.edge.replay(recording)?;
        Ok(self)
    }

    /// Begins the replay as late as possible for computing this job from recorded data: with the
    /// last job, up to this one, of which all states of the DAG are recorded
    /// ([`State::record`](fass::shared::State::record)), or, for a DAG without recorded states,
    /// with the job itself. Other DAGs begin with their jobs of the same time. To be called before
    /// the commit. The commit is refused if no inputs of the named DAG are recorded.
    ///
    /// See [`State::record`](fass::shared::State::record) for an example.
    pub fn from(self, dag: &str, job: u64) -> Self {
        let edge = &self.machine.edge;
        edge.of_replay(|replay| replay.begin_before(dag, job));
        self
    }

    /// Keeps only the inputs of each DAG's last jobs, in memory allocated at the commit, like a
    /// machine that records nothing else. So [`recording`](Self::recording) has the inputs leading
    /// to a fault, but no results. The recording contains nothing a function remembers of earlier
    /// jobs, except in recorded states. Each state is written down at least twice in each span of
    /// `jobs` jobs.
    ///
    /// ```
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new().contain_panics().keep_latest(16);
    /// ```
    pub fn keep_latest(self, jobs: u32) -> Self {
        self.set(|settings| settings.most_jobs = Some(jobs))
    }
}

fn narrow(number: u32) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

impl Edge {
    /// Makes the machine replay a recording.
    pub(crate) fn replay(&self, bytes: &[u8]) -> Result<(), Malformed> {
        self.replay.replace(Some(Replay::read(bytes.to_vec())?));
        Ok(())
    }

    pub(crate) fn is_replay(&self) -> bool {
        self.replay.borrow().is_some()
    }

    /// Asks the replay, if there is one.
    pub(crate) fn of_replay<T: Default>(&self, ask: impl FnOnce(&mut Replay) -> T) -> T {
        let mut replay = self.replay.borrow_mut();
        replay.as_mut().map(ask).unwrap_or_default()
    }

    /// Reports whether faults of a DAG come from a replay: their cuts are recorded.
    pub(crate) fn is_replayed(&self, dag: DagId) -> bool {
        self.of_replay(|replay| replay.is_of(dag))
    }

    /// Takes the recorded topics of a DAG.
    pub(crate) fn open(&self, dag: DagId, graph: u64, channels: &[Channel]) {
        edge::open(&mut self.header.borrow_mut(), dag, graph, channels);
    }

    /// Takes a plan, checking that it fits the replayed recording. Keeps the inputs of `most_jobs`
    /// jobs, or of all jobs.
    pub(crate) fn launch(&self, plan: &mut Plan, most_jobs: Option<u32>) -> Result<(), String> {
        let mut header = self.header.borrow_mut();
        edge::name(&mut header, "virtual time", &plan.task_set);
        if let Some(replay) = self.replay.borrow_mut().as_mut() {
            replay.fit(&header, &plan.task_set)?;
            replay.prepare(plan);
        }
        if let Some(jobs) = most_jobs {
            plan.keep_states_of(jobs);
            let latest = LatestJobs::new(&header.channels, jobs);
            let latest = latest.ok_or("there is no memory for the inputs of so many jobs")?;
            self.latest.replace(Some(latest));
        }
        Ok(())
    }

    /// Answers a function asking for the time. In a replay, returns the recorded answer, if there
    /// is one.
    pub(crate) fn answer_ns(&self, instance: Option<Instance>, now_ns: u64) -> u64 {
        let header = self.header.borrow();
        // Only for DAGs with recorded channels: the others are never replayed.
        let is_noted = |of: &Instance| {
            let mut channels = header.channels.iter();
            channels.any(|channel| usize::from(channel.dag) == of.dag.index())
        };
        let Some(instance) = instance.filter(is_noted) else {
            return now_ns;
        };
        let told_ns = self.of_replay(|replay| replay.next_told_ns(instance));
        let answer_ns = told_ns.unwrap_or(now_ns);
        self.told.borrow_mut().push(answer_ns);
        answer_ns
    }

    /// Ends an instance's turn that began at `start_ns`.
    pub(crate) fn finish_turn(&self, instance: Instance, start_ns: u64) {
        let answers = self.told.take();
        if answers.is_empty() {
            return;
        }
        let mut values = self.values.borrow_mut();
        if let Some(latest) = self.latest.borrow().as_ref() {
            // Clock readings are kept as long as the inputs of their jobs, so memory does not grow
            // with the run.
            values.retain(|Kept { entry, .. }| latest.has(entry.dag.into(), entry.job));
        }
        let of = [instance.dag.0, instance.subtask.0].map(narrow);
        values.push(Kept {
            entry: entry(EntryKind::Clock, of, instance.job, start_ns),
            bytes: recording::to_bytes(&answers),
        });
    }

    /// Takes a value of this run, and compares the value with the recorded one.
    pub(crate) fn record(&self, value: &RecordedValue<'_>) {
        self.of_replay(|replay| replay.compare(value));
        match self.latest.borrow_mut().as_mut() {
            Some(latest) => latest.store(value),
            None => {
                let kept = Kept::new(&self.header.borrow(), value);
                self.values.borrow_mut().push(kept);
            }
        }
    }

    /// Lends the recorded value of a channel of the plan.
    pub(crate) fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        // Copied, as `take` may be the app's code, and ask for the time.
        let value = self.of_replay(|replay| replay.value(channel, job).map(<[u8]>::to_vec));
        value.as_deref().into_iter().for_each(take);
    }

    /// Returns the record of the run so far.
    pub(crate) fn recording(&self, run: &Run) -> Vec<u8> {
        let (header, values) = (self.header.borrow(), self.values.borrow());
        let latest = self.latest.borrow();
        let is_kept = |entry: &Entry<'_>| {
            let latest = latest.as_ref();
            latest.is_none_or(|latest| latest.has(entry.dag.into(), entry.job))
        };
        let inputs = latest.iter().flat_map(LatestJobs::values);
        let inputs: Vec<Kept> = inputs.map(|value| Kept::new(&header, &value)).collect();
        let values = values
            .iter()
            .chain(&inputs)
            .map(|Kept { entry, bytes }| Entry {
                value: bytes,
                ..*entry
            });
        let events = run.journal().events();
        let events = events.filter_map(|event| self.recorded(&event, run.task_set()));
        let mut entries: Vec<Entry<'_>> = values.chain(events).filter(is_kept).collect();
        for entry in &mut entries {
            let job = run.record().job(DagId(entry.dag.into()), entry.job);
            let release_ns = job.and_then(|job| job.release_ns);
            // A job never released, such as a skipped job, has the time of its event.
            entry.release_ns = release_ns.unwrap_or(entry.at_ns);
        }
        let replay = self.replay.borrow();
        entries.extend(replay.iter().flat_map(Replay::events));
        // The sort is stable: at one instant values stay before events, as completions are before
        // releases.
        entries.sort_by_key(|entry| entry.at_ns);
        let Some(mut record) = self.committed.borrow().clone() else {
            return Vec::new();
        };
        record.file().header(&header);
        entries.iter().for_each(|entry| record.file().write(entry));
        // A machine keeping only the latest jobs keeps no events, either.
        if self.latest.borrow().is_none() {
            record.end_run(run);
        }
        record.finish()
    }

    /// Returns a recording's entry for an event, if there is one. Skips and cuts of the recorded
    /// run do not appear here.
    fn recorded(&self, event: &Event, task_set: &TaskSet) -> Option<Entry<'static>> {
        let what = match event.what {
            // A signal counts at the instant of the release.
            journal::EventKind::Due => return None,
            journal::EventKind::Released if task_set.dag(event.dag).is_sporadic() => {
                journal::EventKind::Due
            }
            what => what,
        };
        let what = edge::recorded(what).filter(|_| !self.is_replayed(event.dag))?;
        let subtask = event.subtask.map_or(0, |subtask| subtask.0);
        let of = [event.dag.0, subtask].map(narrow);
        Some(entry(what, of, event.job, event.time_ns))
    }
}
