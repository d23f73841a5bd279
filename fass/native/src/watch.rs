//! The observer of a run: none, or a recorder.

use sched_dag::{CoreId, Instance, Observer};

/// Is told of everything, always by the worker that steps the scheduler.
pub(crate) trait Watch: Observer + Send {
    /// How far the scheduler's clock moves on from one instant to the next.
    ///
    /// Not at all if nobody looks on; else instants must differ, so that what comes
    /// first can be seen.
    const STEP_NS: u64;

    /// An instant begins.
    fn instant(&mut self, now_ns: u64) {
        let _ = now_ns;
    }

    /// A core begins an instance at this instant.
    fn started(&mut self, instance: Instance, core: CoreId) {
        let _ = (instance, core);
    }

    /// The scheduler hears of an instance's end at this instant.
    fn finished(&mut self, instance: Instance, core: CoreId) {
        let _ = (instance, core);
    }
}

impl Watch for () {
    const STEP_NS: u64 = 0;
}
