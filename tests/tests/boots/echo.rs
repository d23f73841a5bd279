//! Packets going back to their peers: by a script on the machine, over loopback on Linux.

use std::io::Write;
use std::net::{Ipv4Addr, UdpSocket};
use std::process::{Command, Stdio};
use std::time::Duration;

use harness::{Guest, Members, Said};
use tool::image;
use views::protocol::Transcript;

/// Several packets at once, more than a job takes, the last of the greatest length; half of the
/// lines name their wire.
#[test]
fn the_packets_of_a_script_go_back_as_the_same_bytes_in_every_run_on_any_cores() {
    let (mut script, mut wanted) = (String::new(), String::new());
    for number in 0..30_u8 {
        let at_us = 1_000 + 700 * u32::from(number / 12);
        let bytes = vec![number; (1 + usize::from(number) * 51).min(1472)];
        let packet = format!("10.0.2.2:{} \"{}\"\n", 1 + number % 3, bytes.escape_ascii());
        let wire = ["", "wire.echo "][usize::from(number % 2)];
        script += &format!("{at_us}us {wire}{packet}");
        wanted += &format!("wire.echo {packet}");
    }
    for (cores, clusters) in [(1, ""), (1, ""), (4, ""), (4, "clusters=2,2")] {
        let words = format!("wire.echo=file ms=100 us=200 {clusters}");
        let guest = Guest::new("echo").word(&words).cores(cores);
        let (outcome, sent) = guest.input(&script).succeed_sending();
        let sent = String::from_utf8_lossy(&sent);
        let mut lines = sent.lines().zip(wanted.lines());
        let differs = lines.position(|(sent, line)| sent != line);
        let lengths = (sent.len(), wanted.len());
        assert!(
            sent == wanted,
            "{words}: line {differs:?} differs, {lengths:?} bytes"
        );
        (outcome.line("wire")).has([("packets", 30), ("lost_packets", 0), ("unsent_bytes", 0)]);
        assert!(
            outcome.serial.contains("; 0 allocations while jobs ran"),
            "{}",
            outcome.serial
        );
    }
}

#[test]
fn two_wires_of_a_script_have_their_own_packets_and_lines() {
    let script = "1ms wire.one \"a\\n\"\n1ms 10.0.0.1:5 \"b\"\n12ms wire.two 10.0.0.2:6 \"c\"\n";
    let words = "wire.one=file wire.two=file";
    let (_, sent) = Guest::test("wires")
        .word(words)
        .input(script)
        .succeed_sending();
    let wanted = "wire.two \"a!\"\nwire.two \"b!\"\nwire.one \"c!\"\n";
    assert_eq!(String::from_utf8_lossy(&sent), wanted);
    // Bytes without a word go as they are, so no second wire has the port.
    let guest = Guest::test("wires").input("1ms \"a\\n\"\n");
    let refused = guest
        .altered(
            &[],
            "-chardev null,id=wire -device isa-serial,chardev=wire,iobase=0x2f8,irq=3",
        )
        .refusal();
    let wanted =
        "wire `two` finds the serial port taken by another wire; connect this one elsewhere";
    assert!(refused.starts_with(wanted), "{refused}");
    let refused = Guest::new("echo").word("wire.echo=file").refusal();
    assert_eq!(refused, "`wire.echo=file` has no file; give --input FILE");
}

/// Returns a command for the app's Linux program, with more words.
fn on_linux(words: &str) -> Command {
    let mut command = Command::new(image::build_linux("echo", None).expect("it is built"));
    command.args(["cores=1", "mechanism=normal", "budget_factor=0"]);
    command.args(words.split_whitespace());
    command
}

/// A socket of another program, and its port.
fn socket() -> (UdpSocket, u16) {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("there is a port");
    let port = socket.local_addr().expect("it is bound").port();
    (socket, port)
}

#[test]
fn on_linux_200_packets_go_back_in_their_order() {
    let ((socket, _), (_, port)) = (socket(), socket());
    let mut command = on_linux(&format!("wire.echo=udp://:{port} console=on"));
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let program = command.spawn().expect("it can be run");
    let say = |bytes: &[u8]| _ = socket.send_to(bytes, (Ipv4Addr::LOCALHOST, port));
    let hear = |limit_ms| {
        let limit = Some(Duration::from_millis(limit_ms));
        socket.set_read_timeout(limit).expect("it may be set");
        let mut bytes = [0; 2000];
        let count = socket.recv(&mut bytes).ok()?;
        Some(bytes[..count].to_vec())
    };
    // The program is up when there is an answer. Earlier questions are lost, or answered late.
    let answers = || {
        say(b"up?");
        hear(100)
    };
    while answers().is_none() {}
    let mut more = 1;
    for number in (0..200_u8).step_by(8) {
        let packets = (number..number + 8).map(|number| vec![number; 1 + usize::from(number) * 7]);
        packets.clone().for_each(|packet| say(&packet));
        for packet in packets {
            let mut heard = hear(20_000);
            while heard.as_deref() == Some(b"up?") {
                more += 1;
                heard = hear(20_000);
            }
            assert_eq!(heard, Some(packet));
        }
    }
    writeln!(program.stdin.as_ref().expect("a pipe"), "shutdown").expect("it is read");
    let output = program.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    let transcript = Transcript::read(&said);
    let line = transcript.of_kind("wire").next().expect("it is printed");
    line.has([("packets", 200 + more), ("lost_packets", 0)]);
}

#[test]
fn on_linux_what_a_wire_cannot_have_is_told() {
    let (_socket, port) = socket();
    for (word, code, says) in [
        (
            &*format!("wire.echo=udp://:{port}"),
            1,
            &*format!("wire `echo`: UDP port {port} cannot be"),
        ),
        (
            "wire.echo=file",
            2,
            "`wire.echo=file`: a script of times is for the machine; on Linux",
        ),
        (
            "wire.echo=tcp://:7",
            2,
            "`wire.echo=tcp://:7`: allowed are udp://:PORT,",
        ),
        (
            "",
            2,
            "wire `echo` has no ends; give --input -, --output FILE or `wire.echo=udp://:PORT`",
        ),
    ] {
        let output = on_linux(word).output().expect("it can be run");
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(says), "{said}");
    }
}
