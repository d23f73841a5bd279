//! The report of a run: its jobs, memory, wires and recording, and the lines of the log, which are
//! printed during the run.

use alloc::sync::Arc;
use core::fmt::{self, Display, Write};
use core::iter;

use fass::edge::{RecordingState, ReplayOutcome, Sink};
use fass::log::LogLine;
use fass::platform::Protocol;
use fass::shared::{Wire, WireCounts};
use sched_dag::engine::{FaultCost, Run};
use sched_dag::{Dag, DagId, DagSnapshot, Instance, TaskSet};

use crate::text::json::{self, JsonObject};

pub use crate::text::Ns;
pub use sched_dag::law::Distribution;

/// Prints a DAG's line for people, whose end is written by `print`, and the DAG's machine line.
pub fn show_dag(snapshot: &DagSnapshot, dag: DagId, model: &Dag, print: fn(&DagSnapshot, &Dag)) {
    crate::print!("  dag {} ", dag.0);
    print(snapshot, model);
    let of = snapshot.statistics;
    json::emit("dag_status", |line| {
        line.number("dag", dag.0)
            .text("name", model.name())
            .text("state", snapshot.word())
            .number("released", of.released)
            .number("completed", of.completed)
            .number("in_flight", snapshot.in_flight)
            .number("waiting", snapshot.waiting)
            .number("misses", of.misses)
            .number("skips", of.skips)
            .number("aborts", of.aborts)
            .number("faults", of.faults)
            .number("failed", of.failed)
            .number("restarts", of.restarts);
    });
}

/// Prints the counts of each DAG of a finished run.
pub(crate) fn show_counts(run: &Run) {
    for (dag, model) in (0..).map(DagId).zip(run.task_set().dags()) {
        show_dag(run.snapshot(dag), dag, model, print_counts);
    }
}

/// Prints the counts of a DAG's jobs.
pub fn print_counts(snapshot: &DagSnapshot, model: &Dag) {
    let of = snapshot.statistics;
    crate::println!(
        "`{}`: {}; {} jobs released, {} completed, {} in flight, {} waiting; {} deadlines \
         missed, {} jobs skipped, {} aborted, {} lost to faults",
        model.name(),
        snapshot.word(),
        of.released,
        of.completed,
        snapshot.in_flight,
        snapshot.waiting,
        of.misses,
        of.skips,
        of.aborts,
        of.failed
    );
}

/// The machine's memory in use while nothing runs.
///
/// See `Machine::resources`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryInUse {
    /// The bytes of the heap in use.
    pub heap_bytes: usize,
    /// The number of contexts for instances, each with a stack; 0 on Linux, where each run has its
    /// own threads.
    pub contexts: usize,
    /// The number of free contexts: while nothing runs, all of them.
    pub contexts_free: usize,
}

/// The present, the peak and the possible use of a heap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HeapUsage {
    /// How often memory was allocated.
    pub allocations: u64,
    /// The bytes in use.
    pub in_use_bytes: usize,
    /// The most bytes in use so far, measured between two operations.
    pub peak_bytes: usize,
    /// The size of the heap, in bytes.
    pub capacity_bytes: usize,
}

impl HeapUsage {
    /// Prints the peak use.
    pub(crate) fn report(self) {
        // In virtual time allocations are not counted.
        if self.capacity_bytes == 0 {
            return;
        }
        crate::println!(
            "heap: {} KiB at its peak of {} KiB",
            self.peak_bytes.div_ceil(1024),
            self.capacity_bytes / 1024
        );
        json::emit("memory", |line| {
            line.number("heap_peak_bytes", self.peak_bytes as u64)
                .number("heap_bytes", self.capacity_bytes as u64)
                .number("allocations", self.allocations);
        });
    }
}

/// Reports a contained fault: the instance, with the names of its DAG and subtask; the cause, in a
/// word and in a message; the core and the place in the code; and the cost of the fault.
pub fn fault(
    (instance, [dag, subtask]): (Instance, [&dyn Display; 2]),
    (cause, message): (&str, &dyn Display),
    (core, place): (u32, &dyn Display),
    cost: FaultCost,
    more: impl Fn(&mut JsonObject<'_, '_>),
) {
    crate::println!(
        "fault: {cause} in subtask `{subtask}` of dag `{dag}`, job {}, on core {core}: {message}; at \
         {place}; {}",
        instance.job,
        cost.consequence()
    );
    json::report("fault", |line| {
        line.text("cause", cause)
            .number("dag", instance.dag.0)
            .text("dag_name", dag)
            .number("subtask", instance.subtask.0)
            .text("subtask_name", subtask)
            .number("job", instance.job)
            .text("cost", cost.word())
            .number("cpu", core)
            .text("place", place)
            .text("message", message);
        more(line);
    });
}

/// Prints how complete a recording is.
pub fn recorded(drained: &RecordingState) {
    let is_complete = !drained.is_cut && drained.lost == 0;
    json::emit("recorded", |line| {
        line.number("entries", drained.entries)
            .number("lost", drained.lost)
            .flag("complete", is_complete);
    });
}

