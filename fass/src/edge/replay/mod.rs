//! Replays: values taken from a recording. Findings of a replay: differing values, and faults not
//! occurring again.
//!
//! A function failing because of its inputs fails again. In a replay, functions lack their memory
//! of unrecorded jobs, so a fault caused by that memory does not occur again. Nor does a fault of a
//! recorded source, which is not called, or of a budget.
//!
//! # Replays on a machine
//!
//! Only recorded signals release sporadic DAGs. No signal is raised before its time, or before the
//! previous signal has led to a release. So no signal is dropped where functions take longer than
//! in the recorded run. Core 0 in its spare time, or a thread on Linux, raises the signals.

mod fit;

use alloc::borrow::Cow;
use alloc::boxed::Box;
use alloc::collections::{BTreeMap, VecDeque};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::{AtomicU64, Ordering};
use core::{fmt, mem};

pub use fit::job_of;
use recording::{Channel, Entry, EntryKind, Header, Malformed, Recordable, Recording, Role, Shown};
use sched_dag::{DagId, DriverNotice, Instance, SubtaskId, TaskSet, journal};

use super::{Crossing, Drain, Record, RecordingState, ReplayHost, name, open};
use crate::run::line::{LineOf, RecordedValue};
use crate::run::plan::{Plan, SubtaskCode};

/// A recording in the place of a run's inputs.
#[derive(Debug, Default)]
pub struct Replay {
    bytes: Cow<'static, [u8]>,
    header: Header,
    /// The places of the values, by channel and job.
    values: Vec<((u16, u64), Range<usize>)>,
    /// Whether the recording says nothing of the time after its last entry.
    is_cut: bool,
    passed: Arc<SkippedInstances>,
    /// The times told to instances when they asked.
    clock: BTreeMap<(u16, u16, u64), ToldTimes>,
    /// The releases of sporadic DAGs, including those of skipped jobs: so later jobs keep their
    /// numbers.
    signals: BTreeMap<DagId, VecDeque<u64>>,
    /// The first job of each DAG with a recorded signal.
    first_signals: BTreeMap<DagId, u64>,
    /// The entries of signals, skips, cuts, restarts and faults.
    events: Vec<Entry<'static>>,
    /// The recorded faults that have not occurred again so far.
    faults: Vec<RecordedFault>,
    /// The first lost value of a source: its channel and job.
    lost: Option<(u16, u64)>,
    /// The job to be computed, if the user names one.
    from: Option<(String, u64)>,
    /// The first job of the replay, for each DAG of the plan.
    begins: Vec<u64>,
    /// See [`ReplayOutcome`].
    lacking: Option<(String, u64)>,
    /// The header of the plan.
    own: Header,
    /// The recording's channel for each channel of the plan, if there is one.
    channels: Vec<Option<u16>>,
    /// The number of recorded values that this run can be compared with.
    to_compare: u64,
    compared: u64,
    /// For each value, whether it has been compared.
    is_compared: Vec<bool>,
    /// The channel of the plan, the job, and the place of the recorded value.
    divergence: Option<(u16, u64, Range<usize>)>,
    /// The computed value that differs from the recorded one.
    computed: Vec<u8>,
}

/// The times told to an instance, and how many of them have been told again.
#[derive(Debug, Default)]
struct ToldTimes {
    times: Vec<u64>,
    taken: usize,
}

/// The findings of a replay.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReplayOutcome {
    /// The number of values compared.
    pub compared: u64,
    /// The number of recorded values that the replay has not computed.
    pub uncompared: u64,
    /// The first value that differs from the recorded one.
    pub divergence: Option<Divergence>,
    /// The first DAG beginning with a job after job 0, and that job: its functions lack their
    /// memory of earlier jobs. A DAG with a record of all its states there does not count, unless a
    /// fault replaced a function before.
    pub lacking: Option<(String, u64)>,
}

