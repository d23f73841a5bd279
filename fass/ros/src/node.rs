//! A node: its topics, and the conversion between their packets and the datagrams of one router.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::marker::PhantomData;

use fass::platform::Buffer;
use fass::shared::{
    DeviceEnd, Framing, Parameter, ReceiveUse, SendValuesUse, WallClock, Wire, WireOptions,
};
use zenoh::{Session, SessionCounts};

use super::message::{Message, from_cdr, most_bytes, to_cdr};
use super::options::NodeOptions;
use super::rmw::{absolute, is_name, token, type_in_keys};

/// The most topics of a node: one bit each marks the topics that have got a packet.
const MOST_TOPICS: usize = 64;

/// The number of the first topic in tokens; the node's number is 0.
const FIRST_TOPIC: usize = 10;

/// The default quality of service of `rmw_zenoh`, written as empty fields: reliable, the last 42
/// messages. Datagrams are sent only once, whatever the quality of service.
const RELIABLE: &str = "::,:,:,:,,";

/// A node of ROS 2. A platform connects the node to a router; in virtual time a test has the other
/// ends of its wires.
///
/// ```
/// use ros::geometry_msgs::Twist;
/// use ros::{Node, NodeOptions};
///
/// let options = NodeOptions { identity: 0x1234, ..NodeOptions::default() };
/// let mut node = Node::new("turtle", options);
/// let commands = node.subscribe::<Twist>("cmd_vel");
/// assert_eq!(commands.wire().name(), "cmd_vel");
/// assert_eq!(node.up_since().value(), 0, "no session");
/// ```
pub struct Node {
    name: String,
    pub(crate) options: NodeOptions,
    pub(crate) session: Session,
    /// The counts at the latest report to people.
    pub(crate) told: SessionCounts,
    pub(crate) topics: Vec<Topic>,
    /// The session's declarations: keys for subscriptions, and tokens.
    pub(crate) declared: Vec<(bool, String)>,
    pub(crate) up_since: Parameter<u64>,
    pub(crate) clock: WallClock,
    /// The next datagram, if not empty, and the topic whose turn is next.
    pub(crate) out: Buffer,
    pub(crate) most_bytes: usize,
    pub(crate) turn: usize,
    pub(crate) unsent: u64,
    pub(crate) unknown: u64,
}

#[derive(Debug)]
pub(crate) struct Topic {
    pub(crate) wire: Wire,
    /// The device's end of the wire, once the node has begun.
    pub(crate) end: Option<Arc<DeviceEnd>>,
    pub(crate) key: String,
    /// Whether this is a publication, not a subscription.
    pub(crate) publishes: bool,
    /// The messages so far, and the bytes identifying the publication.
    pub(crate) number: u64,
    pub(crate) gid: u128,
}

/// A topic published by the node.
///
/// See [`Node`].
#[derive(Debug)]
pub struct Publication<T>(Wire, PhantomData<fn(T)>);

/// A topic to which the node subscribes.
///
/// See [`Node`].
#[derive(Debug)]
pub struct Subscription<T>(Wire, PhantomData<fn() -> T>);

impl<T: Message> Publication<T> {
    /// Returns the declaration that a subtask publishes the topic, for
    /// [`Dag::using`](fass::Dag::using). The function gets a [`Publisher`](crate::Publisher).
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn publishing(&self) -> SendValuesUse<T> {
        self.0.sending_values(to_cdr)
    }

    /// Returns the wire whose packets are the messages.
    pub const fn wire(&self) -> &Wire {
        &self.0
    }
}

impl<T: Message> Subscription<T> {
    /// Returns the declaration that a source receives the topic, for
    /// [`Dag::using`](fass::Dag::using). Packets that are not messages are malformed, and counted.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn receiving(&self) -> ReceiveUse<T> {
        self.0.receiving(from_cdr)
    }

    /// Returns the wire whose packets are the messages.
    pub const fn wire(&self) -> &Wire {
        &self.0
    }
}

