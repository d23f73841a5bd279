//! The reports of platforms to their [edges](super::Platform::at_edge), the same on each.

use core::sync::atomic::{AtomicBool, Ordering};

use sched_dag::{DriverNotice, Instance};

use super::{LaunchError, Platform, ask_edge, with_edge};
use crate::edge::{BootRecord, Sink};
use crate::run::plan::Plan;

/// Whether a plan has been launched with a wish, so that events are of interest.
static IS_ON: AtomicBool = AtomicBool::new(false);

/// Sets recording or replay of a plan up on a platform, if it was asked for, restores its states, and
/// adds it to the record, if one is kept.
///
/// See [`Platform`].
///
/// # Errors
///
/// If nothing of the plan is recorded, it does not fit a replay, or it is a second one; or its states
/// cannot be restored.
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

/// Takes note that an instance has failed, and when on the clock. The scheduler's lock is held.
///
/// See [`Platform`].
pub fn failed(instance: Instance, clock_ns: u64) {
    if IS_ON.load(Ordering::Relaxed) {
        with_edge(|edge| edge.failed(instance, clock_ns));
    }
}

/// Takes what became of a job or an instance, if it is of interest. The scheduler's lock is held.
///
/// See [`Platform`].
pub fn happened(notice: &DriverNotice) {
    if IS_ON.load(Ordering::Relaxed) {
        with_edge(|edge| edge.happened(notice));
    }
}
