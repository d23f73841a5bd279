//! What crosses the edge of a run: written down, or taken from a recording.
//!
//! A *replay* does not call sources that are recorded, and takes their values; signals come when
//! they came. A job that the recording has no values of, and an instance that was cut, is
//! passed over: its function is not called. What else is recorded is compared.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use fass::{Plan, Recorded};
use recording::{
    Channel, DagHeader, Entry, Header, Malformed, Recording, Role, Shown, What, Writer,
};
use sched_dag::journal::{self, Event};
use sched_dag::law::Record;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

/// The edge of one machine.
#[derive(Debug, Default)]
pub(crate) struct Edge {
    /// What the recordings of this machine say of themselves.
    header: RefCell<Header>,
    /// The values so far, in the order in which they were complete.
    values: RefCell<Vec<Value>>,
    replay: RefCell<Option<Replay>>,
}

#[derive(Debug)]
struct Value {
    channel: u16,
    job: u64,
    at_ns: u64,
    bytes: Option<Vec<u8>>,
}

/// A recording that takes the place of what enters.
#[derive(Debug)]
pub(crate) struct Replay {
    header: Header,
    values: BTreeMap<(u16, u64), Vec<u8>>,
    /// The jobs of which a source has a value.
    jobs: BTreeSet<(u16, u64)>,
    cuts: BTreeSet<(u16, u16, u64)>,
    pub(crate) signals: Vec<(DagId, u64)>,
    /// For each channel of the plan that of the recording, if it has one.
    channels: Vec<Option<u16>>,
    /// How many recorded values this run can be compared with.
    to_compare: u64,
    compared: u64,
    divergence: Option<Divergence>,
}

/// The first value of a replay that is not the recorded one.
///
/// See [`VirtualTime::replay`](crate::VirtualTime::replay).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Divergence {
    /// The name of the DAG.
    pub dag: String,
    /// The topic.
    pub topic: String,
    /// The job.
    pub job: u64,
    /// The recorded value, as JSON.
    pub recorded: String,
    /// The value of this run, as JSON.
    pub computed: String,
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            dag,
            topic,
            job,
            recorded,
            computed,
        } = self;
        write!(
            f,
            "topic `{topic}` of dag `{dag}` diverges in job {job}: {recorded} is recorded, and \
             {computed} is computed; does a function share something behind the scheduler's back?"
        )
    }
}

impl Edge {
    /// Makes the machine replay a recording.
    pub(crate) fn replay(&self, bytes: &[u8]) -> Result<(), Malformed> {
        self.replay.replace(Some(Replay::read(bytes)?));
        Ok(())
    }

    pub(crate) fn is_replay(&self) -> bool {
        self.replay.borrow().is_some()
    }

    /// Takes the recorded topics of a DAG.
    pub(crate) fn open(&self, dag: DagId, graph: u64, channels: &[Channel]) {
        let mut header = self.header.borrow_mut();
        let dags = header.dags.len().max(dag.index() + 1);
        header.dags.resize(dags, DagHeader::default());
        header.dags[dag.index()].graph = graph;
        header.channels.extend_from_slice(channels);
    }

    /// Takes a plan, which has to fit to what is replayed. Returns the signals of the replay.
    pub(crate) fn launch(&self, plan: &Plan) -> Result<Vec<(DagId, u64)>, String> {
        let mut header = self.header.borrow_mut();
        header.app = "virtual time".into();
        let dags = plan.task_set.dags();
        header.dags.resize(dags.len(), DagHeader::default());
        for (header, dag) in header.dags.iter_mut().zip(dags) {
            header.name = dag.name().into();
        }
        let signals = match self.replay.borrow_mut().as_mut() {
            Some(replay) => replay.fit(&header)?,
            None => Vec::new(),
        };
        Ok(signals)
    }

    /// Takes a value of this run, and compares it with the recorded one.
    pub(crate) fn record(&self, value: &Recorded<'_>) {
        if let Some(replay) = self.replay.borrow_mut().as_mut() {
            replay.compare(&self.header.borrow(), value);
        }
        self.values.borrow_mut().push(Value {
            channel: value.channel,
            job: value.job,
            at_ns: value.completed_ns,
            bytes: value.bytes.map(<[u8]>::to_vec),
        });
    }

