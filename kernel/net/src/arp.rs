//! Neighbours: the Ethernet addresses of the IPv4 addresses next to us (RFC 826).

use core::net::Ipv4Addr;

use crate::Mac;
use crate::bytes::{array, ip_at, mac_at, u16_at};

/// The number of neighbours known at a time.
const NEIGHBOURS: usize = 8;

/// The bytes of an ARP packet, after the Ethernet header.
pub(crate) const LENGTH: usize = 28;

/// Ethernet and IPv4, with addresses of 6 and 4 bytes.
const KINDS: [u8; 6] = [0, 1, 8, 0, 6, 4];

/// A question for an Ethernet address, or the answer.
#[derive(Clone, Copy)]
pub(crate) struct ArpPacket {
    pub(crate) is_question: bool,
    pub(crate) from: (Mac, Ipv4Addr),
    pub(crate) to: (Mac, Ipv4Addr),
}

impl ArpPacket {
    pub(crate) fn read(bytes: &[u8]) -> Option<Self> {
        (array(bytes, 0)? == KINDS).then_some(())?;
        Some(Self {
            is_question: match u16_at(bytes, 6)? {
                1 => true,
                2 => false,
                _ => return None,
            },
            from: (mac_at(bytes, 8)?, ip_at(bytes, 14)?),
            to: (mac_at(bytes, 18)?, ip_at(bytes, 24)?),
        })
    }

    pub(crate) fn bytes(self) -> [u8; LENGTH] {
        let mut bytes = [0; LENGTH];
        bytes[..6].copy_from_slice(&KINDS);
        bytes[7] = if self.is_question { 1 } else { 2 };
        for (at, (mac, ip)) in [(8, self.from), (18, self.to)] {
            bytes[at..at + 6].copy_from_slice(&mac.0);
            bytes[at + 6..at + 10].copy_from_slice(&ip.octets());
        }
        bytes
    }
}

struct Neighbour<B> {
    /// Unspecified in a free place.
    ip: Ipv4Addr,
    /// None while the question for the address has no answer.
    mac: Option<Mac>,
    /// Room for the latest frame waiting for the answer, and whether there is such a frame.
    frame: B,
    is_waiting: bool,
    /// The count of uses at the latest use of this neighbour; 0 if nothing was ever sent to it.
    last_use: u64,
}

/// The neighbours that are known or asked for.
pub(crate) struct Neighbours<B> {
    table: [Neighbour<B>; NEIGHBOURS],
    uses: u64,
}

impl<B> Neighbours<B> {
    /// Makes the table, with room for a frame each.
    pub(crate) fn new(mut room: impl FnMut() -> B) -> Self {
        Self {
            table: [(); NEIGHBOURS].map(|()| Neighbour {
                ip: Ipv4Addr::UNSPECIFIED,
                mac: None,
                frame: room(),
                is_waiting: false,
                last_use: 0,
            }),
            uses: 0,
        }
    }

    fn find(&mut self, ip: Ipv4Addr) -> Option<&mut Neighbour<B>> {
        self.table.iter_mut().find(|known| known.ip == ip)
    }

    /// Returns the neighbour of an address. A new neighbour replaces the neighbour not sent to for
    /// the longest time, so strangers with questions displace only each other.
    fn entry(&mut self, ip: Ipv4Addr) -> &mut Neighbour<B> {
        let oldest = (0..NEIGHBOURS).min_by_key(|&place| {
            let known = &self.table[place];
            let is_taken = !known.ip.is_unspecified();
            (known.ip != ip, is_taken, known.last_use)
        });
        let place = &mut self.table[oldest.unwrap_or(0)];
        if place.ip != ip {
            (place.ip, place.mac) = (ip, None);
            (place.is_waiting, place.last_use) = (false, 0);
        }
        place
    }

    /// Returns the Ethernet address of the neighbour a frame is to be sent to, if known.
    pub(crate) fn resolve(&mut self, ip: Ipv4Addr) -> Option<Mac> {
        self.uses += 1;
        let uses = self.uses;
        let known = self.find(ip)?;
        known.last_use = uses;
        known.mac
    }

    /// Forgets all Ethernet addresses, so that each neighbour is asked anew.
    pub(crate) fn forget(&mut self) {
        // Frames stay: the answers to come send them.
        self.table.iter_mut().for_each(|known| known.mac = None);
    }

    /// Keeps a frame until its neighbour has answered, in exchange for the previously kept buffer.
    pub(crate) fn keep(&mut self, ip: Ipv4Addr, frame: &mut B) {
        let uses = self.uses;
        let neighbour = self.entry(ip);
        neighbour.last_use = uses;
        core::mem::swap(&mut neighbour.frame, frame);
        neighbour.is_waiting = true;
    }

    /// Learns from a packet, and returns the place of the frame that has waited for it.
    ///
    /// Only neighbours asking for us are added; neighbours known, or asked for, are renewed.
    pub(crate) fn learn(&mut self, (mac, ip): (Mac, Ipv4Addr), asks_us: bool) -> Option<usize> {
        let neighbour = match asks_us {
            true => self.entry(ip),
            false => self.find(ip)?,
        };
        neighbour.mac = Some(mac);
        let was_waiting = core::mem::take(&mut neighbour.is_waiting);
        let place = was_waiting.then(|| self.table.iter().position(|known| known.ip == ip));
        place.flatten()
    }

    /// Returns the frame of a place.
    pub(crate) fn frame(&mut self, place: usize) -> &mut B {
        &mut self.table[place].frame
    }
}
