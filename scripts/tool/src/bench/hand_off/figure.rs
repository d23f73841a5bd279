//! One figure of the guest, and what it is called.

use crate::json::{Object, Value};
use crate::protocol::Transcript;
use crate::qemu::Mode;

/// One measured quantity of one workload on a number of cores.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Figure {
    pub(super) cores: u64,
    pub(super) workload: String,
    pub(super) figure: String,
    /// How many steps each of the numbers below is of.
    pub(super) per: u64,
    pub(super) median: u64,
    pub(super) p99: u64,
    pub(super) max: u64,
}

impl Figure {
    /// Reads all figures of a boot.
    pub(super) fn read_all(transcript: &Transcript, cores: u64) -> Result<Vec<Figure>, String> {
        let lines = transcript.of_kind("hand_off");
        lines
            .map(|line| {
                let value = &line.value;
                Self::read(value, cores, value.get("value").unwrap_or(value))
                    .ok_or_else(|| format!("serial line {}: a figure lacks a member", line.number))
            })
            .collect()
    }

    /// Reads a figure as `json` writes it.
    pub(super) fn from_json(value: &Value) -> Option<Figure> {
        Self::read(value, value.get("cores")?.as_u64()?, value)
    }

    /// Reads a figure whose numbers are members of an object of their own, or of the same.
    fn read(value: &Value, cores: u64, numbers: &Value) -> Option<Figure> {
        let text = |name| value.get(name)?.as_text().map(String::from);
        let number = |name| numbers.get(name)?.as_u64();
        Some(Figure {
            cores,
            workload: text("workload")?,
            figure: text("figure")?,
            per: value.get("per")?.as_u64().filter(|per| *per > 0)?,
            median: number("median")?,
            p99: number("p99")?,
            max: number("max")?,
        })
    }

    /// Ends an object with its members.
    pub(super) fn json(&self, begun: Object) -> String {
        begun
            .number("cores", self.cores)
            .text("workload", &self.workload)
            .text("figure", &self.figure)
            .number("per", self.per)
            .number("median", self.median)
            .number("p99", self.p99)
            .number("max", self.max)
            .end()
    }

    /// Returns the machine line that the tool prints.
    pub(super) fn machine_line(&self, mode: Mode) -> String {
        let begun = Object::new().text("kind", "hand_off");
        self.json(begun.text("mode", mode.name()))
    }

    /// Returns whether two are of the same quantity.
    pub(super) fn is_same(&self, other: &Figure) -> bool {
        (self.cores, &self.workload, &self.figure) == (other.cores, &other.workload, &other.figure)
    }

    /// Returns whether it counts something else than time or instructions.
    pub(super) fn is_count(&self) -> bool {
        matches!(&*self.figure, "allocations" | "locks" | "sink_wakeups")
    }

    /// Says in words what it is a figure of.
    pub(super) fn name(&self) -> &str {
        match &*self.figure {
            "reading" => "reading the clock",
            "stamp" => "a body's stamp",
            "return_to_ready" => "last return -> successor ready",
            "ready_to_start" => "ready -> first instruction",
            "return_to_start" => "last return -> first instruction",
            "return_to_start_recorded" => "the same, if the value is recorded",
            "recording" => "recording a value",
            "hop" => "start -> start, per hop",
            "source_to_sink" => "source start -> sink start",
            "instance" => "source start -> sink start, per instance",
            "release_to_start" => "release -> first instruction",
            "release_jitter" => "release jitter above its minimum",
            "commit" => "commit, per subtask",
            "allocations" => "heap allocations, per job",
            "locks" => "takings of the scheduler's lock, per instance",
            "sink_wakeups" => "times the sink was made ready, per job",
            "request_to_suspended" => "preemption request -> the preempted suspended",
            "suspended_to_start" => "suspended -> preemptor started: switch of contexts",
            "finish_to_resumed" => "preemptor finished -> the preempted resumed",
            "preempted_to_start" => "preempted -> preemptor's first instruction",
            "return_to_resumed" => "preemptor's return -> the preempted goes on",
            unknown => unknown,
        }
    }

    /// Returns a number of this figure for one step, as text.
    pub(super) fn one(&self, number: u64) -> String {
        if self.per == 1 {
            return number.to_string();
        }
        let decimals = if self.is_count() { 2 } else { 1 };
        format!("{:.decimals$}", number as f64 / self.per as f64)
    }
}
