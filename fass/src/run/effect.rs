//! What an instance leaves outside its DAG, held back until it is complete.
//!
//! Values on edges need no holding back: their readers are started by the
//! scheduler, and only after the completion. A latest value and a signal have
//! readers that ask nobody. So the function only *prepares* them, and the platform
//! publishes them when it reports the completion
//! ([`Body::complete`](crate::Body::complete)): the completion boundary (R3) holds
//! for them as it does for edges, also in virtual time, where a function has run
//! long before its instance is complete.

use sched_dag::DagId;

/// Something that a function has prepared, perhaps.
pub(crate) trait Effect: Send {
    /// Publishes it if it was prepared since the last time. `raise` takes the
    /// DAG that gets a signal.
    fn happen(&mut self, completed_ns: u64, raise: &mut dyn FnMut(DagId));

    /// Does what is to be done for an instance that has failed.
    fn fail(&mut self, _failed_ns: u64) {}
}
