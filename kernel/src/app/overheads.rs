//! How an app leaves it to the command line to have the kernel measure its own costs.
//!
//! An image whose app does not call this has none of the code.

use fass::Overheads;

use super::calibration;
use super::machine_handle::Machine;
use crate::options::UsageError;
use executive::run::platform::KERNEL;
use front::app::ending::Ending;
use front::json;

/// The margin if nobody states one, in hundredths.
const MARGIN_PERCENT: u64 = 20;

impl Machine {
    /// Takes the word `overheads`. With `overheads=measured` the kernel runs DAGs of its own
    /// now, on all cores, and measures what it takes itself; the commits to come charge that
    /// with a margin of 20 %, or `overheads_margin=PERCENT`, and their answers say so.
    ///
    /// To be called before anything is committed and before the cores are divided. It settles
    /// the size of stacks: subtasks may state no more than 64 KiB then.
    ///
    /// # Errors
    ///
    /// If the words are wrong, or `overheads_ns` states the overheads besides; if there is no
    /// memory for it.
    ///
    /// ```no_run
    /// fn take_part(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.offer_overheads()?;
    ///     machine.options().finish(&["overheads", "overheads_margin"])?;
    ///     // build and commit DAGs
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn offer_overheads(&self) -> Result<(), Ending> {
        let options = self.options();
        let measures = options.choice("overheads", &[("stated", false), ("measured", true)])?;
        let margin = options.text("overheads_margin").is_some();
        let percent = options.number("overheads_margin", 0..=10_000, MARGIN_PERCENT)?;
        if measures && options.text("overheads_ns").is_some() {
            let line = "`overheads=measured` and `overheads_ns` exclude each other; give one";
            return Err(UsageError::new(line).into());
        }
        if margin && !measures {
            let line = "`overheads_margin` is for overheads that are measured; add \
                        `overheads=measured`, or leave it out";
            return Err(UsageError::new(line).into());
        }
        match measures {
            true => charge(u32::try_from(percent).unwrap_or(u32::MAX)),
            false => Ok(()),
        }
    }
}

/// Measures, and has the commits to come charge it with this margin.
fn charge(margin_percent: u32) -> Result<(), Ending> {
    let costs = calibration::run()?;
    let overheads = Overheads::measured(&costs, margin_percent, calibration::AT_ONCE);
    KERNEL.set_overheads(overheads);
    KERNEL.set_measured(costs.dispatches, margin_percent);
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
