//! The signals of a replay on a machine.
//!
//! Only recorded ones release anything, each not before its time, nor before the one before it
//! has led to a release: so none is dropped where functions take longer than they took. They are
//! raised by what core 0 does when it has nothing else to do.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU64, Ordering};

use sched_dag::DagId;

use super::replay::Replay;
use super::{Drain, Drained, Host, Record};
use crate::run::plan::Plan;

/// The number of a plan whose signals are a replay's: no signal of the app knows it.
const REPLAYED: u64 = u64::MAX;

/// Stands where a time does, for: no signal is to come, or not yet.
const NONE: u64 = u64::MAX;

/// The next signal of each sporadic DAG.
#[derive(Clone, Debug)]
pub(super) struct Signals(Arc<[(DagId, AtomicU64)]>);

impl Signals {
    /// Takes the place of all signals of a plan.
    pub(super) fn take_over(plan: &mut Plan, replay: &mut Replay) -> Self {
        plan.number = REPLAYED;
        plan.after_fault.fill(None);
        for body in plan.bodies.iter_mut().flatten() {
            body.mute();
        }
        let dags = (0..).map(DagId).zip(plan.task_set.dags());
        let sporadic = dags.filter(|(_, dag)| dag.is_sporadic());
        let next =
            sporadic.map(|(dag, _)| (dag, replay.next_signal_ns(dag).unwrap_or(NONE).into()));
        Self(next.collect())
    }

    /// Goes on to the next signal of a DAG: the one before has led to a release.
    pub(super) fn follow(&self, dag: DagId, next_ns: Option<u64>) {
        if let Some((_, at_ns)) = self.0.iter().find(|(of, _)| *of == dag) {
            at_ns.store(next_ns.unwrap_or(NONE), Ordering::Release);
        }
    }

    /// Takes those that are due.
    fn due(&self, now_ns: u64) -> impl Iterator<Item = DagId> {
        let is_due = move |(_, at_ns): &&(DagId, AtomicU64)| {
            let due_ns = at_ns.load(Ordering::Acquire);
            // Before the signal, which may have led to a release when `raise` returns.
            let place = (due_ns <= now_ns).then(|| at_ns.store(NONE, Ordering::Release));
            place.is_some()
        };
        self.0.iter().filter(is_due).map(|(dag, _)| *dag)
    }

    /// Returns what raises them, if there are any.
    pub(super) fn raiser(&self, host: Host) -> Option<Box<dyn Drain>> {
        let raiser = Raiser {
            signals: self.clone(),
            host,
            epoch_ns: 0,
        };
        (!self.0.is_empty()).then(|| Box::new(raiser) as _)
    }
}

/// Raises the signals of a replay.
struct Raiser {
    signals: Signals,
    host: Host,
    epoch_ns: u64,
}

impl Drain for Raiser {
    fn begin(&mut self, _to: &mut Record) {}

    fn begin_run(&mut self, epoch_ns: u64) {
        self.epoch_ns = epoch_ns;
    }

    fn step(&mut self, _to: Option<&mut Record>) -> bool {
        if let Some(now_ns) = (self.host.now_ns)().checked_sub(self.epoch_ns) {
            for dag in self.signals.due(now_ns) {
                (self.host.raise)(REPLAYED, dag);
            }
        }
        false
    }

    fn end(&mut self, _to: &mut Record) -> Option<Drained> {
        None
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn a_signal_is_due_once_and_the_next_one_after_its_release() {
        let signals = Signals(Arc::new([(DagId(1), 10.into()), (DagId(4), 30.into())]));
        let due = |now_ns| signals.due(now_ns).collect::<Vec<_>>();
        assert_eq!(due(9), []);
        assert_eq!(due(10), [DagId(1)]);
        assert_eq!(due(20), [], "it has led to no release");
        signals.follow(DagId(1), Some(15));
        assert_eq!(due(40), [DagId(1), DagId(4)]);
        signals.follow(DagId(4), None);
        assert_eq!(due(u64::MAX - 1), []);
    }
}
