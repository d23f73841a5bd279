//! One figure, as it leaves the machine.

use alloc::string::String;

use kernel::json;
use kernel::report::Distribution;

/// One measured quantity of one workload.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) workload: String,
    pub(crate) figure: &'static str,
    /// How many steps one sample is of; the figure is a sample divided by it.
    pub(crate) per: u64,
    pub(crate) samples: Distribution,
}

impl Row {
    pub(crate) fn new(
        workload: &str,
        figure: &'static str,
        samples: impl IntoIterator<Item = u64>,
    ) -> Self {
        Self {
            workload: workload.into(),
            figure,
            per: 1,
            samples: Distribution::new(samples),
        }
    }

    /// States that a sample is of `per` equal steps.
    pub(crate) fn per(self, per: u64) -> Self {
        Self { per, ..self }
    }

    /// Prints it as a machine line.
    pub(crate) fn emit(&self) {
        json::emit("hand_off", |line| {
            line.text("workload", &self.workload)
                .text("figure", self.figure)
                .number("per", self.per)
                .number("samples", self.samples.count())
                .distribution("value", &self.samples);
        });
    }
}
