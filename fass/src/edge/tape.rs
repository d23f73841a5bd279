//! The recorder: entries on their way from the edge into a file.
//!
//! Each channel has a place for its values, into which its subtask writes them. The tape takes only
//! other events, and the jobs whose values had no room. If even these are too many, the tape ends,
//! and the recording says that it is cut.
//!
//! The drain makes the file. It takes the earliest of the waiting values and events, so the file is
//! nearly in the order of time, and each channel's values are in order. Completions note lost
//! values, one at a time; the drain reports them before the channel's next value.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use recording::{Channel, Encoder, Entry, EntryKind, Header, Recordable};
use sched_dag::{DagId, DriverNotice, Instance, SubtaskId, TaskSet};

use super::replay::narrow;
use super::{Crossing, Drain, Record, RecordingState, name, open, recorded};
use crate::run::cell::outbox::{Outbox, OutboxReader, PublishedRecord, outbox, words_of};
use crate::run::line::{LineOf, RecordedValue};
use crate::run::plan::Plan;

/// Records a run.
pub(super) struct RunRecorder {
    app: &'static str,
    bytes: usize,
    header: Header,
    events: Option<Outbox>,
    drain: Option<Box<dyn Drain>>,
    lines: Vec<LineOf>,
    /// The outboxes for values given instead of read, by channel: used if somebody watches values
    /// in front of the tape.
    given: Vec<Option<Outbox>>,
    lost: LossCounts,
}

impl RunRecorder {
    pub(super) fn new(app: &'static str, bytes: usize) -> Self {
        Self {
            app,
            bytes,
            header: Header::default(),
            events: None,
            drain: None,
            lines: Vec::new(),
            given: Vec::new(),
            lost: LossCounts {
                values: Arc::default(),
                rest_ns: Arc::new(AtomicU64::new(u64::MAX)),
            },
        }
    }

    /// Makes all places, each with the same share of the memory; `None`: there is too little.
    fn provide(&mut self, plan: &mut Plan) -> Option<()> {
        let channels = &self.header.channels;
        // One share for each channel, and one for events.
        let words = self.bytes / 8 / (channels.len() + 1);
        // Room for at least 64 events, however little memory is given: a run has more events than
        // values.
        let (events, reader) = outbox(words.max(64 * words_of(EVENT_BYTES)))?;
        self.lines = mem::take(&mut plan.lines);
        let records = (self.lines.iter().zip(channels))
            .map(|(of, channel)| of.line.reader(words, channel.schema.least_bytes()));
        let (records, given) = records.collect::<Option<_>>()?;
        self.given = given;
        self.lost.values = channels.iter().map(|_| LostJobs::new()).collect();
        self.events = Some(events);
        self.drain = Some(Box::new(OfTape {
            events: reader,
            records,
            lost: self.lost.clone(),
            header: self.header.clone(),
            releases: ReleaseTimes::new(&plan.task_set),
            epoch_ns: 0,
        }));
        Some(())
    }

    /// Puts an event into its ring; without room the recording ends.
    fn put(&mut self, what: EntryKind, of: Instance, release_ns: Option<u64>, at_ns: u64) {
        let mut bytes = [0; EVENT_BYTES];
        let mut out = Encoder::new(&mut bytes);
        // The commit has refused to record DAGs or subtasks with larger numbers.
        let (dag, subtask) = narrow(of).unwrap_or((u16::MAX, u16::MAX));
        (what, dag, subtask, release_ns).encode(&mut out);
        let length = out.finish().unwrap_or(EVENT_BYTES);
        if let Some(events) = &self.events
            && !events.put(of.job, at_ns, &bytes[..length])
        {
            // A lost event cannot be reported like a lost value, as a replay would miss a signal.
            // So the recording ends here.
            self.lost.finish(at_ns);
        }
    }
}

/// Takes a value that is not where the drain reads: puts it there, or notes its loss.
fn store(given: &[Option<Outbox>], lost: &LossCounts, value: &RecordedValue<'_>, at_ns: u64) {
    let outbox = given
        .get(usize::from(value.channel))
        .and_then(Option::as_ref);
    let is_put = (value.bytes.zip(outbox))
        .is_some_and(|(bytes, outbox)| outbox.put(value.job, value.completed_ns, bytes));
    if !is_put {
        // A lost value is reported by its job, and the recording goes on.
        lost.note(value, at_ns);
    }
}

impl Crossing for RunRecorder {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool {
        open(&mut self.header, dag, graph, channels);
        true
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        name(&mut self.header, self.app, &plan.task_set);
        self.provide(plan).ok_or_else(|| {
            alloc::format!(
                "`keep`: there is no memory for a buffer of {} KiB; give the machine more \
                 memory, or the buffer less",
                self.bytes / 1024
            )
        })
    }

