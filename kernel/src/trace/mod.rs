//! What happened when: a ring of events for each core, always on.
//!
//! An event is four words, written by the core that it happens on, with
//! interrupts disabled, without a lock. When a ring is full the oldest event
//! makes way; how many did is counted. After a run the rings are printed as
//! machine lines if the command line asks for it (`trace=dump`), for
//! `./scripts/check-trace` to hold against the model's rules.
//!
//! Times are nanoseconds since the run's epoch.

mod dump;
mod load;
mod ring;
mod subject;

use alloc::boxed::Box;
use alloc::format;

use sched_dag::CoreId;

use crate::machine::once::Once;
use crate::memory::heap;
use crate::options::UsageError;
pub(crate) use dump::{dump, latest};
pub(crate) use load::loads_permille;
use ring::Ring;
pub(crate) use subject::Subject;

/// What has happened. The words of the machine lines are the names in lower case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum What {
    /// A job is released.
    Released,
    /// A job's release waits for an older job to end.
    Queued,
    /// A job's release does not happen.
    Skipped,
    /// A job starts no further instance.
    Aborted,
    /// A job's deadline has passed.
    Missed,
    /// No instance of a job is left.
    Completed,
    /// All that an instance waits for has happened.
    Ready,
    /// An instance will not run.
    Cancelled,
    /// A core shall run the instance instead of what it runs.
    Request,
    /// The instance's function is called.
    Start,
    /// The instance's context leaves the core.
    Suspend,
    /// The instance's context continues on the core.
    Resume,
    /// The instance's function has returned.
    Finish,
    /// The instance was ended by a fault.
    Ended,
    /// A signal came, which lets a sporadic DAG's job be due.
    Signalled,
    /// A signal came while one was kept for the job, or no job was left.
    Dropped,
}

/// The words of the machine lines, by [`What`]'s number.
const WORDS: [&str; 16] = [
    "released",
    "queued",
    "skipped",
    "aborted",
    "missed",
    "completed",
    "ready",
    "cancelled",
    "request",
    "start",
    "suspend",
    "resume",
    "finish",
    "ended",
    "signalled",
    "dropped",
];

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Event {
    pub(crate) time_ns: u64,
    pub(crate) what: What,
    pub(crate) core: CoreId,
    pub(crate) subject: Subject,
}

static RINGS: Once<Box<[Ring]>> = Once::new();

/// Makes a ring of `events` events, or up to the next power of two, for each core.
/// With 0 nothing is recorded. Refuses what does not fit into the memory that is free.
pub(crate) fn create(cores: usize, events: usize) -> Result<(), UsageError> {
    let capacity = match events {
        0 => 0,
        _ => events.checked_next_power_of_two().unwrap_or(events),
    };
    let usage = heap::usage();
    let free_kib = (usage.capacity_bytes - usage.in_use_bytes) / 1024;
    let needed_kib = (capacity.saturating_mul(Ring::EVENT_BYTES))
        .saturating_mul(cores)
        .div_ceil(1024);
    // The heap's fit wastes a little, and a run needs memory, too.
    if needed_kib > free_kib - free_kib / 8 {
        return Err(UsageError::new(format!(
            "`trace_events={events}` takes {needed_kib} KiB on {cores} cores, and {free_kib} KiB \
             of memory are free; ask for fewer events, or give the machine more memory"
        )));
    }
    let rings = (0..).map(CoreId).take(cores);
    // A second call would come from a second boot, which there is not.
    let _ = RINGS.set(rings.map(|core| Ring::new(core, capacity)).collect());
    Ok(())
}

/// Where the events of all cores go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recorders(&'static [Ring]);

/// Where one core's events go, looked up once for several of them. For as long as
/// its holder stays on the core, with interrupts disabled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recorder(&'static Ring);

/// Returns where the events of all cores go, once they have rings.
pub(crate) fn recorders() -> Recorders {
    Recorders(all_rings())
}

impl Recorders {
    /// Returns where the events of core `here` go, which executes this.
    ///
    /// # Panics
    ///
    /// If the cores have no rings yet.
    #[inline]
    pub(crate) fn of(self, here: CoreId) -> Recorder {
        Recorder(&self.0[here.index()])
    }
}

impl Recorder {
    /// Records that something happened on this core.
    #[inline]
    pub(crate) fn own(self, what: What, time_ns: u64, subject: Subject) {
        self.0.push_own(what, time_ns, subject);
    }

    /// Records that something happened that is for core `core`.
    pub(crate) fn for_core(self, core: CoreId, what: What, time_ns: u64, subject: Subject) {
        self.0.push(&Event {
            time_ns,
            what,
            core,
            subject,
        });
    }
}

/// Reports whether there is room for events.
pub(crate) fn has_room() -> bool {
    all_rings().iter().any(Ring::has_room)
}

/// Records events from now on, or forgets those so far and records no more. So
/// what is missing of a trace is always the oldest of each core, which is what
/// readers of a trace can deal with. Does nothing if there is no room.
pub(crate) fn record_events(on: bool) {
    if !has_room() || on == is_recording() {
        return;
    }
    for ring in all_rings() {
        ring.record_events(on);
    }
}

fn is_recording() -> bool {
    all_rings().iter().all(Ring::is_on)
}

/// Forgets all events. To be called while no run is going on.
pub(crate) fn clear() {
    all_rings().iter().for_each(Ring::clear);
}

fn all_rings() -> &'static [Ring] {
    RINGS.get().map_or(&[], |rings| rings)
}
