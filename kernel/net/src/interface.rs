//! The interface: finds the meaning of each received frame, and writes the headers of each sent
//! frame.

use core::net::Ipv4Addr;
use core::ops::Range;

use crate::arp::{self, Neighbours};
use crate::bytes::{check_sum, mac_at, put, sum, u16_at};
use crate::ipv4::{self, Ipv4Packet};
use crate::{Mac, Peer, udp};

/// The bytes of all headers before a datagram's payload: Ethernet, IPv4, UDP.
pub const HEADERS: usize = ipv4::START + ipv4::LENGTH + udp::LENGTH;

/// The most bytes of a datagram's payload; they make a frame of 1514 bytes.
pub const MOST_PAYLOAD: usize = 1500 - ipv4::LENGTH - udp::LENGTH;

const TYPE_IPV4: u16 = 0x0800;
const TYPE_ARP: u16 = 0x0806;

/// The address of an interface, and the network around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// The address; unspecified (0.0.0.0) while there is none.
    pub ip: Ipv4Addr,
    /// The number of leading bits shared by all addresses of the network, 0 to 32.
    pub prefix: u8,
    /// The router to all other networks.
    pub gateway: Option<Ipv4Addr>,
}

impl Address {
    /// No address, as before an answer of DHCP.
    pub const NONE: Self = Self {
        ip: Ipv4Addr::UNSPECIFIED,
        prefix: 32,
        gateway: None,
    };

    /// Returns whether the address, and the router's if there is a router, may each belong to a
    /// single host.
    #[must_use]
    pub fn is_of_a_host(&self) -> bool {
        let mut ips = [Some(self.ip), self.gateway].into_iter().flatten();
        ips.all(|ip| is_host(ip) && !self.is_for_all(ip))
    }

    fn host_bits(&self) -> u32 {
        u32::MAX.checked_shr(self.prefix.into()).unwrap_or(0)
    }

    fn broadcast(&self) -> Ipv4Addr {
        (self.ip | Ipv4Addr::from(self.host_bits())) & Ipv4Addr::BROADCAST
    }

    fn is_for_all(&self, ip: Ipv4Addr) -> bool {
        // Networks of two addresses and of one have no broadcast address.
        ip == Ipv4Addr::BROADCAST || self.prefix < 31 && ip == self.broadcast()
    }

    /// Returns the neighbour through which an address is reached.
    fn next_hop(&self, ip: Ipv4Addr) -> Option<Ipv4Addr> {
        let is_near = (self.ip.to_bits() ^ ip.to_bits()) & !self.host_bits() == 0;
        if is_near { Some(ip) } else { self.gateway }
    }
}

/// Returns whether an address may belong to a single host.
pub(crate) fn is_host(ip: Ipv4Addr) -> bool {
    !(ip.is_unspecified() || ip.is_multicast() || ip.is_broadcast())
}

/// The numbers of received frames, by their kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// All frames.
    pub frames: u64,
    /// Frames with a wrong length, check sum or header.
    pub malformed: u64,
    /// Frames for other addresses, of other protocols, and fragments.
    pub foreign: u64,
    /// ARP packets.
    pub arps: u64,
    /// ICMP echo requests to this address.
    pub echoes: u64,
    /// Datagrams to this address or to all.
    pub datagrams: u64,
}

/// A datagram in the received frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Datagram {
    /// The sender.
    pub from: Peer,
    /// The port to which the datagram was sent.
    pub port: u16,
    /// The place of the payload in the frame.
    pub payload: Range<usize>,
}

/// The place of a [kept](Interface::keep) frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept(usize);

/// A frame's meaning.
#[derive(Debug, PartialEq, Eq)]
pub enum Heard {
    /// Nothing is to be done.
    Nothing,
    /// The frame's first bytes have become the answer, which is to be sent.
    Answer {
        /// The number of the answer's bytes.
        length: usize,
        /// A kept frame whose neighbour has become known by the question.
        resolved: Option<Kept>,
    },
    /// The neighbour of a kept frame has answered: the frame is whole, and is to be sent.
    Resolved(Kept),
    /// A datagram.
    Datagram(Datagram),
}

/// The next step for a frame whose headers have been written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// The frame is whole, and is to be sent.
    Ready,
    /// This neighbour is to be [asked](Interface::question), and the frame to be
    /// [kept](Interface::keep) until the neighbour answers.
    Unresolved(Ipv4Addr),
    /// No neighbour leads to the address, as there is no gateway or no address yet.
    None,
}

