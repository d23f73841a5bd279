//! A replay as a machine carries it out.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;

use recording::{Channel, Header};
use sched_dag::DagId;
use sched_dag::journal::What;

use super::replay::{Outcome, Replay};
use super::{Crossing, Drain, Happened, name, open};
use crate::run::crossing::Recorded;
use crate::run::plan::Plan;

/// A replay of what the loader has left in memory.
pub(super) struct OfMachine {
    bytes: &'static [u8],
    own: Header,
    /// From the launch on.
    replay: Option<Replay>,
}

impl OfMachine {
    pub(super) fn new(bytes: &'static [u8]) -> Self {
        Self {
            bytes,
            own: Header::default(),
            replay: None,
        }
    }
}

impl Crossing for OfMachine {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) {
        open(&mut self.own, dag, graph, channels);
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        name(&mut self.own, "", &plan.task_set);
        let read = Replay::read(self.bytes);
        let mut replay = read.map_err(|malformed| format!("the recording, {malformed}"))?;
        replay.fit(&self.own, &plan.task_set)?;
        let dags = plan.task_set.dags().iter();
        let mut replayed = ((0..).map(DagId).zip(dags)).filter(|(dag, _)| replay.is_of(*dag));
        if let Some((_, dag)) = replayed.find(|(_, dag)| dag.is_sporadic()) {
            return Err(format!(
                "dag `{}` is sporadic, and a machine does not replay signals yet; replay it in \
                 virtual time",
                dag.name()
            ));
        }
        replay.prepare(plan);
        replay.guard(plan);
        self.replay = Some(replay);
        Ok(())
    }

    fn record(&mut self, value: &Recorded<'_>, _at_ns: u64) {
        if let Some(replay) = &mut self.replay {
            replay.compare(value);
        }
    }

    fn happened(&mut self, _what: What, _happened: &Happened) {}

    fn lend(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        if let Some(value) = (self.replay.as_ref()).and_then(|replay| replay.value(channel, job)) {
            take(value);
        }
    }

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        None
    }

    fn flush(&mut self) -> bool {
        true
    }

    fn outcome(&self, is_over: bool) -> Option<Outcome> {
        (self.replay.as_ref()).map(|replay| replay.outcome(is_over))
    }
}