    /// Lends the recorded value of a channel of the plan.
    pub(crate) fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        let replay = self.replay.borrow();
        let value = replay.as_ref().and_then(|replay| {
            let channel = *replay.channels.get(usize::from(channel))?;
            replay.values.get(&(channel?, job))
        });
        if let Some(value) = value {
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

    /// Returns how many values were compared, how many were not, and the first one that
    /// differs.
    pub(crate) fn outcome(&self) -> (u64, u64, Option<Divergence>) {
        let replay = self.replay.borrow();
        replay.as_ref().map_or((0, 0, None), |replay| {
            let Replay {
                to_compare,
                compared,
                divergence,
                ..
            } = replay;
            (*compared, to_compare - compared, divergence.clone())
        })
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
        let values = self.values.borrow();
        let values = values.iter().map(|value| {
            let dag = header.channels[usize::from(value.channel)].dag;
            Entry {
                what: value.bytes.as_ref().map_or(What::Lost, |_| What::Value),
                dag,
                place: value.channel,
                job: value.job,
                release_ns: release_ns(dag, value.job, value.at_ns),
                at_ns: value.at_ns,
                value: value.bytes.as_deref().unwrap_or_default(),
            }
        });
        let others = events.iter().filter_map(|event| {
            let is_sporadic = task_set.dag(event.dag).is_sporadic();
            let what = match event.what {
                journal::What::Released if is_sporadic => What::Signal,
                journal::What::Skipped => What::Skip,
                journal::What::Cancelled => What::Cut,
                journal::What::Restarted => What::Restart,
                _ => return None,
            };
            let dag = u16::try_from(event.dag.0).ok()?;
            Some(Entry {
                what,
                dag,
                place: event
                    .subtask
                    .and_then(|subtask| u16::try_from(subtask.0).ok())
                    .unwrap_or(0),
                job: event.job,
                release_ns: release_ns(dag, event.job, event.time_ns),
                at_ns: event.time_ns,
                value: &[],
            })
        });
        let mut entries: Vec<Entry<'_>> = values.chain(others).collect();
        entries.sort_by_key(|entry| entry.at_ns);
        entries.iter().for_each(|entry| writer.write(entry));
        writer.finish()
    }
}

impl Replay {
    fn read(bytes: &[u8]) -> Result<Self, Malformed> {
        let recording = Recording::read(bytes)?;
        let header = recording.header().clone();
        let (mut values, mut jobs) = (BTreeMap::new(), BTreeSet::new());
        let (mut cuts, mut signals) = (BTreeSet::new(), Vec::new());
        for Entry {
            what,
            dag,
            place,
            job,
            release_ns,
            value,
            ..
        } in recording.entries()
        {
            match what {
                What::Value => {
                    if header.channels[usize::from(place)].role == Role::Source {
                        jobs.insert((dag, job));
                    }
                    values.insert((place, job), value.to_vec());
                }
                What::Cut => _ = cuts.insert((dag, place, job)),
                What::Signal => signals.push((DagId(dag.into()), release_ns)),
                What::Skip | What::Restart | What::Lost => {}
            }
        }
        Ok(Self {
            header,
            values,
            jobs,
            cuts,
            signals,
            channels: Vec::new(),
            to_compare: 0,
            compared: 0,
            divergence: None,
        })
    }

    /// Finds the channels of the plan.
    fn fit(&mut self, own: &Header) -> Result<Vec<(DagId, u64)>, String> {
        for (number, (recorded, dag)) in self.header.dags.iter().zip(&own.dags).enumerate() {
            if recorded.name != dag.name {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here it is `{}`; commit the DAGs \
                     that were recorded, in their order",
                    recorded.name, dag.name
                ));
            }
            if recorded.graph != 0 && recorded.graph != dag.graph {
                return Err(format!(
                    "the recording is of another graph of dag `{}`; record it again",
                    dag.name
                ));
            }
        }
        self.channels.clear();
        for Channel {
            dag,
            role,
            topic,
            schema,
            ..
        } in &own.channels
        {
            let mut others = (0..).zip(&self.header.channels);
            let found = others
                .find(|(_, other)| (other.dag, other.role, &other.topic) == (*dag, *role, topic));
            match found {
                Some((_, other)) if other.schema != *schema => {
                    return Err(format!(
                        "topic `{topic}` was recorded with values of type {}, and is of type \
                         {schema} now; record it again",
                        other.schema
                    ));
                }
                None if *role == Role::Source => {
                    return Err(format!(
                        "topic `{topic}` of a source is not in the recording; record it again"
                    ));
                }
                found => {
                    let number = found.map(|(number, _)| number);
                    let values = self.values.keys().filter(|(of, _)| Some(*of) == number);
                    self.to_compare += match role {
                        Role::Result => values.count() as u64,
                        _ => 0,
                    };
                    self.channels.push(number);
                }
            }
        }
        Ok(self.signals.clone())
    }

    fn passes_over(&self, instance: Instance) -> bool {
        let Instance {
            dag: DagId(dag),
            subtask: SubtaskId(subtask),
            job,
        } = instance;
        let (Ok(dag), Ok(subtask)) = (u16::try_from(dag), u16::try_from(subtask)) else {
            return false;
        };
        let is_recorded = |channel: &Channel| channel.dag == dag && channel.role == Role::Source;
        let has_sources = self.header.channels.iter().any(is_recorded);
        has_sources
            && (!self.jobs.contains(&(dag, job)) || self.cuts.contains(&(dag, subtask, job)))
    }

    fn compare(&mut self, own: &Header, value: &Recorded<'_>) {
        let number = usize::from(value.channel);
        let (channel, bytes) = (&own.channels[number], value.bytes.unwrap_or_default());
        if channel.role == Role::Source {
            // It is where the value is from.
            return;
        }
        let Some(recorded) =
            (self.channels[number]).and_then(|number| self.values.get(&(number, value.job)))
        else {
            return;
        };
        self.compared += 1;
        if recorded != bytes && self.divergence.is_none() {
            let shown = |bytes| {
                Shown {
                    schema: &channel.schema,
                    bytes,
                }
                .to_string()
            };
            self.divergence = Some(Divergence {
                dag: own.dags[usize::from(channel.dag)].name.clone(),
                topic: channel.topic.clone(),
                job: value.job,
                recorded: shown(recorded),
                computed: shown(bytes),
            });
        }
    }
}