/// An interface with one address, for frames in buffers of kind `B`.
pub struct Interface<B> {
    mac: Mac,
    address: Address,
    neighbours: Neighbours<B>,
    identification: u16,
    counts: Counts,
}

impl<B: AsMut<[u8]>> Interface<B> {
    /// Returns the interface of a card. Each call of `room` makes a buffer for a frame waiting for
    /// a neighbour's answer.
    pub fn new(mac: Mac, address: Address, room: impl FnMut() -> B) -> Self {
        Self {
            mac,
            address,
            neighbours: Neighbours::new(room),
            identification: 0,
            counts: Counts::default(),
        }
    }

    /// Returns the address.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// Sets another address, as DHCP gives and withdraws addresses.
    pub fn set_address(&mut self, address: Address) {
        self.address = address;
    }

    /// Returns the numbers of received frames.
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Returns the meaning of a received frame. An answer is made in place.
    pub fn hear(&mut self, frame: &mut [u8]) -> Heard {
        self.counts.frames += 1;
        let (Some(to), Some(kind)) = (mac_at(frame, 0), u16_at(frame, 12)) else {
            self.counts.malformed += 1;
            return Heard::Nothing;
        };
        let is_ours = to == self.mac || to == Mac::BROADCAST;
        let heard = match kind {
            TYPE_ARP if is_ours => self.hear_arp(frame),
            TYPE_IPV4 if is_ours => self.hear_ipv4(frame),
            _ => {
                self.counts.foreign += 1;
                Some(Heard::Nothing)
            }
        };
        heard.unwrap_or_else(|| {
            self.counts.malformed += 1;
            Heard::Nothing
        })
    }

    /// Takes an ARP packet; returns `None` if the packet is malformed.
    fn hear_arp(&mut self, frame: &mut [u8]) -> Option<Heard> {
        let packet = arp::ArpPacket::read(&frame[ipv4::START..])?;
        self.counts.arps += 1;
        let (mac, ip) = packet.from;
        // A neighbour with a group's address would draw our frames to the whole group.
        if mac.is_group() || !is_host(ip) {
            return Some(Heard::Nothing);
        }
        let asks_us =
            packet.is_question && packet.to.1 == self.address.ip && is_host(self.address.ip);
        let resolved = self.neighbours.learn(packet.from, asks_us).map(Kept);
        if let Some(frame) = resolved {
            put(self.kept(frame).as_mut(), 0, &mac.0);
        }
        if asks_us {
            let answer = arp::ArpPacket {
                is_question: false,
                from: (self.mac, self.address.ip),
                to: packet.from,
            };
            let length = self.write_arp(frame, mac, answer);
            return Some(Heard::Answer { length, resolved });
        }
        Some(resolved.map_or(Heard::Nothing, Heard::Resolved))
    }

    /// Takes an IPv4 packet; returns `None` if the packet is malformed.
    fn hear_ipv4(&mut self, frame: &mut [u8]) -> Option<Heard> {
        let packet = Ipv4Packet::read(frame)?;
        let is_ours = packet.to == self.address.ip && !packet.to.is_unspecified();
        let is_for_all = self.address.is_for_all(packet.to);
        let from = packet.from;
        // An answer to a sender that is no host, or is the broadcast address, would go to all.
        let is_from_host =
            is_host(from) && !self.address.is_for_all(from) && from != self.address.ip;
        match packet.protocol {
            _ if packet.is_fragment || !is_from_host => {}
            ipv4::UDP if is_ours || is_for_all => {
                let (from, port, payload) = udp::read(frame, &packet)?;
                self.counts.datagrams += 1;
                let from = Peer::new(packet.from, from);
                return Some(Heard::Datagram(Datagram {
                    from,
                    port,
                    payload,
                }));
            }
            ipv4::ICMP if is_ours => return self.hear_icmp(frame, &packet),
            _ => {}
        }
        self.counts.foreign += 1;
        Some(Heard::Nothing)
    }

