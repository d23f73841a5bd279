//! What a replay takes from a recording, and what it finds.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use fass::Recorded;
use recording::{Channel, Entry, Header, Malformed, Recording, Role, Shown, What};
use sched_dag::{DagId, Instance, SubtaskId};

/// A recording that takes the place of what enters.
#[derive(Debug)]
pub(super) struct Replay {
    header: Header,
    values: BTreeMap<(u16, u64), Vec<u8>>,
    /// The jobs of which a source has a value.
    jobs: BTreeSet<(u16, u64)>,
    cuts: BTreeSet<(u16, u16, u64)>,
    /// The releases, if the DAG is sporadic; those of skipped jobs, too, so that the jobs after
    /// them keep their numbers.
    pub(super) signals: Vec<(DagId, u64)>,
    /// The first value of a source that is lost: its channel and job.
    lost: Option<(u16, u64)>,
    /// For each channel of the plan that of the recording, if it has one.
    channels: Vec<Option<u16>>,
    /// How many recorded values this run can be compared with.
    to_compare: u64,
    /// The channels and jobs of this run whose values were compared.
    compared: BTreeSet<(u16, u64)>,
    divergence: Option<Divergence>,
}

/// The first value of a replay that is not the recorded one, or, if all that were computed are,
/// the first recorded one that was not computed.
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
    /// The value of this run, as JSON; none if the run is over and has computed none.
    pub computed: Option<String>,
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
            "topic `{topic}` of dag `{dag}` diverges in job {job}: {recorded} is recorded, and {} is \
             computed; does a function share something behind the scheduler's back?",
            computed.as_deref().unwrap_or("nothing")
        )
    }
}