/// The first difference of a replay from its recording: a computed value other than the recorded
/// one; else a recorded value that was not computed; else a recorded fault that has not occurred
/// again.
///
/// See [`ReplayOutcome`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Divergence {
    /// The name of the DAG.
    pub dag: String,
    /// The topic or the state; for a fault, the subtask.
    pub topic: String,
    /// Whether `topic` names a state.
    pub is_state: bool,
    /// The job.
    pub job: u64,
    /// The recorded value, as JSON; `None` for a fault.
    pub recorded: Option<String>,
    /// The value of this run, as JSON; `None` if the run is over without computing it.
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
    /// If the bytes are no whole and unaltered recording, or memory is lacking for the places of
    /// its values.
    #[allow(clippy::too_many_lines, reason = "one arm for each kind of entry")]
    pub fn read(bytes: impl Into<Cow<'static, [u8]>>) -> Result<Self, Malformed> {
        let bytes = bytes.into();
        let recording = Recording::read(&bytes)?;
        let role = |place: u16| recording.header().channels[usize::from(place)].role;
        let no_memory = |_| Malformed {
            offset: bytes.len(),
            expected: "fewer entries, for whose places there is memory",
        };
        // Counted in a first pass, so a damaged or huge file is refused before its values are
        // placed.
        let is_value = |entry: &Entry<'_>| entry.what == EntryKind::Value;
        let count = recording.entries().filter(is_value).count();
        let mut replay = Self {
            header: recording.header().clone(),
            is_cut: recording.is_cut(),
            // Room in advance: then a value of a usual size allocates nothing.
            computed: Vec::with_capacity(4096),
            ..Self::default()
        };
        // The count comes from a file, so the request for memory must be able to fail.
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
            if !matches!(what, EntryKind::Value | EntryKind::Lost | EntryKind::Clock) {
                replay.events.push(Entry {
                    value: &[],
                    ..entry
                });
            }
            match what {
                EntryKind::Value => {
                    // A range instead of a slice: the bytes are moved into the replay below.
                    let start = value.as_ptr().addr() - bytes.as_ptr().addr();
                    (replay.values).push(((place, job), start..start + value.len()));
                    replay.is_compared.push(false);
                }
                EntryKind::Cut => cuts.push((dag, place, job)),
                EntryKind::Fault => replay.faults.push(RecordedFault::new(dag, place, job)),
                EntryKind::Signal | EntryKind::Skip => {
                    // A skipped job was due by a signal just like a released one.
                    replay.first_signals.entry(id).or_insert(job);
                    let of_dag = replay.signals.entry(id).or_default();
                    of_dag.push_back(entry.release_ns);
                }
                EntryKind::Clock => {
                    // The machine writes each answer as an entry of its own.
                    let told = replay.clock.entry((dag, place, job)).or_default();
                    // In the order of the file, which is the order of the questions.
                    told.times.extend(Vec::<u64>::from_bytes(value)?);
                }
                EntryKind::Lost if role(place) == Role::Source => {
                    // A source with a lost value cannot be replayed; the error names the first such
                    // job.
                    replay.lost.get_or_insert((place, job));
                }
                EntryKind::Restart | EntryKind::Lost => {}
            }
        }
        // Sorted by channel and job for binary searches during the run.
        replay.values.sort_unstable_by_key(|(of, _)| *of);
        cuts.sort_unstable();
        let passed = SkippedInstances {
            cuts,
            ..SkippedInstances::default()
        };
        Ok(Self {
            passed: Arc::new(passed),
            bytes,
            ..replay
        })
    }

    /// Reports whether the inputs of a DAG are recorded.
    pub fn is_of(&self, dag: DagId) -> bool {
        u16::try_from(dag.0).is_ok_and(|dag| self.passed.is_of(dag))
    }

    /// Takes the next time told to an instance, in the order of its questions.
    pub fn next_told_ns(&mut self, instance: Instance) -> Option<u64> {
        let (dag, subtask) = narrow(instance)?;
        let told = self.clock.get_mut(&(dag, subtask, instance.job))?;
        let time_ns = told.times.get(told.taken).copied();
        // Also beyond the last time: an instance asking more often than before gets no time twice.
        told.taken += 1;
        time_ns
    }

    /// Returns the recorded events of the DAGs with recorded inputs: all entries except values,
    /// losses and told times.
    pub fn events(&self) -> impl Iterator<Item = Entry<'_>> {
        (self.events.iter().copied()).filter(|entry| self.passed.is_of(entry.dag))
    }

    /// Takes the next signal of a sporadic DAG, or the next release of a skipped job.
    pub fn next_signal_ns(&mut self, dag: DagId) -> Option<u64> {
        self.signals.get_mut(&dag)?.pop_front()
    }

    /// Returns the recorded value of a channel of the plan.
    pub fn value(&self, channel: u16, job: u64) -> Option<&[u8]> {
        self.bytes.get(self.place(channel, job)?)
    }

    /// Returns the value's place in the recording.
    fn place(&self, channel: u16, job: u64) -> Option<Range<usize>> {
        let (_, place) = &self.values[self.find(channel, job)?];
        Some(place.clone())
    }

    /// Returns the index of a recorded value.
    fn find(&self, channel: u16, job: u64) -> Option<usize> {
        let channel = *self.channels.get(usize::from(channel))?;
        let of = (channel?, job);
        (self.values.binary_search_by_key(&of, |(of, _)| *of)).ok()
    }

    /// Reports whether the replay passes an instance over: the instance was cut, or its job has no
    /// recorded inputs.
    pub fn passes_over(&self, instance: Instance) -> bool {
        self.passed.has(instance)
    }

    /// Compares a value of the run with the recorded one.
    pub fn compare(&mut self, value: &RecordedValue<'_>) {
        if !is_compared(self.own.channels[usize::from(value.channel)].role) {
            // The replay has lent this value itself, so a comparison would prove nothing.
            return;
        }
        let Some(found) = self.find(value.channel, value.job) else {
            return;
        };
        // Counted once, however often the value comes.
        if !core::mem::replace(&mut self.is_compared[found], true) {
            self.compared += 1;
        }
        let place = self.values[found].1.clone();
        let bytes = value.bytes.unwrap_or_default();
        // Only the first divergence is kept: later ones may only follow from it, and would hide it.
        if self.bytes[place.clone()] != *bytes && self.divergence.is_none() {
            self.computed.extend_from_slice(bytes);
            self.divergence = Some((value.channel, value.job, place));
        }
    }

    /// Returns the findings so far; if the run is over, they include a value it has not computed,
    /// or a recorded fault that has not occurred again.
    #[must_use]
    pub fn outcome(&self, is_over: bool) -> ReplayOutcome {
        let differs = self.divergence.as_ref().map(|(channel, job, place)| {
            let channel = &self.own.channels[usize::from(*channel)];
            self.describe(channel, *job, place, Some(&self.computed))
        });
        // As long as the run goes on, a value or a fault may still come.
        let missing = || is_over.then(|| self.missing()).flatten();
        let unmet = || is_over.then(|| self.unmet_fault(None)).flatten();
        ReplayOutcome {
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
            // States and samples may rightly be missing: a cut job has none.
            let is_missing = channel.role == Role::Result && !is_compared;
            is_missing.then_some((*job, channel, range))
        });
        let (job, channel, range) = missing.min_by_key(|(job, ..)| *job)?;
        Some(self.describe(channel, job, range, None))
    }

    /// Describes a differing value.
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

    /// Cuts all instances waiting for a failed instance in its job.
    pub fn cut_behind(&mut self, instance: Instance, task_set: &TaskSet) {
        // The recorded fault has occurred again, so it is no longer missing.
        self.meet_fault(instance);
        let Instance { dag, subtask, job } = instance;
        let mut behind = task_set.dag(dag).successors(subtask).to_vec();
        while let Some(subtask) = behind.pop() {
            let instance = Instance { dag, subtask, job };
            // Visits each instance once, although two paths may lead to it.
            if Arc::make_mut(&mut self.passed).cut(instance) {
                behind.extend(task_set.dag(dag).successors(subtask));
            }
        }
    }
}

