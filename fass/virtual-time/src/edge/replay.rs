//! What a replay takes from a recording, and what it finds.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;

use fass::Recorded;
use recording::{Channel, Entry, Header, Malformed, Recordable, Recording, Role, Shown, What};
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

/// The most jobs of a DAG that a replay goes through: everything of them is kept.
const MOST_JOBS: u64 = 10_000_000;

/// A recording that takes the place of what enters.
#[derive(Debug)]
pub(super) struct Replay {
    header: Header,
    values: BTreeMap<(u16, u64), Vec<u8>>,
    /// The jobs of these DAGs that have inputs.
    jobs: BTreeSet<(u16, u64)>,
    cuts: BTreeSet<(u16, u16, u64)>,
    /// What instances were answered that asked for the time.
    clock: BTreeMap<(u16, u16, u64), Vec<u64>>,
    /// The releases, if the DAG is sporadic; those of skipped jobs, too, so that the jobs after
    /// them keep their numbers.
    pub(super) signals: BTreeMap<DagId, VecDeque<u64>>,
    /// The first job of each DAG that a signal is recorded of.
    first_signals: BTreeMap<DagId, u64>,
    /// What has no value.
    events: Vec<Entry<'static>>,
    /// The DAGs whose inputs are recorded.
    dags: BTreeSet<u16>,
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
        let mut values = BTreeMap::new();
        let (mut cuts, mut clock, mut lost) = (BTreeSet::new(), BTreeMap::new(), None);
        let mut signals = BTreeMap::<DagId, VecDeque<u64>>::new();
        let (mut first_signals, mut events) = (BTreeMap::new(), Vec::new());
        let role = |place: u16| header.channels[usize::from(place)].role;
        for entry in recording.entries() {
            let Entry {
                what,
                dag,
                place,
                job,
                release_ns,
                value,
                ..
            } = entry;
            if matches!(what, What::Signal | What::Skip | What::Cut | What::Restart) {
                events.push(Entry {
                    value: &[],
                    ..entry
                });
            }
            match what {
                What::Value => _ = values.insert((place, job), value.to_vec()),
                What::Cut => _ = cuts.insert((dag, place, job)),
                What::Signal | What::Skip => {
                    first_signals.entry(DagId(dag.into())).or_insert(job);
                    let of_dag = signals.entry(DagId(dag.into())).or_default();
                    of_dag.push_back(release_ns);
                }
                What::Clock => {
                    let answers = Vec::<u64>::from_bytes(value)?;
                    clock.insert((dag, place, job), answers);
                }
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
            jobs: BTreeSet::new(),
            cuts,
            clock,
            signals,
            first_signals,
            events,
            dags: BTreeSet::new(),
            lost,
            channels: Vec::new(),
            to_compare,
            compared: BTreeSet::new(),
            divergence: None,
        })
    }

    /// Finds the channels of the plan.
    pub(super) fn fit(&mut self, own: &Header, task_set: &TaskSet) -> Result<(), String> {
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
            let others = (0..).zip(&self.header.channels);
            let mut others = others.filter(|(_, other)| is_same(other, channel));
            // A subtask may sample topics of one name of several DAGs.
            let before = own.channels.iter().take(self.channels.len());
            let before = before.filter(|before| is_same(before, channel)).count();
            match others.nth(before) {
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
        self.check_jobs()?;
        // Nothing but signals releases a sporadic DAG, and nothing else takes any.
        let is_sporadic = |dag: &DagId| task_set.dags()[dag.index()].is_sporadic();
        self.signals.retain(|dag, _| is_sporadic(dag));
        for (dag, signals) in &mut self.signals {
            // Where only the last jobs are recorded, the ones before are passed over. They were
            // as far apart as the DAG says, so there is time for them.
            let (dag, first) = (task_set.dag(*dag), self.first_signals.get(dag));
            for job in (0..first.copied().unwrap_or(0)).rev() {
                signals.push_front(dag.grid_ns(job));
            }
        }
        self.find_inputs(task_set);
        Ok(())
    }

    /// Makes sure that a replay can go through all jobs up to the last one.
    fn check_jobs(&self) -> Result<(), String> {
        let of_values = self.values.iter().map(|((place, job), _)| {
            let channel = &self.header.channels[usize::from(*place)];
            (channel.dag, *job)
        });
        let of_signals = self.first_signals.iter();
        let of_signals = of_signals.filter_map(|(dag, job)| Some((dag.0.try_into().ok()?, *job)));
        match of_values.chain(of_signals).max_by_key(|(_, job)| *job) {
            Some((dag, job)) if job >= MOST_JOBS => Err(format!(
                "the recording has job {job} of dag `{}`, and a replay goes through all jobs from 0 \
                 on, which may be {MOST_JOBS} at most; record a shorter run",
                self.header.dags[usize::from(dag)].name
            )),
            _ => Ok(()),
        }
    }

    /// Finds the DAGs whose inputs are recorded, and the jobs that have some: values that
    /// sources returned, or else what they have sampled.
    fn find_inputs(&mut self, task_set: &TaskSet) {
        let is_source = |channel: &Channel| {
            let dag = task_set.dags().get(usize::from(channel.dag));
            dag.is_some_and(|dag| dag.sources().contains(&SubtaskId(channel.subtask.into())))
        };
        for role in [Role::Source, Role::Sample] {
            let channels = (0_u16..).zip(&self.header.channels);
            let inputs: Vec<(u16, u16)> = channels
                .filter(|(_, channel)| channel.role == role && !self.dags.contains(&channel.dag))
                .filter(|(_, channel)| role == Role::Source || is_source(channel))
                .map(|(number, channel)| (number, channel.dag))
                .collect();
            for (number, dag) in inputs {
                self.dags.insert(dag);
                let values = self.values.range((number, 0)..=(number, u64::MAX));
                self.jobs.extend(values.map(|((_, job), _)| (dag, *job)));
            }
        }
    }

    /// Reports whether the inputs of a DAG are recorded.
    pub(super) fn is_of(&self, dag: DagId) -> bool {
        u16::try_from(dag.0).is_ok_and(|dag| self.dags.contains(&dag))
    }

    /// Cuts all that waits for an instance in its job.
    pub(super) fn cut_behind(&mut self, instance: Instance, task_set: &TaskSet) {
        let Instance { dag, subtask, job } = instance;
        let mut behind = task_set.dag(dag).successors(subtask).to_vec();
        while let Some(subtask) = behind.pop() {
            let instance = Instance { dag, subtask, job };
            let Some((dag, number)) = narrow(instance) else {
                continue;
            };
            if self.cuts.insert((dag, number, job)) {
                behind.extend(task_set.dag(instance.dag).successors(subtask));
            }
        }
    }

    /// Returns how many jobs of a DAG the recording is of, from job 0 on, if its inputs are
    /// recorded.
    pub(super) fn jobs_of(&self, dag: DagId) -> Option<u64> {
        let dag = u16::try_from(dag.0).ok().filter(|_| self.is_of(dag))?;
        let mut jobs = self.jobs.range((dag, 0)..=(dag, u64::MAX));
        Some(
            jobs.next_back()
                .map_or(1, |(_, last)| last.saturating_add(1)),
        )
    }

    /// Returns what the time was for an instance, whenever it asked.
    pub(super) fn clock(&self, instance: Instance) -> Option<Vec<u64>> {
        let (dag, subtask) = narrow(instance)?;
        self.clock.get(&(dag, subtask, instance.job)).cloned()
    }

    /// Returns what is recorded of the DAGs besides values.
    pub(super) fn events(&self) -> impl Iterator<Item = Entry<'_>> {
        (self.events.iter().copied()).filter(|entry| self.dags.contains(&entry.dag))
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
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let job = instance.job;
        self.dags.contains(&dag)
            && (!self.jobs.contains(&(dag, job)) || self.cuts.contains(&(dag, subtask, job)))
    }

    pub(super) fn compare(&mut self, own: &Header, value: &Recorded<'_>) {
        let channel = &own.channels[usize::from(value.channel)];
        let bytes = value.bytes.unwrap_or_default();
        if channel.role != Role::Result {
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
    let same_subtask = one.role != Role::Sample || one.subtask == other.subtask;
    same_subtask && (one.dag, one.role, &one.topic) == (other.dag, other.role, &other.topic)
}

/// Returns the numbers of a DAG and of a subtask, as recordings have them.
fn narrow(instance: Instance) -> Option<(u16, u16)> {
    let dag = u16::try_from(instance.dag.0).ok()?;
    Some((dag, u16::try_from(instance.subtask.0).ok()?))
}