    fn record(&mut self, value: &RecordedValue<'_>, at_ns: u64) {
        store(&self.given, &self.lost, value, at_ns);
    }

    fn happened(&mut self, notice: &DriverNotice) {
        let event = notice.event;
        if let Some(what) = recorded(event.what) {
            let subtask = event.subtask.unwrap_or(SubtaskId(0));
            let (dag, job) = (event.dag, event.job);
            let of = Instance { dag, job, subtask };
            self.put(what, of, notice.at_ns, event.time_ns);
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, clock_ns: u64) {
        for of in self.lines.iter().filter(|of| of.is_found_by(instance)) {
            // The samples from before the fault are needed to compute the fault again.
            (of.line).publish_or_give(clock_ns, |sample| {
                store(&self.given, &self.lost, sample, at_ns);
            });
        }
        self.put(EntryKind::Fault, instance, None, at_ns);
    }

    fn tell_time(&mut self, instance: Instance, clock_ns: u64, at_ns: u64) -> u64 {
        let number = u16::try_from(instance.dag.0);
        let mut channels = self.header.channels.iter();
        // Only for recorded DAGs: the time told to others is no input of the replay.
        if channels.any(|channel| Ok(channel.dag) == number) {
            self.put(EntryKind::Clock, instance, None, at_ns);
        }
        clock_ns
    }

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        self.drain.take()
    }
}

/// An event in its record: the kind, the DAG and the subtask, and the job's due time, where known.
type Event = (EntryKind, u16, u16, Option<u64>);

/// The greatest length of an event, in bytes.
const EVENT_BYTES: usize = 14;

/// The length of a list of one time, in bytes.
const TOLD: usize = 4 + 8;

/// Writes the time told to an instance, as a list of one time.
fn write_told(clock_ns: u64, bytes: &mut [u8; TOLD]) -> &[u8] {
    (1_u32, clock_ns).encode(&mut Encoder::new(bytes));
    bytes
}

/// Makes the file.
struct OfTape {
    events: OutboxReader,
    /// The values, by channel.
    records: Vec<OutboxReader>,
    lost: LossCounts,
    header: Header,
    releases: ReleaseTimes,
    /// The start of the run's time, on the clock. Values are stamped on the clock.
    epoch_ns: u64,
}

/// The due times of jobs.
pub(super) struct ReleaseTimes {
    pub(super) task_set: Arc<TaskSet>,
    /// For each sporadic DAG, the signals in flight: job and release, each in a place.
    signals: Vec<Vec<(u64, u64)>>,
}

/// The number of signals remembered for a DAG.
pub(super) const SIGNALS: u32 = 64;

impl ReleaseTimes {
    pub(super) fn new(task_set: &Arc<TaskSet>) -> Self {
        let signals = task_set.dags().iter().map(|dag| match dag.is_sporadic() {
            true => (0..SIGNALS).map(|_| (u64::MAX, 0)).collect(),
            false => Vec::new(),
        });
        Self {
            signals: signals.collect(),
            task_set: Arc::clone(task_set),
        }
    }

    pub(super) fn of(&self, dag: usize, job: u64) -> Option<u64> {
        let signals = self.signals.get(dag)?;
        match place_of(job, signals.len()) {
            None => Some(self.task_set.dags()[dag].grid_ns(job)),
            Some(place) => {
                let (of, release_ns) = signals[place];
                // The place may hold an older signal, if the signal of this job was never noted.
                (of == job).then_some(release_ns)
            }
        }
    }

    pub(super) fn note(&mut self, dag: usize, job: u64, release_ns: u64) {
        if let Some(signals) = self.signals.get_mut(dag)
            && let Some(place) = place_of(job, signals.len())
        {
            signals[place] = (job, release_ns);
        }
    }

    /// Returns the entry of an event at a time, which also serves as the release if that is
    /// unknown.
    pub(super) fn entry<'v>(
        &self,
        what: EntryKind,
        [dag, place]: [u16; 2],
        job: u64,
        at_ns: u64,
        value: &'v [u8],
    ) -> Entry<'v> {
        Entry {
            what,
            dag,
            place,
            job,
            release_ns: self.of(dag.into(), job).unwrap_or(at_ns),
            at_ns,
            value,
        }
    }
}

/// Returns the place of a job, if there are places.
pub(super) fn place_of(job: u64, places: usize) -> Option<usize> {
    usize::try_from(job.checked_rem(u64::try_from(places).ok()?)?).ok()
}