/// Prints the findings of a replay.
pub fn replayed(outcome: &ReplayOutcome) {
    let (compared, uncompared) = (outcome.compared, outcome.uncompared);
    crate::println!(
        "replay: {compared} values were compared, {uncompared} recorded ones were not computed"
    );
    if let Some((dag, first)) = &outcome.lacking {
        crate::println!(
            "replay: what functions of dag `{dag}` remember of jobs before {first} is not recorded"
        );
    }
    json::emit("replayed", |line| {
        line.number("compared", outcome.compared)
            .number("uncompared", outcome.uncompared);
        if let Some(divergence) = &outcome.divergence {
            line.text("dag_name", &divergence.dag)
                .text("topic", &divergence.topic)
                .number("job", divergence.job);
            let (recorded, computed) = (&divergence.recorded, &divergence.computed);
            for (name, value) in [("recorded", recorded), ("computed", computed)] {
                if let Some(value) = value {
                    line.text(name, value);
                }
            }
        }
    });
}

/// The length of a line, in bytes: a multiple of three, so that only the last line is padded.
const LINE_BYTES: usize = 768;

/// Prints a record in machine lines of base64.
pub struct RecordLines {
    bytes: [u8; LINE_BYTES],
    length: usize,
}

impl RecordLines {
    /// Creates a printer without any bytes.
    pub const fn new() -> Self {
        Self {
            bytes: [0; LINE_BYTES],
            length: 0,
        }
    }

    /// Prints the bytes waiting for a full line.
    pub fn flush(&mut self) {
        let bytes = &self.bytes[..core::mem::take(&mut self.length)];
        if !bytes.is_empty() {
            json::report("record", |line| {
                line.text("bytes", in_base64(bytes));
            });
        }
    }
}

impl Default for RecordLines {
    fn default() -> Self {
        Self::new()
    }
}

impl Sink for RecordLines {
    fn put(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let count = bytes.len().min(LINE_BYTES - self.length);
            let (now, later) = bytes.split_at(count);
            self.bytes[self.length..self.length + count].copy_from_slice(now);
            self.length += count;
            bytes = later;
            if self.length == LINE_BYTES {
                self.flush();
            }
        }
    }
}

/// Writes bytes in base64 (RFC 4648, section 4).
fn in_base64(bytes: &[u8]) -> impl fmt::Display {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    fmt::from_fn(move |f| {
        bytes.chunks(3).try_for_each(|three| {
            let byte = |place: usize| u32::from(three.get(place).copied().unwrap_or(0));
            let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
            (0..4).try_for_each(|digit| match digit <= three.len() {
                true => {
                    let place = bits >> (18 - 6 * digit) & 63;
                    f.write_char(char::from(DIGITS[place as usize]))
                }
                false => f.write_char('='),
            })
        })
    })
}

/// Prints a wire's counts in a line for people and in a line for programs.
pub fn tell_wire(wire: &Wire) {
    let WireCounts {
        packets,
        bytes,
        lost_packets,
        malformed,
        sent_bytes,
        unsent_bytes,
        ..
    } = wire.counts();
    crate::println!(
        "wire `{}`: {packets} packets came, {lost_packets} were lost, {malformed} malformed; \
         {sent_bytes} bytes sent, {unsent_bytes} lost",
        wire.name()
    );
    json::emit("wire", |line| {
        line.text("name", wire.name())
            .number("packets", packets)
            .number("bytes", bytes)
            .number("lost_packets", lost_packets)
            .number("malformed", malformed)
            .number("sent_bytes", sent_bytes)
            .number("unsent_bytes", unsent_bytes);
    });
}

/// Prints a protocol's counts in a line for people and in a line for programs.
pub fn tell_protocol(peer: &dyn Display, protocol: &dyn Protocol) {
    crate::print!("router {peer}");
    protocol.counts(&mut |name, count| crate::print!(", {name} {count}"));
    crate::println!();
    json::emit("session", |line| {
        let line = line.text("peer", peer);
        protocol.counts(&mut |name, count| _ = line.number(name, count));
    });
}

/// The most lines of the log shown at once: as many as can wait.
const AT_ONCE: usize = 64;

/// Shows the waiting lines of the log, with the names of their run's DAGs and subtasks. Nothing is
/// allocated.
pub fn tell_log(task_set: impl Fn() -> Option<Arc<TaskSet>>) {
    for line in iter::from_fn(LogLine::take).take(AT_ONCE) {
        let task_set = task_set();
        let task_set = task_set.as_deref();
        crate::println!("{}", line.shown(task_set));
        json::emit("log", |object| {
            object
                .text("level", line.level.word())
                .text("message", line.text)
                .number("time_ns", line.at_ns);
            if let Some((dag, subtask, instance)) = line.names(task_set) {
                object
                    .number("dag", instance.dag.0)
                    .text("dag_name", dag)
                    .number("subtask", instance.subtask.0)
                    .text("subtask_name", subtask)
                    .number("job", instance.job);
            }
            let fields = |fields: &mut json::JsonObject<'_, '_>| {
                for (key, value) in line.fields() {
                    fields.shown(key, &value);
                }
            };
            object
                .object("fields", fields)
                .number("left_out", line.left_out);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::{in_base64, *};

    #[test]
    fn bytes_are_written_as_the_standard_has_it() {
        let rows = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (bytes, text) in rows {
            assert_eq!(in_base64(bytes.as_bytes()).to_string(), text);
        }
    }

    #[test]
    fn chooses_the_unit() {
        let texts = [0, 999, 1_050, 25_000_000, 1_500_000_000].map(|ns| Ns(ns).to_string());
        assert_eq!(
            texts,
            ["0 ns", "999 ns", "1.050 us", "25.000 ms", "1.500 s"]
        );
        assert_eq!(format!("{:>8}", Ns(7)), "    7 ns");
    }
}
