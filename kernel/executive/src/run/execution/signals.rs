//! Signals to sporadic DAGs, and what else completions do beyond their DAG.
//!
//! A completing instance's latest values show, and its requests are taken, signals among them,
//! under the lock and before the scheduler's step; the step passes them on right after the
//! completion. A signal from outside makes a step of its own. A request that concerns another
//! cluster is a letter (`letters`), which counts once that cluster takes it.

use fass::{Plan, Request};
use sched_dag::DagId;

use super::core_set::CoreSet;
use super::letters::Letters;
use super::time::here;
use super::{Execution, control, status};
use crate::machine::{interrupt_flag, this_core};

/// The requests of a run that are on their way to its scheduler.
pub(super) struct Signals {
    /// The number of the plan that runs.
    pub(super) plan: u64,
    /// Whether the run has begun, so that there is time.
    pub(super) has_begun: bool,
    pub(super) letters: Letters,
}

impl Signals {
    pub(super) fn new(plan: &Plan, letters: &Letters) -> Self {
        Self {
            plan: plan.number,
            letters: letters.clone(),
            has_begun: false,
        }
    }
}

impl Execution {
    /// Begins to pass signals on, those from before at time 0.
    pub(super) fn begin_signals(&mut self) {
        self.signals.has_begun = true;
        // What was raised before is to DAGs of this cluster.
        let mut none = CoreSet::default();
        let (engine, mut port) = self.parts(&mut none);
        engine.tell((0, here()), &mut port, |_| ());
    }
}

/// Takes a signal from outside all instances to a DAG of the plan with a number. One
/// that comes between the commit and the run counts as of time 0.
///
/// # Panics
///
/// If an instance does so.
#[track_caller]
pub fn raise(plan: u64, dag: DagId) {
    let were_enabled = interrupt_flag::disable();
    let is_instance = status::running(this_core::get()).is_some();
    if !is_instance {
        raise_in_interrupt(plan, dag);
    }
    if were_enabled {
        interrupt_flag::enable();
    }
    assert!(
        !is_instance,
        "a subtask raises a signal that it was not registered with; register it by \
         `dag.using(signal.raising())`"
    );
}

/// Takes a signal from outside, like [`raise`], in an interrupt or where one could be: interrupts
/// are disabled.
pub fn raise_in_interrupt(plan: u64, dag: DagId) {
    control::serve(Some(plan), dag, Request::Signal(dag));
}
