//! What crosses the edge of a run: written down, or taken from a recording.
//!
//! A *replay* does not call sources that are recorded, and takes their values; it gives subtasks
//! what they sampled and the time that they were told; signals come when they came. No job is
//! lost on the way: releases queue, and a fault cuts what it cut. A job that the recording has no values of, and an instance that was cut, is
//! passed over: its function is not called. What else is recorded is compared.

mod clock;

use std::cell::{Cell, RefCell};

use fass::edge::{self, Outcome, Replay};
use fass::{LatestJobs, Plan, Recorded};
use recording::{Channel, Entry, Header, Malformed, Recordable, Role, Shown, What, Writer};
use sched_dag::journal::{self, Event};
use sched_dag::law::Record;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

use clock::Clock;
pub use fass::edge::Divergence;

/// The edge of one machine.
#[derive(Debug, Default)]
pub(crate) struct Edge {
    /// What the recordings of this machine say of themselves.
    header: RefCell<Header>,
    /// The values so far, in the order in which they were complete.
    values: RefCell<Vec<Value>>,
    clock: Clock,
    /// How many jobs' inputs are kept, if not all is.
    pub(crate) most_jobs: Cell<Option<u32>>,
    latest: RefCell<Option<LatestJobs>>,
    replay: RefCell<Option<Replay>>,
}

/// An entry of the recording to be.
#[derive(Debug)]
struct Value {
    what: What,
    dag: u16,
    /// The channel; or the subtask, of what it was answered that asked for the time.
    place: u16,
    job: u64,
    at_ns: u64,
    bytes: Vec<u8>,
}

impl Value {
    fn new(header: &Header, value: &Recorded<'_>) -> Self {
        Self {
            what: value.bytes.map_or(What::Lost, |_| What::Value),
            dag: header.channels[usize::from(value.channel)].dag,
            place: value.channel,
            job: value.job,
            at_ns: value.completed_ns,
            bytes: value.bytes.unwrap_or_default().to_vec(),
        }
    }
}

fn narrow(number: u32) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

/// A value of a job, for people.
pub(crate) struct Crossed {
    /// What it is to its DAG; `None`: what a subtask was answered that asked for the time.
    pub(crate) role: Option<Role>,
    /// What wrote it, or sampled or asked.
    pub(crate) subtask: SubtaskId,
    pub(crate) topic: String,
    /// The value; `None`: it is lost.
    pub(crate) json: Option<String>,
}

