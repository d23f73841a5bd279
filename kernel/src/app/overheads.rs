//! Charging commits with what the kernel has measured of its own costs.

use fass::{OverheadSource, Overheads};

use super::calibration;
use executive::run::platform::KERNEL;
use front::app::ending::Ending;
use front::json;

/// Measures, and has the commits to come charge it with this margin.
pub(super) fn charge(margin_percent: u32) -> Result<(), Ending> {
    let costs = calibration::run()?;
    let overheads = Overheads::measured(&costs, margin_percent, calibration::AT_ONCE);
    KERNEL.change(|terms| {
        terms.overheads = overheads;
        terms.overhead_source = OverheadSource::Measured {
            dispatches: costs.dispatches,
            margin_percent,
        };
    });
    crate::println!(
        "overheads measured: {costs}; with a margin of {margin_percent} %: overheads_ns={},{},{},{}",
        overheads.context_switch_ns,
        overheads.dispatch_ns,
        overheads.interrupt_ns,
        overheads.ready_ns
    );
    json::emit("overheads", |line| {
        line.number("dispatches", costs.dispatches)
            .number("owed_ns", costs.owed_ns)
            .number("releases", costs.releases)
            .number("late_ns", costs.late_ns)
            .number("margin_percent", margin_percent);
    });
    Ok(())
}
