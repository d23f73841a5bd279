//! What happens at the edge, on its way to the drain.
//!
//! Each channel has a place for its values, into which its subtask writes them; here comes only
//! what else happens, and which values had no room there. If even these are too many, the tape
//! ends there, and the recording says that it is cut.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;
use core::sync::atomic::AtomicU64;

use recording::{Channel, Encoder, Header, Recordable};
use sched_dag::{DagId, Instance, Notice, SubtaskId};

use super::drain::{EVENT_BYTES, OfTape, event};
use super::lost::{Lost, LostJobs};
use super::replay::Outcome;
use super::{Crossing, Drain, name, open, recorded};
use crate::run::cell::outbox::{Outbox, outbox, words_of};
use crate::run::crossing::Recorded;
use crate::run::line::LineOf;
use crate::run::plan::Plan;

/// Records a run.
pub(super) struct Tape {
    app: &'static str,
    bytes: usize,
    header: Header,
    events: Option<Outbox>,
    drain: Option<Box<dyn Drain>>,
    lines: Vec<LineOf>,
    /// By channel: where a value is put that is given, for somebody in front of the tape looks.
    given: Vec<Option<Outbox>>,
    lost: Lost,
}

impl Tape {
    pub(super) fn new(app: &'static str, bytes: usize) -> Self {
        Self {
            app,
            bytes,
            header: Header::default(),
            events: None,
            drain: None,
            lines: Vec::new(),
            given: Vec::new(),
            lost: Lost {
                values: Arc::default(),
                rest_ns: Arc::new(AtomicU64::new(u64::MAX)),
            },
        }
    }

    /// Makes all places, each with the same part of the memory; `None`: there is too little.
    fn provide(&mut self, plan: &mut Plan) -> Option<()> {
        let channels = &self.header.channels;
        let words = self.bytes / 8 / (channels.len() + 1);
        let (events, reader) = outbox(words.max(64 * words_of(EVENT_BYTES)))?;
        self.lines = mem::take(&mut plan.lines);
        let records = (self.lines.iter().zip(channels))
            .map(|(of, channel)| of.line.reader(words, channel.schema.least_bytes()));
        let (records, given) = records.collect::<Option<_>>()?;
        self.given = given;
        self.lost.values = channels.iter().map(|_| LostJobs::new()).collect();
        let (header, lost) = (self.header.clone(), self.lost.clone());
        let drain = OfTape::new(reader, records, header, lost, &plan.task_set);
        self.events = Some(events);
        self.drain = Some(Box::new(drain));
        Some(())
    }
}

impl Tape {
    /// Puts an event into its ring; without room the recording ends.
    fn put(&mut self, what: recording::What, of: Instance, release_ns: Option<u64>, at_ns: u64) {
        let mut bytes = [0; EVENT_BYTES];
        let mut out = Encoder::new(&mut bytes);
        event(what, of, release_ns).encode(&mut out);
        let length = out.finish().unwrap_or(EVENT_BYTES);
        if let Some(events) = &self.events
            && !events.put(of.job, at_ns, &bytes[..length])
        {
            self.lost.end(at_ns);
        }
    }
}

/// Takes a value that is not where the drain reads it: it is given, and is put there, or is lost.
fn take(given: &[Option<Outbox>], lost: &Lost, value: &Recorded<'_>, at_ns: u64) {
    let outbox = given
        .get(usize::from(value.channel))
        .and_then(Option::as_ref);
    let is_put = (value.bytes.zip(outbox))
        .is_some_and(|(bytes, outbox)| outbox.put(value.job, value.completed_ns, bytes));
    if !is_put {
        lost.note(value, at_ns);
    }
}

impl Crossing for Tape {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool {
        open(&mut self.header, dag, graph, channels);
        true
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        name(&mut self.header, self.app, &plan.task_set);
        self.provide(plan).ok_or_else(|| {
            alloc::format!(
                "`record`: there is no memory for a buffer of {} KiB; give the machine more \
                 memory, or the buffer less",
                self.bytes / 1024
            )
        })
    }

    fn record(&mut self, value: &Recorded<'_>, at_ns: u64) {
        take(&self.given, &self.lost, value, at_ns);
    }

    fn happened(&mut self, notice: &Notice) {
        let event = notice.event;
        if let Some(what) = recorded(event.what) {
            let subtask = event.subtask.unwrap_or(SubtaskId(0));
            let (dag, job) = (event.dag, event.job);
            let of = Instance { dag, job, subtask };
            self.put(what, of, notice.at_ns, event.time_ns);
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, clock_ns: u64) {
        for of in self.lines.iter().filter(|of| of.is_found_by(instance)) {
            (of.line).end(clock_ns, |sample| {
                take(&self.given, &self.lost, sample, at_ns);
            });
        }
        self.put(recording::What::Fault, instance, None, at_ns);
    }

    fn tell_time(&mut self, instance: Instance, clock_ns: u64, at_ns: u64) -> u64 {
        let number = u16::try_from(instance.dag.0);
        let mut channels = self.header.channels.iter();
        if channels.any(|channel| Ok(channel.dag) == number) {
            self.put(recording::What::Clock, instance, None, at_ns);
        }
        clock_ns
    }

    fn lend(&self, _channel: u16, _job: u64, _take: &mut dyn FnMut(&[u8])) {}

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        self.drain.take()
    }

    fn outcome(&self, _is_over: bool) -> Option<Outcome> {
        None
    }
}