impl OfTape {
    /// Finds the earliest of all waiting entries: its time, and its channel or `None` for an event.
    fn earliest(&mut self) -> Option<(u64, Option<u16>)> {
        let event = self.events.next().map(|event| (event.at_ns, None));
        let epoch_ns = self.epoch_ns;
        let values = (0..)
            .zip(&mut self.records)
            .filter_map(|(channel, records)| {
                // Values are stamped by the clock, events by the run's time.
                let at_ns = records.next()?.at_ns.saturating_sub(epoch_ns);
                Some((at_ns, Some(channel)))
            });
        // At equal times the event comes first, such as the signal that released the job.
        event
            .into_iter()
            .chain(values)
            .min_by_key(|(at_ns, _)| *at_ns)
    }

    /// Reports lost values of a channel, before its next value or at the end.
    fn tell_lost(&mut self, channel: u16, next: Option<(u64, u64)>, to: &mut Record) {
        let dag = self.header.channels[usize::from(channel)].dag;
        let before = next.map(|(job, _)| job);
        // Before the next value, to keep the file in the order of jobs.
        while let Some((first, last)) = self.lost.values[usize::from(channel)].next_run(before) {
            for job in first..=last {
                // A loss reported only at the end has no time of its own.
                let release_ns = || self.releases.of(dag.into(), job).unwrap_or(0);
                let at_ns = next.map_or_else(release_ns, |(_, at_ns)| at_ns);
                let of = [dag, channel];
                to.write(&self.releases.entry(EntryKind::Lost, of, job, at_ns, &[]));
            }
        }
    }

    /// Writes the next value of a channel.
    fn write_value(&mut self, channel: u16, at_ns: u64, to: &mut Record) {
        let number = usize::from(channel);
        let Some(job) = self.records[number].next().map(|record| record.job) else {
            return;
        };
        self.tell_lost(channel, Some((job, at_ns)), to);
        let of = [self.header.channels[number].dag, channel];
        let records = &mut self.records[number];
        if let Some(PublishedRecord { bytes, .. }) = records.next() {
            to.write(&self.releases.entry(EntryKind::Value, of, job, at_ns, bytes));
        }
        // Only now may the writer use the place again.
        records.forget();
    }

    /// Writes the next event.
    fn write_event(&mut self, to: &mut Record) {
        let Some(PublishedRecord { job, at_ns, bytes }) = self.events.next() else {
            return;
        };
        // Copied out before the place is given back.
        let event = Event::from_bytes(bytes);
        self.events.forget();
        let Ok((what, dag, place, known_ns)) = event else {
            return;
        };
        let mut told = [0; TOLD];
        let value = match what {
            EntryKind::Clock => write_told(at_ns + self.epoch_ns, &mut told),
            _ => &[],
        };
        let entry = self.releases.entry(what, [dag, place], job, at_ns, value);
        // A signal's release is on no grid, so the event itself carries the time.
        let release_ns = known_ns.unwrap_or(entry.release_ns);
        if what == EntryKind::Signal {
            self.releases.note(dag.into(), job, release_ns);
        }
        to.write(&Entry {
            release_ns,
            ..entry
        });
    }

    /// Reports whether the recording has ended before this time for lack of room.
    fn has_ended(&self, at_ns: u64) -> bool {
        self.lost.rest_ns.load(Ordering::Acquire) < at_ns
    }
}

impl Drain for OfTape {
    fn send_header(&mut self, to: &mut Record) {
        to.header(&self.header);
    }

    fn begin_run(&mut self, epoch_ns: u64) {
        self.epoch_ns = epoch_ns;
    }

    fn step(&mut self, to: Option<&mut Record>) -> bool {
        let Some(to) = to else {
            return false;
        };
        match self.earliest() {
            // All entries left are younger than the gap, and would make a file with a hole.
            Some((at_ns, _)) if self.has_ended(at_ns) => return false,
            Some((at_ns, Some(channel))) => self.write_value(channel, at_ns, to),
            Some((_, None)) => self.write_event(to),
            None => return false,
        }
        true
    }

    fn send_losses(&mut self, to: &mut Record) -> Option<RecordingState> {
        let is_cut = self.has_ended(u64::MAX);
        // A cut recording tells nothing of the time after its end, so it tells no losses there
        // either.
        if !is_cut {
            (0..)
                .take(self.records.len())
                .for_each(|channel| self.tell_lost(channel, None, to));
        }
        Some(RecordingState::of(to, is_cut))
    }
}

/// The greatest number of runs of lost jobs noted at a time.
const MOST_RUNS: usize = 32;

/// Runs of consecutive lost jobs.
struct LostJobs {
    /// The first and the last job of each run.
    runs: [[AtomicU64; 2]; MOST_RUNS],
    /// The numbers of runs ever written, and ever read.
    written: AtomicUsize,
    read: AtomicUsize,
}

