//! The journal of a run, kept by a driver: events with their times, on all cores, in one list.
//!
//! (If the cores are divided into clusters, each cluster keeps its own journal, and the run's
//! journal merges all of them.)
//!
//! On several cores, every event except a core's clock is read and written under the lock of the
//! cluster's scheduler. So the list is in the order in which the scheduler learnt of the events,
//! and needs neither atomics nor a lock of its own. Events are written once as they happen, and
//! mostly read after the run (views copy them during the run): [`law`](crate::law) then computes
//! all times, breaches of the rules and statistics from the journal.
//!
//! # Memory
//!
//! Unless the journal grows, its memory is taken at commit: as much as the events of all jobs can
//! need, within a stated limit. (A newly ready instance preempts at most one other instance, so an
//! instance has at most six events, and five more for each wait.) If this is more than a quarter of
//! the free memory, the journal takes only the quarter, since the times computed after the run take
//! up to half as much again. If some DAG has no last job, the need is unknown, and a fixed number
//! of events takes its place. Signals that are dropped come on top, in any number. When the journal
//! is full, the oldest event makes way for each new event, until the journal is closed. The
//! [`RunTally`] first counts the oldest event, so statistics cover the whole run, unless recording
//! was off for a time.
//!
//! Times are nanoseconds since the run's epoch.

use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::ids::{ClusterId, CoreId};
use crate::journal::{Event, EventKind, EventSubject};
use crate::law::{MeasuredCosts, RunTally};
use crate::task_set::{Dag, TaskSet};

/// The number of events worth keeping in a run without a last job: 6 MiB.
const EVENTS_WITHOUT_END: usize = 1 << 18;

/// The finest resolution of statistics: 32 buckets for each doubling.
pub(crate) const FINEST: u32 = 5;

/// The events of a run, or only the latest events of a long run.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    /// The room for events, and the events in it; no room while recording is off.
    events: Vec<[u64; 3]>,
    /// The room while recording is off.
    put_away: Vec<[u64; 3]>,
    /// The index of the oldest event, once all room is taken.
    oldest: usize,
    /// The number of events dropped or never recorded.
    lost: u64,
    /// Statistics of the dropped events, if any event can be dropped.
    tally: Option<RunTally>,
    /// Whether the tally has missed a lost event.
    is_incomplete: bool,
    /// Whether the journal grows to keep all events, as long as there is memory.
    grows: bool,
    /// Whether the journal accepts no more events.
    is_closed: bool,
}

impl Journal {
    /// Takes the memory for the events of one cluster's DAGs, out of `free_bytes`, and for at most
    /// `most_events` events.
    #[inline(never)]
    pub fn of_cluster(
        task_set: &Arc<TaskSet>,
        cluster: ClusterId,
        free_bytes: usize,
        most_events: u64,
    ) -> Self {
        let is_here = |dag: &&Dag| cluster == dag.cluster();
        let mut here = task_set.dags().iter().filter(is_here);
        let needed = events_of(here.clone());
        let wished = usize::try_from(most_events).unwrap_or(usize::MAX);
        let affordable = free_bytes / 4 / size_of::<[u64; 3]>();
        let room = needed.unwrap_or(EVENTS_WITHOUT_END);
        let mut room = room.min(wished).min(affordable);
        let mut events = Vec::new();
        // Free memory may be in pieces.
        while events.try_reserve_exact(room).is_err() {
            room /= 2;
        }
        // The number of dropped signals has no bound.
        let has_signals = here.any(Dag::is_sporadic);
        let is_enough = needed.is_some_and(|needed| needed <= room && !has_signals);
        let tally = (!is_enough && room > 0).then(|| tally(task_set, free_bytes / 8));
        Self {
            events,
            tally,
            ..Self::default()
        }
    }

    /// Closes the journal: later events are neither written down nor counted as lost.
    pub fn close(&mut self) {
        self.events.shrink_to_fit();
        self.is_closed = true;
    }

    /// Makes a journal that keeps all events, as long as there is memory.
    pub fn growing() -> Self {
        Self {
            grows: true,
            ..Self::default()
        }
    }

    /// Writes down an event.
    #[inline]
    pub fn write(&mut self, core: CoreId, what: EventKind, time_ns: u64, subject: EventSubject) {
        self.write_all(core, [(what, time_ns, subject)]);
    }

