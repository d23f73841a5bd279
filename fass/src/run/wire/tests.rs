//! Tests of both ways of a wire, one of them on real threads.

use alloc::string::{String, ToString};
use alloc::vec::Vec;

use super::{Framing, WireInput};

/// Takes all packets that are there, as text.
fn packets(incoming: &WireInput) -> Vec<String> {
    let (mark, mut buffer) = (incoming.mark(), incoming.buffer());
    let mut packets = Vec::new();
    while let Some((bytes, _)) = incoming.take_packet(mark, &mut buffer) {
        packets.push(String::from_utf8_lossy(bytes).to_string());
    }
    packets
}

/// Lets bytes arrive one by one, and takes the packets after each.
fn framed(framing: Framing, bytes: &[u8]) -> Vec<String> {
    let incoming = WireInput::new(framing, 5, 64);
    let mut all = Vec::new();
    for byte in bytes {
        let is_whole = incoming.arrive(&[*byte], 7);
        let new = packets(&incoming);
        assert_eq!(is_whole, !new.is_empty());
        all.extend(new);
    }
    if framing != Framing::Chunks {
        let at_once = WireInput::new(framing, 5, 256);
        at_once.arrive(bytes, 7);
        assert_eq!(packets(&at_once), all, "the same, at once");
    }
    all
}

#[test]
fn each_framing_finds_the_packets_and_too_long_ones_are_none() {
    let lines = b"one\r\n\n\r\ntoo long\ntwo\nfive5\r\nrest";
    assert_eq!(framed(Framing::Lines, lines), ["one", "two"]);
    assert_eq!(
        framed(Framing::Until(0), b"\0a\r\0\0sixsix\0b\0"),
        ["a\r", "b"]
    );
    assert_eq!(framed(Framing::Fixed(3), b"abcdefgh"), ["abc", "def"]);
    let counted = b"\0\x02ab\0\0\0\x01c\0\x06longer\0\x01d";
    assert_eq!(framed(Framing::LengthFirst, counted), ["ab", "c", "d"]);
    assert_eq!(framed(Framing::Chunks, b"abc"), ["a", "b", "c"]);
}

#[test]
fn what_comes_after_the_mark_waits() {
    let incoming = WireInput::new(Framing::Lines, 20, 64);
    incoming.arrive(b"one\ntwo\n", 7);
    let (mark, mut buffer) = (incoming.mark(), incoming.buffer());
    incoming.arrive(b"three\n", 8);
    assert_eq!(
        incoming.take_packet(mark, &mut buffer),
        Some((&b"one"[..], 7))
    );
    assert_eq!(
        incoming.take_packet(mark, &mut buffer),
        Some((&b"two"[..], 7))
    );
    assert_eq!(incoming.take_packet(mark, &mut buffer), None);
    assert_eq!(packets(&incoming), ["three"]);
}

#[test]
fn packets_pass_from_one_thread_to_another_whole_and_in_order() {
    const PACKETS: u64 = if cfg!(miri) { 200 } else { 20_000 };
    let incoming = WireInput::new(Framing::Lines, 64, 256);
    let length = |number: u64| 1 + usize::try_from(number % 40).unwrap();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for number in 0..PACKETS {
                let mut line = vec![b'a' + (number % 26) as u8; length(number)];
                line.push(b'\n');
                incoming.arrive(&line, number);
            }
        });
        let (mut buffer, mut next) = (incoming.buffer(), 0);
        let all = || incoming.packets.get() + incoming.lost.get() == PACKETS;
        loop {
            let is_last = all();
            while let Some((bytes, number)) = incoming.take_packet(incoming.mark(), &mut buffer) {
                assert!(next <= number);
                next = number + 1;
                assert_eq!(bytes, vec![b'a' + (number % 26) as u8; length(number)]);
            }
            if is_last {
                break;
            }
        }
    });
    assert_eq!(incoming.too_long.get(), 0);
    assert!(incoming.packets.get() > 0);
}
