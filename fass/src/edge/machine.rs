//! A replay as a machine carries it out, and its signals.
//!
//! Only recorded signals release anything, each not before its time, nor before the one before it
//! has led to a release: so none is dropped where functions take longer than they took. They are
//! raised by what core 0 does when it has nothing else to do.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;
use core::sync::atomic::{AtomicU64, Ordering};

use recording::{Channel, Header};
use sched_dag::journal::What;
use sched_dag::{DagId, Instance, Notice};

use super::replay::{Outcome, Replay};
use super::{Crossing, Drain, Drained, Host, Record, name, open};
use crate::run::line::{LineOf, Recorded};
use crate::run::plan::Plan;

/// A replay of what the loader has left in memory.
pub(super) struct OfMachine {
    bytes: &'static [u8],
    from: Option<(&'static str, u64)>,
    host: Host,
    own: Header,
    lines: Vec<LineOf>,
    /// From the launch on.
    replay: Option<(Replay, Signals)>,
}

impl OfMachine {
    pub(super) fn new(bytes: &'static [u8], from: Option<(&'static str, u64)>, host: Host) -> Self {
        Self {
            bytes,
            from,
            host,
            own: Header::default(),
            lines: Vec::new(),
            replay: None,
        }
    }
}

impl Crossing for OfMachine {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool {
        open(&mut self.own, dag, graph, channels);
        false
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        name(&mut self.own, "", &plan.task_set);
        let read = Replay::read(self.bytes);
        let mut replay = read.map_err(|malformed| format!("the recording, {malformed}"))?;
        if let Some((dag, job)) = self.from {
            replay.begin_before(dag, job);
        }
        replay.fit(&self.own, &plan.task_set)?;
        replay.prepare(plan)?;
        replay.guard(plan);
        self.lines = mem::take(&mut plan.lines);
        let signals = Signals::take_over(plan, &mut replay);
        self.replay = Some((replay, signals));
        Ok(())
    }

    fn record(&mut self, value: &Recorded<'_>, _at_ns: u64) {
        if let Some((replay, _)) = &mut self.replay {
            replay.compare(value);
        }
    }

    fn happened(&mut self, notice: &Notice) {
        if let What::Due | What::Skipped = notice.event.what
            && let Some((replay, signals)) = &mut self.replay
        {
            let dag = notice.event.dag;
            signals.follow(dag, replay.next_signal_ns(dag));
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, _clock_ns: u64) {
        if let Some((replay, _)) = &mut self.replay {
            for of in self.lines.iter().filter(|of| of.is_found_by(instance)) {
                of.line.show(at_ns, |found| replay.compare(found));
            }
            replay.meet_fault(instance);
        }
    }

    fn tell_time(&mut self, instance: Instance, clock_ns: u64, _at_ns: u64) -> u64 {
        let told = (self.replay.as_mut()).and_then(|(replay, _)| replay.next_told_ns(instance));
        told.unwrap_or(clock_ns)
    }

    fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        if let Some(value) =
            (self.replay.as_ref()).and_then(|(replay, _)| replay.value(channel, job))
        {
            take(value);
        }
    }

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        self.replay.as_ref()?.1.raiser(self.host)
    }

    fn outcome(&self, is_over: bool) -> Option<Outcome> {
        (self.replay.as_ref()).map(|(replay, _)| replay.outcome(is_over))
    }
}

/// The number of a plan whose signals are a replay's: no signal of the app knows it.
const REPLAYED: u64 = u64::MAX;

/// Stands where a time does, for: no signal is to come, or not yet.
const NONE: u64 = u64::MAX;

/// The next signal of each sporadic DAG.
#[derive(Clone, Debug)]
struct Signals(Arc<[(DagId, AtomicU64)]>);

impl Signals {
    /// Takes the place of all signals of a plan.
    fn take_over(plan: &mut Plan, replay: &mut Replay) -> Self {
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
    fn follow(&self, dag: DagId, next_ns: Option<u64>) {
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
    fn raiser(&self, host: Host) -> Option<Box<dyn Drain>> {
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
