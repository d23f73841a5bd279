//! Reports of platforms to their [edges](super::Platform::at_edge), the same for all platforms.

use core::sync::atomic::{AtomicBool, Ordering};

use sched_dag::{DriverNotice, Instance};

use super::{LaunchError, Platform, ask_edge, with_edge};
use crate::edge::{BootRecord, Sink};
use crate::run::plan::Plan;

/// Whether a plan has been launched in a requested mode of the edge, so that events are of
/// interest.
static IS_ON: AtomicBool = AtomicBool::new(false);

/// Sets up recording or replay of a plan on a platform, if requested, restores the plan's states,
/// and adds the plan to the record, if one is kept.
///
/// See [`Platform`].
///
/// # Errors
///
/// In a replay, if nothing of the plan is recorded, if the plan does not fit the recording or is a
/// second plan, or if its states cannot be restored. In a recording, if there is no memory for it.
pub fn launch<S: Sink + Send + 'static>(
    platform: &impl Platform,
    plan: &mut Plan,
    mut record: Option<&mut BootRecord<S>>,
) -> Result<(), LaunchError> {
    let to = record.as_deref_mut().map(BootRecord::file);
    let launched = ask_edge(platform, |edge| {
        let launched = edge.launch(plan, to);
        IS_ON.store(edge.is_on(), Ordering::Relaxed);
        launched
    });
    let restored = launched.unwrap_or(Ok(())).and_then(|()| plan.restore());
    restored.map_err(LaunchError::new)?;
    if let Some(record) = record {
        let terms = platform.terms();
        record.commit(plan, &terms.scheduler, terms.overheads);
    }
    Ok(())
}

/// Reports the failure of an instance to the edge, with its time on the clock. The scheduler's lock
/// is held.
///
/// See [`Platform`].
pub fn failed(instance: Instance, clock_ns: u64) {
    if IS_ON.load(Ordering::Relaxed) {
        with_edge(|edge| edge.failed(instance, clock_ns));
    }
}

/// Reports the fate of a job or an instance to the edge, if the edge needs the report. The
/// scheduler's lock is held.
///
/// See [`Platform`].
pub fn happened(notice: &DriverNotice) {
    if IS_ON.load(Ordering::Relaxed) {
        with_edge(|edge| edge.happened(notice));
    }
}
