//! Tests of both ways of a wire, one of them on real threads.

use super::buffer::Buffer;
use super::*;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// Takes a packet that is there, as text, and its time.
fn take(taker: &mut PacketTaker, mark: usize) -> Option<(String, u64)> {
    taker.take(mark, |packet| {
        let text = String::from_utf8_lossy(packet.buffer.content());
        (text.to_string(), packet.time_ns)
    })
}

/// Takes all packets that are there, as text.
fn packets(taker: &mut PacketTaker) -> Vec<String> {
    let mark = taker.mark();
    let packets = core::iter::from_fn(|| take(taker, mark));
    packets.map(|(text, _)| text).collect()
}

/// Lets bytes arrive one by one, and takes the packets after each.
fn framed(framing: Framing, bytes: &[u8]) -> Vec<String> {
    let incoming = WireInput::new(framing, 5, 4);
    let mut taker = incoming.taker().unwrap();
    let mut all = Vec::new();
    for byte in bytes {
        let is_whole = incoming.arrive(&[*byte], 7);
        let new = packets(&mut taker);
        assert_eq!(is_whole, !new.is_empty());
        all.extend(new);
    }
    if framing != Framing::Chunks {
        let at_once = WireInput::new(framing, 5, 16);
        at_once.arrive(bytes, 7);
        // The same, at once.
        assert_eq!(packets(&mut at_once.taker().unwrap()), all);
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
    let incoming = WireInput::new(Framing::Lines, 20, 4);
    let mut taker = incoming.taker().unwrap();
    incoming.arrive(b"one\ntwo\n", 7);
    let mark = taker.mark();
    incoming.arrive(b"three\n", 8);
    assert_eq!(take(&mut taker, mark), Some(("one".into(), 7)));
    assert_eq!(take(&mut taker, mark), Some(("two".into(), 7)));
    assert_eq!(take(&mut taker, mark), None);
    assert_eq!(packets(&mut taker), ["three"]);
}

#[test]
fn packets_pass_from_one_thread_to_another_whole_and_in_order() {
    const PACKETS: u64 = if cfg!(miri) { 200 } else { 20_000 };
    let incoming = WireInput::new(Framing::Lines, 64, 4);
    let mut taker = incoming.taker().unwrap();
    let line = |number: u64| {
        let length = 1 + usize::try_from(number % 40).unwrap();
        vec![b'a' + (number % 26) as u8; length]
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for number in 0..PACKETS {
                incoming.arrive(&[line(number), b"\n".to_vec()].concat(), number);
            }
        });
        let mut next = 0;
        let all = || incoming.packets.get() + incoming.lost.get() == PACKETS;
        loop {
            let is_last = all();
            let mark = taker.mark();
            while let Some((text, number)) = take(&mut taker, mark) {
                assert!(next <= number);
                next = number + 1;
                assert_eq!(text.as_bytes(), line(number));
            }
            if is_last {
                break;
            }
        }
    });
    assert_eq!(incoming.too_long.get(), 0);
    assert!(incoming.packets.get() > 0);
}

#[test]
fn no_buffer_is_lost_or_copied_however_often_an_instance_fails_at_its_packet() {
    const FAULTS: usize = if cfg!(miri) { 50 } else { 10_000 };
    let peer = core::net::SocketAddrV4::new([10, 0, 0, 2].into(), 7);
    let incoming = WireInput::new(Framing::Chunks, 1472, 4);
    let taker = SharedTaker::new(incoming.taker().unwrap());
    let mut device = Buffer::new(0);
    let mut buffers = std::collections::BTreeSet::new();
    for number in 0..FAULTS {
        device.whole()[..2].copy_from_slice(b"ab");
        device.set_range(0..2);
        let memory = device.whole().as_ptr().addr();
        assert!(incoming.swap(&mut device, Some(peer), 7), "{number}");
        taker.begin_instance();
        // An instance that a fault ends while it looks at the packet: nothing is unwound.
        let mut left = taker.0.change().expect("the claim before is forgotten");
        left.give_back();
        let mark = left.mark();
        let packet = left.taker.front(mark).expect("it is there");
        assert_eq!(
            (packet.buffer.content(), packet.peer),
            (&b"ab"[..], Some(peer))
        );
        assert_eq!(packet.buffer.whole().as_ptr().addr(), memory);
        left.is_held = true;
        core::mem::forget(left);
        buffers.insert(memory);
    }
    assert_eq!(buffers.len(), 5, "those of the wire, and the device's");
}

/// How often the device was told that something goes.
static READY: AtomicUsize = AtomicUsize::new(0);

#[test]
fn what_an_instance_sends_is_one_packet_unless_it_ends_more() {
    let outgoing = Arc::new(WireOutput::new(8, 2));
    outgoing.begin_packets(9, || _ = READY.fetch_add(1, Ordering::Relaxed));
    let mut completion = SendCompletion(Arc::clone(&outgoing));
    let mut complete = || completion.happen(0, &mut |_| ());
    let next = || {
        let mut sent = None;
        outgoing.take_packet(|packet| {
            sent = Some(packet.buffer.content().to_vec());
            true
        });
        sent
    };
    assert!(outgoing.stage(b"one, ") && outgoing.stage(b"two"));
    assert_eq!(next(), None, "before the completion");
    complete();
    assert_eq!(next().as_deref(), Some(&b"one, two"[..]));
    outgoing.begin_instance();
    outgoing.stage(b"a");
    outgoing.end_packet();
    outgoing.end_packet();
    outgoing.stage(b"b");
    complete();
    assert_eq!(
        (next(), next(), next()),
        (Some(b"a".into()), Some(b"b".into()), None)
    );
    // Too long, and a packet too many.
    assert!(!outgoing.stage(b"ten bytes!"));
    complete();
    for part in [b"a", b"b", b"c"] {
        outgoing.stage(part);
        outgoing.end_packet();
    }
    complete();
    assert_eq!(
        (next(), outgoing.lost.get(), outgoing.sent.get()),
        (None, 13, 10)
    );
    // An instance that a fault ends while it sends.
    for _ in 0..100 {
        outgoing.begin_instance();
        outgoing.stage(b"never");
        core::mem::forget(outgoing.staging.change());
    }
    outgoing.begin_instance();
    assert!(outgoing.stage(b"at last"));
    complete();
    assert_eq!(next().as_deref(), Some(&b"at last"[..]));
    assert_eq!(READY.load(Ordering::Relaxed), 3, "not for what is lost");
}

#[test]
fn a_value_is_written_into_its_place_and_lost_with_all_others_if_it_has_none() {
    let outgoing = Arc::new(WireOutput::new(8, 2));
    outgoing.begin_packets(9, || ());
    let mut completion = SendCompletion(Arc::clone(&outgoing));
    let mut put = |values: &[&[u8]]| {
        for value in values {
            outgoing.stage_packet(|place| {
                let place = place.get_mut(..value.len());
                _ = place.map(|place| place.copy_from_slice(value));
                value.len()
            });
        }
        completion.happen(0, &mut |_| ());
        let mut sent = Vec::new();
        while outgoing.take_packet(|packet| {
            sent.push(packet.buffer.content().to_vec());
            true
        }) {}
        (sent.concat(), outgoing.lost.get())
    };
    assert_eq!(put(&[b"nine more", b"a"]), (b"nine morea".to_vec(), 0));
    assert_eq!(put(&[b"a", b"ten bytes."]), (vec![], 11));
    assert_eq!(
        put(&[b"a", b"b", b"c"]),
        (vec![], 14),
        "there is room for two"
    );
    assert_eq!(put(&[b"a"]), (b"a".to_vec(), 14));
}
