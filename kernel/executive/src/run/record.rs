//! The record of a boot: the destination of its bytes.
//!
//! QEMU's debug port takes the bytes; without such a port the console does, in lines of base 64.
//! The console has little room during a run, so values for the console are sent after the run.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::edge::{BootRecord, Drain, Outgoing, Sink};
use sched_dag::engine::Run;

use super::{edge, execution};
use crate::machine::debug_port;
use crate::machine::spinlock::SpinLock;
use crate::text::console;
use front::report::{self, RecordLines};

type File = BootRecord<RecordSink>;

static RECORD: SpinLock<Option<File>> = SpinLock::new(None);

/// Whether to send the record during a run, too, to have it even if the run dies.
static IS_LIVE: AtomicBool = AtomicBool::new(false);

/// The way of the record's bytes out of the machine.
pub(super) enum RecordSink {
    Port,
    Console(Box<RecordLines>),
}

impl Sink for RecordSink {
    fn put(&mut self, bytes: &[u8]) {
        match self {
            Self::Port => debug_port::send(bytes),
            Self::Console(lines) => lines.put(bytes),
        }
    }
}

/// Begins a record.
pub fn start(is_live: bool) {
    IS_LIVE.store(is_live, Ordering::Relaxed);
    *RECORD.lock() = Some(BootRecord::new(match debug_port::is_there() {
        true => RecordSink::Port,
        false => RecordSink::Console(Box::new(RecordLines::new())),
    }));
}

/// Lends the record, if one is kept. The record leaves its lock for that time, because sending
/// takes long and the lock keeps interrupts disabled.
pub(super) fn with<T>(work: impl FnOnce(Option<&mut File>) -> T) -> T {
    let mut record = RECORD.lock().take();
    let result = work(record.as_mut());
    *RECORD.lock() = record;
    result
}

/// Sends a part of a run in progress, or raises the signals of a replay. Returns `false` if there
/// was nothing to do now.
pub fn step(outgoing: &mut Outgoing) -> bool {
    let has_port = debug_port::is_there();
    with(|mut record| {
        let to = record
            .as_deref_mut()
            // Without a port the values wait: during a run the console has little room.
            .filter(|_| has_port)
            .map(BootRecord::file);
        let is_sent = (outgoing.as_mut()).is_some_and(|drain| drain.step(to));
        let has_room = IS_LIVE.load(Ordering::Relaxed) && (has_port || !console::has_pending());
        // `|`, not `||`: a long recording must not hold back the events, nor the reverse.
        is_sent | record.is_some_and(|record| has_room && take_events(record))
    })
}

fn take_events(record: &mut File) -> bool {
    record.take_events(|cluster, take| {
        execution::with_scheduler(cluster, |scheduler| take(&scheduler.log.journal));
    })
}

/// Sends the rest of a finished run while the journals still exist, or the jobs kept from before a
/// fault, and reports the outcome of a replay and how complete the recording is.
pub fn end_recording(outgoing: Outgoing, is_over: bool) {
    let mut edge = edge::get();
    let outcome = edge.end_run(is_over);
    let before_fault = edge.before_fault();
    // Before anything is printed: this lock keeps interrupts disabled.
    drop(edge);
    if let Some(outcome) = outcome {
        report::replayed(&outcome);
    }
    if before_fault.is_some() && RECORD.lock().is_none() {
        // Nobody has asked for a record, but the latest jobs were kept for just this fault.
        start(false);
    }
    with(|record| {
        let Some(record) = record else { return };
        let is_live = IS_LIVE.load(Ordering::Relaxed);
        while is_live && take_events(record) {}
        let begin = |mut drain: Box<dyn Drain>| {
            drain.send_header(record.file());
            drain
        };
        let outgoing = outgoing.or_else(|| before_fault.map(begin));
        if let Some(drained) = record.end_recording(outgoing) {
            report::recorded(&drained);
        }
    });
}

/// Sends a run's result.
pub fn end_run(run: &Run) {
    with(|record| {
        if let Some(record) = record {
            record.end_run(run);
        }
    });
}

/// Ends the record.
pub fn finish() {
    let record = RECORD.lock().take();
    if let Some(RecordSink::Console(mut lines)) = record.map(BootRecord::finish) {
        lines.flush();
    }
}
