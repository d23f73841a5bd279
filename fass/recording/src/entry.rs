//! A recording's header, naming its app and its contents, and the entries of a recording, one after
//! the other.
//!
//! The module also has the commit of a run, that is, its accepted model and the proven bounds, and
//! the statistics of all jobs of an ended run.

use alloc::string::String;
use alloc::vec::Vec;

use super::bytes::{Decoder, Encoder, Malformed};
use super::recordable::Recordable;
use super::schema::Schema;

crate::recordable! {
    /// The start of a recording.
    ///
    /// See [`Writer`](crate::Writer).
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Header {
        /// The app, or another origin of the recording.
        pub app: String,
        /// The DAGs, in the order of their commit.
        pub dags: Vec<DagHeader>,
        /// The channels of values.
        pub channels: Vec<Channel>,
    }

    /// A DAG of a recording.
    ///
    /// See [`Writer`](crate::Writer).
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct DagHeader {
        /// The DAG's name.
        pub name: String,
        /// The hash of the DAG's names and edges; 0: the DAG has no recorded topics, or the values
        /// were not recorded in a run.
        pub graph: u64,
    }

    /// Values of one type and one place: values that a subtask writes to a topic, samples, finds in
    /// a state, or gets from a device.
    ///
    /// See [`Writer`](crate::Writer).
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Channel {
        /// The number of the DAG.
        pub dag: u16,
        /// The number of the subtask writing the values, or finding them.
        pub subtask: u16,
        /// The role of the values in the DAG.
        pub role: Role,
        /// The topic, the state or the device.
        pub topic: String,
        /// The type.
        pub schema: Schema,
    }
}

/// Declares kinds with a number in recordings, in their order, and a word for each.
macro_rules! kinds {
    ($($(#[$about:meta])* pub enum $Kinds:ident($expected:literal) {
        $($(#[$doc:meta])* $Kind:ident = $name:literal,)+
    })+) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $Kinds {
            $($(#[$doc])* $Kind,)+
        }

        impl $Kinds {
            /// Returns the word for the kind.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Kind => $name,)+
                }
            }
        }

        impl Recordable for $Kinds {
            const LEAST_BYTES: usize = 1;
            const DEPTH: usize = 1;

            fn schema() -> Schema {
                u8::schema()
            }

            fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
                // The number is the place in the declaration: new kinds are added only at the end.
                out.put(&[*self as u8]);
            }

            fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
                // Made before the byte is read, so the error names the place of the number itself.
                let malformed = input.expected($expected);
                let number = usize::from(u8::decode(input)?);
                [$(Self::$Kind),+].get(number).copied().ok_or(malformed)
            }
        }
    )+};
}

kinds! {
    /// The role of values in their DAG.
    ///
    /// ```
    /// assert_eq!(recording::Role::Source.name(), "source");
    /// ```
    pub enum Role("what the values are: 0 source, 1 result, 2 sample, 3 state, 4 answer") {
        /// A source returned the values. A replay takes them.
        Source = "source",
        /// Another subtask returned the values. A replay compares them.
        Result = "result",
        /// A subtask found the values as latest values of a topic of any DAG. The type is
        /// `(u64, u64, T)?`, with the value's job, and the time at which its writer was complete.
        /// A replay takes the values.
        Sample = "sample",
        /// A subtask found the values in a state, before changing the state in the job. A replay
        /// beginning with a job takes that job's recorded states, and compares the others. Since
        /// version 5 of the format.
        State = "state",
        /// A subtask waited for the values, as answers of a device. The type is `[(u32, u64, T?)]`:
        /// for each wait of the job, its number, the answer's delay in nanoseconds, and the answer,
        /// if in time. A replay takes the values. Since version 6 of the format.
        Answer = "answer",
    }

    /// The kind of an entry.
    ///
    /// ```
    /// assert_eq!(recording::EntryKind::Value.name(), "value");
    /// ```
    pub enum EntryKind("what happened, a number from 0 to 7") {
        /// A value of a channel.
        Value = "value",
        /// A signal released the job of a sporadic DAG.
        Signal = "signal",
        /// The job was due, and was never released.
        Skip = "skip",
        /// The instance of a subtask will not run.
        Cut = "cut",
        /// The subtask goes on with another function, after a fault in this job.
        Restart = "restart",
        /// The value of a channel is missing in the recording, for lack of room.
        Lost = "lost",
        /// The instance of a subtask asked for the time: the value is a `Vec<u64>` of the answers,
        /// in nanoseconds. Since version 2 of the format.
        Clock = "clock",
        /// The instance of the subtask failed. Since version 3 of the format.
        Fault = "fault",
    }
}

impl Role {
    /// Reports whether a subtask writes the values to a topic of its DAG.
    ///
    /// ```
    /// assert!(!recording::Role::Sample.is_written());
    /// ```
    pub const fn is_written(self) -> bool {
        matches!(self, Self::Source | Self::Result)
    }
}

