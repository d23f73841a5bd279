//! Wires connected to UDP, with their peers on loopback.

use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::thread;
use std::time::Duration;

use crate::support::{alone, every, mechanisms, ms};
use fass::shared::{Framing, Received, Sender, Wire, WireOptions};
use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};

fn wire(name: &str) -> Wire {
    let options = WireOptions {
        framing: Framing::Chunks,
        longest_bytes: 3_000,
        room: 16,
    };
    Wire::with(name, options)
}

/// A DAG that sends packets back: to their peers, if the DAG `answers`, or as the device has it.
fn echoing(wire: &Wire, answers: bool) -> Dag {
    let dag = create_dag();
    dag.name(wire.name()).relative_deadline(ms(50));
    dag.sporadic(ms(1));
    let echo = move |(mut packets, mut wire): (Received<'_, ()>, Sender<'_>)| {
        let mut answer = |bytes: &[u8], _: u64, from: Option<_>| {
            wire.to(from.filter(|_| answers));
            wire.send(bytes);
            wire.end_packet();
        };
        while packets.look(&mut answer).is_some() {}
    };
    dag.using((wire.receiving(|_| Some(())), wire.sending()))
        .source(echo)
        .register(SubtaskAttributes::named("echo"));
    dag
}

/// A socket of another program.
fn peer() -> UdpSocket {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a port");
    let limit = Some(Duration::from_secs(20));
    socket.set_read_timeout(limit).expect("it may be set");
    socket
}

/// Sends to a port of this computer.
fn say(from: &UdpSocket, port: u16, bytes: &[u8]) {
    let sent = from.send_to(bytes, (Ipv4Addr::LOCALHOST, port));
    assert_eq!(sent.expect("it is sent"), bytes.len());
}

fn hear(socket: &UdpSocket) -> Vec<u8> {
    let mut bytes = [0; 2000];
    let count = socket.recv(&mut bytes).expect("there is an answer");
    bytes[..count].into()
}

#[test]
fn each_wire_hears_its_peers_and_counts_what_is_too_long() {
    for mechanism in mechanisms() {
        let alone = alone(2, mechanism);
        let [open, closed] = ["open", "closed"].map(wire);
        let dags = [
            echoing(&open, true),
            echoing(&closed, false),
            every(ms(10), "clock"),
        ];
        // The run goes on until it is closed.
        dags[2].register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
        finish_create_dags(&dags).expect("they are sound");
        let control = alone.machine.control().expect("it is committed");
        let peers = [peer(), peer(), peer()];
        let only = peers[2].local_addr().expect("it is bound").port();
        let only = SocketAddrV4::new(Ipv4Addr::LOCALHOST, only);
        let connections = [(&open, None), (&closed, Some(only))].map(|(wire, peer)| {
            let connected = alone.machine.connect_udp(wire, 0, peer);
            connected.expect("there is a port")
        });
        assert!(open.link().value());
        let [first, second] = connections.each_ref().map(linux::UdpConnection::port);
        let own = closed.clone();
        let talker = thread::spawn(move || {
            for number in 1..=30_u8 {
                let ways = [(&peers[0], first), (&peers[1], first), (&peers[2], second)];
                for (peer, port) in ways {
                    say(peer, port, &[number; 50]);
                }
                for (peer, _) in ways {
                    assert_eq!(hear(peer), [number; 50]);
                }
            }
            say(&peers[0], second, b"stop");
            // The second is heard, and too long to go back. In its place there is a buffer of the
            // wire now.
            for length in [3_001, 3_000, 9_000] {
                say(&peers[2], second, &vec![7; length]);
            }
            while own.counts().unsent_bytes == 0 {
                thread::sleep(ms(1));
            }
            say(&peers[2], second, b"end");
            assert_eq!(hear(&peers[2]), b"end");
            control.close();
        });
        let run = alone.machine.run().expect("it is committed");
        talker.join().expect("all answers are right");
        assert_eq!(run.violations().count(), 0);
        // Then the port is free.
        drop(connections);
        assert!(!open.link().value());
        // A test beside this one may be given a port that is free again.
        assert!((0..10).any(|_| {
            let connection = alone.machine.connect_udp(&closed, 0, None);
            let port = connection.expect("there is a port").port();
            let again = alone.machine.connect_udp(&closed, port, None);
            again.is_ok_and(|connection| connection.port() == port)
        }));
        let counts = [&open, &closed].map(|wire| {
            let counts = wire.counts();
            let sent = (counts.sent_bytes, counts.unsent_bytes);
            (counts.packets, counts.malformed, sent)
        });
        assert_eq!(counts, [(60, 0, (3_000, 0)), (32, 2, (1_503, 3_000))]);
    }
}
