//! What a recording says of itself: whose it is, and what is in it.

use alloc::string::String;
use alloc::vec::Vec;

use crate::value::decode::{Decoder, Malformed};
use crate::value::encode::Encoder;
use crate::value::recordable::Recordable;
use crate::value::schema::Schema;

crate::recordable! {
    /// What stands at the start of a recording.
    ///
    /// See [`Writer`](crate::Writer).
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Header {
        /// The app, or what else the recording is of.
        pub app: String,
        /// The DAGs, in the order of their commit.
        pub dags: Vec<DagHeader>,
        /// What values there are.
        pub channels: Vec<Channel>,
    }

    /// A DAG of a recording.
    ///
    /// See [`Writer`](crate::Writer).
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct DagHeader {
        /// Its name.
        pub name: String,
        /// The hash of its names and edges; 0: the values were not recorded in a run.
        pub graph: u64,
    }

    /// Values of one type and one place: what a subtask writes to a topic, or samples, or finds in
    /// a state.
    ///
    /// See [`Writer`](crate::Writer).
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Channel {
        /// The number of the DAG.
        pub dag: u16,
        /// The number of the subtask that writes the values, or finds them.
        pub subtask: u16,
        /// What the values are to the DAG.
        pub role: Role,
        /// The topic, or the state.
        pub topic: String,
        /// The type.
        pub schema: Schema,
    }
}

/// What values are to their DAG.
///
/// ```
/// assert_eq!(recording::Role::Source.name(), "source");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A source returned them. A replay takes them.
    Source,
    /// Another subtask returned them. A replay compares them.
    Result,
    /// A subtask found them as latest values of a topic, of whatever DAG: the type is
    /// `(u64, u64, T)?`, with the job that the value is of, and when that was complete. A
    /// replay takes them.
    Sample,
    /// A subtask found them in a state, before it changed that in the job. A replay that begins
    /// with a job takes what is recorded of it, and compares the others. Since version 5 of the
    /// format.
    State,
}

impl Role {
    const ALL: [Self; 4] = [Self::Source, Self::Result, Self::Sample, Self::State];

    /// Returns the word for it.
    ///
    /// See [`Role`].
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Source => "source",
            Self::Result => "result",
            Self::Sample => "sample",
            Self::State => "state",
        }
    }

    /// Reports whether a subtask writes the values to a topic of its DAG.
    ///
    /// ```
    /// assert!(!recording::Role::Sample.is_written());
    /// ```
    #[must_use]
    pub const fn is_written(self) -> bool {
        matches!(self, Self::Source | Self::Result)
    }
}

impl Recordable for Role {
    const LEAST_BYTES: usize = 1;
    const DEPTH: usize = 1;

    fn schema() -> Schema {
        u8::schema()
    }

    fn encode(&self, out: &mut Encoder<'_>) {
        let place = Self::ALL.iter().position(|other| other == self);
        let number = place.and_then(|place| u8::try_from(place).ok());
        out.put(&[number.unwrap_or(u8::MAX)]);
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
        let malformed =
            input.expected("what the values are: 0 source, 1 result, 2 sample, 3 state");
        let number = u8::decode(input)?;
        (Self::ALL.get(usize::from(number)).copied()).ok_or(malformed)
    }
}
