//! The publish/subscribe baseline: joins made by matching stamps.
//!
//! With publish and subscribe, inputs that belong together arrive as separate messages, and a
//! *synchronizer* has to match them. This crate implements the two policies of ROS 2's package
//! `message_filters` (as of 4.3.5, Humble): [`ExactTime`] and [`ApproximateTime`]. DAG-native joins
//! are compared with these policies, so the policies behave as the originals do, faults included:
//! messages never matched, sets mixing jobs, sets coming late.
//!
//! Some terms. A *topic* is one input, named by its position from 0; the order of topics matters
//! where stamps tie. A *message* comes with its *stamp*, a time in nanoseconds chosen by the
//! sender. An *arrival* hands one message to the synchronizer. A *set* is one message of each
//! topic, emitted together. A message that leaves without a set is *dropped*; a message superseded
//! by a later message of the same topic and stamp is *replaced*.
//!
//! Both policies are purely reactive: they never read a clock and have no timer. So a set can come
//! out only while some message arrives, none or several at a time.
//!
//! - [`Synchronizer`], [`Stamped`], [`Outlet`], [`Set`]: the common part of both policies;
//! - [`ExactTime`]: equal stamps make a set;
//! - [`ApproximateTime`], [`Parameters`], [`AgePenalty`]: close stamps make a set;
//! - [`graph`]: topics, subscriptions and callbacks, and the workers executing the callbacks: the
//!   surroundings of the synchronizers.
//!
//! The crate guarantees that every message leaves at most once, that the queue size bounds the
//! number of held messages, and that nothing is allocated after construction (one exception: an
//! [`ExactTime`] without a limit). The crate depends on no kernel, no scheduler and no clock, and
//! all arithmetic is in integers. The crate logs nothing: the original warns of stamps going
//! backwards, these policies do not.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod approximate_time;
mod exact_time;
pub mod graph;

use alloc::vec::Drain;

pub use approximate_time::{AgePenalty, ApproximateTime, Parameters};
pub use exact_time::ExactTime;

/// A message with the time given by its sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamped<M> {
    /// The stamp in nanoseconds, any value. The stamps of a topic may repeat or go
    /// backwards.
    pub stamp_ns: u64,
    /// The message.
    pub message: M,
}

/// A policy that makes sets of the messages of several topics.
///
/// A policy can be chosen at run time: `Box<dyn Synchronizer<M>>`.
pub trait Synchronizer<M> {
    /// Accepts one message, and hands all messages leaving in consequence to `outlet`.
    ///
    /// # Panics
    ///
    /// If the topic does not exist.
    fn arrive(&mut self, topic: usize, message: Stamped<M>, outlet: &mut dyn Outlet<M>);
}

/// The receiver of messages leaving a synchronizer.
pub trait Outlet<M> {
    /// Takes a set, while the completing arrival is handled. An arrival may emit several sets; they
    /// come in order.
    fn emitted(&mut self, set: Set<'_, M>);

    /// Takes a message that will be in no set. The order within one arrival means nothing.
    fn dropped(&mut self, _topic: usize, _message: Stamped<M>) {}

    /// Takes a message superseded by a later message of the same topic and stamp. The original
    /// gives no notice of such messages.
    fn replaced(&mut self, _topic: usize, _message: Stamped<M>) {}
}

/// A set: one message of each topic, in the order of the topics.
///
/// Messages not taken out of the set are gone with the set.
pub type Set<'a, M> = Drain<'a, Stamped<M>>;