    /// Writes down several events on one core, and checks the room for all of them at once.
    #[inline(always)]
    pub fn write_all<const N: usize>(
        &mut self,
        core: CoreId,
        happened: [(EventKind, u64, EventSubject); N],
    ) {
        let words =
            happened.map(|(what, time_ns, subject)| Event::words(time_ns, what, core, subject));
        if self.events.capacity() - self.events.len() >= N {
            self.events.extend(words);
        } else if self.events.capacity() == 0 && !(self.grows | self.is_closed) {
            self.lost += N as u64;
            self.is_incomplete = true;
        } else {
            // Passed by value, so that the words need not lie in memory for the other case.
            for [time_ns, job, rest] in words {
                self.replace_oldest(time_ns, job, rest);
            }
        }
    }

    /// Writes an event in place of the oldest, if no room is left.
    #[cold]
    #[inline(never)]
    fn replace_oldest(&mut self, time_ns: u64, job: u64, rest: u64) {
        if self.is_closed {
            return;
        }
        let words = [time_ns, job, rest];
        if self.grows || self.events.len() < self.events.capacity() {
            self.events.push(words);
            return;
        }
        self.lost += 1;
        let Some(oldest) = self.events.get_mut(self.oldest) else {
            self.is_incomplete = true;
            return;
        };
        let words = core::mem::replace(oldest, words);
        self.oldest += 1;
        if self.oldest == self.events.len() {
            self.oldest = 0;
        }
        if let (Some(tally), Some(event)) = (&mut self.tally, Event::unpack(words)) {
            tally.add(&event);
        }
    }

    /// Starts recording events, or forgets the events so far and stops recording.
    pub fn record_events(&mut self, on: bool) {
        if on == self.is_recording() {
            return;
        }
        self.lost += self.events.len() as u64;
        self.is_incomplete = true;
        self.events.clear();
        self.oldest = 0;
        core::mem::swap(&mut self.events, &mut self.put_away);
        if let Some(tally) = &mut self.tally {
            tally.skip();
        }
    }

    /// Reports whether events are recorded; false for a growing journal still without events.
    pub const fn is_recording(&self) -> bool {
        self.events.capacity() > 0
    }

    /// Reports whether there is room for events.
    pub const fn has_room(&self) -> bool {
        self.is_recording() || self.put_away.capacity() > 0
    }

    /// Returns the number of events dropped or never recorded.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Returns the remaining events, in their order.
    pub fn events(&self) -> impl DoubleEndedIterator<Item = Event> + Clone {
        self.words().filter_map(|words| Event::unpack(*words))
    }

    fn words(&self) -> impl DoubleEndedIterator<Item = &[u64; 3]> + Clone {
        let (newer, older) = self.events.split_at(self.oldest);
        older.iter().chain(newer)
    }

    /// Returns the number of events written, equal to the number of the next event.
    pub const fn written(&self) -> u64 {
        self.lost + self.events.len() as u64
    }

    /// Copies the words of events from number `from` on, oldest first. Returns the number of the
    /// first remaining event, and the number of copied events.
    pub fn copy_from(&self, from: u64, buffer: &mut [[u64; 3]]) -> (u64, usize) {
        let first = from.max(self.lost);
        let skipped = usize::try_from(first - self.lost).unwrap_or(usize::MAX);
        let left = self.events.len().saturating_sub(skipped);
        let count = left.min(buffer.len());
        for (place, number) in buffer[..count].iter_mut().zip(skipped..) {
            let place_of = self.oldest + number;
            let place_of = place_of.checked_sub(self.events.len()).unwrap_or(place_of);
            *place = self.events[place_of];
        }
        (first, count)
    }

    /// Copies the events before number `end`, from the latest backwards, and returns the number of
    /// the oldest event copied.
    pub fn copy_back(&self, end: u64, buffer: &mut [Option<Event>]) -> u64 {
        let before = |count: usize| {
            let number = end.checked_sub(count as u64 + 1)?;
            let index = usize::try_from(number.checked_sub(self.lost)?).ok()?;
            let place = self.oldest.checked_add(index)?;
            let place = place.checked_sub(self.events.len()).unwrap_or(place);
            Event::unpack(*self.events.get(place)?)
        };
        let mut number = end;
        for (count, place) in buffer.iter_mut().enumerate() {
            *place = before(count);
            number -= u64::from(place.is_some());
        }
        number
    }