/// Reports whether values of this role are compared, rather than lent.
const fn is_compared(role: Role) -> bool {
    matches!(role, Role::Result | Role::State)
}

/// The instances whose functions the replay does not call.
#[derive(Clone, Debug, Default)]
struct SkippedInstances {
    /// The DAGs with recorded inputs, in order.
    dags: Vec<u16>,
    /// The jobs of these DAGs with recorded inputs, in order.
    jobs: Vec<(u16, u64)>,
    /// The cut instances, in order.
    cuts: Vec<(u16, u16, u64)>,
}

impl SkippedInstances {
    /// Reports whether the inputs of a DAG are recorded.
    fn is_of(&self, dag: u16) -> bool {
        self.dags.binary_search(&dag).is_ok()
    }

    /// Adds a cut instance; `false`: it was cut before.
    fn cut(&mut self, instance: Instance) -> bool {
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let cut = (dag, subtask, instance.job);
        // The list stays sorted for the binary search on the hot path.
        let place = self.cuts.binary_search(&cut);
        place.map_err(|place| self.cuts.insert(place, cut)).is_err()
    }

    /// Reports whether an instance is skipped.
    fn has(&self, instance: Instance) -> bool {
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let job = instance.job;
        self.is_of(dag)
            // The inputs of an unrecorded job are unknown, so none of its functions is called.
            && (self.jobs.binary_search(&(dag, job)).is_err()
                || self.cuts.binary_search(&(dag, subtask, job)).is_ok())
    }
}

/// Returns the numbers of a DAG and a subtask in the format of recordings.
pub(super) fn narrow(instance: Instance) -> Option<(u16, u16)> {
    let dag = u16::try_from(instance.dag.0).ok()?;
    Some((dag, u16::try_from(instance.subtask.0).ok()?))
}

