//! Frames from the outside and between two interfaces: meanings, answers, check sums.

use core::net::Ipv4Addr;

use crate::mutation::{mend, ping, vectors};
use net::{Address, Counts, HEADERS, Heard, Interface, MOST_PAYLOAD, Mac, Peer, Route};

pub(super) const MAC: Mac = Mac([0x52, 0x54, 0, 0x12, 0x34, 0x56]);
pub(super) const IP: Ipv4Addr = Ipv4Addr::new(10, 0, 2, 15);
const THERE: Ipv4Addr = Ipv4Addr::new(10, 0, 2, 2);

fn address(ip: Ipv4Addr) -> Address {
    Address {
        ip,
        prefix: 24,
        gateway: Some(THERE),
    }
}

pub(super) fn interface() -> Interface<Vec<u8>> {
    Interface::new(MAC, address(IP), Vec::new)
}

fn peer(ip: Ipv4Addr, port: u16) -> Peer {
    Peer::new(ip, port)
}

/// Returns a frame with a datagram, and the way it goes.
fn datagram(from: &mut Interface<Vec<u8>>, to: Peer, payload: &[u8]) -> (Vec<u8>, Route) {
    let mut frame = [&[0; HEADERS], payload].concat();
    let route = from.address_datagram(&mut frame, 5000, to);
    (frame, route)
}

#[test]
fn frames_of_others_are_understood() {
    let mut interface = interface();
    for mut frame in vectors() {
        let before = frame.clone();
        match (interface.hear(&mut frame), before[13], before[23]) {
            (Heard::Answer { length: 42, .. }, 6, _) => {
                assert_eq!(frame[..6], before[6..12]);
                assert_eq!(frame[20..22], [0, 2]);
                assert_eq!(frame[22..32], [&MAC.0[..], &IP.octets()].concat());
            }
            (Heard::Datagram(heard), 0, 17) => {
                assert_eq!((heard.from, heard.port), (peer(THERE, 4000), heard.port));
                assert_eq!(before[heard.payload.clone()], before[42..]);
            }
            (Heard::Answer { length, .. }, 0, 1) => {
                assert_eq!(length, before.len());
                assert_eq!((frame[34], &frame[38..]), (0, &before[38..]));
                let words = frame[34..].chunks(2);
                let words = words.map(|word| u32::from(word[0]) << 8 | u32::from(word[1]));
                assert_eq!(words.sum::<u32>() % 0xffff, 0, "the check sum");
                assert_eq!(frame[26..34], [&before[30..34], &before[26..30]].concat());
            }
            other => panic!("{other:?} of {before:02x?}"),
        }
    }
    assert_eq!(interface.counts().malformed + interface.counts().foreign, 0);
}

// 0 is the same sum as 0xffff, but for nothing but zeros.
#[test]
fn an_echo_is_answered_with_the_right_sum() {
    for byte in 0..=255 {
        let mut frame = ping(&[byte; 3]);
        frame[38..42].fill(byte);
        mend(&mut frame);
        let mut right = frame.clone();
        assert!(matches!(interface().hear(&mut frame), Heard::Answer { .. }));
        right[34] = 0;
        mend(&mut right);
        let sum = |frame: &[u8]| u16::from_be_bytes([frame[36], frame[37]]);
        assert_eq!(sum(&frame) % 0xffff, sum(&right) % 0xffff);
        assert!(byte > 0 || sum(&frame) > 0);
    }
}

