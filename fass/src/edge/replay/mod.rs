//! What a replay takes from a recording, and what it finds: values that differ, and faults that do not
//! come again.
//!
//! A function that fails because of its inputs fails again. What it remembers of jobs that are not
//! recorded is lacking in a replay, so a fault that follows from that does not come again; nor does
//! one of a source that is not called, or of a budget.

mod fit;

use alloc::borrow::Cow;
use alloc::collections::{BTreeMap, VecDeque};
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;
use core::{fmt, mem};

use recording::{Channel, Entry, Header, Malformed, Recordable, Recording, Role, Shown, What};
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

use crate::run::line::Recorded;
use crate::run::plan::{Body, Plan};

pub use fit::job_of;

/// A recording that takes the place of what enters.
#[derive(Debug, Default)]
pub struct Replay {
    bytes: Cow<'static, [u8]>,
    header: Header,
    /// Where the values lie, by channel and job.
    values: Vec<((u16, u64), Range<usize>)>,
    /// Whether it says nothing of what came after its last entry.
    is_cut: bool,
    passed: Arc<Passed>,
    /// What instances were answered that asked for the time.
    clock: BTreeMap<(u16, u16, u64), Told>,
    /// The releases, if the DAG is sporadic; those of skipped jobs, too, so that the jobs after
    /// them keep their numbers.
    signals: BTreeMap<DagId, VecDeque<u64>>,
    /// The first job of each DAG that a signal is recorded of.
    first_signals: BTreeMap<DagId, u64>,
    /// What has no value.
    events: Vec<Entry<'static>>,
    /// The instances that have failed in the recorded run, and in this one not yet.
    faults: Vec<Fault>,
    /// The first value of a source that is lost: its channel and job.
    lost: Option<(u16, u64)>,
    /// The job that shall be computed, if the person names one.
    from: Option<(String, u64)>,
    /// For each DAG of the plan the job that it begins with.
    begins: Vec<u64>,
    /// See [`Outcome`].
    lacking: Option<(String, u64)>,
    /// What the plan says of itself.
    own: Header,
    /// For each channel of the plan that of the recording, if it has one.
    channels: Vec<Option<u16>>,
    /// How many recorded values this run can be compared with.
    to_compare: u64,
    compared: u64,
    /// For each value whether it was.
    is_compared: Vec<bool>,
    /// The channel of the plan, the job, and the place of the recorded value.
    divergence: Option<(u16, u64, Range<usize>)>,
    /// The value that is not the recorded one.
    computed: Vec<u8>,
}

/// The times that an instance was told, and how many of them it has been told again.
#[derive(Debug, Default)]
struct Told {
    times: Vec<u64>,
    taken: usize,
}

/// What a replay has found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// How many values were compared.
    pub compared: u64,
    /// How many recorded ones the replay has not computed.
    pub uncompared: u64,
    /// The first value that is not the recorded one.
    pub divergence: Option<Divergence>,
    /// The first DAG that begins with a later job than 0, and that job, unless all of its states
    /// are recorded there: what its functions remember of jobs before is lacking.
    pub lacking: Option<(String, u64)>,
}

/// The first value of a replay that is not the recorded one, or, if all that were computed are,
/// the first recorded one that was not computed, or else a recorded fault that has not come again.
///
/// See [`Outcome`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Divergence {
    /// The name of the DAG.
    pub dag: String,
    /// The topic or the state; of a fault, the subtask.
    pub topic: String,
    /// Whether it is a state.
    pub is_state: bool,
    /// The job.
    pub job: u64,
    /// The recorded value, as JSON; none for a fault.
    pub recorded: Option<String>,
    /// The value of this run, as JSON; none if the run is over and has computed none.
    pub computed: Option<String>,
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            dag,
            topic,
            is_state,
            job,
            recorded,
            computed,
        } = self;
        let kind = if *is_state { "state" } else { "topic" };
        let Some(recorded) = recorded else {
            return write!(
                f,
                "subtask `{topic}` of dag `{dag}` failed in job {job} of the recorded run, and has \
                 not in this one; a replay knows nothing of what functions remember of jobs that \
                 are not recorded, keeps no budget, and calls no recorded source"
            );
        };
        write!(
            f,
            "{kind} `{topic}` of dag `{dag}` diverges in job {job}: {recorded} is recorded, and {} is \
             computed; does a function share something behind the scheduler's back?",
            computed.as_deref().unwrap_or("nothing")
        )
    }
}