/// An event of a run.
///
/// See [`Writer`](crate::Writer).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'v> {
    /// The kind of event.
    pub what: EntryKind,
    /// The number of the DAG.
    pub dag: u16,
    /// The number of the channel or of the subtask, depending on the [`EntryKind`].
    pub place: u16,
    /// The job.
    pub job: u64,
    /// The nominal release of the job, in nanoseconds from the start of the run; if unknown, the
    /// time of the event.
    pub release_ns: u64,
    /// The time of the event. For values: the completion of the instance that wrote or found them,
    /// or its fault.
    pub at_ns: u64,
    /// The value's bytes, if there is a value.
    pub value: &'v [u8],
}

/// Reads the nominal release of the entry whose value begins at offset `value` in a recording.
///
/// ```
/// use recording::{Entry, EntryKind, Header, Recording, Writer};
///
/// let mut record = Writer::new(&Header { dags: vec![Default::default()], ..Header::default() });
/// let what = EntryKind::Clock;
/// record.write(&Entry { what, dag: 0, place: 0, job: 2, release_ns: 20, at_ns: 25, value: &[0; 4] });
/// let bytes = record.end();
/// let value = Recording::read(&bytes).unwrap().entries().next().unwrap().value;
/// let place = value.as_ptr().addr() - bytes.as_ptr().addr();
/// assert_eq!(recording::release_ns_of(&bytes, place), Some(20));
/// ```
pub fn release_ns_of(bytes: &[u8], value: usize) -> Option<u64> {
    // The release is the last but one of the numbers before the value.
    let (_, [release_ns, _]) = bytes.get(..value)?.as_rchunks::<8>().1.split_last_chunk()?;
    Some(u64::from_le_bytes(*release_ns))
}

impl<'v> Entry<'v> {
    pub(super) fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        // The value comes last and has no length: the frame's length determines its end.
        self.what.encode(out);
        (self.dag, self.place, self.job, self.release_ns, self.at_ns).encode(out);
        out.put(self.value);
    }

    pub(super) fn decode(payload: &'v [u8]) -> Result<Self, Malformed> {
        let mut input = Decoder::new(payload);
        let what = EntryKind::decode(&mut input)?;
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

    /// Makes sure that the entry fits the header.
    pub(super) fn check(&self, header: &Header) -> Result<(), Malformed> {
        /// Offsets of the numbers and the value in the payload.
        const DAG: usize = 1;
        const PLACE: usize = 3;
        const VALUE: usize = 29;
        let malformed = |offset, expected| Malformed { offset, expected };
        // Later code uses these numbers as indices without further checks.
        if usize::from(self.dag) >= header.dags.len() {
            return Err(malformed(DAG, "the number of a DAG of the header"));
        }
        let mut rest = Decoder::new(self.value);
        let checked = match self.what {
            EntryKind::Value | EntryKind::Lost => {
                let channel = header.channels.get(usize::from(self.place));
                let Some(channel) = channel.filter(|channel| channel.dag == self.dag) else {
                    return Err(malformed(PLACE, "the number of a channel of the DAG"));
                };
                match self.what {
                    EntryKind::Value => channel.schema.walk(&mut rest, &mut |_| ()),
                    // A lost value has no bytes; `end` below checks that.
                    _ => Ok(()),
                }
            }
            EntryKind::Clock => Vec::<u64>::schema().walk(&mut rest, &mut |_| ()),
            EntryKind::Signal
            | EntryKind::Skip
            | EntryKind::Cut
            | EntryKind::Restart
            | EntryKind::Fault => Ok(()),
        };
        checked
            .and_then(|()| rest.expect_end())
            .map_err(|malformed| malformed.behind(VALUE))
    }
}

