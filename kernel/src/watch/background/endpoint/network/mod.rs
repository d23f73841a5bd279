//! The machine's network: its first card, and the interface on which wires hear and send.
//!
//! The card's interrupt takes incoming frames, on a single core: the first core of the cluster
//! whose DAG is released by the first wire. Output is sent on the core that has completed the
//! instance, by an interrupt the core sends to itself, and thus after the core has dropped the
//! scheduler's lock.
//!
//! # A storm is bounded by law
//!
//! An interrupt takes at most [`Law::most`] frames, and masks the card. [`Law::distance_ns`] later
//! an alarm of the same core takes at most as many, and masks the card again; if there are no
//! frames, the alarm lets the card interrupt again. Meanwhile the card drops the frames it has no
//! buffer for, at no cost. So any storm costs that core at most one such interrupt in each
//! distance, and bounds are charged for exactly this.
//!
//! # Locks
//!
//! The card's two halves have a lock each. The sending half's lock is held for a heard frame or a
//! sent packet, not longer. Neither lock is held while functions are told, because a wait that ends
//! needs the scheduler's lock. A [protocol] has a lock of its own, taken within the receiving
//! half's; the sending half's is taken within the protocol's.

pub(super) mod protocol;
mod wire;

use alloc::boxed::Box;
use alloc::format;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use cards::{Card, Receive, Transmit};
use executive::devices::lines::{Bell, DeviceLine, Line, tie};
use executive::devices::{ecam, pci};
use executive::machine::clock;
use executive::machine::spinlock::SpinLock;
use executive::machine::this_core::{self, Core};
use executive::machine::timer::{self, Alarm};
use executive::run::execution;
use executive::run::platform::KERNEL;
use fass::commit::Overheads;
use fass::platform::{Buffer, Platform as _, SetOnce};
use front::app::ending::AppError;
use front::{json, report};
use net::{Address, Client, Heard, Interface, Kept, Mac, Peer, Route};

use super::{CONNECTED, Chain, Endpoint, failure};
use crate::options::{CommandLine, UsageError};
use protocol::PROTOCOLS;
use wire::Sent;
pub(super) use wire::UdpWire;

/// The limit on the cost of a storm.
#[derive(Clone, Copy)]
struct Law {
    /// The most frames taken, or packets sent, in an interrupt.
    most: u64,
    /// The least time from one interrupt to the next, in nanoseconds.
    distance_ns: u64,
    /// Whether the app's options state the charge.
    is_stated: bool,
}

impl Law {
    /// Reads the options, and charges the commits to come, unless `overheads_ns` states a device.
    ///
    /// The charge is that of the longest interrupt in instructions, each a nanosecond: with its
    /// entry and exit, its frames, the release of a DAG, the alarm, and the packet sent by a
    /// heartbeat. Packets sent by a core behind a completion are charged as a part of the dispatch.
    /// The time that cores wait for each other, when several need the card at the same time, is not
    /// charged.
    fn charged(options: &CommandLine<'static>, distance_us: u64) -> Result<Self, UsageError> {
        let most = options.number("net_packets", 1..=16, 2)?;
        // No longer than a heartbeat, because the heartbeat sends as well.
        let distance_us = options.number("net_us", 10..=1_000, distance_us)?;
        let mut overheads = KERNEL.terms().overheads;
        let is_stated = overheads.device_ns > 0;
        if !is_stated {
            overheads.device_ns = RELEASE_NS + most * FRAME_NS + SENT_NS;
            overheads.device_distance_ns = distance_us * 1_000;
            overheads.dispatch_ns += BELL_NS + most * SENT_NS;
        }
        let law = Self {
            most,
            distance_ns: overheads.device_distance_ns,
            is_stated,
        };
        law.charge(overheads)?;
        Ok(law)
    }

    /// Charges this much more for an interrupt, and for the packets sent behind a completion.
    fn charge_more(&self, device_ns: u64, dispatch_ns: u64) -> Result<(), UsageError> {
        let mut overheads = KERNEL.terms().overheads;
        if !self.is_stated {
            overheads.device_ns += device_ns;
            overheads.dispatch_ns += dispatch_ns;
        }
        self.charge(overheads)
    }

    fn charge(&self, overheads: Overheads) -> Result<(), UsageError> {
        if !overheads.device_leaves_time() {
            let (us, most) = (self.distance_ns / 1_000, self.most);
            let line = format!(
                "`net_us={us}`: {most} packets may take longer; give a longer distance, or fewer by \
                 `net_packets=`"
            );
            return Err(UsageError::new(line));
        }
        KERNEL.change(|terms| terms.overheads = overheads);
        Ok(())
    }
}