/// Makes all bodies of a plan pass over the skipped instances.
fn guard(plan: &mut Plan, passed: &Arc<SkippedInstances>) {
    for (dag, bodies) in (0..).map(DagId).zip(&mut plan.bodies) {
        let of_subtasks = (0..).map(SubtaskId).zip(mem::take(bodies));
        let guarded = of_subtasks.map(|(subtask, body): (_, SubtaskCode)| {
            let passed = Arc::clone(passed);
            body.before(move |job| !passed.has(Instance { dag, job, subtask }))
        });
        *bodies = guarded.collect();
    }
}

/// A fault of the recorded run.
#[derive(Debug)]
struct RecordedFault {
    instance: Instance,
    /// The name of the subtask, once known.
    subtask: String,
}

impl RecordedFault {
    fn new(dag: u16, subtask: u16, job: u64) -> Self {
        let (dag, subtask) = (DagId(dag.into()), SubtaskId(subtask.into()));
        Self {
            instance: Instance { dag, subtask, job },
            subtask: String::new(),
        }
    }
}

impl Replay {
    /// Finds the names of the failed subtasks. The plan's DAGs must be those of the recording.
    fn name_faults(&mut self, task_set: &TaskSet) {
        for RecordedFault { instance, subtask } in &mut self.faults {
            let subtasks = task_set.dag(instance.dag).subtasks();
            let failed = subtasks.get(instance.subtask.index());
            *subtask = failed.map_or("", |failed| failed.name()).into();
        }
    }

    /// Notes that an instance of this run has failed.
    pub(crate) fn meet_fault(&mut self, instance: Instance) {
        self.faults.retain(|fault| fault.instance != instance);
    }

