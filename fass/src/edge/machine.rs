//! A replay as a machine carries it out.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::mem;

use recording::{Channel, Header};
use sched_dag::journal::What;
use sched_dag::{DagId, Instance, Notice};

use super::replay::{Outcome, Replay};
use super::signals::Signals;
use super::{Crossing, Drain, Host, name, open};
use crate::run::crossing::Recorded;
use crate::run::line::LineOf;
use crate::run::plan::Plan;

/// A replay of what the loader has left in memory.
pub(super) struct OfMachine {
    bytes: &'static [u8],
    from: Option<(&'static str, u64)>,
    host: Host,
    own: Header,
    lines: Vec<LineOf>,
    /// From the launch on.
    replay: Option<Replay>,
    signals: Option<Signals>,
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
            signals: None,
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
        self.signals = Some(Signals::take_over(plan, &mut replay));
        self.replay = Some(replay);
        Ok(())
    }

    fn record(&mut self, value: &Recorded<'_>, _at_ns: u64) {
        if let Some(replay) = &mut self.replay {
            replay.compare(value);
        }
    }

    fn happened(&mut self, notice: &Notice) {
        if let What::Due | What::Skipped = notice.event.what
            && let (Some(replay), Some(signals)) = (&mut self.replay, &self.signals)
        {
            let dag = notice.event.dag;
            signals.follow(dag, replay.next_signal_ns(dag));
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, _clock_ns: u64) {
        if let Some(replay) = &mut self.replay {
            for of in self.lines.iter().filter(|of| of.is_found_by(instance)) {
                of.line.show(at_ns, |found| replay.compare(found));
            }
            replay.meet_fault(instance);
        }
    }

    fn tell_time(&mut self, instance: Instance, clock_ns: u64, _at_ns: u64) -> u64 {
        let told = (self.replay.as_mut()).and_then(|replay| replay.next_told_ns(instance));
        told.unwrap_or(clock_ns)
    }

    fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        if let Some(value) = (self.replay.as_ref()).and_then(|replay| replay.value(channel, job)) {
            take(value);
        }
    }

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        self.signals.as_ref()?.raiser(self.host)
    }

    fn outcome(&self, is_over: bool) -> Option<Outcome> {
        (self.replay.as_ref()).map(|replay| replay.outcome(is_over))
    }
}
