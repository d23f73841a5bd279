//! What happened, one after the other.

use alloc::vec::Vec;

use crate::file::header::Header;
use crate::value::decode::{Decoder, Malformed};
use crate::value::encode::Encoder;
use crate::value::recordable::Recordable;

/// Something that happened in a run.
///
/// See [`Writer`](crate::Writer).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'v> {
    /// What.
    pub what: What,
    /// The number of the DAG.
    pub dag: u16,
    /// The number of the channel or of the subtask; [`What`] says which.
    pub place: u16,
    /// The job.
    pub job: u64,
    /// The nominal release of the job, in nanoseconds from the start of the run.
    pub release_ns: u64,
    /// When it happened: for values, when the instance was complete that wrote or sampled
    /// them.
    pub at_ns: u64,
    /// The value's bytes, where it has one.
    pub value: &'v [u8],
}

/// What happened.
///
/// ```
/// assert_eq!(recording::What::Value.name(), "value");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// A value of a channel.
    Value,
    /// A signal released the job of a sporadic DAG.
    Signal,
    /// The job was due, and was never released.
    Skip,
    /// The instance of a subtask will not run.
    Cut,
    /// The subtask goes on with another function, after a fault in this job.
    Restart,
    /// The value of a channel is not in the recording, for there was no room.
    Lost,
    /// The instance of a subtask asked for the time: the value is a `Vec<u64>` of the answers,
    /// in nanoseconds. Since version 2 of the format.
    Clock,
    /// The instance of the subtask failed. Since version 3 of the format.
    Fault,
}

impl What {
    const ALL: [Self; 8] = [
        Self::Value,
        Self::Signal,
        Self::Skip,
        Self::Cut,
        Self::Restart,
        Self::Lost,
        Self::Clock,
        Self::Fault,
    ];

    /// Returns the word for it.
    ///
    /// See [`What`].
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Value => "value",
            Self::Signal => "signal",
            Self::Skip => "skip",
            Self::Cut => "cut",
            Self::Restart => "restart",
            Self::Lost => "lost",
            Self::Clock => "clock",
            Self::Fault => "fault",
        }
    }
}

impl<'v> Entry<'v> {
    pub(super) fn encode(&self, out: &mut Encoder<'_>) {
        let place = What::ALL.iter().position(|what| *what == self.what);
        let number = place.and_then(|place| u8::try_from(place).ok());
        out.put(&[number.unwrap_or(u8::MAX)]);
        (self.dag, self.place, self.job, self.release_ns, self.at_ns).encode(out);
        out.put(self.value);
    }

    pub(super) fn decode(payload: &'v [u8]) -> Result<Self, Malformed> {
        let mut input = Decoder::new(payload);
        let malformed = input.expected("what happened, a number from 0 to 7");
        let number = usize::from(u8::decode(&mut input)?);
        let what = *What::ALL.get(number).ok_or(malformed)?;
        let (dag, place, job, release_ns, at_ns) = Recordable::decode(&mut input)?;
        Ok(Self {
            what,
            dag,
            place,
            job,
            release_ns,
            at_ns,
            value: input.take(input.remaining(), "the value")?,
        })
    }

    /// Makes sure that it fits to the header.
    pub(super) fn check(&self, header: &Header) -> Result<(), Malformed> {
        /// Where the numbers and the value stand in the payload.
        const DAG: usize = 1;
        const PLACE: usize = 3;
        const VALUE: usize = 29;
        let malformed = |offset, expected| Malformed { offset, expected };
        if usize::from(self.dag) >= header.dags.len() {
            return Err(malformed(DAG, "the number of a DAG of the header"));
        }
        let mut rest = Decoder::new(self.value);
        let checked = match self.what {
            What::Value | What::Lost => {
                let channel = header.channels.get(usize::from(self.place));
                let Some(channel) = channel.filter(|channel| channel.dag == self.dag) else {
                    return Err(malformed(PLACE, "the number of a channel of the DAG"));
                };
                match self.what {
                    What::Value => channel.schema.walk(&mut rest, &mut |_| ()),
                    _ => Ok(()),
                }
            }
            What::Clock => Vec::<u64>::schema().walk(&mut rest, &mut |_| ()),
            What::Signal | What::Skip | What::Cut | What::Restart | What::Fault => Ok(()),
        };
        checked
            .and_then(|()| rest.end())
            .map_err(|malformed| malformed.behind(VALUE))
    }
}