    /// Returns the first recorded fault that has not occurred again: of any job, or of the given
    /// one. Where the replay begins with job 0 of the DAG, only faults of called functions count.
    #[must_use]
    pub fn unmet_fault(&self, of: Option<(DagId, u64)>) -> Option<Divergence> {
        let is_unmet = |RecordedFault { instance, .. }: &&RecordedFault| {
            let is_of = of.is_none_or(|of| of == (instance.dag, instance.job));
            let is_only_a_part = self.begins[instance.dag.index()] > 0;
            is_of && self.is_of(instance.dag) && (is_only_a_part || !self.passes_over(*instance))
        };
        let RecordedFault { instance, subtask } = self.faults.iter().find(is_unmet)?;
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

/// A replay of a recording left in memory by the loader.
pub(in crate::edge) struct OfMachine {
    bytes: &'static [u8],
    from: Option<(&'static str, u64)>,
    host: ReplayHost,
    own: Header,
    lines: Vec<LineOf>,
    /// `Some` from the launch on.
    replay: Option<(Replay, SignalTimes)>,
    /// `Some` from the launch until the platform takes it, if there are signals to raise.
    replayer: Option<Box<dyn Drain>>,
}

impl OfMachine {
    pub(in crate::edge) fn new(
        bytes: &'static [u8],
        from: Option<(&'static str, u64)>,
        host: ReplayHost,
    ) -> Self {
        Self {
            bytes,
            from,
            host,
            own: Header::default(),
            lines: Vec::new(),
            replay: None,
            replayer: None,
        }
    }
}

impl Crossing for OfMachine {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool {
        open(&mut self.own, dag, graph, channels);
        false
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        name(&mut self.own, "", &plan.task_set);
        let read = Replay::read(self.bytes);
        let mut replay = read.map_err(|malformed| format!("the recording, {malformed}"))?;
        if let Some((dag, job)) = self.from {
            replay.begin_before(dag, job);
        }
        replay.fit(&self.own, &plan.task_set)?;
        replay.prepare(plan);
        replay.guard(plan);
        self.lines = mem::take(&mut plan.lines);
        // After `prepare`, which counts the signals; this takes the first of each DAG out.
        let signals = SignalTimes::take_over(plan, &mut replay);
        self.replayer = signals.raiser(self.host);
        self.replay = Some((replay, signals));
        Ok(())
    }

    fn record(&mut self, value: &RecordedValue<'_>, _at_ns: u64) {
        if let Some((replay, _)) = &mut self.replay {
            replay.compare(value);
        }
    }

    fn happened(&mut self, notice: &DriverNotice) {
        if let journal::EventKind::Due | journal::EventKind::Skipped = notice.event.what
            && let Some((replay, signals)) = &mut self.replay
        {
            let dag = notice.event.dag;
            signals.follow(dag, replay.next_signal_ns(dag));
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, _clock_ns: u64) {
        if let Some((replay, _)) = &mut self.replay {
            for of in self.lines.iter().filter(|of| of.is_found_by(instance)) {
                of.line.show(at_ns, |found| replay.compare(found));
            }
            replay.meet_fault(instance);
        }
    }

    fn tell_time(&mut self, instance: Instance, clock_ns: u64, _at_ns: u64) -> u64 {
        let told = (self.replay.as_mut()).and_then(|(replay, _)| replay.next_told_ns(instance));
        told.unwrap_or(clock_ns)
    }

    fn find(&self, channel: u16, job: u64) -> Option<&'static [u8]> {
        let (replay, _) = self.replay.as_ref()?;
        self.bytes.get(replay.place(channel, job)?)
    }

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        self.replayer.take()
    }

    fn outcome(&self, is_over: bool) -> Option<ReplayOutcome> {
        (self.replay.as_ref()).map(|(replay, _)| replay.outcome(is_over))
    }
}

/// The plan number of a replay, unknown to all signals of the app: only the replay can raise its
/// signals.
const REPLAYED: u64 = u64::MAX;

/// Stands for "no signal to come, or not yet" in the place of a time.
const NONE: u64 = u64::MAX;

/// The time of each sporadic DAG's next signal.
#[derive(Clone, Debug)]
struct SignalTimes(Arc<[(DagId, AtomicU64)]>);

impl SignalTimes {
    /// Takes the place of all signals of a plan.
    fn take_over(plan: &mut Plan, replay: &mut Replay) -> Self {
        plan.number = REPLAYED;
        // The recording has the signals raised by faults and functions as well: raised again here,
        // they would release jobs twice.
        plan.after_fault.fill(None);
        for body in plan.bodies.iter_mut().flatten() {
            body.mute();
        }
        let dags = (0..).map(DagId).zip(plan.task_set.dags());
        let sporadic = dags.filter(|(_, dag)| dag.is_sporadic());
        let next =
            sporadic.map(|(dag, _)| (dag, replay.next_signal_ns(dag).unwrap_or(NONE).into()));
        Self(next.collect())
    }

    /// Advances to the next signal of a DAG, after the previous one has led to a release.
    fn follow(&self, dag: DagId, next_ns: Option<u64>) {
        if let Some((_, at_ns)) = self.0.iter().find(|(of, _)| *of == dag) {
            at_ns.store(next_ns.unwrap_or(NONE), Ordering::Release);
        }
    }

    /// Takes the due signals.
    fn due(&self, now_ns: u64) -> impl Iterator<Item = DagId> {
        let is_due = move |(_, at_ns): &&(DagId, AtomicU64)| {
            let due_ns = at_ns.load(Ordering::Acquire);
            // Stored before the signal is raised: when `raise` returns, the signal may have led to
            // a release already, and `follow` may have set the next time.
            let place = (due_ns <= now_ns).then(|| at_ns.store(NONE, Ordering::Release));
            place.is_some()
        };
        self.0.iter().filter(is_due).map(|(dag, _)| *dag)
    }

    /// Returns the replayer for these signals, if there are any.
    fn raiser(&self, host: ReplayHost) -> Option<Box<dyn Drain>> {
        let raiser = SignalReplayer {
            signals: self.clone(),
            host,
            epoch_ns: 0,
        };
        (!self.0.is_empty()).then(|| Box::new(raiser) as _)
    }
}

/// Raises the signals of a replay.
struct SignalReplayer {
    signals: SignalTimes,
    host: ReplayHost,
    epoch_ns: u64,
}

impl Drain for SignalReplayer {
    fn send_header(&mut self, _to: &mut Record) {}

    fn begin_run(&mut self, epoch_ns: u64) {
        self.epoch_ns = epoch_ns;
    }

    fn step(&mut self, _to: Option<&mut Record>) -> bool {
        if let Some(now_ns) = (self.host.now_ns)().checked_sub(self.epoch_ns) {
            for dag in self.signals.due(now_ns) {
                (self.host.raise)(REPLAYED, dag);
            }
        }
        false
    }

    fn send_losses(&mut self, _to: &mut Record) -> Option<RecordingState> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_due_once_and_the_next_one_after_its_release() {
        let signals = SignalTimes(Arc::new([(DagId(1), 10.into()), (DagId(4), 30.into())]));
        let due = |now_ns| signals.due(now_ns).collect::<Vec<_>>();
        assert_eq!(due(9), []);
        assert_eq!(due(10), [DagId(1)]);
        assert_eq!(due(20), [], "it has led to no release");
        signals.follow(DagId(1), Some(15));
        assert_eq!(due(40), [DagId(1), DagId(4)]);
        signals.follow(DagId(4), None);
        assert_eq!(due(u64::MAX - 1), []);
    }
}
