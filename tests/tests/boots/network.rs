//! Network cards and their traffic, with a live peer: judged by the arriving packets, and by
//! counts.

#[path = "../../../kernel/net/tests/it/mutation.rs"]
mod mutation;

use std::io::Write;
use std::net::{Ipv4Addr, UdpSocket};
use std::os::unix::net::UnixStream;
use std::thread;
use std::time::{Duration, Instant};

use harness::file::File;
use harness::{Guest, Members, Said};
use mutation::{datagram, mutated, ping, vectors, wanted};
use random::Random;
use tool::Outcome;
use tool::qemu::Machine;
use views::protocol::Status;

const VIRTIO: &str = "virtio-net-pci,romfile=";
const E1000E: &str = "e1000e,romfile=";

/// The most bytes of a datagram.
const MOST: usize = 1472;

/// The longest charged interrupt, without the parts unseen by its driver.
const LONGEST_NS: u64 = 8_300;

/// The most time a peer asks for an answer.
const LIMIT: Duration = Duration::from_secs(120);

/// The time a peer waits for an answer before asking again.
const PATIENCE: Duration = Duration::from_millis(200);

/// Returns a socket of this host, and a free port, to which the socket is connected.
fn socket() -> (UdpSocket, u16) {
    let new = || UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
    let (socket, other) = (new(), new());
    let port = other.local_addr().expect("an address").port();
    socket.set_read_timeout(Some(PATIENCE)).expect("a time");
    socket.connect((Ipv4Addr::LOCALHOST, port)).expect("a peer");
    (socket, port)
}

/// Sends packets, again and again until an answer comes for which `is_answer` holds.
#[track_caller]
fn ask(socket: &UdpSocket, packets: &[&[u8]], is_answer: impl Fn(&[u8]) -> bool) {
    let (start, mut bytes) = (Instant::now(), [0; 2048]);
    while start.elapsed() < LIMIT {
        // Nobody may be there yet.
        packets.iter().for_each(|packet| drop(socket.send(packet)));
        let sent = Instant::now();
        while sent.elapsed() < PATIENCE {
            match socket.recv(&mut bytes) {
                Ok(length) if is_answer(&bytes[..length]) => return,
                Ok(_) => {}
                Err(_) => thread::sleep(Duration::from_millis(10)),
            }
        }
    }
    panic!("no answer to {packets:02x?}");
}

/// Sends packets of all lengths, and waits for each to come back.
fn exchange(socket: &UdpSocket) {
    ask(socket, &[b"hello"], |answer| answer == b"hello");
    for number in 0..200_usize {
        let length = 1 + number * (MOST - 1) / 199;
        let packet = (0..length).map(|at| (at * 7 + number).to_le_bytes()[0]);
        let packet: Vec<u8> = packet.collect();
        ask(socket, &[&packet], |answer| answer == packet);
    }
}

fn echoes(card: &'static str, cores: u64, words: &str) {
    let (socket, port) = socket();
    let network = format!("user,hostfwd=udp:127.0.0.1:{port}-:5000");
    let guest = Guest::new("echo").in_real_time().cores(cores);
    let guest = guest.network(card, &network).word("wire.echo=udp://:5000");
    let (outcome, ()) = guest.word(words).succeed_beside(|_| exchange(&socket));
    let line = outcome.only("network");
    line.reads([("address", "10.0.2.15/24"), ("mac", "52:54:00:12:34:56")]);
    line.has([("malformed", 0), ("unheard", 0), ("elsewhere", 0)]);
    let wire = outcome.only("wire");
    wire.has([("lost_packets", 0), ("malformed", 0), ("unsent_bytes", 0)]);
    assert!(wire.number("packets") > 200 && line.number("datagrams") > 200);
    assert_eq!(wire.number("bytes"), wire.number("sent_bytes"));
}

#[test]
fn datagrams_of_all_lengths_come_back_whole_by_virtio() {
    echoes(VIRTIO, 1, "");
    echoes(VIRTIO, 2, "net=10.0.2.15/24,10.0.2.2");
}

#[test]
fn datagrams_of_all_lengths_come_back_whole_by_the_82574() {
    echoes(E1000E, 1, "net=10.0.2.15/24,10.0.2.2");
    echoes(E1000E, 2, "net=dhcp");
}

#[test]
fn a_machine_without_a_card_and_wrong_words_are_refused_with_a_remedy() {
    let echo = Guest::new("echo").word("wire.echo=udp://:5000");
    let q35 = echo.clone().machine(Machine::Q35);
    for (guest, reason) in [
        (
            echo.clone(),
            "wire `echo` finds that the machine has no PCI configuration space in memory; boot a PC \
             with PCI Express, in QEMU by `--machine q35`, with a network by `--net user`",
        ),
        (
            q35,
            "wire `echo` finds no network card that is known, virtio-net or an 82574; give one, in \
             QEMU by `--net user`",
        ),
    ] {
        assert_eq!(guest.end_in(Status::Failure).reason(), reason);
    }
    assert_eq!(
        echo.word("net=10.0.2.15").refusal(),
        "`net=10.0.2.15`: allowed are dhcp, ADDRESS/PREFIX and ADDRESS/PREFIX,GATEWAY, such as \
         10.0.2.15/24,10.0.2.2"
    );
}

