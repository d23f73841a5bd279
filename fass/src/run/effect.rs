//! What an instance leaves outside its DAG, held back until it is complete.
//!
//! Values on edges need no holding back: their readers are started by the
//! scheduler, and only after the completion. Latest values, signals and requests to the
//! run as a whole have readers that do not wait for it. So the function only *prepares*
//! them, and the platform publishes them when it reports the completion
//! ([`Body::complete`](crate::Body::complete)): the completion boundary (R3) holds
//! for them as it does for edges, also in virtual time, where a function has run
//! long before its instance is complete.

use alloc::boxed::Box;

use sched_dag::lifecycle::Request;

/// An effect without its signals.
pub(crate) struct Muted(pub(crate) Box<dyn Effect>);

impl Effect for Muted {
    fn happen(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request)) {
        self.0.happen(completed_ns, &mut |request| match request {
            Request::Signal(_) => {}
            other => ask(other),
        });
    }

    fn fail(&mut self, failed_ns: u64) {
        self.0.fail(failed_ns);
    }
}

/// Something that a function has prepared, perhaps.
pub(crate) trait Effect: Send {
    /// Publishes it if it was prepared since the last time. `ask` takes what the scheduler is
    /// to be told.
    fn happen(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request));

    /// Does what is to be done for an instance that has failed.
    fn fail(&mut self, _failed_ns: u64) {}
}

/// What a platform does at a completion.
pub(super) struct Act(pub(super) Box<dyn FnMut() + Send>);

impl Effect for Act {
    fn happen(&mut self, _completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        (self.0)();
    }
}
