//! Datagrams: what a wire sends goes to a peer, and what peers send to its port arrives on it.
//!
//! A wire with the word `udp://:PORT` hears everyone, and answers whom an instance
//! [says](fass::shared::Sender::to), or else who has sent last. One with a peer's address hears that
//! peer alone, from a port of its own: 49152 for the app's first wire, and so on.

use alloc::boxed::Box;
use alloc::format;

use executive::machine::this_core::Core;
use fass::shared::{DeviceEnd, Wire};
use front::app::endpoint::EndpointWord;
use net::{Client, MOST_PAYLOAD};

use super::network::{self, Network, UdpWire};
use super::{Endpoint, EndpointWords, Opened, end_of, failure};

/// The first port of a wire that has none by its word (RFC 6335, 6).
const FIRST_OWN_PORT: u16 = 49_152;

/// An endpoint in the machine's network, which its first one drives.
struct UdpEndpoint {
    /// The network, for its first endpoint.
    first: Option<&'static Network>,
    wire: &'static UdpWire,
}

/// Opens the network for the wire, if its word says so.
pub(super) fn open(wire: &Wire, words: &EndpointWords<'_>) -> Opened {
    let (port, peer) = match words.word {
        Some(EndpointWord::Peer(peer)) => (None, Some(peer)),
        Some(EndpointWord::Port(port)) => (Some(port), None),
        _ => return Ok(None),
    };
    let network = network::open(wire, words.options)?;
    let count = network.wires.iter().count();
    let own = FIRST_OWN_PORT.saturating_add(u16::try_from(count).unwrap_or(u16::MAX));
    let port = port.unwrap_or(own);
    if let Some(other) = network.wires.iter().find(|other| other.port == port) {
        let other = other.end.wire().name();
        let line = format!("has port {port} of wire `{other}`; give each one its own");
        return Err(failure(wire, &line));
    }
    if port == Client::PORT {
        let line = "has the port at which the network asks for its address; give another than 68";
        return Err(failure(wire, line));
    }
    let end = end_of(wire)?;
    end.begin_packets(MOST_PAYLOAD, network::ring);
    end.set_link(false);
    network.wires.add(UdpWire::new(end, port, peer));
    let wire = network.wires.iter().last();
    let first = (count == 0).then_some(network);
    Ok(wire.map(|wire| -> Box<dyn Endpoint> { Box::new(UdpEndpoint { first, wire }) }))
}

impl Endpoint for UdpEndpoint {
    fn begin_run(&self, _now_ns: u64) {
        if let Some(network) = self.first {
            let dag = self.wire.end.released();
            network.begin_run(dag.map(|(_, dag)| dag));
        }
    }

    fn beat(&self, core: &Core, now_ns: u64) {
        if let Some(network) = self.first {
            network.beat(core, now_ns);
        }
    }

    fn step(&self) -> bool {
        // What was more than a completion sends.
        self.first.is_some_and(|network| network.send(1))
    }

    fn end_run(&self) {
        if let Some(network) = self.first {
            network.end_run();
        }
    }

    fn tell(&self) {
        if let Some(network) = self.first {
            network.tell();
        }
    }

    fn end(&self) -> &DeviceEnd {
        &self.wire.end
    }
}