impl LostJobs {
    const fn new() -> Self {
        Self {
            runs: [const { [const { AtomicU64::new(0) }; 2] }; MOST_RUNS],
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
        }
    }

    /// Notes a lost job, later than all before; `false`: there are too many runs.
    fn note(&self, job: u64) -> bool {
        let written = self.written.load(Ordering::Relaxed);
        // Pairs with the release store in `next_run`: the place of a run already read may be
        // written again.
        let read = self.read.load(Ordering::Acquire);
        // The job continues the last run. Nobody reads that run yet: a read needs a published value
        // of a later job, which would lie between the run and this job.
        if written > read
            && let [_, last] = &self.runs[(written - 1) % MOST_RUNS]
            && last.load(Ordering::Relaxed) + 1 == job
        {
            last.store(job, Ordering::Release);
            return true;
        }
        if written - read == MOST_RUNS {
            return false;
        }
        // Relaxed suffices: the store to `written` below publishes both ends.
        for end in &self.runs[written % MOST_RUNS] {
            end.store(job, Ordering::Relaxed);
        }
        self.written.store(written + 1, Ordering::Release);
        true
    }

    /// Takes the next run if it lies before a job with a value, or at the end.
    fn next_run(&self, before: Option<u64>) -> Option<(u64, u64)> {
        let read = self.read.load(Ordering::Relaxed);
        if read == self.written.load(Ordering::Acquire) {
            return None;
        }
        let ends = self.runs[read % MOST_RUNS].each_ref();
        let [first, last] = ends.map(|end| end.load(Ordering::Acquire));
        // The run comes after the value at hand, and is reported with a later value.
        if before.is_some_and(|before| first >= before) {
            return None;
        }
        // After both loads, so the writer cannot overwrite the run during the read.
        self.read.store(read + 1, Ordering::Release);
        Some((first, last))
    }
}

/// Counts of losses.
#[derive(Clone)]
struct LossCounts {
    /// Lost values, by channel.
    values: Arc<[LostJobs]>,
    /// When an event, or the note of a lost value, found no room; `u64::MAX`: never.
    rest_ns: Arc<AtomicU64>,
}

impl LossCounts {
    /// Notes a lost value. Called at completions, under the scheduler's lock.
    #[cold]
    fn note(&self, value: &RecordedValue<'_>, at_ns: u64) {
        let jobs = self.values.get(usize::from(value.channel));
        if jobs.is_some_and(|jobs| !jobs.note(value.job)) {
            self.finish(at_ns);
        }
    }

    /// Ends the recording, unless it has ended before.
    #[cold]
    fn finish(&self, at_ns: u64) {
        self.rest_ns.fetch_min(at_ns, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_told_before_the_next_value_and_the_rest_at_the_end() {
        let lost = LostJobs::new();
        for job in [3, 4, 5, 7, 9, 10] {
            assert!(lost.note(job));
        }
        assert_eq!(lost.next_run(Some(2)), None);
        assert_eq!(lost.next_run(Some(8)), Some((3, 5)));
        assert_eq!(lost.next_run(Some(8)), Some((7, 7)));
        assert_eq!(lost.next_run(Some(8)), None);
        assert_eq!(
            (lost.next_run(None), lost.next_run(None)),
            (Some((9, 10)), None)
        );
        let noted = (0..100).filter(|run| lost.note(2 * run)).count();
        assert_eq!(noted, MOST_RUNS, "more are refused");
        // One is gone.
        assert!(lost.next_run(None).is_some() && lost.note(1000));
    }

    #[test]
    fn each_lost_job_is_told_before_the_next_value_while_jobs_go_on() {
        let jobs = if cfg!(miri) { 60 } else { 30_000_u64 };
        // The last one is published, as is every fourth, and every third.
        let is_lost = |job: u64| !(job.is_multiple_of(4) || job.is_multiple_of(3));
        let (lost, published) = (LostJobs::new(), AtomicU64::new(0));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for job in 1..=jobs {
                    match is_lost(job) {
                        false => published.store(job, Ordering::Release),
                        true => {
                            while !lost.note(job) {
                                std::thread::yield_now();
                            }
                        }
                    }
                }
            });
            let mut expected = (1..=jobs).filter(|job| is_lost(*job)).peekable();
            let mut job = 0;
            while job < jobs {
                job = published.load(Ordering::Acquire);
                while let Some((first, last)) = lost.next_run(Some(job)) {
                    (first..=last).for_each(|lost| assert_eq!(expected.next(), Some(lost)));
                }
                let next = expected.peek().copied();
                assert!(
                    next.is_none_or(|next| next > job),
                    "{next:?} is not told before {job}"
                );
            }
        });
    }
}
