//! The publish/subscribe baseline: joins made by matching stamps.
//!
//! With publish and subscribe, several inputs that belong together arrive as
//! separate messages, and a *synchronizer* has to find out which. This crate has
//! the two policies of ROS 2's package `message_filters` (as of 4.3.5, Humble):
//! [`ExactTime`] and [`ApproximateTime`]. They are what a DAG-native join is
//! compared with, so they do what the originals do, faults included: messages
//! that are never matched, sets that mix jobs, sets that come late.
//!
//! Some words. A *topic* is one input, named by its position from 0; the order
//! matters where stamps tie. A *message* comes with its *stamp*, a time in
//! nanoseconds that its sender chose. An *arrival* hands one message to the
//! synchronizer. A *set* is one message of each topic, emitted together. A message
//! that leaves without being in a set is *dropped*; one that a later message of
//! the same topic and stamp supersedes is *replaced*.
//!
//! Both policies are purely reactive: they never read a clock and have no timer, so
//! a set can come out only while some message arrives, none or several at a time.
//!
//! - [`Synchronizer`], [`Stamped`], [`Outlet`], [`Set`]: what both policies share;
//! - [`ExactTime`]: equal stamps make a set;
//! - [`ApproximateTime`], [`Parameters`], [`AgePenalty`]: close stamps make a set;
//! - [`graph`]: topics, subscriptions and callbacks, and the workers that
//!   execute them: what the synchronizers run in.
//!
//! It guarantees that every message leaves at most once, that what is held is
//! bounded by the queue size, and that nothing is allocated after construction
//! (one exception: an [`ExactTime`] without a limit). It knows no kernel, no
//! scheduler and no clock, and all arithmetic is in integers. It logs nothing:
//! where the original would warn of stamps that go backwards, nothing is said.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod approximate_time;
mod exact_time;
pub mod graph;

use alloc::vec::Drain;

pub use approximate_time::{AgePenalty, ApproximateTime, Parameters};
pub use exact_time::ExactTime;

/// A message with the time that its sender gave it.
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
    /// Takes one message, and hands what leaves on account of it to `outlet`.
    ///
    /// # Panics
    ///
    /// If there is no such topic.
    fn arrive(&mut self, topic: usize, message: Stamped<M>, outlet: &mut dyn Outlet<M>);
}

/// Where messages leave a synchronizer to.
pub trait Outlet<M> {
    /// Takes a set, while the arrival that completed it is handled. An arrival may
    /// emit several sets; they come in order.
    fn emitted(&mut self, set: Set<'_, M>);

    /// Takes a message that will be in no set. The order inside one arrival means
    /// nothing.
    fn dropped(&mut self, _topic: usize, _message: Stamped<M>) {}

    /// Takes a message that a later one of the same topic and stamp superseded. The
    /// original gives no notice of these.
    fn replaced(&mut self, _topic: usize, _message: Stamped<M>) {}
}

/// A set: one message of each topic, in the order of the topics.
///
/// Messages that are not taken out of it are gone with it.
pub type Set<'a, M> = Drain<'a, Stamped<M>>;
