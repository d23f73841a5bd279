//! Datagrams: packets of a wire go to a peer, and packets of peers arrive at the wire's port.
//!
//! Each connection has a socket, bound to all addresses of this computer, and a thread waiting for
//! datagrams. Another thread sends for all connections. A completion sending a packet wakes the
//! sender, by an exchange and, while the sender sleeps, by a system call. Neither thread has a
//! real-time level, as with bytes. A [protocol](Protocol) takes the place of a wire, in front of
//! its own wires.

use std::fmt;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::{self, JoinHandle, Thread};
use std::time::Duration;

use fass::platform::{Buffer, Platform as _, Protocol};
use fass::shared::{DeviceEnd, Wire};

use crate::edge::unpoisoned;
use crate::machine::{Linux, end_of};
use crate::platform::HOST;

/// The most bytes of a packet to send: a frame of Ethernet has room for them.
const MOST_BYTES: usize = 1472;

/// The most bytes of a datagram.
const MOST_RECEIVED: usize = 65_536;

/// The port of a protocol (RFC 6335, 6), unless somebody has it.
const FIRST_OWN_PORT: u16 = 49_152;

/// How long the sender sleeps while a protocol may have something to say.
const PROTOCOL_PERIOD: Duration = Duration::from_millis(5);

/// A wire's or a protocol's connection to UDP. Dropping this closes it.
///
/// See [`Linux::connect_udp`].
#[derive(Debug)]
pub struct UdpConnection {
    place: Arc<UdpPlace>,
    receiver: Option<JoinHandle<()>>,
}

struct UdpPlace {
    /// The wires: those of a protocol, or one.
    ends: Box<[Arc<DeviceEnd>]>,
    protocol: Option<Mutex<Box<dyn Protocol>>>,
    socket: UdpSocket,
    peer: Option<SocketAddrV4>,
    /// The latest peer.
    last: Mutex<Option<SocketAddrV4>>,
    has_ended: AtomicBool,
}

/// The connected places, locked while sending.
static PLACES: Mutex<Vec<Arc<UdpPlace>>> = Mutex::new(Vec::new());

/// The sending thread, once there is one.
static SENDER: OnceLock<Thread> = OnceLock::new();

impl Linux {
    /// Connects a wire to UDP, from a port of this computer; 0 is any free port. A wire with a peer
    /// hears nobody else. Without a peer the wire hears everyone, and answers the address [given by
    /// an instance](fass::shared::Sender::to), or else the latest peer. To be called after the
    /// commit and once a wire.
    ///
    /// A sent packet carries 1,472 bytes at most; the wire limits the received ones. The wire's
    /// link is up during the connection.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::shared::{Received, Wire};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::new(1, Mechanism::Normal).expect("one processor is there");
    /// let (wire, dag, period) = (Wire::new("keys"), create_dag(), Duration::from_millis(2));
    /// dag.jobs(3).relative_deadline(period);
    /// let hear = |lines: Received<'_, u8>| println!("{} lines", lines.count());
    /// dag.period(period)
    ///     .using(wire.receiving(|line| line.first().copied()))
    ///     .source(hear)
    ///     .register(SubtaskAttributes::named("hear"));
    /// finish_create_dags(&[dag]).unwrap();
    /// let connection = machine.connect_udp(&wire, 0, None).unwrap();
    /// println!("say something to port {}", connection.port());
    /// machine.run().unwrap();
    /// ```
    ///
    /// # Errors
    ///
    /// The port is taken, the wire is connected already, or the system has no more threads.
    pub fn connect_udp(
        &self,
        wire: &Wire,
        port: u16,
        peer: Option<SocketAddrV4>,
    ) -> io::Result<UdpConnection> {
        let end = end_of(wire)?;
        let socket = bind(port)?;
        end.begin_packets(MOST_BYTES, wake_sender);
        connect(Box::new([Arc::new(end)]), None, socket, peer)
    }

    /// Connects a protocol to its peer, from port 49,152 of this computer, or from another port if
    /// that is taken. To be called before the commit of the DAGs using the protocol's wires, and
    /// once a run.
    ///
    /// See [`connect_udp`](Self::connect_udp).
    ///
    /// # Errors
    ///
    /// A wire of the protocol is connected already, or the system has no more threads.
    pub fn connect_protocol(
        &self,
        mut protocol: Box<dyn Protocol>,
        peer: SocketAddrV4,
    ) -> io::Result<UdpConnection> {
        // With the same port, a node that begins again ends the session of the node before at once.
        let socket = bind(FIRST_OWN_PORT).or_else(|_| bind(0))?;
        let ends = protocol.begin(MOST_BYTES, wake_sender);
        let ends = ends.map_err(io::Error::other)?;
        connect(ends, Some(Mutex::new(protocol)), socket, Some(peer))
    }
}

fn bind(port: u16) -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port)).map_err(|why| {
        let remedy = "choose another one, or end the program that has it";
        let line = format!("UDP port {port} cannot be had ({why}); {remedy}");
        io::Error::new(why.kind(), line)
    })?;
    // The end of a run wakes the receiver by a datagram, and a firewall may stop that.
    socket.set_read_timeout(Some(Duration::from_secs(1)))?;
    Ok(socket)
}

fn wake_sender() {
    let _ = SENDER.get().map(Thread::unpark);
}