fn dag_id(dag: usize) -> Option<DagId> {
    u32::try_from(dag).ok().map(DagId)
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

    /// Takes the recorded topics of a DAG.
    pub(crate) fn open(&self, dag: DagId, graph: u64, channels: &[Channel]) {
        edge::open(&mut self.header.borrow_mut(), dag, graph, channels);
    }

    /// Takes a plan, which has to fit to what is replayed. Returns the signals of the replay.
    pub(crate) fn launch(&self, plan: &mut Plan) -> Result<Vec<(DagId, u64)>, String> {
        let mut header = self.header.borrow_mut();
        edge::name(&mut header, "virtual time", &plan.task_set);
        if let Some(replay) = self.replay.borrow_mut().as_mut() {
            replay.fit(&header, &plan.task_set)?;
            replay.prepare(plan);
        }
        let latest = |jobs| {
            let latest = LatestJobs::new(&header.channels, jobs);
            latest.ok_or("there is no memory for the inputs of so many jobs")
        };
        self.latest
            .replace(self.most_jobs.get().map(latest).transpose()?);
        let task_set = &plan.task_set;
        let sporadic = (0..header.dags.len()).filter_map(dag_id);
        let sporadic = sporadic.filter(|dag| task_set.dag(*dag).is_sporadic());
        Ok(sporadic
            .filter_map(|dag| Some((dag, self.next_signal_ns(dag)?)))
            .collect())
    }

    /// Takes the next recorded signal of a DAG. A signal follows when the one before it has led
    /// to a release, for else it would be dropped where functions take longer than they took.
    pub(crate) fn next_signal_ns(&self, dag: DagId) -> Option<u64> {
        let mut replay = self.replay.borrow_mut();
        replay.as_mut()?.next_signal_ns(dag)
    }

    /// Reports whether faults of a DAG are those of a replay: what they cut is recorded.
    pub(crate) fn is_replayed(&self, dag: DagId) -> bool {
        let replay = self.replay.borrow();
        replay.as_ref().is_some_and(|replay| replay.is_of(dag))
    }

    /// Takes note that an instance of a replay has failed: nothing behind it runs in its job,
    /// whether that is recorded or not.
    pub(crate) fn failed(&self, instance: Instance, task_set: &TaskSet) {
        if let Some(replay) = self.replay.borrow_mut().as_mut() {
            replay.cut_behind(instance, task_set);
        }
    }

    /// Begins an instance.
    pub(crate) fn begin(&self, instance: Instance) {
        let of_dag = |channel: &Channel| usize::from(channel.dag) == instance.dag.index();
        let is_recorded = self.header.borrow().channels.iter().any(of_dag);
        let replay = self.replay.borrow();
        let recorded = (replay.as_ref()).and_then(|replay| replay.clock(instance));
        self.clock.begin(is_recorded, recorded.map(<[u64]>::to_vec));
    }

    /// Answers a function that asks for the time: with what was answered then, if it is
    /// recorded.
    pub(crate) fn answer_ns(&self, now_ns: u64) -> u64 {
        self.clock.answer_ns(now_ns)
    }

    /// Ends an instance, which began then.
    pub(crate) fn end(&self, instance: Instance, start_ns: u64) {
        if let Some(bytes) = self.clock.end() {
            let mut values = self.values.borrow_mut();
            if let Some(latest) = self.latest.borrow().as_ref() {
                values.retain(|value| latest.has(value.dag.into(), value.job));
            }
            values.push(Value {
                what: What::Clock,
                dag: narrow(instance.dag.0),
                place: narrow(instance.subtask.0),
                job: instance.job,
                at_ns: start_ns,
                bytes,
            });
        }
    }

    /// Takes a value of this run, and compares it with the recorded one.
    pub(crate) fn record(&self, value: &Recorded<'_>) {
        if let Some(replay) = self.replay.borrow_mut().as_mut() {
            replay.compare(value);
        }
        if let Some(latest) = self.latest.borrow_mut().as_mut() {
            latest.take(value);
            return;
        }
        let value = Value::new(&self.header.borrow(), value);
        self.values.borrow_mut().push(value);
    }

    /// Lends the recorded value of a channel of the plan.
    pub(crate) fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        let replay = self.replay.borrow();
        if let Some(value) = (replay.as_ref()).and_then(|replay| replay.value(channel, job)) {
            take(value);
        }
    }

    /// Reports whether an instance is one whose function is not called.
    pub(crate) fn passes_over(&self, instance: Instance) -> bool {
        let replay = self.replay.borrow();
        replay
            .as_ref()
            .is_some_and(|replay| replay.passes_over(instance))
    }

    /// Returns what the replay has found, if it is one; if the run is over, also a value that it has
    /// not computed.
    pub(crate) fn outcome(&self, is_over: bool) -> Outcome {
        let replay = self.replay.borrow();
        (replay.as_ref()).map_or_else(Outcome::default, |replay| replay.outcome(is_over))
    }

    /// Returns a fault of a job that is recorded and has not come again.
    pub(crate) fn unmet_fault(&self, dag: DagId, job: u64) -> Option<Divergence> {
        let replay = self.replay.borrow();
        replay.as_ref()?.unmet_fault(Some((dag, job)))
    }

    /// Reports whether a topic of a DAG is recorded.
    pub(crate) fn records(&self, dag: DagId, topic: &str) -> bool {
        let header = self.header.borrow();
        let mut channels = header.channels.iter();
        channels.any(|channel| {
            let is_of = usize::from(channel.dag) == dag.index() && channel.role.is_written();
            is_of && channel.topic == topic
        })
    }

    /// Returns the values of a job so far.
    pub(crate) fn crossed(&self, dag: DagId, job: u64) -> Vec<Crossed> {
        let header = self.header.borrow();
        let times = Vec::<u64>::schema();
        let values = self.values.borrow();
        let mut crossed = Vec::new();
        for value in values.iter() {
            if (value.dag, value.job) != (narrow(dag.0), job) {
                continue;
            }
            let channel =
                (value.what != What::Clock).then(|| &header.channels[usize::from(value.place)]);
            let (schema, bytes) = (
                channel.map_or(&times, |channel| &channel.schema),
                &value.bytes,
            );
            crossed.push(Crossed {
                role: channel.map(|channel| channel.role),
                subtask: SubtaskId(
                    channel
                        .map_or(value.place, |channel| channel.subtask)
                        .into(),
                ),
                topic: channel.map_or("the time".into(), |channel| channel.topic.clone()),
                json: (value.what != What::Lost).then(|| Shown { schema, bytes }.to_string()),
            });
        }
        crossed
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(
        &self,
        task_set: &TaskSet,
        events: &[Event],
        record: &Record,
    ) -> Vec<u8> {
        let header = self.header.borrow();
        let mut writer = Writer::new(&header);
        let release_ns = |dag: u16, job, at_ns| {
            let of_job = record.job(DagId(dag.into()), job);
            of_job.and_then(|job| job.release_ns).unwrap_or(at_ns)
        };
        let latest = self.latest.borrow();
        let kept = latest.iter().flat_map(LatestJobs::values);
        let kept: Vec<Value> = kept.map(|value| Value::new(&header, &value)).collect();
        let is_kept = |dag: usize, job| latest.as_ref().is_none_or(|latest| latest.has(dag, job));
        let values = self.values.borrow();
        let values = (values.iter()).filter(|value| is_kept(value.dag.into(), value.job));
        let values = values.chain(&kept).map(|value| Entry {
            what: value.what,
            dag: value.dag,
            place: value.place,
            job: value.job,
            release_ns: release_ns(value.dag, value.job, value.at_ns),
            at_ns: value.at_ns,
            value: &value.bytes,
        });
        let others = events.iter().filter_map(|event| {
            let is_sporadic = task_set.dag(event.dag).is_sporadic();
            // A signal is one at the instant of the release.
            let what = match event.what {
                journal::What::Due => return None,
                journal::What::Released if is_sporadic => journal::What::Due,
                what => what,
            };
            let what = edge::recorded(what)?;
            let dag = u16::try_from(event.dag.0).ok()?;
            // What was skipped or cut in the recorded run is not so here.
            if self.is_replayed(event.dag) || !is_kept(event.dag.index(), event.job) {
                return None;
            }
            Some(Entry {
                what,
                dag,
                place: event.subtask.map_or(0, |subtask| narrow(subtask.0)),
                job: event.job,
                release_ns: release_ns(dag, event.job, event.time_ns),
                at_ns: event.time_ns,
                value: &[],
            })
        });
        let replay = self.replay.borrow();
        let replayed = replay.iter().flat_map(Replay::events);
        let mut entries: Vec<Entry<'_>> = values.chain(others).chain(replayed).collect();
        entries.sort_by_key(|entry| entry.at_ns);
        entries.iter().for_each(|entry| writer.write(entry));
        writer.finish()
    }
}
