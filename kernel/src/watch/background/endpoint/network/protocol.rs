//! A protocol's place in the network: its port, its peer, and the wires behind it.
//!
//! A single lock guards the protocol. The lock is held for a heard or sent datagram, and dropped
//! before functions are told.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU64, Ordering};

use executive::machine::spinlock::SpinLock;
use executive::run::execution;
use fass::platform::{Buffer, Protocol};
use fass::shared::DeviceEnd;
use front::app::ending::AppError;
use front::report;
use net::{MOST_PAYLOAD, Peer};
use sched_dag::DagId;

use super::super::{Chain, failure};
use super::wire::{Sent, with_headers};
use super::{WIRE_NS, open, ring};
use crate::options::CommandLine;

/// The protocols of this machine.
pub(super) static PROTOCOLS: Chain<Box<dyn Station>> = Chain::new();

/// A place in the network with a protocol. The network uses this trait, so that the image of an app
/// without protocols contains no code for any.
pub(super) trait Station: Send + Sync {
    /// Returns the protocol's port.
    fn port(&self) -> u16;

    /// Takes a datagram, and reports whether it belongs to the protocol.
    fn hear(&self, datagram: &[u8], port: u16, from: Peer, now_ns: u64) -> bool;

    /// Tells the app's functions about arrived packets. Called in the card's interrupt, because the
    /// call may release DAGs.
    fn tell_come(&self);

    /// Passes the next waiting datagram to `send`. Reports whether a datagram was sent.
    fn send(&self, now_ns: u64, send: &mut dyn FnMut(&mut Buffer, u16, Peer) -> Sent) -> bool;

    /// Returns the first DAG released by the protocol's packets.
    fn released(&self) -> Option<(u64, DagId)>;

    /// Tells the protocol whether the card has a link and an address.
    fn set_link(&self, is_up: bool);

    /// Says goodbye to the peer.
    fn close(&self);

    /// Prints whether a session was opened or lost. Called in the background.
    fn tell_news(&self);

    /// Prints the protocol's report of the finished run.
    fn tell(&self);
}

/// The longest times spent in a protocol: for a message heard, and more for each topic; once an
/// interrupt, for copying a message of 8 KiB, because its fragments fill many datagrams; for a
/// datagram sent, again with more for each topic.
const MESSAGE_NS: u64 = 600;
const TOPIC_NS: u64 = 30;
const COPIED_NS: u64 = 11_000;
const PUT_NS: u64 = 1_500;

/// The most messages of a datagram, of which one may have come in fragments.
const MESSAGES: u64 = 16;

/// The default time between two interrupts, in microseconds.
const DISTANCE_US: u64 = 500;

struct ProtocolPlace {
    protocol: SpinLock<Box<dyn Protocol>>,
    ends: Box<[Arc<DeviceEnd>]>,
    port: u16,
    peer: Peer,
    /// The wires with unannounced packets, as bits.
    come: AtomicU64,
}

/// Gives a protocol a place in the network.
pub(crate) fn connect(
    mut protocol: Box<dyn Protocol>,
    peer: Peer,
    options: &CommandLine<'static>,
) -> Result<(), AppError> {
    let who = alloc::format!("`router=udp://{peer}`");
    let network = open(&who, options, DISTANCE_US)?;
    let port = network.port(&who, None)?;
    let begun = protocol.begin(MOST_PAYLOAD, ring);
    let ends = begun.map_err(|why| failure(&who, &why))?;
    let (most, topics) = (network.law.most, ends.len() as u64);
    let heard_ns = most * MESSAGES * (MESSAGE_NS + topics * TOPIC_NS) + COPIED_NS;
    let released_ns = topics.saturating_sub(1) * WIRE_NS;
    let put_ns = PUT_NS + topics * TOPIC_NS;
    // Charged before it gets its place: a refused charge leaves no protocol behind.
    (network.law).charge_more(heard_ns + put_ns + released_ns, most * put_ns)?;
    PROTOCOLS.add(Box::new(ProtocolPlace {
        protocol: SpinLock::new(protocol),
        ends,
        port,
        peer,
        come: AtomicU64::new(0),
    }));
    Ok(())
}

impl Station for ProtocolPlace {
    fn port(&self) -> u16 {
        self.port
    }

    fn hear(&self, datagram: &[u8], port: u16, from: Peer, now_ns: u64) -> bool {
        let is_ours = port == self.port && self.peer == from;
        if is_ours {
            let come = self.protocol.lock().hear(datagram, now_ns);
            self.come.fetch_or(come, Ordering::Relaxed);
        }
        is_ours
    }

    fn tell_come(&self) {
        // Taken before the announcements: a packet that comes meanwhile sets its bit again.
        let mut come = self.come.swap(0, Ordering::Relaxed);
        while come != 0 {
            let end = self.ends.get(come.trailing_zeros() as usize);
            if let Some((plan, dag)) = end.and_then(|end| end.announce()) {
                execution::raise_in_interrupt(plan, dag);
            }
            come &= come - 1;
        }
    }

    fn send(&self, now_ns: u64, send: &mut dyn FnMut(&mut Buffer, u16, Peer) -> Sent) -> bool {
        let mut send = |datagram: &mut Buffer| {
            with_headers(datagram, |datagram| send(datagram, self.port, self.peer))
        };
        let has_gone = self.protocol.lock().send(now_ns, &mut send);
        if has_gone {
            self.ends.iter().for_each(|end| end.tell_gone());
        }
        has_gone
    }

    fn released(&self) -> Option<(u64, DagId)> {
        self.ends.iter().find_map(|end| end.released())
    }

    fn set_link(&self, is_up: bool) {
        self.protocol.lock().set_link(is_up);
    }

    fn close(&self) {
        self.protocol.lock().close();
    }

    fn tell_news(&self) {
        self.protocol.lock().tell_news();
    }

    fn tell(&self) {
        self.tell_news();
        let wires = self.ends.iter().map(|end| end.wire());
        wires.for_each(report::tell_wire);
        report::tell_protocol(&self.peer, &**self.protocol.lock());
    }
}