fn connect(
    ends: Box<[Arc<DeviceEnd>]>,
    protocol: Option<Mutex<Box<dyn Protocol>>>,
    socket: UdpSocket,
    peer: Option<SocketAddrV4>,
) -> io::Result<UdpConnection> {
    let place = Arc::new(UdpPlace {
        ends,
        protocol,
        socket,
        peer,
        last: Mutex::new(None),
        has_ended: AtomicBool::new(false),
    });
    // Held until the place is in: two connections must not both begin the sending thread.
    let mut places = unpoisoned(&PLACES);
    if SENDER.get().is_none() {
        let sender = thread::Builder::new().name("fass-udp".into()).spawn(send)?;
        let _ = SENDER.set(sender.thread().clone());
    }
    let own = Arc::clone(&place);
    let receiver = thread::Builder::new().spawn(move || own.receive())?;
    places.push(Arc::clone(&place));
    drop(places);
    place.set_link(true);
    // A protocol may have something to say at once.
    wake_sender();
    let receiver = Some(receiver);
    Ok(UdpConnection { place, receiver })
}

/// Sends waiting packets, again and again.
fn send() {
    loop {
        let places = unpoisoned(&PLACES);
        places.iter().for_each(|place| place.send());
        let may_be_due = places.iter().any(|place| place.protocol.is_some());
        drop(places);
        match may_be_due {
            true => thread::park_timeout(PROTOCOL_PERIOD),
            false => thread::park(),
        }
    }
}

impl UdpPlace {
    /// Sends all packets.
    fn send(&self) {
        let say = |packet: &mut Buffer, to: Option<SocketAddrV4>| {
            // Without a peer the packet is for nobody. If the kernel refuses a packet, the packet
            // is lost, as on any way.
            let _ = to.map(|to| self.socket.send_to(packet.content(), to));
            true
        };
        let last = || *unpoisoned(&self.last);
        let next = || match &self.protocol {
            None => self.ends[0].swap_out(|packet, to| say(packet, to.or(self.peer).or_else(last))),
            Some(protocol) => {
                let mut protocol = unpoisoned(protocol);
                let has_gone = protocol.send(fass::now_ns(), &mut |packet| say(packet, self.peer));
                protocol.tell_news();
                has_gone
            }
        };
        while next() {
            self.ends.iter().for_each(|end| end.tell_gone());
        }
    }

    fn set_link(&self, is_up: bool) {
        match &self.protocol {
            None => self.ends[0].set_link(is_up),
            Some(protocol) => unpoisoned(protocol).set_link(is_up),
        }
    }

    /// Takes a datagram.
    fn take(&self, packet: &mut Buffer, from: SocketAddrV4) {
        *unpoisoned(&self.last) = Some(from);
        let now_ns = fass::now_ns();
        let come = match &self.protocol {
            None => self.ends[0].swap_in(packet, from, now_ns).into(),
            Some(protocol) => unpoisoned(protocol).hear(packet.content(), now_ns),
        };
        for (place, end) in self.ends.iter().enumerate() {
            if come >> place & 1 > 0
                && let Some((plan, dag)) = end.announce()
            {
                HOST.raise(plan, dag);
            }
        }
        if come == 0 {
            // The packet may be a question of a protocol's peer.
            wake_sender();
        }
    }

    /// Lets datagrams arrive, until the end.
    fn receive(&self) {
        // Behind the headroom each buffer has room for the wire's longest packet, and a byte more.
        // So a longer datagram, though cut, is still too long, and is counted.
        const START: usize = Buffer::HEADROOM - 1;
        let mut buffer = Buffer::new(START + MOST_RECEIVED);
        loop {
            let received = self.socket.recv_from(&mut buffer.whole()[START..]);
            if self.has_ended.load(Ordering::Acquire) {
                return;
            }
            // An error ends a wait, at the limit or by a signal.
            if let Ok((count, SocketAddr::V4(from))) = received
                && self.peer.is_none_or(|peer| peer == from)
            {
                buffer.set_range(START..START + count);
                self.take(&mut buffer, from);
            }
        }
    }
}

impl UdpConnection {
    /// Returns the port of this computer.
    #[must_use]
    pub fn port(&self) -> u16 {
        let address = self.place.socket.local_addr();
        address.map_or(0, |address| address.port())
    }

    /// Sends the rest, says goodbye by a protocol, and ends the connection. A second call does
    /// nothing.
    ///
    /// See [`Linux::connect_udp`].
    pub fn close(&mut self) {
        let Some(receiver) = self.receiver.take() else {
            return;
        };
        let place = &self.place;
        let mut places = unpoisoned(&PLACES);
        // Under the lock that the sending thread holds while it sends: from here on, only this
        // thread sends for the place.
        places.retain(|other| !Arc::ptr_eq(other, place));
        place.send();
        if let Some(protocol) = &place.protocol {
            unpoisoned(protocol).close();
            place.send();
        }
        drop(places);
        place.set_link(false);
        place.has_ended.store(true, Ordering::Release);
        // Wakes the receiver, which then sees the end.
        let _ = (place.socket).send_to(&[], (Ipv4Addr::LOCALHOST, self.port()));
        // After the join the port is free. The thread does not panic.
        let _ = receiver.join();
    }

    /// Shows the protocol and its wires, if the connection has a protocol.
    ///
    /// See [`Linux::connect_protocol`].
    pub fn with_protocol(&self, look: impl FnOnce(&dyn Protocol, &[Arc<DeviceEnd>])) {
        if let Some(protocol) = &self.place.protocol {
            look(&**unpoisoned(protocol), &self.place.ends);
        }
    }
}

impl Drop for UdpConnection {
    fn drop(&mut self) {
        self.close();
    }
}

impl fmt::Debug for UdpPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("UdpPlace").field(&self.socket).finish()
    }
}