/// The times of an interrupt of the card without its frames, of the release by another wire, of a
/// frame of the greatest length, of a sent packet, and of the interrupt by which a core sends.
const RELEASE_NS: u64 = 3_600;
const WIRE_NS: u64 = 2_300;
const FRAME_NS: u64 = 1_700;
const SENT_NS: u64 = 1_300;
const BELL_NS: u64 = 400;

pub(super) struct Network {
    mac: Mac,
    wires: Chain<UdpWire>,
    receiver: SpinLock<Box<dyn Receive>>,
    sender: SpinLock<NetworkSender>,
    law: Law,
    /// The core interrupted by the card.
    core: AtomicU32,
    /// The time when the masked card may interrupt again; `u64::MAX` if not masked, or outside a
    /// run.
    unmask_ns: AtomicU64,
    is_run: AtomicBool,
    is_linked: AtomicBool,
    interrupts: AtomicU64,
    /// The interrupts that came to another core.
    elsewhere: AtomicU64,
    longest_ns: AtomicU64,
    /// The datagrams to no wire.
    unheard: AtomicU64,
}

/// The sending half, and the interface, whose neighbours both halves need.
struct NetworkSender {
    transmitter: Box<dyn Transmit>,
    interface: Interface<Buffer>,
    dhcp: Option<Client>,
    /// For the machine's own frames: ARP questions, and messages of DHCP.
    own: Buffer,
}

static NETWORK: SetOnce<Network> = SetOnce::new();
static LINE: SetOnce<Line> = SetOnce::new();
static BELL: SetOnce<Bell> = SetOnce::new();

/// The first port for a wire or protocol without a stated port (RFC 6335, 6).
const FIRST_OWN_PORT: u16 = 49_152;

/// Returns the network. The first call opens it, with `distance_us` between interrupts by default.
pub(super) fn open(
    who: &str,
    options: &CommandLine<'static>,
    distance_us: u64,
) -> Result<&'static Network, AppError> {
    if let Some(network) = NETWORK.get() {
        return Ok(network);
    }
    let address = address(options)?;
    let law = Law::charged(options, distance_us)?;
    let space = ecam::configuration().map_err(|why| failure(who, &format!("finds that {why}")))?;
    let mut opened = None;
    pci::find(space, &mut |function| {
        if opened.is_none() {
            opened = cards::open(&function).map(|card| (function, card));
        }
    });
    let Some((function, card)) = opened else {
        let line = "finds no network card that is known, virtio-net or an 82574; give one, in QEMU \
                    by `--net user`";
        return Err(failure(who, line));
    };
    let card = card.map_err(|why| AppError::Failure(format!("{why}")))?;
    let message = card.message;
    // Before any line is tied: its handler finds the network here.
    NETWORK.set(Network::new(card, address, law));
    let network = NETWORK.get();
    let network = network.ok_or_else(|| failure(who, "finds the network being opened"))?;
    let line_error = |why| AppError::Failure(format!("network card at {} {why}", function.place));
    BELL.set(Bell::new(&SendLine).map_err(line_error)?);
    LINE.set(tie(&function, message, &CardLine, 0).map_err(line_error)?);
    CONNECTED.add(Box::new(network));
    Ok(network)
}

/// Takes the option for the address: `net=ADDRESS/PREFIX`, with or without `,GATEWAY`, or `dhcp`.
fn address(options: &CommandLine<'static>) -> Result<Option<Address>, UsageError> {
    let Some(value) = options.text("net").filter(|value| *value != "dhcp") else {
        return Ok(None);
    };
    let read = || {
        let (place, gateway) = match value.split_once(',') {
            Some((place, gateway)) => (place, Some(gateway.parse().ok()?)),
            None => (value, None),
        };
        let (ip, prefix) = place.split_once('/')?;
        let address = Address {
            ip: ip.parse().ok()?,
            prefix: prefix.parse().ok().filter(|prefix| *prefix <= 32)?,
            gateway,
        };
        Some(address).filter(Address::is_of_a_host)
    };
    read().map(Some).ok_or_else(|| {
        let allowed = "allowed are dhcp, ADDRESS/PREFIX and ADDRESS/PREFIX,GATEWAY, such as";
        UsageError::new(format!("`net={value}`: {allowed} 10.0.2.15/24,10.0.2.2"))
    })
}