impl Replay {
    /// Reads a recording.
    ///
    /// # Errors
    ///
    /// It is no whole and unaltered one, or there is no memory for the places of its values.
    pub fn read(bytes: impl Into<Cow<'static, [u8]>>) -> Result<Self, Malformed> {
        let bytes = bytes.into();
        let recording = Recording::read(&bytes)?;
        let role = |place: u16| recording.header().channels[usize::from(place)].role;
        let no_memory = |_| Malformed {
            offset: bytes.len(),
            expected: "fewer entries, for whose places there is memory",
        };
        let is_value = |entry: &Entry<'_>| entry.what == What::Value;
        let count = recording.entries().filter(is_value).count();
        let mut replay = Self {
            header: recording.header().clone(),
            is_cut: recording.is_cut(),
            // A value of a usual size allocates nothing.
            computed: Vec::with_capacity(4096),
            ..Self::default()
        };
        (replay.values.try_reserve_exact(count)).map_err(no_memory)?;
        (replay.is_compared.try_reserve_exact(count)).map_err(no_memory)?;
        let mut cuts = Vec::new();
        for entry in recording.entries() {
            let Entry {
                what,
                dag,
                place,
                job,
                value,
                ..
            } = entry;
            let id = DagId(dag.into());
            if !matches!(what, What::Value | What::Lost | What::Clock) {
                replay.events.push(Entry {
                    value: &[],
                    ..entry
                });
            }
            match what {
                What::Value => {
                    let start = value.as_ptr().addr() - bytes.as_ptr().addr();
                    (replay.values).push(((place, job), start..start + value.len()));
                    replay.is_compared.push(false);
                }
                What::Cut => cuts.push((dag, place, job)),
                What::Fault => replay.faults.push(Fault::new(dag, place, job)),
                What::Signal | What::Skip => {
                    replay.first_signals.entry(id).or_insert(job);
                    let of_dag = replay.signals.entry(id).or_default();
                    of_dag.push_back(entry.release_ns);
                }
                What::Clock => {
                    // The machine writes each answer by itself.
                    let told = replay.clock.entry((dag, place, job)).or_default();
                    told.times.extend(Vec::<u64>::from_bytes(value)?);
                }
                What::Lost if role(place) == Role::Source => {
                    replay.lost.get_or_insert((place, job));
                }
                What::Restart | What::Lost => {}
            }
        }
        replay.values.sort_unstable_by_key(|(of, _)| *of);
        cuts.sort_unstable();
        let passed = Passed {
            cuts,
            ..Passed::default()
        };
        Ok(Self {
            passed: Arc::new(passed),
            bytes,
            ..replay
        })
    }

    /// Reports whether the inputs of a DAG are recorded.
    #[must_use]
    pub fn is_of(&self, dag: DagId) -> bool {
        u16::try_from(dag.0).is_ok_and(|dag| self.passed.is_of(dag))
    }

    /// Returns what the time was for an instance, whenever it asked.
    #[must_use]
    pub fn clock(&self, instance: Instance) -> Option<&[u64]> {
        let (dag, subtask) = narrow(instance)?;
        let told = self.clock.get(&(dag, subtask, instance.job))?;
        Some(&told.times)
    }

    /// Takes the next one of these times.
    pub(super) fn next_told_ns(&mut self, instance: Instance) -> Option<u64> {
        let (dag, subtask) = narrow(instance)?;
        let told = self.clock.get_mut(&(dag, subtask, instance.job))?;
        let time_ns = told.times.get(told.taken).copied();
        told.taken += 1;
        time_ns
    }

