//! What the policies share: messages go in one by one, sets come out.
//!
//! A [`Synchronizer`] takes arrivals in order and hands whatever leaves to an
//! [`Outlet`], before the next arrival is taken. Messages are moved, never copied.

use alloc::vec::Drain;
use core::fmt;

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
    /// Returns the number of topics.
    fn topics(&self) -> usize;

    /// Takes one message, and hands what leaves on account of it to `outlet`.
    ///
    /// # Panics
    ///
    /// If there is no such topic.
    fn arrive(&mut self, topic: usize, message: Stamped<M>, outlet: &mut dyn Outlet<M>);

    /// Returns how many messages of a topic have arrived and not left.
    ///
    /// # Panics
    ///
    /// If there is no such topic.
    fn held(&self, topic: usize) -> usize;
}

/// Where messages leave a synchronizer to.
pub trait Outlet<M> {
    /// Takes a set, while the arrival that completed it is handled. An arrival may
    /// emit several sets; they come in order.
    fn emitted(&mut self, set: Set<'_, M>);

    /// Takes a message that will be in no set. The order inside one arrival means
    /// nothing.
    fn dropped(&mut self, topic: usize, message: Stamped<M>) {
        let _ = (topic, message);
    }

    /// Takes a message that a later one of the same topic and stamp superseded. The
    /// original gives no notice of these.
    fn replaced(&mut self, topic: usize, message: Stamped<M>) {
        let _ = (topic, message);
    }
}

/// A set: one message of each topic, in the order of the topics.
///
/// What is not taken out of it is gone with it.
pub struct Set<'a, M>(Drain<'a, Stamped<M>>);

impl<'a, M> Set<'a, M> {
    pub(crate) fn new(messages: Drain<'a, Stamped<M>>) -> Self {
        Self(messages)
    }

    /// Returns the messages that were not taken yet.
    #[must_use]
    pub fn as_slice(&self) -> &[Stamped<M>] {
        self.0.as_slice()
    }
}

impl<M> Iterator for Set<'_, M> {
    type Item = Stamped<M>;

    fn next(&mut self) -> Option<Stamped<M>> {
        self.0.next()
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.0.size_hint()
    }
}

impl<M> ExactSizeIterator for Set<'_, M> {}

impl<M: fmt::Debug> fmt::Debug for Set<'_, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Set").field(&self.as_slice()).finish()
    }
}
