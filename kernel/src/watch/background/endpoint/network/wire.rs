//! A wire's place in the network: its port, and whom it exchanges datagrams with.

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
    /// The peer that has sent last: its address and port, or 0.
    last: AtomicU64,
    /// Whether a packet has come that is not announced, or one has gone that is not told.
    has_come: AtomicBool,
    has_gone: AtomicBool,
}

/// The fate of a packet that is to be sent.
pub(super) enum Sent {
    /// It has gone, or can go nowhere.
    Gone,
    /// It waits for room, or for an address.
    Waits,
}

/// Lets `send` have a packet with room for its headers. Reports whether it has gone.
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

    /// Reports whether a datagram to this port is the wire's.
    pub(super) fn hears(&self, port: u16, from: Peer) -> bool {
        port == self.port && self.peer.is_none_or(|peer| peer == from)
    }

    /// Takes a datagram, whose payload is the buffer's content.
    pub(super) fn take(&self, payload: &mut Buffer, from: Peer, now_ns: u64) {
        let bits = u64::from(from.ip().to_bits()) << 16 | u64::from(from.port());
        self.last.store(bits, Ordering::Relaxed);
        if self.end.swap_in(payload, from, now_ns) {
            self.has_come.store(true, Ordering::Relaxed);
        }
    }

    /// Lets `send` have the oldest packet that is to go, with room for its headers, and whom it is
    /// to. Reports whether it has gone.
    pub(super) fn send(&self, mut send: impl FnMut(&mut Buffer, u16, Peer) -> Sent) -> bool {
        let has_gone = self.end.swap_out(|packet, to| {
            let Some(to) = to.or(self.peer).or_else(|| self.last()) else {
                // Nobody has sent anything yet, so there is nobody whom it could be for.
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

    /// Tells the app's functions of what has come. In the card's interrupt, as it may release a DAG.
    pub(super) fn tell_come(&self) {
        if self.has_come.swap(false, Ordering::Relaxed)
            && let Some((plan, dag)) = self.end.announce()
        {
            execution::raise_in_interrupt(plan, dag);
        }
    }

    /// Tells those that wait of what has gone.
    pub(super) fn tell_gone(&self) {
        if self.has_gone.swap(false, Ordering::Relaxed) {
            self.end.tell_gone();
        }
    }
}