/// Makes this core send the waiting output, after the completion it is making.
pub(super) fn ring() {
    if let Some(bell) = BELL.get() {
        bell.ring(this_core::get());
    }
}

/// The card's message: frames have come.
struct CardLine;

/// A core's message to itself: there is output to send.
struct SendLine;

impl DeviceLine for CardLine {
    fn interrupt(&self, now_ns: u64) {
        if let Some(network) = NETWORK.get() {
            network.receive(now_ns);
        }
    }
}

impl DeviceLine for SendLine {
    fn interrupt(&self, now_ns: u64) {
        if let Some(network) = NETWORK.get() {
            // A run begins by this bell, which unmasks the card: frames may be there already.
            network.unmask(this_core::get(), now_ns);
            network.send(network.law.most, now_ns);
        }
    }
}

impl Network {
    fn new(card: Card, address: Option<Address>, law: Law) -> Self {
        let room = || Buffer::new(Buffer::LEAST_BYTES);
        let first = address.unwrap_or(Address::NONE);
        // The time of this boot makes the number unlikely to be another client's.
        let transaction = u32::from_le_bytes(card.mac.0[2..].try_into().unwrap_or_default());
        let transaction = transaction.wrapping_add(clock::now_ns().to_le_bytes()[2].into());
        Self {
            mac: card.mac,
            wires: Chain::new(),
            receiver: SpinLock::new(card.receiver),
            sender: SpinLock::new(NetworkSender {
                transmitter: card.transmitter,
                interface: Interface::new(card.mac, first, room),
                dhcp: address
                    .is_none()
                    .then(|| Client::new(card.mac, transaction)),
                own: room(),
            }),
            law,
            core: AtomicU32::new(0),
            unmask_ns: AtomicU64::new(u64::MAX),
            is_run: AtomicBool::new(false),
            is_linked: AtomicBool::new(false),
            interrupts: AtomicU64::new(0),
            elsewhere: AtomicU64::new(0),
            longest_ns: AtomicU64::new(0),
            unheard: AtomicU64::new(0),
        }
    }

    /// Returns the stated port, or a free one.
    pub(super) fn port(&self, who: &str, stated: Option<u16>) -> Result<u16, AppError> {
        let taken = || {
            let wires = self.wires.iter().map(|wire| wire.port);
            wires.chain(PROTOCOLS.iter().map(|place| place.port()))
        };
        let count = u16::try_from(taken().count()).unwrap_or(u16::MAX);
        let port = stated.unwrap_or(FIRST_OWN_PORT.saturating_add(count));
        if taken().any(|other| other == port) {
            let line = format!("has port {port} of another one; give each one its own");
            return Err(failure(who, &line));
        }
        if port == Client::PORT {
            let line =
                "has the port at which the network asks for its address; give another than 68";
            return Err(failure(who, line));
        }
        Ok(port)
    }

    /// Adds a wire, and charges for it: each of an interrupt's packets may release another DAG.
    pub(super) fn add(&self, wire: UdpWire) -> Result<(), UsageError> {
        let others = self.wires.iter().count() as u64;
        self.wires.add(wire);
        let releases_more = others > 0 && others < self.law.most;
        self.law
            .charge_more(if releases_more { WIRE_NS } else { 0 }, 0)
    }

    /// Takes the frames of an interrupt, and masks the card until the next one.
    fn receive(&self, now_ns: u64) {
        // The interrupt was on its way when the card was masked.
        if self.unmask_ns.load(Ordering::Relaxed) != u64::MAX {
            return;
        }
        let until_ns = now_ns.saturating_add(self.law.distance_ns);
        self.unmask_ns.store(until_ns, Ordering::Relaxed);
        // The heartbeat looks at the clock before it unmasks, so its alarm may come early.
        timer::set_no_later(this_core::get(), Alarm::Heartbeat, until_ns);
        let mut receiver = self.receiver.lock();
        receiver.set_interrupt(false);
        // The end of the run waits for the lock, and nothing may be heard after the end.
        if !self.is_run.load(Ordering::Relaxed) {
            return;
        }
        for _ in 0..self.law.most {
            if !receiver.receive(&mut |frame| self.hear(frame, now_ns)) {
                break;
            }
        }
        drop(receiver);
        self.wires.iter().for_each(UdpWire::tell_come);
        if !PROTOCOLS.is_empty() {
            Self::tell_elsewhere();
        }
        let took_ns = clock::now_ns().saturating_sub(now_ns);
        self.longest_ns.fetch_max(took_ns, Ordering::Relaxed);
        self.interrupts.fetch_add(1, Ordering::Relaxed);
        let is_elsewhere = this_core::get().index != self.core.load(Ordering::Relaxed);
        self.elsewhere
            .fetch_add(is_elsewhere.into(), Ordering::Relaxed);
    }