/// Boots the echo on port 7 next to a control loop, on a cable ending at the socket.
fn cabled(card: &'static str, to: &UdpSocket, port: u16) -> Guest {
    let own = to.local_addr().expect("an address").port();
    let words = format!(
        "dgram,local.type=inet,local.host=127.0.0.1,local.port={port},\
         remote.type=inet,remote.host=127.0.0.1,remote.port={own}"
    );
    let guest = Guest::test("network").network(card, &words);
    guest.word("wire.echo=udp://:7 net=10.0.2.15/24,10.0.2.2")
}

/// Returns the number of the control loop's jobs, after checking that nothing has disturbed them.
fn undisturbed(outcome: &Outcome) -> u64 {
    outcome.only("control").has([("allocations", 0)]);
    let loops = outcome.line("dag_status");
    loops.reads([("name", "control")]);
    loops.has([("misses", 0), ("faults", 0)]);
    loops.number("completed")
}

/// Asks for an echo by a frame, with a payload of its own, until the echo comes.
fn probe(socket: &UdpSocket, number: u64) {
    let payload = [&[0xa5; 24], &number.to_le_bytes()[..]].concat();
    // By the question for it the guest learns where the answer goes.
    let packets = [&vectors()[0][..], &datagram(7, &payload)];
    ask(socket, &packets, |answer| answer.ends_with(&payload));
}

/// Sends `count` frames with wrong bytes, and a flood of as many right frames. The longest right
/// frames take the longest interrupts, while they are summed and answered. After each 64 frames an
/// echo must be answered.
fn storm(socket: &UdpSocket, count: u64) {
    let (mut random, frames) = (Random::new(wanted("SEED", 1)), vectors());
    let mut summed = datagram(7, &[1; MOST]);
    summed[40] = 1;
    let flood = [
        datagram(7, &[1; 8]),
        datagram(7, &[1; MOST]),
        ping(&[1; MOST]),
        summed,
    ];
    for number in 0..2 * count {
        let frame = if number < count {
            let drawn = random.index(frames.len());
            mutated(&mut random, &frames[drawn])
        } else {
            // As many of a kind as an interrupt takes, and more.
            flood[(number / 8) as usize % flood.len()].clone()
        };
        // To QEMU an empty one is the end of the cable.
        if !frame.is_empty() {
            let _ = socket.send(&frame);
        }
        if number % 64 == 0 {
            probe(socket, number);
        }
    }
    probe(socket, u64::MAX);
}

#[test]
fn no_storm_of_frames_has_a_control_loop_miss_a_deadline() {
    let count = wanted("FRAMES", 10_000);
    let (socket, port) = socket();
    let guest = cabled(VIRTIO, &socket, port);
    let (outcome, ()) = guest.succeed_beside(|_| storm(&socket, count));
    let network = outcome.only("network");
    let loops = undisturbed(&outcome);
    println!(
        "{loops} loops; {}\n{}",
        network.text,
        outcome.only("wire").text
    );
    // The law: so many frames an interrupt, one of which comes in each distance and is charged.
    let number = |name| network.number(name);
    assert!(loops > 1000 && number("frames") <= number("most_packets") * number("interrupts"));
    assert!(number("interrupts") * number("distance_ns") <= 1_000_000 * (loops + 1));
    assert!(number("longest_ns") <= LONGEST_NS);
    assert!(number("frames") > count / 10 * 19);
    assert!(number("malformed") > count / 10);
}

#[test]
fn a_card_interrupts_the_cluster_whose_dag_it_releases() {
    let (socket, port) = socket();
    let guest = cabled(VIRTIO, &socket, port).cores(2).word("clusters=1,1");
    let (outcome, ()) = guest.succeed_beside(|_| probe(&socket, 1));
    let line = outcome.only("network");
    line.has([("core", 1), ("elsewhere", 0)]);
    assert!(line.number("interrupts") > 0);
}

#[test]
fn a_pulled_cable_is_seen_and_what_comes_later_is_answered() {
    for card in [VIRTIO, E1000E] {
        let (socket, port) = socket();
        let monitor = File::new("monitor", "socket");
        let words = format!("-monitor unix:{},server=on,wait=off", monitor.0.display());
        let guest = cabled(card, &socket, port).altered(&[], &words);
        let (outcome, ()) = guest.succeed_beside(|lines| {
            let seen = |state| {
                let said = |line: String| line == format!("the link is {state}");
                while !said(lines.recv_timeout(LIMIT).expect("a line")) {}
            };
            seen("up");
            probe(&socket, 1);
            let mut monitor = UnixStream::connect(&monitor.0).expect("a monitor");
            for (word, state) in [("off", "down"), ("on", "up")] {
                writeln!(monitor, "set_link net {word}").expect("a monitor");
                seen(state);
            }
            probe(&socket, 2);
        });
        undisturbed(&outcome);
    }
}