#[test]
fn a_datagram_waits_for_its_neighbour_and_arrives_whole() {
    let other = Mac([2, 0, 0, 0, 0, 9]);
    for length in [0, 1, 2, 3, 63, 64, MOST_PAYLOAD] {
        let (mut here, mut there) = (interface(), Interface::new(other, address(THERE), Vec::new));
        let payload: Vec<u8> = (0..length).map(|at| at.to_le_bytes()[0]).collect();
        let (mut frame, route) = datagram(&mut here, peer(THERE, 7), &payload);
        assert_eq!(route, Route::Unresolved(THERE));
        here.keep(THERE, &mut frame.clone());
        let mut question = [0; HEADERS];
        let asked = here.question(&mut question, THERE);
        let heard = there.hear(&mut question[..asked]);
        let Heard::Answer { length, resolved } = heard else {
            panic!("{heard:?}");
        };
        assert_eq!(resolved, None);
        frame[..6].copy_from_slice(&other.0);
        let Heard::Resolved(kept) = here.hear(&mut question[..length]) else {
            panic!("it is no answer");
        };
        assert_eq!(*here.kept(kept), frame);
        let Heard::Datagram(heard) = there.hear(&mut frame) else {
            panic!("no datagram");
        };
        assert_eq!((heard.from, heard.port), (peer(IP, 5000), 7));
        assert_eq!(frame[heard.payload], payload);
        // Now both know each other, and a wrong bit anywhere behind the addresses is noticed.
        let (frame, route) = datagram(&mut there, peer(IP, 5000), &payload);
        assert_eq!(route, Route::Ready);
        here.forget_neighbours();
        let asks_anew = datagram(&mut here, peer(THERE, 7), &payload).1;
        assert_eq!(asks_anew, Route::Unresolved(THERE));
        for at in ipv4_and_later(&frame) {
            let mut wrong = frame.clone();
            wrong[at] ^= 0x10;
            let heard = here.hear(&mut wrong);
            assert!(matches!(heard, Heard::Nothing), "byte {at}: {heard:?}");
        }
    }
}

/// Returns the places of a frame that a check sum covers.
fn ipv4_and_later(frame: &[u8]) -> impl Iterator<Item = usize> {
    14..frame.len()
}

#[test]
fn a_question_that_crosses_ours_frees_the_frame_that_waits() {
    let mut here = interface();
    let (mut frame, _) = datagram(&mut here, peer(THERE, 7), b"first");
    here.keep(THERE, &mut frame);
    let (mut frame, _) = datagram(&mut here, peer(THERE, 7), b"latest");
    here.keep(THERE, &mut frame);
    let mut question = vectors().remove(0);
    let heard = here.hear(&mut question);
    let Heard::Answer { resolved, .. } = heard else {
        panic!("{heard:?}");
    };
    assert!(here.kept(resolved.unwrap()).ends_with(b"latest"));
}

#[test]
fn strangers_who_ask_displace_no_neighbour_that_is_used() {
    let mut here = interface();
    here.hear(&mut vectors()[0]);
    assert_eq!(datagram(&mut here, peer(THERE, 7), b"").1, Route::Ready);
    for stranger in 100..250 {
        let mut question = vectors().remove(0);
        question[31] = stranger;
        assert!(matches!(here.hear(&mut question), Heard::Answer { .. }));
    }
    assert_eq!(datagram(&mut here, peer(THERE, 7), b"").1, Route::Ready);
    let known = |last| datagram(&mut here, peer(Ipv4Addr::new(10, 0, 2, last), 7), b"").1;
    let known = (100..250).map(known).filter(|route| *route == Route::Ready);
    assert_eq!(
        known.count(),
        7,
        "the others share the places that are left"
    );
}

#[test]
fn an_address_leads_to_a_neighbour_the_gateway_all_or_nobody() {
    let mut here = interface();
    let mut route = |ip: [u8; 4]| datagram(&mut here, peer(ip.into(), 7), b"").1;
    let near = Ipv4Addr::new(10, 0, 2, 9);
    assert_eq!(route([10, 0, 2, 9]), Route::Unresolved(near));
    assert_eq!(route([8, 8, 8, 8]), Route::Unresolved(THERE));
    assert_eq!(route([10, 0, 2, 255]), Route::Ready);
    assert_eq!(route([255; 4]), Route::Ready);
    let gateway = None;
    here.set_address(Address {
        gateway,
        ..address(IP)
    });
    assert_eq!(
        datagram(&mut here, peer([8; 4].into(), 7), b"").1,
        Route::None
    );
    here.set_address(Address::NONE);
    assert_eq!(datagram(&mut here, peer(near, 7), b"").1, Route::None);
    assert_eq!(
        datagram(&mut here, peer([255; 4].into(), 67), b"").1,
        Route::Ready
    );
}

