//! Datagrams: a wire sends its output to a peer, and receives the datagrams that peers send to its
//! port.
//!
//! A wire with the option `udp://:PORT` hears everyone, and answers the peer named by an
//! [instance](fass::shared::Sender::to), or else the latest sender. A wire with a peer's address
//! hears that peer alone, from a port of its own: 49152 for the app's first wire, and so on.

use fass::shared::Wire;
use front::app::endpoint::EndpointWord;
use net::MOST_PAYLOAD;

use super::network::{self, UdpWire};
use super::{EndpointWords, Opened, end_of, name_of};

/// The default time between two interrupts, in microseconds.
const DISTANCE_US: u64 = 170;

/// Gives the wire a place in the network, if its option says so.
pub(super) fn open(wire: &Wire, words: &EndpointWords<'_>) -> Opened {
    let (port, peer) = match words.word {
        Some(EndpointWord::Peer(peer)) => (None, Some(peer)),
        Some(EndpointWord::Port(port)) => (Some(port), None),
        _ => return Ok(false),
    };
    let who = name_of(wire);
    let network = network::open(&who, words.options, DISTANCE_US)?;
    let port = network.port(&who, port)?;
    let end = end_of(wire)?;
    end.begin_packets(MOST_PAYLOAD, network::ring);
    end.set_link(false);
    network.add(UdpWire::new(end, port, peer))?;
    Ok(true)
}
