//! Signals to sporadic DAGs, and what else completions do beyond their DAG.
//!
//! A completing instance's latest values show, and its requests are taken, signals among them,
//! under the lock and before the scheduler's step; the step passes them on right after the
//! completion. A signal from outside makes a step of its own. A request that concerns another
//! cluster is a letter ([`letters`]), which counts once that cluster takes it.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::sync::atomic::Ordering;

use fass::{Body, Plan, Request};
use sched_dag::lifecycle::{Lifecycle, Requests};
use sched_dag::{ClusterId, DagId, Moment};

use super::cluster::MAY_DIVIDE;
use super::core_set::CoreSet;
use super::letters::{self, Letters};
use super::watcher::Watcher;
use super::{Execution, Occasion, cluster, divided, status};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, interrupt_flag, this_core};

/// The requests of a run that are on their way to its scheduler.
pub(super) struct Signals {
    /// The number of the plan that runs.
    plan: u64,
    /// Whether the run has begun, so that there is time.
    has_begun: bool,
    requests: Requests,
    /// The cluster whose requests these are.
    cluster: ClusterId,
    letters: Letters,
    /// By DAG, the one that gets a signal when a fault ends it.
    after_fault: Vec<Option<DagId>>,
}

impl Signals {
    pub(super) fn new(
        plan: &Plan,
        cluster: ClusterId,
        letters: &Letters,
        lifecycle: Option<Box<dyn Lifecycle>>,
    ) -> Self {
        Self {
            plan: plan.number,
            cluster,
            letters: letters.clone(),
            has_begun: false,
            requests: Requests::new(plan.bodies.len(), lifecycle),
            after_fault: plan.after_fault.clone(),
        }
    }

    /// Returns the DAG that gets a signal when a fault ends another.
    pub(super) fn after_fault(&self, ended: DagId) -> Option<DagId> {
        self.after_fault.get(ended.index()).copied().flatten()
    }

    /// Publishes what the body has prepared, and takes its requests. Apart, as most
    /// bodies never have any.
    #[inline(never)]
    pub(super) fn take(&mut self, body: &mut Body, completed_ns: u64) {
        body.complete(completed_ns, &mut |request| self.requests.keep(request));
    }

    /// Reports whether none is on its way.
    pub(super) const fn are_none(&self) -> bool {
        self.requests.are_none()
    }

    /// Passes on what was taken, and adds the cores that have to take letters.
    #[inline(always)]
    pub(super) fn send(
        &mut self,
        moment: &mut Moment<'_>,
        watcher: &mut Watcher,
        woken: &mut CoreSet,
    ) {
        if MAY_DIVIDE {
            let (letters, cluster) = (&self.letters, self.cluster);
            self.requests
                .give_away(|request| letters::send(letters, cluster, request, woken));
        }
        self.requests.serve(moment, watcher);
    }

    /// Passes one signal on.
    pub(super) fn pass(
        &self,
        dag: DagId,
        moment: &mut Moment<'_>,
        watcher: &mut Watcher,
        woken: &mut CoreSet,
    ) {
        let signal = Request::Signal(dag);
        if !MAY_DIVIDE || !letters::send(&self.letters, self.cluster, signal, woken) {
            moment.signal(dag, watcher);
        }
    }

    /// Takes the letters that have come.
    pub(super) fn take_letters(&mut self, moment: &mut Moment<'_>, watcher: &mut Watcher) {
        watcher.cluster().has_letters.swap(false, Ordering::AcqRel);
        if let Some(letters) = &self.letters {
            (self.requests).serve_letters(letters, self.cluster, moment, watcher);
        }
    }
}

impl Execution {
    /// Begins to pass signals on, those from before at time 0.
    pub(super) fn begin_signals(&mut self) {
        self.signals.has_begun = true;
        let mut moment = self.scheduler.at(0);
        // What was raised before is to DAGs of this cluster.
        let mut none = CoreSet::default();
        self.signals.send(&mut moment, &mut self.watcher, &mut none);
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
    let cluster = divided::of_dag(dag);
    let mut place = cluster.execution.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    if execution.signals.plan != plan {
        return;
    }
    if !execution.signals.has_begun {
        execution.signals.requests.keep(Request::Signal(dag));
        return;
    }
    let occasion = Occasion::Signalled(dag);
    let mut woken = CoreSet::default();
    cluster::among(cluster, || {
        execution.step(clock::now_ns(), occasion, &mut woken)
    });
    drop(place);
    woken.wake();
    // The step may want this core, too, which follows at its next interrupt.
    timer::set(Alarm::Schedule, clock::now_ns());
}
