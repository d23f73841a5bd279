//! The header of a datagram (RFC 768).

use core::net::Ipv4Addr;
use core::ops::Range;

use crate::bytes::{check_sum, put, sum, u16_at};
use crate::ipv4::{self, Ipv4Packet};

/// The bytes of the header.
pub(crate) const LENGTH: usize = 8;

/// The sum of the pseudo header.
fn pseudo_header((from, to): (Ipv4Addr, Ipv4Addr), length: u16) -> u64 {
    let addresses = u64::from(from.to_bits()) + u64::from(to.to_bits());
    addresses + u64::from(ipv4::UDP) + u64::from(length)
}

/// Reads a datagram, if its length and its check sum are right: the sender's and the receiver's
/// port, and the place of the payload in the frame.
pub(crate) fn read(frame: &[u8], packet: &Ipv4Packet) -> Option<(u16, u16, Range<usize>)> {
    let bytes = &frame[packet.payload.clone()];
    let length = u16_at(bytes, 4)?;
    let datagram = bytes.get(..usize::from(length))?;
    let pseudo = pseudo_header((packet.from, packet.to), length);
    // A check sum of 0 means that there is none.
    let is_right = u16_at(datagram, 6)? == 0 || check_sum(sum(datagram, pseudo)) == 0;
    let start = packet.payload.start;
    let payload = start + LENGTH..start + datagram.len();
    is_right.then_some((u16_at(datagram, 0)?, u16_at(datagram, 2)?, payload))
}

/// Writes the header of a datagram, whose payload follows the header in the frame.
pub(crate) fn write(datagram: &mut [u8], ports: (u16, u16), addresses: (Ipv4Addr, Ipv4Addr)) {
    let length = u16::try_from(datagram.len()).unwrap_or(u16::MAX);
    put(datagram, 0, &ports.0.to_be_bytes());
    put(datagram, 2, &ports.1.to_be_bytes());
    put(datagram, 4, &length.to_be_bytes());
    put(datagram, 6, &[0; 2]);
    let check = match check_sum(sum(datagram, pseudo_header(addresses, length))) {
        // On the wire 0 would mean "no check sum"; all ones is the same sum (RFC 768).
        0 => 0xffff,
        check => check,
    };
    put(datagram, 6, &u16::to_be_bytes(check));
}
