//! One measured quantity: as a guest prints it, as a baseline keeps it, and for one step.

use sched_dag::law::Distribution;

use crate::json::{Object, Value};
use crate::protocol::Transcript;

/// One measured quantity of one workload on a number of cores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::bench) struct Figure {
    pub(in crate::bench) cores: u64,
    pub(in crate::bench) workload: String,
    pub(in crate::bench) figure: String,
    /// How many steps each of the numbers below is of.
    pub(in crate::bench) per: u64,
    pub(in crate::bench) median: u64,
    pub(in crate::bench) p99: u64,
    pub(in crate::bench) max: u64,
    /// The least sample; a baseline does not keep it.
    pub(in crate::bench) min: u64,
    /// The number of samples; a baseline does not keep it.
    pub(in crate::bench) samples: u64,
}

impl Figure {
    /// Makes a figure of samples that are of `per` steps each.
    pub(in crate::bench) fn new(
        (cores, workload, figure): (u64, impl ToString, &str),
        per: u64,
        samples: impl IntoIterator<Item = u64>,
    ) -> Self {
        let of = Distribution::new(samples);
        Self {
            cores,
            workload: workload.to_string(),
            figure: figure.into(),
            per,
            median: of.median(),
            p99: of.p99(),
            max: of.max(),
            min: of.min(),
            samples: of.count(),
        }
    }

    /// Reads all figures of a boot.
    pub(in crate::bench) fn read_all(
        transcript: &Transcript,
        cores: u64,
    ) -> Result<Vec<Self>, String> {
        let lines = transcript.of_kind("hand_off");
        let figures = lines.map(|line| {
            let value = &line.value;
            Self::read(value, cores, value.get("value").unwrap_or(value))
                .ok_or_else(|| format!("serial line {}: a figure lacks a member", line.number))
        });
        figures.collect()
    }

    /// Reads a figure as [`json`](Self::json) writes it.
    pub(in crate::bench) fn from_json(value: &Value) -> Option<Self> {
        Self::read(value, value.get("cores")?.as_u64()?, value)
    }

    /// Reads a figure whose numbers are members of an object of their own, or of the same.
    fn read(value: &Value, cores: u64, numbers: &Value) -> Option<Self> {
        let text = |name| value.get(name)?.as_text().map(String::from);
        let number = |name| numbers.get(name)?.as_u64();
        Some(Self {
            cores,
            workload: text("workload")?,
            figure: text("figure")?,
            per: value.get("per")?.as_u64().filter(|per| *per > 0)?,
            median: number("median")?,
            p99: number("p99")?,
            max: number("max")?,
            ..Self::default()
        })
    }

    /// Ends an object with its members.
    pub(in crate::bench) fn json(&self, begun: Object) -> String {
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

    /// Returns whether two are of the same quantity.
    pub(in crate::bench) fn is_same(&self, other: &Self) -> bool {
        (self.cores, &self.workload, &self.figure) == (other.cores, &other.workload, &other.figure)
    }

    /// Returns whether it counts something else than time or instructions.
    pub(in crate::bench) fn is_count(&self) -> bool {
        matches!(&*self.figure, "allocations" | "locks" | "sink_wakeups")
    }

    /// Returns a number of this figure for one step.
    pub(in crate::bench) fn of_step(&self, number: u64) -> f64 {
        number as f64 / self.per as f64
    }

    /// Returns a number of this figure for one step, as text.
    pub(in crate::bench) fn one(&self, number: u64) -> String {
        let decimals = match (self.per, self.is_count()) {
            (1, _) => 0,
            (_, true) => 2,
            (_, false) => 1,
        };
        format!("{:.decimals$}", self.of_step(number))
    }
}