    /// Returns what is recorded of the DAGs besides values.
    pub fn events(&self) -> impl Iterator<Item = Entry<'_>> {
        (self.events.iter().copied()).filter(|entry| self.passed.is_of(entry.dag))
    }

    /// Takes the next signal of a sporadic DAG, or release of a job that was skipped.
    pub fn next_signal_ns(&mut self, dag: DagId) -> Option<u64> {
        self.signals.get_mut(&dag)?.pop_front()
    }

    /// Returns the recorded value of a channel of the plan.
    #[must_use]
    pub fn value(&self, channel: u16, job: u64) -> Option<&[u8]> {
        let (_, place) = &self.values[self.find(channel, job)?];
        self.bytes.get(place.clone())
    }

    /// Returns the number of a recorded value.
    fn find(&self, channel: u16, job: u64) -> Option<usize> {
        let channel = *self.channels.get(usize::from(channel))?;
        let of = (channel?, job);
        (self.values.binary_search_by_key(&of, |(of, _)| *of)).ok()
    }

    /// Reports whether an instance is one whose function is not called.
    #[must_use]
    pub fn passes_over(&self, instance: Instance) -> bool {
        self.passed.has(instance)
    }

    /// Compares a value of the run with the recorded one.
    pub fn compare(&mut self, value: &Recorded<'_>) {
        if !is_compared(self.own.channels[usize::from(value.channel)].role) {
            // It is where the value is from.
            return;
        }
        let Some(found) = self.find(value.channel, value.job) else {
            return;
        };
        if !core::mem::replace(&mut self.is_compared[found], true) {
            self.compared += 1;
        }
        let place = self.values[found].1.clone();
        let bytes = value.bytes.unwrap_or_default();
        if self.bytes[place.clone()] != *bytes && self.divergence.is_none() {
            self.computed.extend_from_slice(bytes);
            self.divergence = Some((value.channel, value.job, place));
        }
    }

    /// Returns what was found so far; if the run is over, also a value that it has not computed.
    #[must_use]
    pub fn outcome(&self, is_over: bool) -> Outcome {
        let differs = self.divergence.as_ref().map(|(channel, job, place)| {
            let channel = &self.own.channels[usize::from(*channel)];
            self.describe(channel, *job, place, Some(&self.computed))
        });
        let missing = || is_over.then(|| self.missing()).flatten();
        let unmet = || is_over.then(|| self.unmet_fault(None)).flatten();
        Outcome {
            compared: self.compared,
            uncompared: self.to_compare - self.compared,
            divergence: differs.or_else(missing).or_else(unmet),
            lacking: self.lacking.clone(),
        }
    }

    /// Returns the recorded value of the earliest job that this run has not computed.
    fn missing(&self) -> Option<Divergence> {
        let all = self.values.iter().zip(&self.is_compared);
        let missing = all.filter_map(|(((place, job), range), is_compared)| {
            let mut of_run = self.channels.iter().zip(&self.own.channels);
            let (_, channel) = of_run.find(|(recorded, _)| **recorded == Some(*place))?;
            let is_missing = channel.role == Role::Result && !is_compared;
            is_missing.then_some((*job, channel, range))
        });
        let (job, channel, range) = missing.min_by_key(|(job, ..)| *job)?;
        Some(self.describe(channel, job, range, None))
    }

    /// Describes a value that differs.
    fn describe(
        &self,
        channel: &Channel,
        job: u64,
        recorded: &Range<usize>,
        computed: Option<&[u8]>,
    ) -> Divergence {
        let schema = &channel.schema;
        let shown = |bytes| Shown { schema, bytes }.to_string();
        Divergence {
            dag: self.own.dags[usize::from(channel.dag)].name.clone(),
            topic: channel.topic.clone(),
            is_state: channel.role == Role::State,
            job,
            recorded: Some(shown(&self.bytes[recorded.clone()])),
            computed: computed.map(shown),
        }
    }

    /// Cuts all that waits for an instance in its job.
    pub fn cut_behind(&mut self, instance: Instance, task_set: &TaskSet) {
        self.meet_fault(instance);
        let Instance { dag, subtask, job } = instance;
        let mut behind = task_set.dag(dag).successors(subtask).to_vec();
        while let Some(subtask) = behind.pop() {
            let instance = Instance { dag, subtask, job };
            if Arc::make_mut(&mut self.passed).cut(instance) {
                behind.extend(task_set.dag(dag).successors(subtask));
            }
        }
    }
}

