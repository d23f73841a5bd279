//! Datagrams: packets of a wire go to a peer, and those of peers to its port arrive.
//!
//! Each wire has a socket, bound to all addresses of this computer, and a thread waiting for
//! datagrams. Another thread sends for all wires. A completion wakes the sender, by an exchange and,
//! while the sender sleeps, a call of the kernel. Neither thread has a level, as with bytes.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::{self, JoinHandle, Thread};
use std::time::Duration;

use fass::platform::{Buffer, Platform as _};
use fass::shared::{DeviceEnd, Wire};

use crate::edge::unpoisoned;
use crate::machine::{Linux, end_of};
use crate::platform::HOST;

/// The most bytes of a packet to send: a frame of Ethernet has room for them.
const MOST_BYTES: usize = 1472;

/// The most bytes of a datagram.
const MOST_RECEIVED: usize = 65_536;

/// A wire's connection to UDP. Dropping this sends the rest, and ends the connection.
///
/// See [`Linux::connect_udp`].
#[derive(Debug)]
pub struct UdpConnection {
    wire: Arc<UdpWire>,
    receiver: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct UdpWire {
    end: DeviceEnd,
    socket: UdpSocket,
    peer: Option<SocketAddrV4>,
    /// The latest peer.
    last: Mutex<Option<SocketAddrV4>>,
    has_ended: AtomicBool,
}

/// The connected wires, locked while sending.
static WIRES: Mutex<Vec<Arc<UdpWire>>> = Mutex::new(Vec::new());

/// The sending thread, once there is a wire.
static SENDER: OnceLock<Thread> = OnceLock::new();

impl Linux {
    /// Connects a wire to UDP, from a port of this computer; 0 is any free port. A wire with a peer
    /// hears nobody else. Without a peer the wire hears everyone, and answers whom an instance
    /// [says](fass::shared::Sender::to), or else the latest peer. To be called after the commit and
    /// once a wire.
    ///
    /// A packet goes with 1,472 bytes at most. The wire's link is up during the connection.
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
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port)).map_err(|why| {
            let remedy = "choose another one, or end the program that has it";
            let line = format!("UDP port {port} cannot be had ({why}); {remedy}");
            io::Error::new(why.kind(), line)
        })?;
        // The end of a run wakes the receiver by a datagram, which a firewall may stop.
        socket.set_read_timeout(Some(Duration::from_secs(1)))?;
        end.begin_packets(MOST_BYTES, || _ = SENDER.get().map(Thread::unpark));
        let (last, has_ended) = (Mutex::new(None), AtomicBool::new(false));
        let wire = Arc::new(UdpWire {
            end,
            socket,
            peer,
            last,
            has_ended,
        });
        let mut wires = unpoisoned(&WIRES);
        if SENDER.get().is_none() {
            let sender = thread::Builder::new().name("fass-udp".into()).spawn(send)?;
            let _ = SENDER.set(sender.thread().clone());
        }
        let own = Arc::clone(&wire);
        let receiver = thread::Builder::new().spawn(move || own.receive())?;
        wires.push(Arc::clone(&wire));
        drop(wires);
        wire.end.set_link(true);
        let receiver = Some(receiver);
        Ok(UdpConnection { wire, receiver })
    }
}

/// Sends packets of all wires, again and again.
fn send() {
    loop {
        unpoisoned(&WIRES).iter().for_each(|wire| wire.send());
        thread::park();
    }
}

impl UdpWire {
    /// Sends all packets.
    fn send(&self) {
        let send = |packet: &mut Buffer, to: Option<SocketAddrV4>| {
            let last = || *unpoisoned(&self.last);
            // Without a peer the packet is for nobody. If the kernel refuses a packet, that is lost, as
            // on any way.
            if let Some(to) = to.or(self.peer).or_else(last) {
                let _ = self.socket.send_to(packet.content(), to);
            }
            true
        };
        while self.end.swap_out(send) {
            self.end.tell_gone();
        }
    }

    /// Lets datagrams arrive, until the end.
    fn receive(&self) {
        // Behind the headroom each buffer has room for the wire's longest packet. With a byte more, a
        // longer datagram, though cut, is too long all the same, and counted.
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
                *unpoisoned(&self.last) = Some(from);
                buffer.set_range(START..START + count);
                if self.end.swap_in(&mut buffer, from, fass::now_ns())
                    && let Some((plan, dag)) = self.end.announce()
                {
                    HOST.raise(plan, dag);
                }
            }
        }
    }
}

impl UdpConnection {
    /// Returns the wire's port of this computer.
    #[must_use]
    pub fn port(&self) -> u16 {
        let address = self.wire.socket.local_addr();
        address.map_or(0, |address| address.port())
    }
}

impl Drop for UdpConnection {
    fn drop(&mut self) {
        let wire = &self.wire;
        let mut wires = unpoisoned(&WIRES);
        wires.retain(|other| !Arc::ptr_eq(other, wire));
        wire.send();
        drop(wires);
        wire.end.set_link(false);
        wire.has_ended.store(true, Ordering::Release);
        let _ = wire.socket.send_to(&[], (Ipv4Addr::LOCALHOST, self.port()));
        // Then the port is free. The thread does not panic.
        let _ = self.receiver.take().map(JoinHandle::join);
    }
}