    /// Reports whether no event is lost.
    pub const fn is_whole(&self) -> bool {
        self.lost == 0
    }

    /// Computes the statistics of the run, in histograms of `2^bits` buckets for each doubling, or
    /// in the resolution of the existing tally. Returns `None` if any event was neither kept nor
    /// counted.
    #[inline(never)]
    pub fn statistics(&self, task_set: &Arc<TaskSet>, bits: u32) -> Option<RunTally> {
        let mut tally = match &self.tally {
            Some(tally) => tally.clone(),
            None => RunTally::new(task_set, bits),
        };
        self.events().for_each(|event| tally.add(&event));
        (!self.is_incomplete).then_some(tally)
    }

    /// Measures the cost of the platform's own work, core by core; `None` if events are lost.
    #[inline(never)]
    pub fn costs(&self, task_set: &TaskSet) -> Option<MeasuredCosts> {
        let measure = || MeasuredCosts::of_cores(task_set, self.events());
        self.is_whole().then(measure)
    }

    /// Takes over the journal of another cluster in the same run, whose cores are numbered from the
    /// cluster's first core. Without memory for both journals, the other's events count as lost.
    ///
    /// Each journal is in the order in which its scheduler learnt of the events, and the merge
    /// keeps this order: of the two next events, the earlier goes first. No rule compares events of
    /// two clusters, since each DAG and each core is in one cluster; so any order between them
    /// tells the same run. (A signal sent to another cluster counts from its arrival there.)
    #[inline(never)]
    pub fn absorb(&mut self, other: Self, cluster: ClusterId, first_core: u32) {
        let mut merged = Vec::new();
        let both = self.events.len() + other.events.len();
        if merged.try_reserve_exact(both).is_err() {
            self.lost += other.written();
            self.is_incomplete = true;
            return;
        }
        let theirs = other.words();
        let mut theirs = theirs
            .map(|words| Event::on_core_from(*words, first_core))
            .peekable();
        for words in self.words() {
            while let Some(earlier) = theirs.next_if(|theirs| theirs[0] < words[0]) {
                merged.push(earlier);
            }
            merged.push(*words);
        }
        merged.extend(theirs);
        self.events = merged;
        self.oldest = 0;
        self.lost += other.lost;
        self.is_incomplete |= other.is_incomplete;
        match (&mut self.tally, other.tally) {
            (Some(ours), Some(theirs)) => ours.adopt(theirs, cluster),
            // A cluster without lost events has counted nothing yet.
            (none, theirs) => *none = none.take().or(theirs),
        }
    }
}

/// Returns the maximum number of events in a run, apart from dropped signals; `None` if a DAG has
/// no last job, or if the number overflows.
fn events_of<'a>(mut dags: impl Iterator<Item = &'a Dag>) -> Option<usize> {
    let of_dag = |dag: &Dag| {
        // Released, due, queued or skipped, aborted, missed, completed, signalled.
        let waits: usize = dag.subtasks().iter().map(|of| of.waits().len()).sum();
        let of_waits = waits.checked_mul(5)?;
        let a_job = dag.subtasks().len().checked_mul(6)?.checked_add(7)?;
        let a_job = a_job.checked_add(of_waits)?;
        let jobs = dag.jobs()?.saturating_sub(dag.first_job());
        let jobs = usize::try_from(jobs).ok()?;
        jobs.checked_mul(a_job)?.checked_add(1)
    };
    dags.try_fold(0usize, |sum, dag| sum.checked_add(of_dag(dag)?))
}

/// Makes the finest tally with at most `most_bytes`, or else the coarsest.
fn tally(task_set: &Arc<TaskSet>, most_bytes: usize) -> RunTally {
    let mut finest = (0..=FINEST).rev();
    let bits = finest.find(|&bits| RunTally::size_of(task_set, bits) <= most_bytes);
    RunTally::new(task_set, bits.unwrap_or(0))
}

#[cfg(test)]
mod tests;
