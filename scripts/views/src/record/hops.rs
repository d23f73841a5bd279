//! Hops: what a record says of the messages that another machine has sent.
//!
//! A message between machines is a [`Hop`], or has one as its field `hop`. The source that receives
//! the messages returns them, so the hops are in its recorded values.

use std::collections::BTreeSet;
use std::ops::Range;

use recording::{Channel, CommittedDag, Decoder, Entry, EntryKind};
use recording::{Recordable, Recording, Role, Schema};
use sched_dag::chains::{SampledEdge, SubtaskRef};
use sched_dag::law::Distribution;
use sched_dag::{DagId, SubtaskId};

recording::recordable! {
    /// Where a value has come from, as `ros::Hop`. Times are those of clocks, not of runs.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Hop {
        /// The sending job.
        pub job: u64,
        /// When it was put, by the sender's clock.
        pub sent_ns: u64,
        /// When it was heard, by the receiver's clock; 0: it was not.
        pub received_ns: u64,
        /// The delay that the app states for the link.
        pub delay_ns: u64,
    }
}

/// The messages that a source has heard from another machine.
#[derive(Clone, Debug)]
pub struct Heard {
    /// The topic that it writes, named as that of the sender.
    pub topic: String,
    /// The source.
    pub source: SubtaskRef,
    /// The jobs whose values have hops.
    pub hops: Vec<(u64, Hop)>,
}

/// A machine of several whose runs are read as one.
#[derive(Clone, Debug)]
pub struct Machine {
    /// The name of its record.
    pub name: String,
    /// Its DAGs in the joint run.
    pub dags: Range<u32>,
    /// Its cores in the joint run.
    pub cores: Range<u32>,
    /// When its run began, on the joint axis of time.
    pub began_ns: u64,
    /// How much its clock is ahead of the first machine's.
    pub ahead_ns: i128,
    /// By how much that may be wrong, if it is known.
    pub wrong_ns: Option<u64>,
}

/// A link between machines: a subtask sends the messages of a topic, and another one receives them.
#[derive(Clone, Debug)]
pub struct Link {
    /// The sender, and the receiver.
    pub edge: SampledEdge,
    /// The positions of their machines.
    pub machines: [usize; 2],
    /// The messages, each with the first job that has it.
    pub heard: Heard,
    /// How much the receiver's clock is ahead of the sender's.
    pub ahead_ns: i128,
    /// By how much that may be wrong, if it is known.
    pub wrong_ns: Option<u64>,
    /// How long each took, by the offset of the clocks.
    pub delays: Distribution,
    /// How many took longer than stated, by more than the offset may be wrong.
    pub exceeded: usize,
    /// The receiving jobs for which no bound holds.
    pub late: BTreeSet<u64>,
    /// How many jobs of the sender have no message.
    pub lost: usize,
}

impl Link {
    /// Returns the delay that the app states.
    pub fn stated_ns(&self) -> u64 {
        let hops = self.heard.hops.iter();
        hops.map(|(_, hop)| hop.delay_ns).max().unwrap_or(0)
    }
}

/// Returns the messages that the sources of a recording have heard.
pub(super) fn heard(recording: &Recording<'_>, dags: &[CommittedDag]) -> Vec<Heard> {
    let header = recording.header();
    let of_channel = |(place, channel): (u16, &Channel)| {
        let name = &header.dags[usize::from(channel.dag)].name;
        let (dag, _) = (0..).zip(dags).find(|(_, dag)| dag.name == *name)?;
        let is_of = |entry: &Entry<'_>| (entry.what, entry.place) == (EntryKind::Value, place);
        let hop = |entry: Entry<'_>| {
            let hop = hop(&channel.schema, &mut Decoder::new(entry.value));
            // The sender's own value has a hop, too, which nobody has heard.
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

/// Returns the hop of a value, if it has one.
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