    /// Lets the card interrupt this core again, once the distance has passed.
    fn unmask(&self, core: &Core, now_ns: u64) {
        let is_ours = core.index == self.core.load(Ordering::Relaxed);
        let until_ns = self.unmask_ns.load(Ordering::Relaxed);
        if !is_ours || until_ns == u64::MAX {
            return;
        }
        if now_ns < until_ns {
            return timer::set_no_later(core, Alarm::Heartbeat, until_ns);
        }
        // Before the card may interrupt: `receive` takes any other value for a masked card.
        self.unmask_ns.store(u64::MAX, Ordering::Relaxed);
        let has_frames = self.receiver.lock().set_interrupt(true);
        // No message comes about the frames received while the card was masked.
        if has_frames {
            self.receive(now_ns);
        }
    }

    /// Hears a frame.
    fn hear(&self, frame: &mut Buffer, now_ns: u64) {
        let mut sender = self.sender.lock();
        let start = frame.range().start;
        match sender.interface.hear(frame.content_mut()) {
            Heard::Nothing => {}
            Heard::Answer { length, resolved } => {
                frame.set_range(start..start + length);
                // Without room the answer is lost, as it may be anywhere on its way.
                let _ = sender.transmitter.send(frame);
                sender.send_kept(resolved);
            }
            Heard::Resolved(kept) => sender.send_kept(Some(kept)),
            Heard::Datagram(datagram) => {
                let payload = datagram.payload;
                frame.set_range(start + payload.start..start + payload.end);
                if datagram.port == Client::PORT {
                    return sender.hear_server(frame, now_ns);
                }
                // Dropped before any protocol's lock is taken: that lock comes outside this one.
                drop(sender);
                let mut wires = self.wires.iter();
                let heard = wires.find(|wire| wire.hears(datagram.port, datagram.from));
                if let Some(wire) = heard {
                    return wire.take(frame, datagram.from, now_ns);
                }
                self.hear_elsewhere(frame.content(), datagram.port, datagram.from, now_ns);
            }
        }
    }

    /// Sends waiting output, at most `most` packets. Reports whether anything was sent.
    fn send(&self, most: u64, now_ns: u64) -> bool {
        let mut left = most;
        for wire in self.wires.iter() {
            let send = || {
                let mut sender = self.sender.lock();
                wire.send(|packet, port, to| sender.send(packet, port, to))
            };
            while left > 0 && wire.end.has_bytes_to_go() && send() {
                left -= 1;
            }
        }
        if !PROTOCOLS.is_empty() {
            left = self.send_elsewhere(left, now_ns);
        }
        let has_gone = left < most;
        if has_gone {
            // Once for all packets: each call may be a write to the card's registers.
            self.sender.lock().transmitter.ring();
            self.wires.iter().for_each(UdpWire::tell_gone);
        }
        has_gone
    }

    // The functions below are kept out of the wires' code, so that its longest path stays short.

