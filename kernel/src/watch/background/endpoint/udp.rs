//! Datagrams: what a wire sends goes to a peer, and what peers send to its port arrives on it.
//!
//! A wire with the word `udp://:PORT` hears everyone, and answers whom an instance
//! [says](fass::shared::Sender::to), or else who has sent last. One with a peer's address hears that
//! peer alone, from a port of its own: 49152 for the app's first wire, and so on.

use alloc::boxed::Box;
use alloc::format;
use core::net::{Ipv4Addr, SocketAddrV4};
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use executive::machine::this_core::Core;
use fass::platform::Buffer;
use fass::shared::{DeviceEnd, Wire};
use front::app::endpoint::EndpointWord;
use net::{HEADERS, MOST_PAYLOAD, Peer};

use super::network::{self, Network};
use super::{Endpoint, EndpointWords, Opened, end_of, failure};

/// The first port of a wire that has none by its word (RFC 6335, 6).
const FIRST_OWN_PORT: u16 = 49_152;

/// The wire's place in the network.
pub(super) struct UdpWire {
    pub(super) end: DeviceEnd,
    pub(super) port: u16,
    peer: Option<SocketAddrV4>,
    /// The peer that has sent last: its address and port, or 0.
    last: AtomicU64,
    /// Whether a packet has come that is not announced, or one has gone that is not told.
    has_come: AtomicBool,
    has_gone: AtomicBool,
}

/// What becomes of a packet that is to be sent.
pub(super) enum Sent {
    /// It has gone, or can go nowhere.
    Gone,
    /// It waits for room, or for an address.
    Waits,
}

/// An endpoint in the machine's network, which its first one drives.
struct UdpEndpoint {
    network: &'static Network,
    wire: &'static UdpWire,
    is_first: bool,
}

/// Opens the network for the wire, if its word says so.
pub(super) fn open(wire: &Wire, words: &EndpointWords<'_>) -> Opened {
    if !matches!(
        words.word,
        Some(EndpointWord::Port(_) | EndpointWord::Peer(_))
    ) {
        return Ok(None);
    }
    let network = network::open(wire, words.options)?;
    let count = network.wires.iter().count();
    let own = FIRST_OWN_PORT.saturating_add(u16::try_from(count).unwrap_or(u16::MAX));
    let (port, peer) = match words.word {
        Some(EndpointWord::Peer(peer)) => (own, Some(peer)),
        Some(EndpointWord::Port(port)) => (port, None),
        _ => (own, None),
    };
    if let Some(other) = network.wires.iter().find(|other| other.port == port) {
        let other = other.end.wire().name();
        let line = format!("has port {port} of wire `{other}`; give each one its own");
        return Err(failure(wire, &line));
    }
    let end = end_of(wire)?;
    end.begin_packets(MOST_PAYLOAD, network::ring);
    end.set_link(false);
    network.wires.add(UdpWire {
        end,
        port,
        peer,
        last: AtomicU64::new(0),
        has_come: AtomicBool::new(false),
        has_gone: AtomicBool::new(false),
    });
    let wire = network.wires.iter().last();
    let is_first = count == 0;
    Ok(wire.map(|wire| -> Box<dyn Endpoint> {
        Box::new(UdpEndpoint {
            network,
            wire,
            is_first,
        })
    }))
}

impl UdpWire {
    /// Reports whether a datagram to this port is the wire's.
    pub(super) fn hears(&self, port: u16, from: Peer) -> bool {
        let is_peer = |peer: SocketAddrV4| (*peer.ip(), peer.port()) == (from.ip, from.port);
        port == self.port && self.peer.is_none_or(is_peer)
    }

    /// Takes a datagram, whose payload is the buffer's content.
    pub(super) fn take(&self, payload: &mut Buffer, from: Peer, now_ns: u64) {
        let bits = u64::from(from.ip.to_bits()) << 16 | u64::from(from.port);
        self.last.store(bits, Ordering::Relaxed);
        let from = SocketAddrV4::new(from.ip, from.port);
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
            let to = Peer {
                ip: *to.ip(),
                port: to.port(),
            };
            let payload = packet.range();
            packet.set_range(payload.start - HEADERS..payload.end);
            match send(packet, self.port, to) {
                Sent::Gone => true,
                Sent::Waits => {
                    packet.set_range(payload);
                    false
                }
            }
        });
        if has_gone {
            self.has_gone.store(true, Ordering::Relaxed);
        }
        has_gone
    }

    fn last(&self) -> Option<SocketAddrV4> {
        let bits = self.last.load(Ordering::Relaxed);
        let [.., a, b, c, d, high, low] = bits.to_be_bytes();
        let ip = Ipv4Addr::new(a, b, c, d);
        (bits > 0).then(|| SocketAddrV4::new(ip, u16::from_be_bytes([high, low])))
    }

    /// Tells the app's functions of what has come, and those that wait of what has gone.
    pub(super) fn tell(&self) {
        if self.has_come.swap(false, Ordering::Relaxed)
            && let Some((plan, dag)) = self.end.announce()
        {
            executive::run::execution::raise_in_interrupt(plan, dag);
        }
        if self.has_gone.swap(false, Ordering::Relaxed) {
            self.end.tell_gone();
        }
    }
}

impl Endpoint for UdpEndpoint {
    fn begin_run(&self, _now_ns: u64) {
        if self.is_first {
            let dag = self.wire.end.released();
            self.network.begin_run(dag.map(|(_, dag)| dag));
        }
    }

    fn beat(&self, core: &Core, now_ns: u64) {
        if self.is_first {
            self.network.beat(core, now_ns);
        }
    }

    fn end_run(&self) {
        if self.is_first {
            self.network.end_run();
        }
    }

    fn tell(&self) {
        if self.is_first {
            self.network.tell();
        }
    }

    fn end(&self) -> &DeviceEnd {
        &self.wire.end
    }
}
