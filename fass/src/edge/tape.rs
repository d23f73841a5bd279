//! What happens at the edge, on its way into the buffer.
//!
//! What has no room is lost, but not what was lost: for each channel the jobs are noted, and go
//! into the buffer before the channel's next value does. If even these are too many, or an
//! event is lost, the tape ends there, and the recording says that it is cut.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::mem;

use recording::{Channel, Header};
use sched_dag::journal::What;
use sched_dag::{DagId, Instance};

use super::drain::{OfTape, Tag};
use super::replay::Outcome;
use super::ring::{Head, RingWriter, ring};
use super::{Crossing, Drain, Happened, name, open, recorded};
use crate::run::crossing::Recorded;
use crate::run::plan::Plan;
use crate::run::sample::{SampledBy, give_failed};

/// The words of the buffer that are left for events.
const KEPT_WORDS: usize = 512;

/// The most runs of jobs that are noted as lost, of each channel.
const MOST_RUNS: usize = 32;

/// Records a run.
pub(super) struct Tape {
    app: &'static str,
    bytes: usize,
    header: Header,
    ring: Option<RingWriter>,
    drain: Option<Box<dyn Drain>>,
    samplers: Vec<SampledBy>,
    /// By channel: the jobs whose values had no room, from one to another one.
    lost: Vec<Vec<(u64, u64)>>,
    /// Whether there is a buffer that is not closed, and no job is noted as lost.
    is_sound: bool,
}

impl Tape {
    pub(super) fn new(app: &'static str, bytes: usize) -> Self {
        Self {
            app,
            bytes,
            header: Header::default(),
            ring: None,
            drain: None,
            samplers: Vec::new(),
            lost: Vec::new(),
            is_sound: false,
        }
    }

    /// Records a value where something is lost, or it has no room.
    #[cold]
    fn record_or_lose(&mut self, value: &Recorded<'_>, at_ns: u64) {
        let (channel, job) = (value.channel, value.job);
        if self.ring.as_ref().is_none_or(RingWriter::is_closed) {
            return;
        }
        // There may be room again.
        if self.tell_lost(channel, at_ns) && self.put(value, at_ns) {
            self.is_sound = self.lost.iter().all(Vec::is_empty);
        } else {
            self.lose(channel, job);
        }
    }

    /// Writes a value into the buffer; `false`: it has no room.
    #[inline(always)]
    fn put(&mut self, value: &Recorded<'_>, at_ns: u64) -> bool {
        let (Some(ring), Some(bytes)) = (&mut self.ring, value.bytes) else {
            return false;
        };
        let tag = Tag::Value {
            channel: value.channel,
        };
        let head = Head {
            tag: tag.to_word(),
            job: value.job,
            at_ns,
        };
        ring.put(head, bytes, KEPT_WORDS)
    }

    /// Notes that a value is lost.
    #[cold]
    fn lose(&mut self, channel: u16, job: u64) {
        self.is_sound = false;
        let (Some(ring), Some(runs)) = (&self.ring, self.lost.get_mut(usize::from(channel))) else {
            return;
        };
        let is_full = runs.len() == runs.capacity();
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == job => *last = job,
            _ if is_full => ring.close(),
            _ => runs.push((job, job)),
        }
    }

    /// Hands the lost jobs of a channel to the drain; `false`: they have no room.
    #[cold]
    fn tell_lost(&mut self, channel: u16, at_ns: u64) -> bool {
        let (Some(ring), Some(runs)) = (&mut self.ring, self.lost.get_mut(usize::from(channel)))
        else {
            return true;
        };
        while let Some(&(first, last)) = runs.first() {
            let head = Head {
                tag: Tag::Lost { channel }.to_word(),
                job: first,
                at_ns,
            };
            if !ring.put_seldom(head, &last.to_le_bytes(), KEPT_WORDS) {
                return false;
            }
            runs.remove(0);
        }
        true
    }
}

impl Crossing for Tape {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) {
        open(&mut self.header, dag, graph, channels);
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        name(&mut self.header, self.app, &plan.task_set);
        let Some((writer, reader)) = ring(self.bytes) else {
            return Err(alloc::format!(
                "`record`: there is no memory for a buffer of {} KiB; give the machine more \
                 memory, or the buffer less",
                self.bytes / 1024
            ));
        };
        self.ring = Some(writer);
        self.samplers = mem::take(&mut plan.samplers);
        self.lost = (self.header.channels.iter())
            .map(|_| Vec::with_capacity(MOST_RUNS))
            .collect();
        let drain = OfTape::new(reader, self.header.clone(), &plan.task_set);
        self.drain = Some(Box::new(drain));
        self.is_sound = true;
        Ok(())
    }

    fn record(&mut self, value: &Recorded<'_>, at_ns: u64) {
        if !self.is_sound || !self.put(value, at_ns) {
            self.record_or_lose(value, at_ns);
        }
    }

    fn happened(&mut self, what: What, happened: &Happened) {
        let Happened {
            dag,
            subtask,
            job,
            release_ns,
            at_ns,
        } = *happened;
        // The platform tells of releases only where they are signals.
        let (Some(ring), Some(what)) = (&mut self.ring, recorded(what, true)) else {
            return;
        };
        if ring.is_closed() {
            return;
        }
        let tag = Tag::Event { what, dag, subtask }.to_word();
        let release_ns = release_ns.map(u64::to_le_bytes);
        let bytes = release_ns.as_ref().map_or(&[][..], |bytes| bytes);
        if !ring.put_seldom(Head { tag, job, at_ns }, bytes, 0) {
            self.is_sound = false;
            ring.close();
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64) {
        let samplers = mem::take(&mut self.samplers);
        give_failed(&samplers, instance, at_ns, &mut |sample| {
            self.record(sample, at_ns);
        });
        self.samplers = samplers;
    }

    fn lend(&self, _channel: u16, _job: u64, _take: &mut dyn FnMut(&[u8])) {}

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        self.drain.take()
    }

    fn flush(&mut self) -> bool {
        (0..)
            .zip(&self.header.channels.clone())
            .all(|(channel, _)| {
                let runs = self.lost.get(usize::from(channel));
                runs.is_none_or(Vec::is_empty) || self.tell_lost(channel, u64::MAX)
            })
    }

    fn outcome(&self, _is_over: bool) -> Option<Outcome> {
        None
    }
}