    /// Passes a datagram that belongs to no wire to the protocols.
    #[inline(never)]
    fn hear_elsewhere(&self, datagram: &[u8], port: u16, from: Peer, now_ns: u64) {
        let mut places = PROTOCOLS.iter();
        if !places.any(|place| place.hear(datagram, port, from, now_ns)) {
            self.unheard.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Sends the output of protocols, at most `left` datagrams. Returns how many more may be sent.
    #[inline(never)]
    fn send_elsewhere(&self, mut left: u64, now_ns: u64) -> u64 {
        let mut send = |packet: &mut Buffer, port, to| self.sender.lock().send(packet, port, to);
        for place in PROTOCOLS.iter() {
            while left > 0 && place.send(now_ns, &mut send) {
                left -= 1;
            }
        }
        left
    }

    #[inline(never)]
    fn tell_elsewhere() {
        PROTOCOLS.iter().for_each(|place| place.tell_come());
    }
}

impl Endpoint for &'static Network {
    fn begin_run(&self, _now_ns: u64) {
        // By the first wire, or else by the first protocol that releases a DAG.
        let released = match self.wires.iter().next() {
            Some(wire) => wire.end.released(),
            None => PROTOCOLS.iter().find_map(|place| place.released()),
        };
        let core = released.map_or(0, |(_, dag)| execution::first_core_of(dag));
        let routed = LINE.get().map(|line| line.route(core));
        // If messages do not reach that core, core 0 takes the card.
        let core = if matches!(routed, Some(Ok(()))) {
            core
        } else {
            0
        };
        self.core.store(core, Ordering::Relaxed);
        let is_up = self.is_linked.load(Ordering::Relaxed);
        PROTOCOLS.iter().for_each(|place| place.set_link(is_up));
        // Before the card may interrupt: outside a run, `receive` takes no frame.
        self.is_run.store(true, Ordering::Relaxed);
        // Due at once, by the bell: frames may be there already, without any message for them.
        self.unmask_ns.store(0, Ordering::Relaxed);
        if let (Some(bell), Some(core)) = (BELL.get(), this_core::all().get(core as usize)) {
            bell.ring(core);
        }
    }

    fn beat(&self, core: &Core, now_ns: u64) {
        self.unmask(core, now_ns);
        if core.index > 0 || !self.is_run.load(Ordering::Relaxed) {
            return;
        }
        let is_linked = self.receiver.lock().is_linked();
        let mut sender = self.sender.lock();
        let has_asked = sender.ask_server(now_ns);
        let has_address = !sender.interface.address().ip.is_unspecified();
        drop(sender);
        // An address counts like a link: without either, nothing that is sent can arrive.
        let is_up = is_linked && has_address;
        if self.is_linked.swap(is_up, Ordering::Relaxed) != is_up {
            // Behind a new link, or with a new address, other neighbours may answer.
            self.sender.lock().interface.forget_neighbours();
            self.wires.iter().for_each(|wire| wire.end.set_link(is_up));
            PROTOCOLS.iter().for_each(|place| place.set_link(is_up));
        }
        // Sends a packet that had no room or no address so far, exceeded a bell's limit, or is due
        // to a protocol's peer. Not after a message of DHCP: a heartbeat is charged for one packet.
        if !has_asked {
            self.send(1, now_ns);
        }
    }

    fn step(&self) -> bool {
        PROTOCOLS.iter().for_each(|place| place.tell_news());
        // Sends a packet beyond the limit of a completion.
        self.send(1, clock::now_ns())
    }

    /// Sends the rest, and hears nothing any more.
    fn end_run(&self) {
        self.is_run.store(false, Ordering::Relaxed);
        self.unmask_ns.store(u64::MAX, Ordering::Relaxed);
        self.receiver.lock().set_interrupt(false);
        let send_rest = || while self.send(self.law.most, clock::now_ns()) {};
        send_rest();
        // In between: closing leaves a goodbye to be sent, behind everything else.
        PROTOCOLS.iter().for_each(|place| place.close());
        send_rest();
    }

    fn tell(&self) {
        let wires = self.wires.iter().map(|wire| wire.end.wire());
        wires.for_each(report::tell_wire);
        PROTOCOLS.iter().for_each(|place| place.tell());
        let dropped = self.receiver.lock().dropped();
        let sender = self.sender.lock();
        let (address, counts) = (sender.interface.address(), sender.interface.counts());
        drop(sender);
        let longest_ns = self.longest_ns.swap(0, Ordering::Relaxed);
        let interrupts = self.interrupts.swap(0, Ordering::Relaxed);
        let unheard = self.unheard.load(Ordering::Relaxed);
        crate::println!(
            "network: {} frames came, {} malformed, {} for others, {unheard} to no wire; the longest \
             of {interrupts} interrupts took {longest_ns} ns",
            counts.frames,
            counts.malformed + dropped,
            counts.foreign
        );
        json::emit("network", |line| {
            line.text("mac", format!("{}", self.mac))
                .text("address", format!("{}/{}", address.ip, address.prefix))
                .number("frames", counts.frames)
                .number("malformed", counts.malformed + dropped)
                .number("foreign", counts.foreign)
                .number("arps", counts.arps)
                .number("echoes", counts.echoes)
                .number("datagrams", counts.datagrams)
                .number("unheard", unheard)
                .number("interrupts", interrupts)
                .number("core", self.core.load(Ordering::Relaxed))
                .number("elsewhere", self.elsewhere.load(Ordering::Relaxed))
                .number("most_packets", self.law.most)
                .number("distance_ns", self.law.distance_ns)
                .number("longest_ns", longest_ns);
        });
    }
}

impl NetworkSender {
    /// Sends a packet that has room for its headers in front.
    fn send(&mut self, packet: &mut Buffer, port: u16, to: Peer) -> Sent {
        let interface = &mut self.interface;
        match interface.address_datagram(packet.content_mut(), port, to) {
            Route::Ready if self.transmitter.send(packet) => Sent::Gone,
            // There is no route, and the packet would hold up those behind it.
            Route::None if !interface.address().ip.is_unspecified() => Sent::Gone,
            Route::Ready | Route::None => Sent::Waits,
            Route::Unresolved(neighbour) => {
                interface.keep(neighbour, packet);
                let start = Buffer::HEADROOM;
                let length = interface.question(&mut self.own.whole()[start..], neighbour);
                self.own.set_range(start..start + length);
                let _ = self.transmitter.send(&mut self.own);
                Sent::Gone
            }
        }
    }

