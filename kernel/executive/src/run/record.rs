//! The record of a boot: where its bytes go.
//!
//! QEMU's debug port takes them, and where there is none the console, in lines of base 64. The
//! console has little room during a run, so values that go there are sent when it is over.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::edge::{Drain, Kept, Outgoing, Sink};
use fass::{Plan, Terms};
use sched_dag::engine::Run;

use super::execution;
use crate::machine::debug_port;
use crate::machine::spinlock::{SpinLock, SpinLockGuard};
use crate::text::console;
use front::report::crossing;
use front::report::record::Lines;

type File = Kept<To>;

static RECORD: SpinLock<Option<File>> = SpinLock::new(None);

/// Whether it is sent during a run, too, so that it is there if the run dies.
static IS_LIVE: AtomicBool = AtomicBool::new(false);

/// What takes its bytes.
pub(super) enum To {
    Port,
    Console(Box<Lines>),
}

impl Sink for To {
    fn put(&mut self, bytes: &[u8]) {
        match self {
            Self::Port => debug_port::send(bytes),
            Self::Console(lines) => lines.put(bytes),
        }
    }
}

/// Begins to keep a record.
pub fn begin(is_live: bool) {
    IS_LIVE.store(is_live, Ordering::Relaxed);
    *RECORD.lock() = Some(Kept::new(match debug_port::is_there() {
        true => To::Port,
        false => To::Console(Box::new(Lines::new())),
    }));
}

/// Returns the record, if one is kept. It is not locked under another lock but that of what
/// crosses.
pub(super) fn get() -> SpinLockGuard<'static, Option<File>> {
    RECORD.lock()
}

/// Takes what is committed.
pub(super) fn commit(plan: &Plan, terms: &Terms) {
    if let Some(record) = &mut *get() {
        record.commit(plan, terms);
    }
}

/// Sends something of a run that goes on, or has the signals of a replay raised; `false`: there
/// is nothing.
pub fn step(outgoing: &mut Outgoing) -> bool {
    let mut record = get();
    let has_port = debug_port::is_there();
    let to = record.as_mut().filter(|_| has_port).map(Kept::file);
    let is_sent = (outgoing.as_mut()).is_some_and(|drain| drain.step(to));
    let has_room = IS_LIVE.load(Ordering::Relaxed) && (has_port || !console::has_pending());
    is_sent | (record.as_mut()).is_some_and(|record| has_room && take_events(record))
}

fn take_events(record: &mut File) -> bool {
    record.take_events(|cluster, take| {
        execution::with_scheduler(cluster, |scheduler| take(&scheduler.log.journal));
    })
}

/// Sends what is left of a run that is over, but whose journals are still there, or what is kept
/// of jobs before a fault, and says how complete its recording is.
pub(super) fn end_recording(outgoing: Outgoing, before_fault: Outgoing) {
    if before_fault.is_some() && get().is_none() {
        begin(false);
    }
    if let Some(record) = &mut *get() {
        let is_live = IS_LIVE.load(Ordering::Relaxed);
        while is_live && take_events(record) {}
        let begin = |mut drain: Box<dyn Drain>| {
            drain.begin(record.file());
            drain
        };
        let outgoing = outgoing.or_else(|| before_fault.map(begin));
        if let Some(drained) = record.end_recording(outgoing) {
            crossing::recorded(&drained);
        }
    }
}

/// Sends how a run has ended.
pub fn end_run(run: &Run) {
    if let Some(record) = &mut *get() {
        record.end_run(run);
    }
}

/// Ends the record.
pub fn end() {
    let record = get().take();
    if let Some(To::Console(mut lines)) = record.map(Kept::end) {
        lines.flush();
    }
}
