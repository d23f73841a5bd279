//! A wire's place in the network: its port, and the peers it exchanges datagrams with.

use core::net::Ipv4Addr;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use executive::run::execution;
use fass::platform::Buffer;
use fass::shared::DeviceEnd;
use net::{HEADERS, Peer};

/// The wire's place in the network.
pub(in super::super) struct UdpWire {
    pub(super) end: DeviceEnd,
    pub(super) port: u16,
    peer: Option<Peer>,
    /// The latest sender: its address and port, or 0.
    last: AtomicU64,
    /// Whether a packet has come but is not announced, or was sent but is not reported.
    has_come: AtomicBool,
    has_gone: AtomicBool,
}

/// The fate of a packet to be sent.
pub(super) enum Sent {
    /// The packet was sent, or can go nowhere.
    Gone,
    /// The packet waits for room, or for an address.
    Waits,
}

/// Passes a packet with room for its headers to `send`. Reports whether the packet is done with.
pub(super) fn with_headers(packet: &mut Buffer, send: impl FnOnce(&mut Buffer) -> Sent) -> bool {
    let payload = packet.range();
    packet.set_range(payload.start - HEADERS..payload.end);
    match send(packet) {
        Sent::Gone => true,
        Sent::Waits => {
            packet.set_range(payload);
            false
        }
    }
}

impl UdpWire {
    pub(in super::super) fn new(end: DeviceEnd, port: u16, peer: Option<Peer>) -> Self {
        Self {
            end,
            port,
            peer,
            last: AtomicU64::new(0),
            has_come: AtomicBool::new(false),
            has_gone: AtomicBool::new(false),
        }
    }

    /// Reports whether a datagram to `port` belongs to the wire.
    pub(super) fn hears(&self, port: u16, from: Peer) -> bool {
        port == self.port && self.peer.is_none_or(|peer| peer == from)
    }

    /// Takes a datagram whose payload is the buffer's content.
    pub(super) fn take(&self, payload: &mut Buffer, from: Peer, now_ns: u64) {
        // In one word, so that a reader never gets one sender's address with another's port.
        let bits = u64::from(from.ip().to_bits()) << 16 | u64::from(from.port());
        self.last.store(bits, Ordering::Relaxed);
        if self.end.swap_in(payload, from, now_ns) {
            self.has_come.store(true, Ordering::Relaxed);
        }
    }

    /// Passes the oldest waiting packet, with room for its headers, and its receiver to `send`.
    /// Reports whether the packet is done with.
    pub(super) fn send(&self, mut send: impl FnMut(&mut Buffer, u16, Peer) -> Sent) -> bool {
        let has_gone = self.end.swap_out(|packet, to| {
            let Some(to) = to.or(self.peer).or_else(|| self.last()) else {
                // Nobody has sent anything yet, so the packet has no receiver, and is dropped.
                return true;
            };
            with_headers(packet, |packet| send(packet, self.port, to))
        });
        if has_gone {
            self.has_gone.store(true, Ordering::Relaxed);
        }
        has_gone
    }

    fn last(&self) -> Option<Peer> {
        let bits = self.last.load(Ordering::Relaxed);
        let [.., a, b, c, d, high, low] = bits.to_be_bytes();
        let ip = Ipv4Addr::new(a, b, c, d);
        (bits > 0).then(|| Peer::new(ip, u16::from_be_bytes([high, low])))
    }

    /// Tells the app's functions about an arrived packet. Called in the card's interrupt, because
    /// the call may release a DAG.
    pub(super) fn tell_come(&self) {
        if self.has_come.swap(false, Ordering::Relaxed)
            && let Some((plan, dag)) = self.end.announce()
        {
            execution::raise_in_interrupt(plan, dag);
        }
    }

    /// Tells waiting functions that a packet was sent.
    pub(super) fn tell_gone(&self) {
        if self.has_gone.swap(false, Ordering::Relaxed) {
            self.end.tell_gone();
        }
    }
}