#[test]
fn an_address_of_nobody_or_of_all_is_none_of_a_host() {
    let is_one = |ip: [u8; 4], gateway: [u8; 4]| {
        let gateway = Some(gateway.into());
        Address {
            gateway,
            ..address(ip.into())
        }
        .is_of_a_host()
    };
    assert!(is_one([10, 0, 2, 15], [10, 0, 2, 2]));
    for none in [[0; 4], [255; 4], [224, 0, 0, 1], [10, 0, 2, 255]] {
        assert!(!is_one(none, [10, 0, 2, 2]), "{none:?}");
        assert!(!is_one([10, 0, 2, 15], none), "{none:?}");
    }
}

#[test]
fn what_is_not_ours_or_not_whole_is_counted() {
    let mut here = interface();
    let (_, datagram) = (vectors().remove(0), vectors().remove(1));
    let counted = |here: &mut Interface<Vec<u8>>, mut frame: Vec<u8>| {
        let Counts {
            malformed, foreign, ..
        } = here.counts();
        assert_eq!(here.hear(&mut frame), Heard::Nothing, "{frame:02x?}");
        let now = here.counts();
        (now.malformed - malformed, now.foreign - foreign)
    };
    // Each frame that is cut is malformed, wherever it is cut.
    for frame in vectors() {
        for length in 0..frame.len() {
            let cut = frame[..length].to_vec();
            assert_eq!(counted(&mut here, cut), (1, 0), "{length} of {frame:02x?}");
        }
    }
    let edited = |edits: &[(usize, u8)]| {
        let mut frame = datagram.clone();
        edits.iter().for_each(|(at, byte)| frame[*at] = *byte);
        mend(&mut frame);
        frame
    };
    let foreign: [&[(usize, u8)]; 10] = [
        &[(0, 2)],                 // another card
        &[(12, 0x86), (13, 0xdd)], // IPv6
        &[(20, 0x20)],             // a fragment with more to come
        &[(23, 6)],                // TCP
        &[(33, 16)],               // another address
        // From nobody, a group, all, all of this network, and this address.
        &[(26, 0), (28, 0), (29, 0)],
        &[(26, 224)],
        &[(26, 255), (27, 255), (28, 255), (29, 255)],
        &[(29, 255)],
        &[(29, 15)],
    ];
    for edits in foreign {
        assert_eq!(counted(&mut here, edited(edits)), (0, 1), "{edits:?}");
    }
    let mut frames = vectors().into_iter();
    let mut with_options = frames.find(|frame| frame[23] == 1).unwrap();
    (with_options[14], with_options[17]) = (0x46, with_options[17] + 4);
    with_options.splice(34..34, [0; 4]);
    mend(&mut with_options);
    assert_eq!(counted(&mut here, with_options), (0, 1));
    let mut nameless = interface();
    nameless.set_address(Address::NONE);
    let asked_for_nobody = [&vectors()[0][..38], &[0; 4]].concat();
    assert_eq!(counted(&mut nameless, asked_for_nobody), (0, 0));
    let malformed: [&[(usize, u8)]; 5] = [
        &[(14, 0x65)], // version 6
        &[(14, 0x44)], // a header of 16 bytes
        &[(17, 19)],   // a packet shorter than its header
        &[(39, 7)],    // a datagram shorter than its header
        &[(38, 9)],    // a datagram longer than its packet
    ];
    for edits in malformed {
        assert_eq!(counted(&mut here, edited(edits)), (1, 0), "{edits:?}");
    }
}
