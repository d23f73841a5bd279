//! The header of an IPv4 packet (RFC 791).

use core::net::Ipv4Addr;
use core::ops::Range;

use crate::bytes::{check_sum, ip_at, put, sum, u16_at};

/// The bytes of a written header. A header that is read may have options.
pub(crate) const LENGTH: usize = 20;

/// The offset of the header in a frame.
pub(crate) const START: usize = 14;

pub(crate) const ICMP: u8 = 1;
pub(crate) const UDP: u8 = 17;

/// A packet in a frame.
pub(crate) struct Ipv4Packet {
    pub(crate) protocol: u8,
    pub(crate) from: Ipv4Addr,
    pub(crate) to: Ipv4Addr,
    pub(crate) is_fragment: bool,
    /// The place of the payload in the frame.
    pub(crate) payload: Range<usize>,
}

impl Ipv4Packet {
    /// Reads the header, if its lengths and its check sum are right.
    pub(crate) fn read(frame: &[u8]) -> Option<Self> {
        let bytes = frame.get(START..)?;
        let first = *bytes.first()?;
        let header = usize::from(first & 15) * 4;
        let total = usize::from(u16_at(bytes, 2)?);
        let is_right = first >> 4 == 4 && (LENGTH..=total).contains(&header);
        if !is_right || total > bytes.len() || check_sum(sum(&bytes[..header], 0)) != 0 {
            return None;
        }
        Some(Self {
            protocol: bytes[9],
            from: ip_at(bytes, 12)?,
            to: ip_at(bytes, 16)?,
            // More fragments follow, or this is not the first.
            is_fragment: u16_at(bytes, 6)? & 0x3fff != 0,
            payload: START + header..START + total,
        })
    }
}

/// Writes the header of a packet that fills the rest of the frame.
pub(crate) fn write(
    frame: &mut [u8],
    identification: u16,
    protocol: u8,
    (from, to): (Ipv4Addr, Ipv4Addr),
) {
    let packet = &mut frame[START..];
    let total = u16::try_from(packet.len()).unwrap_or(u16::MAX);
    let header = &mut packet[..LENGTH];
    header.fill(0);
    // Version 4, and a header of five words.
    header[0] = 0x45;
    put(header, 2, &total.to_be_bytes());
    put(header, 4, &identification.to_be_bytes());
    // Not to be fragmented; 64 routers at most.
    header[6] = 0x40;
    header[8] = 64;
    header[9] = protocol;
    put(header, 12, &from.octets());
    put(header, 16, &to.octets());
    let check = check_sum(sum(header, 0));
    put(header, 10, &check.to_be_bytes());
}