impl Node {
    /// Makes a node without topics.
    ///
    /// # Panics
    ///
    /// If ROS 2 does not allow the name, the namespace or the domain, the identity is missing, or
    /// the lease is too short for any router to answer in time.
    #[must_use]
    #[track_caller]
    pub fn new(name: &str, options: NodeOptions) -> Self {
        let is_namespace = |name: &str| name.is_empty() || is_name(name);
        assert!(
            is_name(name)
                && !name.contains('/')
                && is_namespace(&options.namespace)
                && options.domain <= 232
                && options.identity != 0
                && options.lease.as_millis() >= 100,
            "node `{name}` cannot have {options:?}; take names of letters, digits and single `_`, no \
             digit first, a domain up to 232, an identity that is not 0, and a lease from 100 ms on"
        );
        Self {
            name: name.into(),
            declared: Vec::from([(true, token(&options, name, "NN", 0, ""))]),
            session: options.session(),
            told: SessionCounts::default(),
            options,
            topics: Vec::new(),
            up_since: Parameter::new(&format!("{name}.up_since"), 0, 0..=u64::MAX),
            clock: WallClock::new(),
            out: Buffer::default(),
            most_bytes: 0,
            turn: 0,
            unsent: 0,
            unknown: 0,
        }
    }

    /// Publishes a topic. The name is absolute (`/imu`) or in the node's namespace.
    ///
    /// # Panics
    ///
    /// If ROS 2 does not allow the name, the node publishes the topic already, or has 64 topics.
    #[track_caller]
    pub fn publish<T: Message>(&mut self, topic: &str) -> Publication<T> {
        Publication(self.add::<T>(topic, "MP", RELIABLE), PhantomData)
    }

    /// Publishes a topic with the quality of service of sensors: best effort, the last 5 messages.
    ///
    /// # Panics
    ///
    /// As [`publish`](Self::publish).
    #[track_caller]
    pub fn publish_sensor<T: Message>(&mut self, topic: &str) -> Publication<T> {
        Publication(self.add::<T>(topic, "MP", "2::,5:,:,:,,"), PhantomData)
    }

    /// Subscribes to a topic. The name is absolute (`/cmd_vel`) or in the node's namespace.
    ///
    /// # Panics
    ///
    /// If ROS 2 does not allow the name, the node subscribes to the topic already, or has 64
    /// topics.
    #[track_caller]
    pub fn subscribe<T: Message>(&mut self, topic: &str) -> Subscription<T> {
        Subscription(self.add::<T>(topic, "MS", RELIABLE), PhantomData)
    }

    /// Returns the time since which there is a session with a router, in nanoseconds on the clock
    /// of [`fass::now_ns`]; 0 without a session. DAGs read the time like any parameter.
    pub const fn up_since(&self) -> &Parameter<u64> {
        &self.up_since
    }

    /// Returns the node's clock. Stamps in messages of the router, or of a sender, correct the
    /// clock.
    pub const fn clock(&self) -> &WallClock {
        &self.clock
    }

    /// Returns the wires of the node's topics, in the order of their creation.
    pub fn wires(&self) -> impl Iterator<Item = &Wire> {
        self.topics.iter().map(|topic| &topic.wire)
    }

    #[track_caller]
    fn add<T: Message>(&mut self, topic: &str, kind: &str, quality: &str) -> Wire {
        let node = &self.name;
        let full = absolute(&self.options.namespace, topic);
        assert!(
            is_name(topic) && is_name(&full),
            "topic `{topic}` of node `{node}` has a name that ROS 2 does not allow; take letters, \
             digits and single `_` between `/`, no digit first"
        );
        let type_in_keys = type_in_keys(T::NAME, T::HASH);
        let key = format!("{}/{full}/{type_in_keys}", self.options.domain);
        let publishes = kind == "MP";
        let is_same = |other: &Topic| other.publishes == publishes && other.key == key;
        assert!(
            !self.topics.iter().any(is_same) && self.topics.len() < MOST_TOPICS,
            "node `{node}` has topic `{topic}` already, or {MOST_TOPICS} topics; use the one that \
             it has, or make another node"
        );
        let id = FIRST_TOPIC + self.topics.len();
        let rest = format!("/%{}/{type_in_keys}/{quality}", full.replace('/', "%"));
        if !publishes {
            self.declared.push((false, key.clone()));
        }
        (self.declared).push((true, token(&self.options, node, kind, id, &rest)));
        let options = WireOptions {
            framing: Framing::Chunks,
            longest_bytes: most_bytes::<T>(),
            ..WireOptions::default()
        };
        let wire = Wire::with(&full, options);
        self.topics.push(Topic {
            wire: wire.clone(),
            end: None,
            key,
            publishes,
            number: 0,
            // Any identifier will do, if it is unique.
            gid: self.options.identity ^ (id as u128) << 120,
        });
        wire
    }
}
