//! What the functions at both ends of a wire get: the packets that have come, and a way to send.

use alloc::boxed::Box;
use alloc::format;
use alloc::sync::Arc;
use core::fmt;

use super::Wire;
use crate::api::dag::Dag;
use crate::api::uses::{Uses, sealed};
use crate::run::wire::outgoing::Departure;

/// The use of a wire by the subtask that receives. Made by [`Wire::receiving`].
///
/// See [`Wire`].
pub struct Receiving<T> {
    pub(super) wire: Wire,
    pub(super) decode: fn(&[u8]) -> Option<T>,
}

/// The use of a wire by the subtask that sends. Made by [`Wire::sending`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct Sending(pub(super) Wire);

/// The packets that an instance is given, the oldest first. Those that it does not take stay
/// for the next one.
///
/// See [`Wire`].
pub struct Received<'a, T> {
    held: &'a mut Receiver<T>,
    mark: usize,
}

/// What a packet says, and when it was whole.
///
/// See [`Wire`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<T> {
    /// What the decoder has made of it.
    pub value: T,
    /// When its last byte came, on the clock of [`crate::now_ns`].
    pub received_ns: u64,
}

/// What a function sends with: bytes, or text by [`core::fmt::Write`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct Sender<'a>(&'a Wire);

impl<T> Iterator for Received<'_, T> {
    type Item = Packet<T>;

    fn next(&mut self) -> Option<Packet<T>> {
        let Receiver { wire, decode, room } = &mut *self.held;
        let incoming = &wire.shared.incoming;
        // Each turn takes a packet, and there are no more than up to the mark.
        loop {
            let (bytes, received_ns) = incoming.take(self.mark, room)?;
            if let Some(value) = decode(bytes) {
                return Some(Packet { value, received_ns });
            }
            incoming.refuse();
        }
    }
}

impl Sender<'_> {
    /// Sends bytes, when this instance is complete.
    ///
    /// See [`Wire`].
    pub fn send(&mut self, bytes: &[u8]) {
        self.0.shared.outgoing.stage(bytes);
    }
}

impl fmt::Write for Sender<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.send(text.as_bytes());
        Ok(())
    }
}

/// What the subtask that receives keeps.
#[doc(hidden)]
pub struct Receiver<T> {
    wire: Wire,
    decode: fn(&[u8]) -> Option<T>,
    /// Room for the longest packet.
    room: Box<[u8]>,
}

impl<T> sealed::Sealed for Receiving<T> {}

impl<T: 'static> Uses for Receiving<T> {
    type Borrowed<'a> = Received<'a, T>;
    type Held = Receiver<T>;
    type Guard<'a> = &'a mut Receiver<T>;

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let takes = format!("receives on wire `{}`", self.wire.name());
        let mut draft = dag.draft.borrow_mut();
        draft.outside.push((subtask, takes));
        let shared = Arc::clone(&self.wire.shared);
        let tell = move |signal| _ = shared.signal.set(signal);
        draft.receives.push(Box::new(tell));
        Receiver {
            room: self.wire.shared.incoming.buffer(),
            wire: self.wire,
            decode: self.decode,
        }
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        held
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        Received {
            mark: guard.wire.shared.incoming.mark(),
            held: guard,
        }
    }
}

impl sealed::Sealed for Sending {}

impl Uses for Sending {
    type Borrowed<'a> = Sender<'a>;
    type Held = Wire;
    type Guard<'a> = &'a Wire;

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let effect = Departure(Arc::clone(&self.0.shared.outgoing));
        let mut draft = dag.draft.borrow_mut();
        draft.effects.push((subtask, Box::new(effect)));
        self.0
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        held.shared.outgoing.begin();
        held
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        Sender(guard)
    }
}
