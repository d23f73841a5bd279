//! A recording's header, which tells whose it is and what is in it; and its entries, one entry
//! after the other.
//!
//! Besides there is a commit of a run, its model as it was accepted and what was proven of it; and
//! the
//! statistics of all jobs of a run that has ended.

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
        /// The app, or what else the recording is of.
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
        /// The role of the values in the DAG.
        pub role: Role,
        /// The topic, or the state.
        pub topic: String,
        /// The type.
        pub schema: Schema,
    }
}

/// Declares kinds that have a number in recordings, in their order, and a word.
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
            /// Returns the word for it.
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
                // The number is the place in the declaration: new kinds are added at the end only.
                out.put(&[*self as u8]);
            }

            fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
                // Taken before the byte is read, so that it names the place of the number itself.
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
        /// A source returned them. A replay takes them.
        Source = "source",
        /// Another subtask returned them. A replay compares them.
        Result = "result",
        /// A subtask found them as latest values of a topic, of whatever DAG: the type is
        /// `(u64, u64, T)?`, with the job that the value is of, and when that was complete. A
        /// replay takes them.
        Sample = "sample",
        /// A subtask found them in a state, before it changed that in the job. A replay that begins
        /// with a job takes what is recorded of it, and compares the others. Since version 5 of the
        /// format.
        State = "state",
        /// A subtask waited for them, as answers of a device: the type is `[(u32, u64, T?)]`, of the
        /// job's waits with their numbers, how many nanoseconds each answer took, and the answer, if
        /// it came in time. A replay takes them. Since version 6 of the format.
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
        /// The value of a channel is not in the recording, for there was no room.
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

/// Something that happened in a run.
///
/// See [`Writer`](crate::Writer).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'v> {
    /// The kind of it.
    pub what: EntryKind,
    /// The number of the DAG.
    pub dag: u16,
    /// The number of the channel or of the subtask; [`EntryKind`] says which.
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

/// Reads the nominal release of the entry whose value begins there in a recording.
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
    // It is the last but one of the numbers before the value.
    let (_, [release_ns, _]) = bytes.get(..value)?.as_rchunks::<8>().1.split_last_chunk()?;
    Some(u64::from_le_bytes(*release_ns))
}

impl<'v> Entry<'v> {
    pub(super) fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        // The value comes last and has no length: the frame's length says where it ends.
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

    /// Makes sure that it fits to the header.
    pub(super) fn check(&self, header: &Header) -> Result<(), Malformed> {
        /// Where the numbers and the value stand in the payload.
        const DAG: usize = 1;
        const PLACE: usize = 3;
        const VALUE: usize = 29;
        let malformed = |offset, expected| Malformed { offset, expected };
        // Later code takes these numbers for indices without asking again.
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
                    // A lost value has no bytes, which `end` below makes sure of.
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
    /// DAGs that were committed together, and how they are scheduled.
    ///
    /// Numbers are those of the kernel: DAGs, subtasks and clusters count from 0, and times are
    /// in nanoseconds.
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
        /// The policy that orders instances: its place in the table of policies.
        pub policy: u8,
        /// Whether an instance that has started may lose its core.
        pub is_preemptive: bool,
        /// All cores.
        pub cores: u32,
        /// The number of cores of each cluster; empty if cores are not divided.
        pub clusters: Vec<u32>,
        /// The analysis charges an instance with so much, if that has an end.
        pub charge_ns: Option<u64>,
        /// It charges so much for making another one ready.
        pub ready_ns: u64,
        /// The DAGs, in the order of their numbers.
        pub dags: Vec<CommittedDag>,
        /// The waits, those of a subtask in their order: DAG and subtask, the limit, and the WCET
        /// of the segment that follows, if it is stated.
        pub waits: Vec<(u32, u32, u64, Option<u64>)>,
        /// The subtasks that are pinned: DAG and subtask, and the core of their cluster. In versions
        /// 7 to 9 of the format only.
        pub pins: Vec<(u32, u32, u32)>,
        /// The affinities: a DAG, and one of the cores of its cluster that alone execute it. Since
        /// version 7, too.
        pub affinities: Vec<(u32, u32)>,
        /// A move to another core takes so much, where cores are told apart. Since version 7, too.
        pub move_ns: u64,
        /// By DAG, which test gave its bound, or why there is none. Since version 8.
        pub answers: Vec<String>,
        /// The uses of locks: DAG and subtask, the lock, its longest section, if it is stated, and
        /// the most sections of an instance. Since version 8.
        pub locks: Vec<(u32, u32, String, Option<u64>, u32)>,
        /// The longest interrupt of a device, and the least time from one to the next; 0: there is
        /// none. Since version 9.
        pub device_ns: [u64; 2],
        /// The lists of cores, by the numbers of DAGs and subtasks, with times. Since version 10.
        pub lists: Vec<String>,
    }

