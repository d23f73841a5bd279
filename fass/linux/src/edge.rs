//! The edge of runs: data crossing the edge is recorded into a file, or replayed.
//!
//! The edge has a lock of its own. Threads take the edge's lock under a cluster's lock; functions
//! asking for the time and replayed sources take it briefly. A thread without a real-time level
//! sends the waiting data, so no instance waits for a file. The thread has a level only while it
//! copies events out of the journals.

use std::cell::Cell;
use std::io::{self, Write};
use std::panic::Location;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Barrier, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use fass::edge::{BootRecord, Drain, Edge, Outgoing, Sink};
use sched_dag::Instance;
use sched_dag::engine::Run;

use crate::clock;

/// The time between two looks for waiting data.
const LOOK: Duration = Duration::from_millis(1);

/// The number of looks for data between two looks for events.
const EVENTS: u64 = 10;

static EDGE: Mutex<Edge> = Mutex::new(Edge::new());

/// The beginning of the run's time, on the clock.
static EPOCH_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// The record, if one is kept.
pub(crate) static FILE: Mutex<Option<BootRecord<File>>> = Mutex::new(None);

/// Whether the record is also written during a run, and so survives the program's death.
pub(crate) static IS_LIVE: AtomicBool = AtomicBool::new(false);

/// The part of the latest run's recording still to be sent.
pub(crate) static LEFT: Mutex<Outgoing> = Mutex::new(None);

thread_local! {
    /// The instance running on this thread.
    static RUNNING: Cell<Option<Instance>> = const { Cell::new(None) };
    /// The latest instance to panic on this thread, and the place of the panic.
    static PANICKED: Cell<Option<(Instance, String)>> = const { Cell::new(None) };
}

/// Notes the place of a panic, if this thread runs an instance.
pub(crate) fn note_place(place: &Location<'_>) {
    if let Some(instance) = RUNNING.get() {
        PANICKED.set(Some((instance, place.to_string())));
    }
}

/// Takes the place at which an instance of this thread has panicked, if there is one.
pub(crate) fn place_of(instance: Instance) -> Option<String> {
    let (panicked, place) = PANICKED.take()?;
    // A panic caught by the app itself may have left the place of an earlier instance.
    (panicked == instance).then_some(place)
}

pub(crate) struct File {
    pub(crate) writer: Box<dyn Write + Send>,
    /// The reason for the first failed write, if any.
    pub(crate) failure: Option<io::Error>,
}

impl File {
    /// Leaves nothing in memory, in case the program dies.
    pub(crate) fn flush(&mut self) {
        if self.failure.is_none() {
            self.failure = self.writer.flush().err();
        }
    }
}

impl Sink for File {
    fn put(&mut self, bytes: &[u8]) {
        if self.failure.is_none() {
            self.failure = self.writer.write_all(bytes).err();
        }
    }
}

pub(crate) fn unpoisoned<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the edge.
pub(crate) fn get() -> MutexGuard<'static, Edge> {
    unpoisoned(&EDGE)
}

/// Notes the instance running on this thread from now on.
pub(crate) fn note_running(instance: Option<Instance>) {
    RUNNING.set(instance);
}

/// Returns the instance running on this thread.
pub(crate) fn running() -> Option<Instance> {
    RUNNING.get()
}

/// Returns the instance running on this thread, and the time of the run.
pub(crate) fn here() -> (Option<Instance>, u64) {
    let epoch_ns = EPOCH_NS.load(Ordering::Relaxed);
    (running(), clock::now_ns().saturating_sub(epoch_ns))
}

/// A thread sending waiting data as long as a run goes on.
pub(crate) struct Sending {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<Outgoing>,
}

/// Begins to send, if there is anything to send. `take_events` adds the events so far to the
/// record.
pub(crate) fn begin_run(
    epoch_ns: u64,
    take_events: impl Fn(&mut BootRecord<File>) + Send + 'static,
) -> Option<Sending> {
    EPOCH_NS.store(epoch_ns, Ordering::Relaxed);
    let mut outgoing = get().begin_run(epoch_ns);
    let is_live = IS_LIVE.load(Ordering::Relaxed);
    if outgoing.is_none() && !is_live {
        return None;
    }
    let is_over = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&is_over);
    let has_begun = Arc::new(Barrier::new(2));
    let begun = Arc::clone(&has_begun);
    let work = move || {
        begun.wait();
        for look in 0_u64.. {
            // Asked before the data is sent: so a last round sends everything left by the run.
            let was_over = seen.load(Ordering::Acquire);
            let step = |drain: &mut Box<dyn Drain>| {
                drain.step(unpoisoned(&FILE).as_mut().map(BootRecord::file))
            };
            while outgoing.as_mut().is_some_and(step) {}
            if let Some(file) = &mut *unpoisoned(&FILE) {
                if is_live && (was_over || look % EVENTS == 0) {
                    take_events(file);
                }
                file.sink().flush();
            }
            if was_over {
                break;
            }
            thread::sleep(LOOK);
        }
        outgoing
    };
    let thread = thread::Builder::new().name("fass-recording".into());
    let thread = thread.spawn(work).expect("the system has a thread to send");
    // Until the thread has allocated its memory: the count of the run's allocations begins later.
    has_begun.wait();
    Some(Sending { is_over, thread })
}

/// Writes the end of a run.
pub(crate) fn end_run(run: &Run) {
    if let Some(file) = &mut *unpoisoned(&FILE) {
        file.end_run(run);
    }
}

impl Sending {
    /// Stops sending, and leaves the rest to the end of the recording.
    pub(crate) fn leave(self) {
        self.is_over.store(true, Ordering::Release);
        *unpoisoned(&LEFT) = self.thread.join().unwrap_or(None);
    }
}
