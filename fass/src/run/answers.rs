//! The answers of a recorded device: written down, and given back in a replay.
//!
//! A device's answer crosses the edge of a DAG, and so does its duration. Both are written down
//! when the instance has got the answer, or has not got it in time. Like all findings of an
//! instance, the answer goes to the platform when the instance is complete, or has failed. The
//! answers of one job form a single value: a list of the waits, each with its number, the answer's
//! duration and the answer. In a replay no question is sent: a wait takes as long as recorded, and
//! has the same result.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use recording::{Decoder, Encoder, Full, Recordable, Schema};

use super::cell::SharedCell;
use super::effect::RequestTarget;
use super::line::{ChannelState, TopicEdge, room_for};

/// An answer in the recorded format: the number of the wait, the answer's duration in nanoseconds,
/// and the answer, if there was one in time.
type FoundAnswer<A> = (u32, u64, Option<A>);

/// A device, with any types of questions and answers.
pub(crate) trait AnyDevice: Send + Sync {
    fn name(&self) -> &str;

    /// Returns the type of a job's recorded answers, and their line, if recorded.
    fn line(&self) -> Option<(Schema, Arc<ChannelState>)>;

    /// Returns the DAG released by the device's questions, if any.
    fn server(&self) -> Option<&Arc<RequestTarget>>;
}

/// A subtask, and the device asked by it.
pub(crate) struct AskedDevice(pub(crate) usize, pub(crate) Arc<dyn AnyDevice>);

/// The answers of a device with recorded answers.
pub(crate) trait AnyAnswers<A>: Send + Sync {
    fn line(&self) -> (Schema, Arc<ChannelState>);

    /// Reports whether answers are recorded in this run, or come from a recording.
    fn is_open(&self) -> bool;

    /// Returns the recorded answer to a wait of a job, and its duration in ns, if this is a replay
    /// with such an answer.
    fn recorded(&self, wait: (u64, u32)) -> Option<(u64, Option<A>)>;

    /// Reports whether this is a replay, and thus without a device.
    fn replays(&self) -> bool;

    /// Writes down the answer to a wait of a job, and its duration in ns.
    fn keep(&self, wait: (u64, u32), took_ns: u64, answer: Option<&A>);
}

/// Recorded answers.
pub(crate) struct RecordedAnswers {
    line: Arc<ChannelState>,
    so_far: SharedCell<JobAnswers>,
}

/// The answers of a job so far, as bytes.
struct JobAnswers {
    job: u64,
    count: u32,
    /// Longer than a permitted value, so a value too long is recognised by its length.
    bytes: Box<[u8]>,
    length: usize,
}

impl RecordedAnswers {
    pub(crate) fn new(edge: &'static TopicEdge) -> Self {
        Self {
            line: Arc::new(ChannelState::new(edge)),
            so_far: SharedCell::new(JobAnswers {
                job: u64::MAX,
                count: 0,
                bytes: vec![0; room_for(0) + 1].into(),
                length: 0,
            }),
        }
    }
}

impl JobAnswers {
    fn add<A: Recordable>(&mut self, (job, number): (u64, u32), ns: u64, answer: Option<&A>) {
        // The answers of a cut job are given up with the first answer of the next job.
        if self.job != job {
            (self.job, self.count, self.length) = (job, 0, 0);
        }
        let mut out = Encoder::new(&mut self.bytes[self.length..]);
        (number, ns, answer.is_some()).encode(&mut out);
        answer
            .into_iter()
            .for_each(|answer| answer.encode(&mut out));
        self.count += 1;
        match out.finish() {
            Ok(count) => self.length += count,
            // Then the whole value is too long for its line, which counts the value as lost.
            Err(Full { .. }) => self.length = self.bytes.len(),
        }
    }
}

impl<A: Recordable + Send + Sync> AnyAnswers<A> for RecordedAnswers {
    fn line(&self) -> (Schema, Arc<ChannelState>) {
        (Vec::<FoundAnswer<A>>::schema(), Arc::clone(&self.line))
    }

    fn is_open(&self) -> bool {
        self.line.is_open()
    }

    fn recorded(&self, (job, number): (u64, u32)) -> Option<(u64, Option<A>)> {
        let mut found = None;
        (self.line.edge.replay)(self.line.number(), job, &mut |bytes| {
            let mut input = Decoder::new(bytes);
            let count = u32::decode(&mut input).unwrap_or(0);
            let answers = (0..count).map_while(|_| FoundAnswer::<A>::decode(&mut input).ok());
            found = { answers }.find(|(of, ..)| *of == number);
        });
        found.map(|(_, ns, answer)| (ns, answer))
    }

    fn replays(&self) -> bool {
        self.line.is_open() && (self.line.edge.replays)()
    }

    fn keep(&self, wait: (u64, u32), took_ns: u64, answer: Option<&A>) {
        // One instance asks at a time (R2).
        let Some(mut so_far) = self.so_far.change() else {
            return;
        };
        so_far.add(wait, took_ns, answer);
        self.line.stage::<Vec<FoundAnswer<A>>>(wait.0, |out| {
            so_far.count.encode(out);
            out.put(&so_far.bytes[..so_far.length]);
        });
    }
}