/// Reports whether values are compared, rather than taken.
const fn is_compared(role: Role) -> bool {
    matches!(role, Role::Result | Role::State)
}

/// The instances whose functions are not called.
#[derive(Clone, Debug, Default)]
struct Passed {
    /// The DAGs whose inputs are recorded, in order.
    dags: Vec<u16>,
    /// The jobs of these that have some, in order.
    jobs: Vec<(u16, u64)>,
    /// The instances that were cut, in order.
    cuts: Vec<(u16, u16, u64)>,
}

impl Passed {
    /// Reports whether the inputs of a DAG are recorded.
    fn is_of(&self, dag: u16) -> bool {
        self.dags.binary_search(&dag).is_ok()
    }

    /// Adds an instance that is cut; `false`: it was before.
    fn cut(&mut self, instance: Instance) -> bool {
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let cut = (dag, subtask, instance.job);
        let place = self.cuts.binary_search(&cut);
        place.map_err(|place| self.cuts.insert(place, cut)).is_err()
    }

    /// Reports whether an instance is one of them.
    fn has(&self, instance: Instance) -> bool {
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let job = instance.job;
        self.is_of(dag)
            && (self.jobs.binary_search(&(dag, job)).is_err()
                || self.cuts.binary_search(&(dag, subtask, job)).is_ok())
    }
}

/// Returns the numbers of a DAG and of a subtask, as recordings have them.
pub(super) fn narrow(instance: Instance) -> Option<(u16, u16)> {
    let dag = u16::try_from(instance.dag.0).ok()?;
    Some((dag, u16::try_from(instance.subtask.0).ok()?))
}

/// Makes all bodies of a plan pass over these.
fn guard(plan: &mut Plan, passed: &Arc<Passed>) {
    for (dag, bodies) in (0..).map(DagId).zip(&mut plan.bodies) {
        let of_subtasks = (0..).map(SubtaskId).zip(mem::take(bodies));
        let guarded = of_subtasks.map(|(subtask, body): (_, Body)| {
            let passed = Arc::clone(passed);
            body.before(move |job| !passed.has(Instance { dag, job, subtask }))
        });
        *bodies = guarded.collect();
    }
}

/// A fault of the recorded run.
#[derive(Debug)]
struct Fault {
    instance: Instance,
    /// The name of the subtask, once it is known.
    subtask: String,
}

impl Fault {
    fn new(dag: u16, subtask: u16, job: u64) -> Self {
        let (dag, subtask) = (DagId(dag.into()), SubtaskId(subtask.into()));
        Self {
            instance: Instance { dag, subtask, job },
            subtask: String::new(),
        }
    }
}

impl Replay {
    /// Finds the names of those that have failed. The DAGs are those of the recording.
    fn name_faults(&mut self, task_set: &TaskSet) {
        for Fault { instance, subtask } in &mut self.faults {
            let subtasks = task_set.dag(instance.dag).subtasks();
            let failed = subtasks.get(instance.subtask.index());
            *subtask = failed.map_or("", |failed| failed.name()).into();
        }
    }

    /// Takes note that an instance of this run has failed.
    pub(crate) fn meet_fault(&mut self, instance: Instance) {
        self.faults.retain(|fault| fault.instance != instance);
    }

    /// Returns the first recorded fault, of any job or of one, that has not come again. Where the
    /// recording is of a whole run, only those count whose function is called.
    #[must_use]
    pub fn unmet_fault(&self, of: Option<(DagId, u64)>) -> Option<Divergence> {
        let is_unmet = |Fault { instance, .. }: &&Fault| {
            let is_of = of.is_none_or(|of| of == (instance.dag, instance.job));
            let is_only_a_part = self.begins[instance.dag.index()] > 0;
            is_of && self.is_of(instance.dag) && (is_only_a_part || !self.passes_over(*instance))
        };
        let Fault { instance, subtask } = self.faults.iter().find(is_unmet)?;
        Some(Divergence {
            dag: self.own.dags[instance.dag.index()].name.clone(),
            topic: subtask.clone(),
            is_state: false,
            job: instance.job,
            recorded: None,
            computed: None,
        })
    }
}
