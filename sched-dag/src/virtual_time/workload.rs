//! The world of a run in virtual time: how long instances execute, what fails, what comes from
//! outside.

use crate::engine::{Body, Cost};
use crate::ids::Instance;
use crate::journal::Subject;
use crate::lifecycle::Request;
use crate::scheduler::Notice;

/// What instances do and how long it takes them.
pub trait Workload<B = Instance> {
    /// Returns the execution time of an instance in nanoseconds; 0 is allowed. Called once for
    /// each instance, at its start. `None`: the run is [stopped](super::End::Stopped) at once.
    fn execute(&mut self, body: &mut B, now_ns: u64) -> Option<u64>;

    /// Reports whether an instance fails, instead of finishing, when its
    /// execution time is over: then its DAG is ended, or its job dropped. Called once for each
    /// instance, at its end.
    fn fails(&mut self, instance: Instance) -> bool {
        let _ = instance;
        false
    }

    /// Reports whether the function of an instance that fails could be replaced, if its body says
    /// so as well. Called once for each, right before the scheduler is told.
    fn is_replaceable(&mut self, instance: Instance) -> bool {
        let _ = instance;
        true
    }

    /// An instance has ended, what it publishes is published; or a fault ended it that costs this.
    fn ended(&mut self, instance: Instance, fault: Option<Cost>) {
        let _ = (instance, fault);
    }

    /// A job is released, skipped or completed, or a DAG stopped.
    fn hear(&mut self, notice: &Notice) {
        let _ = notice;
    }

    /// Takes a request that has come now, by a completion or a fault.
    fn request(&mut self, request: Request, now_ns: u64) {
        let _ = (request, now_ns);
    }

    /// Returns when the next request comes. Asked again at every instant.
    fn next_request_ns(&self) -> Option<u64> {
        None
    }

    /// Returns the next request that has come by now, and forgets it.
    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        let _ = now_ns;
        None
    }

    /// Returns how late the timer's interrupt is that is due then; what comes before it at the
    /// scheduler does what is due. Asked several times for one interrupt.
    fn late_ns(&self, due_ns: u64) -> u64 {
        let _ = due_ns;
        0
    }

    /// Reports whether the run is to stop, though jobs are left. Asked before each
    /// instant.
    fn stops(&self) -> bool {
        false
    }
}

/// A workload of which only the execution times matter.
#[derive(Debug)]
pub struct ExecutionTimes<F>(
    /// Returns the execution time of an instance in nanoseconds.
    pub F,
);

impl<B: Body, F: FnMut(Instance) -> u64> Workload<B> for ExecutionTimes<F> {
    fn execute(&mut self, body: &mut B, _now_ns: u64) -> Option<u64> {
        Some((self.0)(body.subject().instance()))
    }
}

/// Stands for a body without a function, which can always be replaced.
impl Body for Instance {
    type Alternate = ();

    fn set_job(&mut self, job: u64) {
        self.job = job;
    }

    fn subject(&self) -> Subject {
        Subject::of(*self)
    }

    fn discard(&mut self, _: u64) {}

    fn has_effects(&self) -> bool {
        false
    }

    fn complete(&mut self, _: u64, _: &mut dyn FnMut(Request)) {}

    fn alternate(&self) -> Option<()> {
        Some(())
    }

    fn replace(&mut self) {}
}