    /// A DAG of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedDag {
        /// Its name.
        pub name: String,
        /// The hash of its names and edges.
        pub hash: u64,
        /// Whether signals release it, rather than time.
        pub is_sporadic: bool,
        /// The period, or the least time between releases.
        pub period_ns: u64,
        /// From the nominal release to the deadline.
        pub relative_deadline_ns: u64,
        /// The nominal release of job 0.
        pub offset_ns: u64,
        /// The number of jobs, if it has an end.
        pub jobs: Option<u64>,
        /// The most jobs at a time.
        pub in_flight: u32,
        /// The fate of a job that is due while as many are in flight: 0 it waits, 1 it is
        /// skipped, 2 the oldest one is aborted.
        pub overrun: u8,
        /// If a fault costs a job only: the most faults within a window of jobs, the window, and
        /// the most in all.
        pub survives: Option<(u32, u64, u32)>,
        /// The cluster, if the app has chosen it.
        pub cluster: Option<u32>,
        /// The subtasks, in the order of their numbers.
        pub subtasks: Vec<CommittedSubtask>,
        /// The precedence edges, from a subtask to another one.
        pub edges: Vec<(u32, u32)>,
        /// The sinks with their relative deadlines.
        pub sinks: Vec<(u32, u64)>,
        /// The proven bound on its response time.
        pub bound_ns: Option<u64>,
        /// The topics.
        pub topics: Vec<CommittedTopic>,
        /// Of each state that orders two subtasks its name, the earlier and the later one.
        pub states: Vec<(String, u32, u32)>,
        /// The latest values that it samples: the subtask, the DAG that writes them, the number
        /// of the topic there, and how old they may be.
        pub samples: Vec<(u32, u32, u32, Option<u64>)>,
    }

    /// A subtask of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedSubtask {
        /// Its name.
        pub name: String,
        /// Its priority; 0 is the highest.
        pub priority: u32,
        /// Whether it keeps its core once it has started.
        pub is_non_preemptive: bool,
        /// Its WCET, if it is stated.
        pub wcet_ns: Option<u64>,
    }

    /// A topic of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedTopic {
        /// Its name.
        pub name: String,
        /// The type of its values.
        pub type_name: String,
        /// The subtask that writes it.
        pub writer: u32,
        /// The subtasks of the DAG that read it.
        pub readers: Vec<u32>,
        /// Whether DAGs sample its latest value.
        pub is_sampled: bool,
    }
}

crate::recordable! {
    /// The end of a run: how many events there were, and the times of all jobs.
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
        /// From the nominal release to the last finish, of complete jobs.
        pub response: Counted,
        /// From the nominal release to the release.
        pub release_jitter: Counted,
        /// By subtask.
        pub subtasks: Vec<SubtaskTimes>,
    }

    /// The times of a subtask's instances.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct SubtaskTimes {
        /// From the last finish of a predecessor to the start.
        pub join_latency: Counted,
        /// The time that its calls took, preemptions left out.
        pub execution: Counted,
        /// Of a sink of several: from the nominal release to its finish, its deadlines missed,
        /// and the proven bound.
        pub sink: Option<(Counted, u64, Option<u64>)>,
    }

    /// A histogram.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Counted {
        /// The least value, exactly.
        pub min_ns: u64,
        /// The highest value of each bucket that is not empty, and how many are in it; the last
        /// one is exact.
        pub buckets: Vec<(u64, u64)>,
    }
}