impl Replay {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, Malformed> {
        let recording = Recording::read(bytes)?;
        let header = recording.header().clone();
        let (mut values, mut jobs) = (BTreeMap::new(), BTreeSet::new());
        let (mut cuts, mut signals, mut lost) = (BTreeSet::new(), Vec::new(), None);
        let role = |place: u16| header.channels[usize::from(place)].role;
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
                    if role(place) == Role::Source {
                        jobs.insert((dag, job));
                    }
                    values.insert((place, job), value.to_vec());
                }
                What::Cut => _ = cuts.insert((dag, place, job)),
                What::Signal | What::Skip => signals.push((DagId(dag.into()), release_ns)),
                What::Lost if role(place) == Role::Source => {
                    lost.get_or_insert((place, job));
                }
                What::Restart | What::Lost => {}
            }
        }
        let is_result = |(place, _): &&(u16, u64)| role(*place) == Role::Result;
        let to_compare = values.keys().filter(is_result).count() as u64;
        Ok(Self {
            header,
            values,
            jobs,
            cuts,
            signals,
            lost,
            channels: Vec::new(),
            to_compare,
            compared: BTreeSet::new(),
            divergence: None,
        })
    }

    /// Finds the channels of the plan.
    pub(super) fn fit(&mut self, own: &Header) -> Result<(), String> {
        for (number, recorded) in self.header.dags.iter().enumerate() {
            let remedy = "commit the DAGs that were recorded, in their order";
            let Some(dag) = own.dags.get(number) else {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here there is none; {remedy}",
                    recorded.name
                ));
            };
            if recorded.name != dag.name {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here it is `{}`; {remedy}",
                    recorded.name, dag.name
                ));
            }
            // A DAG that records nothing has none.
            if recorded.graph != 0 && dag.graph != 0 && recorded.graph != dag.graph {
                return Err(format!(
                    "the recording is of another graph of dag `{}`; record it again",
                    dag.name
                ));
            }
        }
        self.check_sources(own)?;
        for channel in &own.channels {
            let (topic, schema) = (&channel.topic, &channel.schema);
            let mut others = (0..).zip(&self.header.channels);
            match others.find(|(_, other)| is_same(other, channel)) {
                Some((_, other)) if other.schema != *schema => {
                    return Err(format!(
                        "topic `{topic}` was recorded with values of type {}, and is of type \
                         {schema} now; record it again",
                        other.schema
                    ));
                }
                None if channel.role == Role::Source => {
                    return Err(format!(
                        "topic `{topic}` of a source is not in the recording; record it again"
                    ));
                }
                found => self.channels.push(found.map(|(number, _)| number)),
            }
        }
        Ok(())
    }

    /// Makes sure that no recorded source would be called, and that none of its values is lost.
    fn check_sources(&self, own: &Header) -> Result<(), String> {
        let mut sources = (self.header.channels.iter()).filter(|other| other.role == Role::Source);
        let is_here = |source: &Channel| own.channels.iter().any(|own| is_same(own, source));
        if let Some(Channel { topic, .. }) = sources.find(|source| !is_here(source)) {
            return Err(format!(
                "topic `{topic}` of a source is in the recording, and is not recorded here; add \
                 `dag.record::<T>(\"{topic}\")`"
            ));
        }
        match self.lost {
            None => Ok(()),
            Some((place, job)) => Err(format!(
                "the recording has lost topic `{}` of job {job}, without which later jobs may \
                 come out differently; record smaller values, see `Dag::record`",
                self.header.channels[usize::from(place)].topic
            )),
        }
    }

    /// Returns the recorded value of a channel of the plan.
    pub(super) fn value(&self, channel: u16, job: u64) -> Option<&[u8]> {
        let channel = *self.channels.get(usize::from(channel))?;
        self.values.get(&(channel?, job)).map(Vec::as_slice)
    }

    /// Reports whether an instance is one whose function is not called.
    pub(super) fn passes_over(&self, instance: Instance) -> bool {
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

    pub(super) fn compare(&mut self, own: &Header, value: &Recorded<'_>) {
        let channel = &own.channels[usize::from(value.channel)];
        let bytes = value.bytes.unwrap_or_default();
        if channel.role == Role::Source {
            // It is where the value is from.
            return;
        }
        let Some(recorded) = self.value(value.channel, value.job) else {
            return;
        };
        if recorded != bytes && self.divergence.is_none() {
            let divergence = divergence(own, channel, value.job, recorded, Some(bytes));
            self.divergence = Some(divergence);
        }
        self.compared.insert((value.channel, value.job));
    }

    /// Returns how many values were compared, how many were not, and the first one that
    /// differs; if the run is over, also one that it has not computed.
    pub(super) fn outcome(&self, own: &Header, is_over: bool) -> (u64, u64, Option<Divergence>) {
        let compared = self.compared.len() as u64;
        let missing = || is_over.then(|| self.missing(own)).flatten();
        let divergence = self.divergence.clone().or_else(missing);
        (compared, self.to_compare - compared, divergence)
    }

    /// Returns the recorded value of the earliest job that this run has not computed.
    fn missing(&self, own: &Header) -> Option<Divergence> {
        let of_run = (0_u16..).zip(&self.channels).zip(&own.channels);
        let all = of_run
            .filter(|(_, channel)| channel.role == Role::Result)
            .filter_map(|((number, recorded), channel)| Some((number, (*recorded)?, channel)))
            .flat_map(|(number, place, channel)| {
                let values = self.values.range((place, 0)..=(place, u64::MAX));
                let missing = move |&(&(_, job), _): &(&(u16, u64), &Vec<u8>)| {
                    !self.compared.contains(&(number, job))
                };
                (values.filter(missing)).map(move |((_, job), value)| (*job, channel, value))
            });
        let (job, channel, value) = all.min_by_key(|(job, ..)| *job)?;
        Some(divergence(own, channel, job, value, None))
    }
}

/// Describes a value that differs.
fn divergence(
    own: &Header,
    channel: &Channel,
    job: u64,
    recorded: &[u8],
    computed: Option<&[u8]>,
) -> Divergence {
    let schema = &channel.schema;
    let shown = |bytes| Shown { schema, bytes }.to_string();
    Divergence {
        dag: own.dags[usize::from(channel.dag)].name.clone(),
        topic: channel.topic.clone(),
        job,
        recorded: shown(recorded),
        computed: computed.map(shown),
    }
}

/// Reports whether two channels have the same values, of two runs.
fn is_same(one: &Channel, other: &Channel) -> bool {
    (one.dag, one.role, &one.topic) == (other.dag, other.role, &other.topic)
}