    /// Takes an ICMP message, and answers an echo request; returns `None` if the message is
    /// malformed.
    fn hear_icmp(&mut self, frame: &mut [u8], packet: &Ipv4Packet) -> Option<Heard> {
        let message = &frame[packet.payload.clone()];
        if message.len() < 8 || check_sum(sum(message, 0)) != 0 {
            return None;
        }
        let to = mac_at(frame, 6)?;
        // A question in the name of a group would have the whole group answered, and a question
        // with options would have to move for an answer without options.
        let has_options = packet.payload.start > ipv4::START + ipv4::LENGTH;
        if message[..2] != [8, 0] || to.is_group() || has_options {
            self.counts.foreign += 1;
            return Some(Heard::Nothing);
        }
        self.counts.echoes += 1;
        let end = packet.payload.end;
        // The kind changes from 8 to 0, and the check sum is adapted (RFC 1624): summing all bytes
        // again would cost as much as the first sum.
        let check = !check_sum(u64::from(u16_at(message, 2)?) + 0x0800);
        let message = &mut frame[packet.payload.clone()];
        message[0] = 0;
        put(message, 2, &check.to_be_bytes());
        self.write_ipv4(&mut frame[..end], ipv4::ICMP, packet.from);
        self.write_ethernet(frame, to, TYPE_IPV4);
        let resolved = None;
        Some(Heard::Answer {
            length: end,
            resolved,
        })
    }

    /// Writes the headers of a datagram, whose payload extends from [`HEADERS`] to the end of the
    /// frame.
    ///
    /// # Panics
    ///
    /// Panics if the frame is shorter than its headers.
    pub fn address_datagram(&mut self, frame: &mut [u8], port: u16, to: Peer) -> Route {
        let (ip, to_port) = (*to.ip(), to.port());
        let addresses = (self.address.ip, ip);
        let header = HEADERS - udp::LENGTH;
        udp::write(&mut frame[header..], (port, to_port), addresses);
        // Whatever the route: a kept frame lacks nothing but its neighbour's address.
        self.write_ipv4(frame, ipv4::UDP, ip);
        if self.address.is_for_all(ip) {
            self.write_ethernet(frame, Mac::BROADCAST, TYPE_IPV4);
            return Route::Ready;
        }
        let hop = self.address.next_hop(ip);
        let Some(hop) = hop.filter(|_| !self.address.ip.is_unspecified()) else {
            return Route::None;
        };
        let mac = self.neighbours.resolve(hop);
        self.write_ethernet(frame, mac.unwrap_or_default(), TYPE_IPV4);
        mac.map_or(Route::Unresolved(hop), |_| Route::Ready)
    }

    /// Forgets the neighbours: after the link was down, they may be others.
    pub fn forget_neighbours(&mut self) {
        self.neighbours.forget();
    }

    /// Keeps a frame until its neighbour has answered, in exchange for the previously kept buffer:
    /// there is a single place for each neighbour.
    pub fn keep(&mut self, neighbour: Ipv4Addr, frame: &mut B) {
        self.neighbours.keep(neighbour, frame);
    }

    /// Returns a frame whose neighbour has answered, until another frame is kept.
    #[must_use]
    pub fn kept(&mut self, Kept(place): Kept) -> &mut B {
        self.neighbours.frame(place)
    }

    /// Writes the question for a neighbour, and returns its length.
    ///
    /// # Panics
    ///
    /// Panics if the frame is shorter than [`HEADERS`].
    pub fn question(&self, frame: &mut [u8], neighbour: Ipv4Addr) -> usize {
        let question = arp::ArpPacket {
            is_question: true,
            from: (self.mac, self.address.ip),
            to: (Mac::default(), neighbour),
        };
        self.write_arp(frame, Mac::BROADCAST, question)
    }

    fn write_arp(&self, frame: &mut [u8], to: Mac, packet: arp::ArpPacket) -> usize {
        self.write_ethernet(frame, to, TYPE_ARP);
        put(frame, ipv4::START, &packet.bytes());
        ipv4::START + arp::LENGTH
    }

    fn write_ipv4(&mut self, frame: &mut [u8], protocol: u8, to: Ipv4Addr) {
        self.identification = self.identification.wrapping_add(1);
        let addresses = (self.address.ip, to);
        ipv4::write(frame, self.identification, protocol, addresses);
    }

    fn write_ethernet(&self, frame: &mut [u8], to: Mac, kind: u16) {
        put(frame, 0, &to.0);
        put(frame, 6, &self.mac.0);
        put(frame, 12, &kind.to_be_bytes());
    }
}
