//! The part of IPv4 that a node with one address needs to exchange datagrams: Ethernet (IEEE
//! 802.3), ARP (RFC 826), IPv4 (RFC 791), ICMP echo (RFC 792), UDP (RFC 768), DHCP (RFC 2131).
//!
//! Nothing here has a clock, memory or a device of its own, so the machine, a test and a fuzzer run
//! the same code. The caller passes a received frame, or a buffer for a frame to be sent. No length
//! in a frame is trusted, no loop is longer than the frame, and nothing allocates.
//!
//! Fragments are neither reassembled nor sent. TCP is not supported.

#![no_std]

mod arp;
mod bytes;
mod dhcp;
mod interface;
mod ipv4;
mod udp;

use core::fmt;

/// An address and a port: one end of a datagram's way.
pub use core::net::SocketAddrV4 as Peer;
pub use dhcp::{Client, Lease};
pub use interface::{
    Address, Counts, Datagram, HEADERS, Heard, Interface, Kept, MOST_PAYLOAD, Route,
};

/// An Ethernet address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mac(pub [u8; 6]);

impl Mac {
    /// The address of every card.
    pub const BROADCAST: Self = Self([0xff; 6]);

    /// Returns whether the address is that of several cards.
    const fn is_group(self) -> bool {
        self.0[0] & 1 != 0
    }
}

impl fmt::Display for Mac {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g] = self.0;
        write!(f, "{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}")
    }
}
