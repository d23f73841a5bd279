//! One figure of the guest, and what it is called.

use crate::json::Value;
use crate::protocol::{MachineLine, Transcript};
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

/// What the figures are, in the words of the table.
const NAMES: &[(&str, &str)] = &[
    ("reading", "reading the clock"),
    ("stamp", "a body's stamp"),
    ("return_to_ready", "last return -> successor ready"),
    ("ready_to_start", "ready -> first instruction"),
    ("return_to_start", "last return -> first instruction"),
    (
        "return_to_start_recorded",
        "the same, if the value is recorded",
    ),
    ("recording", "recording a value"),
    ("hop", "start -> start, per hop"),
    ("source_to_sink", "source start -> sink start"),
    ("instance", "source start -> sink start, per instance"),
    ("release_to_start", "release -> first instruction"),
    ("release_jitter", "release jitter above its minimum"),
    ("commit", "commit, per subtask"),
    ("allocations", "heap allocations, per job"),
    ("locks", "takings of the scheduler's lock, per instance"),
    ("sink_wakeups", "times the sink was made ready, per job"),
    (
        "request_to_suspended",
        "preemption request -> the preempted suspended",
    ),
    (
        "suspended_to_start",
        "suspended -> preemptor started: switch of contexts",
    ),
    (
        "finish_to_resumed",
        "preemptor finished -> the preempted resumed",
    ),
    (
        "preempted_to_start",
        "preempted -> preemptor's first instruction",
    ),
    (
        "return_to_resumed",
        "preemptor's return -> the preempted goes on",
    ),
];

impl Figure {
    /// Reads all figures of a boot.
    pub(super) fn read_all(transcript: &Transcript, cores: u64) -> Result<Vec<Figure>, String> {
        let lines = transcript.of_kind("hand_off");
        lines
            .map(|line| {
                Self::read(line, cores)
                    .ok_or_else(|| format!("serial line {}: a figure lacks a member", line.number))
            })
            .collect()
    }

    fn read(line: &MachineLine, cores: u64) -> Option<Figure> {
        Some(Figure {
            cores,
            workload: line.text_at("workload")?.into(),
            figure: line.text_at("figure")?.into(),
            per: line.number_at("per").filter(|per| *per > 0)?,
            median: line.number_at("value.median")?,
            p99: line.number_at("value.p99")?,
            max: line.number_at("value.max")?,
        })
    }

    /// Reads a figure as `json` writes it.
    pub(super) fn from_json(value: &Value) -> Option<Figure> {
        let text = |name| value.get(name)?.as_text().map(String::from);
        let number = |name| value.get(name)?.as_u64();
        Some(Figure {
            cores: number("cores")?,
            workload: text("workload")?,
            figure: text("figure")?,
            per: number("per").filter(|per| *per > 0)?,
            median: number("median")?,
            p99: number("p99")?,
            max: number("max")?,
        })
    }

    /// Returns the members of a JSON object.
    pub(super) fn json_members(&self) -> String {
        let Figure {
            cores,
            workload,
            figure,
            per,
            median,
            p99,
            max,
        } = self;
        format!(
            "\"cores\":{cores},\"workload\":\"{workload}\",\"figure\":\"{figure}\",\"per\":{per},\
             \"median\":{median},\"p99\":{p99},\"max\":{max}"
        )
    }

    /// Returns the machine line that the tool prints.
    pub(super) fn machine_line(&self, mode: Mode) -> String {
        let members = self.json_members();
        format!("{{\"kind\":\"hand_off\",\"mode\":\"{mode}\",{members}}}")
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
        let known = NAMES.iter().find(|(figure, _)| *figure == self.figure);
        known.map_or(&self.figure, |(_, name)| name)
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