    /// Sends a frame whose neighbour has answered, and any frames handed to the card before.
    fn send_kept(&mut self, kept: Option<Kept>) {
        if let Some(kept) = kept {
            let _ = self.transmitter.send(self.interface.kept(kept));
        }
        self.transmitter.ring();
    }

    /// Sends the message due to the DHCP server, and reports whether one was due.
    fn ask_server(&mut self, now_ns: u64) -> bool {
        let client = self.dhcp.as_mut();
        let Some(client) = client.filter(|client| client.due_ns() <= now_ns) else {
            return false;
        };
        let start = Buffer::HEADROOM;
        let sent = client.send(now_ns, &mut self.own.whole()[start..]);
        let lease = client.lease();
        self.interface
            .set_address(lease.map_or(Address::NONE, |lease| lease.address));
        if let Some(length) = sent {
            let mut own = core::mem::take(&mut self.own);
            own.set_range(start - net::HEADERS..start + length);
            let _ = self.send(&mut own, Client::PORT, Client::SERVERS);
            self.own = own;
            self.transmitter.ring();
        }
        true
    }

    /// Takes a message of a DHCP server.
    fn hear_server(&mut self, message: &Buffer, now_ns: u64) {
        if let Some(client) = &mut self.dhcp
            && client.take(message.content(), now_ns)
        {
            let address = client.lease().map_or(Address::NONE, |lease| lease.address);
            self.interface.set_address(address);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Free;

    impl Transmit for Free {
        fn send(&mut self, _frame: &mut Buffer) -> bool {
            true
        }

        fn ring(&mut self) {}
    }

    #[test]
    fn an_address_that_can_be_no_hosts_is_refused() {
        let address = |line| address(&CommandLine::parse(line).unwrap());
        assert_eq!(address("net=dhcp"), Ok(None));
        assert!(address("net=10.0.2.15/24,10.0.2.2").is_ok_and(|address| address.is_some()));
        for value in [
            "0.0.0.0/0",
            "10.0.2.255/24",
            "255.255.255.255/32",
            "10.0.2.15/24,0.0.0.0",
        ] {
            let line = std::format!("net={value}");
            assert!(address(Box::leak(line.into())).is_err(), "{value}");
        }
    }

    #[test]
    fn a_packet_without_a_way_waits_for_an_address_only() {
        let room = || Buffer::new(Buffer::LEAST_BYTES);
        let mut sender = NetworkSender {
            transmitter: Box::new(Free),
            interface: Interface::new(Mac([2; 6]), Address::NONE, room),
            dhcp: None,
            own: room(),
        };
        let ip = [10, 0, 2, 15].into();
        let own = Address {
            ip,
            prefix: 24,
            gateway: None,
        };
        let has_gone = |sender: &mut NetworkSender, ip: [u8; 4]| {
            let mut packet = Buffer::from(&[0; net::HEADERS + 1][..]);
            let peer = Peer::new(ip.into(), 7);
            matches!(sender.send(&mut packet, 5000, peer), Sent::Gone)
        };
        assert!(!has_gone(&mut sender, [1, 2, 3, 4]));
        sender.interface.set_address(own);
        assert!(
            has_gone(&mut sender, [10, 0, 2, 2]),
            "its neighbour is asked"
        );
        // Whoever names such a peer would else silence the wire for good.
        assert!(has_gone(&mut sender, [1, 2, 3, 4]), "nobody leads there");
    }
}
