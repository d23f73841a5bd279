//! Hops: the facts in a record about messages sent by another machine.
//!
//! A message between machines is a [`Hop`], or has a hop as its field `hop`. The source that
//! receives the messages returns them, so the recorded values of the source contain the hops.

use std::collections::BTreeSet;
use std::ops::Range;

use recording::{Channel, CommittedDag, Decoder, Entry, EntryKind};
use recording::{Recordable, Recording, Role, Schema};
use sched_dag::chains::{SampledEdge, SubtaskRef};
use sched_dag::law::Distribution;
use sched_dag::{DagId, SubtaskId};

recording::recordable! {
    /// The origin of a value, as in `ros::Hop`. Times are readings of clocks, not times of runs.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Hop {
        /// The sending job.
        pub job: u64,
        /// The time of sending, by the sender's clock.
        pub sent_ns: u64,
        /// The time of receiving, by the receiver's clock; 0 if nobody received the message.
        pub received_ns: u64,
        /// The delay stated by the app for the link.
        pub delay_ns: u64,
    }
}

/// The messages heard by a source from another machine.
#[derive(Clone, Debug)]
pub struct Heard {
    /// The topic written by the source, with the name of the sender's topic.
    pub topic: String,
    /// The source.
    pub source: SubtaskRef,
    /// The jobs whose values have hops.
    pub hops: Vec<(u64, Hop)>,
}

/// One of several machines with runs read as one.
#[derive(Clone, Debug)]
pub struct Machine {
    /// The name of the machine's record.
    pub name: String,
    /// The machine's DAGs in the joint run.
    pub dags: Range<u32>,
    /// The machine's cores in the joint run.
    pub cores: Range<u32>,
    /// The begin of the machine's run, on the joint axis of time.
    pub began_ns: u64,
    /// The time by which the clock is ahead of the first machine's clock.
    pub ahead_ns: i128,
    /// The uncertainty of `ahead_ns`, if known.
    pub wrong_ns: Option<u64>,
}

/// A link between machines: a subtask sends the messages of a topic, and another subtask receives
/// them.
#[derive(Clone, Debug)]
pub struct Link {
    /// The sender, and the receiver.
    pub edge: SampledEdge,
    /// The positions of the two machines.
    pub machines: [usize; 2],
    /// The messages, each with the first job that has the message.
    pub heard: Heard,
    /// The time by which the receiver's clock is ahead of the sender's clock.
    pub ahead_ns: i128,
    /// The uncertainty of `ahead_ns`, if known.
    pub wrong_ns: Option<u64>,
    /// The time taken by each message, by the offset of the clocks.
    pub delays: Distribution,
    /// The number of messages slower than stated, by more than the uncertainty of the offset.
    pub exceeded: usize,
    /// The receiving jobs without a valid bound.
    pub late: BTreeSet<u64>,
    /// The number of the sender's jobs without a message.
    pub lost: usize,
}

impl Link {
    /// Returns the delay stated by the app.
    pub fn stated_ns(&self) -> u64 {
        let hops = self.heard.hops.iter();
        hops.map(|(_, hop)| hop.delay_ns).max().unwrap_or(0)
    }
}

/// Returns the messages heard by the sources of a recording.
pub(super) fn heard(recording: &Recording<'_>, dags: &[CommittedDag]) -> Vec<Heard> {
    let header = recording.header();
    let of_channel = |(place, channel): (u16, &Channel)| {
        let name = &header.dags[usize::from(channel.dag)].name;
        let (dag, _) = (0..).zip(dags).find(|(_, dag)| dag.name == *name)?;
        let is_of = |entry: &Entry<'_>| (entry.what, entry.place) == (EntryKind::Value, place);
        let hop = |entry: Entry<'_>| {
            let hop = hop(&channel.schema, &mut Decoder::new(entry.value));
            // The sender's own value has a hop, too, but nobody has received that one.
            Some((entry.job, hop.filter(|hop| hop.received_ns > 0)?))
        };
        Some(Heard {
            topic: channel.topic.clone(),
            source: (DagId(dag), SubtaskId(channel.subtask.into())),
            hops: recording.entries().filter(is_of).filter_map(hop).collect(),
        })
    };
    let channels = (0..).zip(&header.channels);
    let sources = channels.filter(|(_, of)| of.role == Role::Source);
    let heard = sources.filter_map(of_channel);
    heard.filter(|heard| !heard.hops.is_empty()).collect()
}

/// Returns the hop of a value, if there is any.
fn hop(schema: &Schema, input: &mut Decoder<'_>) -> Option<Hop> {
    match schema {
        Schema::Option(inner) => bool::decode(input).ok()?.then(|| hop(inner, input))?,
        whole if *whole == Hop::schema() => Hop::decode(input).ok(),
        Schema::Struct(_, fields) => {
            let at = fields.iter().position(|field| field.name == "hop")?;
            for before in &fields[..at] {
                before.schema.walk(input, &mut |_| ()).ok()?;
            }
            hop(&fields[at].schema, input)
        }
        _ => None,
    }
}
