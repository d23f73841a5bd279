//! A figure, as it leaves the machine.

use kernel::json;
use kernel::report::Distribution;

/// Prints a measured quantity of one workload as a machine line; a sample is of `per` equal steps.
pub(crate) fn emit(workload: &str, figure: &str, per: u64, samples: impl IntoIterator<Item = u64>) {
    let samples = Distribution::new(samples);
    json::emit("hand_off", |line| {
        line.text("workload", workload)
            .text("figure", figure)
            .number("per", per)
            .number("samples", samples.count())
            .distribution("value", &samples);
    });
}