crate::recordable! {
    /// DAGs committed together, and their scheduling.
    ///
    /// Numbers are the kernel's: DAGs, subtasks and clusters count from 0, and times are in
    /// nanoseconds.
    ///
    /// ```
    /// use recording::{Commit, Chunk, Recording, Stream};
    ///
    /// let mut record = Stream::begin(Vec::new());
    /// record.commit(&Commit { cores: 2, ..Commit::default() });
    /// let bytes = record.end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// let Some(Chunk::Commit(commit)) = recording.chunks().next() else { panic!() };
    /// assert_eq!(commit.cores, 2);
    /// ```
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Commit {
        /// The policy ordering instances: its place in the table of policies.
        pub policy: u8,
        /// Whether a started instance may lose its core.
        pub is_preemptive: bool,
        /// All cores.
        pub cores: u32,
        /// The number of cores of each cluster; empty if cores are not divided.
        pub clusters: Vec<u32>,
        /// The overhead charged to an instance by the analysis; `None` if unbounded.
        pub charge_ns: Option<u64>,
        /// The overhead charged to an instance for each instance it makes ready.
        pub ready_ns: u64,
        /// The DAGs, in the order of their numbers.
        pub dags: Vec<CommittedDag>,
        /// The waits, those of a subtask in their order: DAG and subtask, the limit, and the WCET
        /// of the next segment, if stated.
        pub waits: Vec<(u32, u32, u64, Option<u64>)>,
        /// The pinned subtasks: DAG and subtask, and the core of their cluster. Only in versions 7
        /// to 9 of the format.
        pub pins: Vec<(u32, u32, u32)>,
        /// The affinities: a DAG, and one of the cores of its cluster allowed to execute the DAG.
        /// Since version 7, too.
        pub affinities: Vec<(u32, u32)>,
        /// The cost of a move to another core, where cores are told apart. Since version 7, too.
        pub move_ns: u64,
        /// By DAG, the test that gave its bound, or the reason for a missing bound. Since version
        /// 8.
        pub answers: Vec<String>,
        /// The uses of locks: DAG and subtask, the lock, its longest section, if stated, and the
        /// most sections of an instance. Since version 8.
        pub locks: Vec<(u32, u32, String, Option<u64>, u32)>,
        /// The longest interrupt of a device, and the least time between two interrupts; 0: no
        /// interrupts. Since version 9.
        pub device_ns: [u64; 2],
        /// The lists of cores, by the numbers of DAGs and subtasks, with times. Since version 10.
        pub lists: Vec<String>,
    }

    /// A DAG of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedDag {
        /// The DAG's name.
        pub name: String,
        /// The hash of the DAG's names and edges.
        pub hash: u64,
        /// Whether signals release the DAG, rather than time.
        pub is_sporadic: bool,
        /// The period, or the least time between releases.
        pub period_ns: u64,
        /// The time from the nominal release to the deadline.
        pub relative_deadline_ns: u64,
        /// The nominal release of job 0.
        pub offset_ns: u64,
        /// The number of jobs, if limited.
        pub jobs: Option<u64>,
        /// The most jobs at a time.
        pub in_flight: u32,
        /// The fate of a job due while the most jobs are in flight: 0 the job waits, 1 the job is
        /// skipped, 2 the oldest job in flight is aborted.
        pub overrun: u8,
        /// If a fault only costs a job: the most faults within a window of jobs, the window, and
        /// the most faults in all.
        pub survives: Option<(u32, u64, u32)>,
        /// The cluster, if chosen by the app.
        pub cluster: Option<u32>,
        /// The subtasks, in the order of their numbers.
        pub subtasks: Vec<CommittedSubtask>,
        /// The precedence edges, from a subtask to a successor.
        pub edges: Vec<(u32, u32)>,
        /// The sinks with their relative deadlines.
        pub sinks: Vec<(u32, u64)>,
        /// The proven bound on the DAG's response time, if there is one.
        pub bound_ns: Option<u64>,
        /// The topics.
        pub topics: Vec<CommittedTopic>,
        /// For each state ordering two subtasks: its name, the earlier and the later subtask.
        pub states: Vec<(String, u32, u32)>,
        /// The sampled latest values: the sampling subtask, the DAG writing the values, the number
        /// of the topic in that DAG, and the bound on the values' age, if there is one.
        pub samples: Vec<(u32, u32, u32, Option<u64>)>,
    }

    /// A subtask of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedSubtask {
        /// The subtask's name.
        pub name: String,
        /// The subtask's priority; 0 is the highest.
        pub priority: u32,
        /// Whether a started instance keeps its core, except in its waits.
        pub is_non_preemptive: bool,
        /// The WCET, if stated or observed.
        pub wcet_ns: Option<u64>,
    }

    /// A topic of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedTopic {
        /// The topic's name.
        pub name: String,
        /// The type of its values.
        pub type_name: String,
        /// The writing subtask.
        pub writer: u32,
        /// The reading subtasks of the DAG.
        pub readers: Vec<u32>,
        /// Whether DAGs sample the topic's latest value.
        pub is_sampled: bool,
    }
}

crate::recordable! {
    /// The end of a run: the number of events, and the times of all jobs.
    ///
    /// ```
    /// use recording::{Chunk, Recording, Stream, Times};
    ///
    /// let mut record = Stream::begin(Vec::new());
    /// record.times(&Times { written: vec![7], ..Times::default() });
    /// let bytes = record.end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// let Some(Chunk::Times(times)) = recording.chunks().next() else { panic!() };
    /// assert_eq!(times.written, [7]);
    /// ```
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Times {
        /// By cluster, how many events its journal has taken.
        pub written: Vec<u64>,
        /// By DAG; empty if nothing was counted.
        pub dags: Vec<DagTimes>,
    }

    /// The times of a DAG's jobs.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct DagTimes {
        /// The time from the nominal release to the last finish, for complete jobs.
        pub response: Counted,
        /// The time from the nominal release to the release.
        pub release_jitter: Counted,
        /// By subtask.
        pub subtasks: Vec<SubtaskTimes>,
    }

    /// The times of a subtask's instances.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct SubtaskTimes {
        /// The time from the last finish of a predecessor to the start.
        pub join_latency: Counted,
        /// The time taken by the subtask's calls, without preemptions.
        pub execution: Counted,
        /// For one of several sinks: the time from the nominal release to its finish, its missed
        /// deadlines, and the proven bound.
        pub sink: Option<(Counted, u64, Option<u64>)>,
    }

    /// A histogram.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Counted {
        /// The least value, exactly.
        pub min_ns: u64,
        /// The highest value of each non-empty bucket, and the number of values in the bucket. The
        /// highest value of the last bucket is exact.
        pub buckets: Vec<(u64, u64)>,
    }
}
