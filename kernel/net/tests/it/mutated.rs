//! Frames with wrong bytes: no panic, and nothing outside of the frame.
//!
//! `FRAMES=n` and `SEED=n` draw more and others.

use net::{Client, HEADERS, Heard, Route};
use random::Random;

use crate::dhcp::answer;
use crate::frames::{MAC, interface};
use crate::mutation::{datagram, mutated, ping, vectors, wanted};

#[test]
fn no_mutated_frame_panics_or_reaches_beyond_itself() {
    let (rounds, seed) = (wanted("FRAMES", 200_000), wanted("SEED", 1));
    let (mut random, mut frames) = (Random::new(seed), vectors());
    let (mut here, mut client) = (interface(), Client::new(MAC, 1));
    let (mut message, mut leases, mut kept) = ([0; 300], 0, 0);
    frames.extend([ping(&[7; 1472]), Vec::new()]);
    for round in 0..rounds {
        if rounds > 200_000 && round % (rounds / 10) == 0 {
            println!(
                "{round} of {rounds} frames, seed {seed}: {:?}",
                here.counts()
            );
        }
        if client.send(client.due_ns(), &mut message).is_some() {
            let kind = if message[242] == 1 { 2 } else { 5 };
            let answer = answer(&message, kind, random.within(0..=u32::MAX));
            *frames.last_mut().unwrap() = datagram(Client::PORT, &answer);
        }
        let drawn = random.index(frames.len());
        let mut frame = mutated(&mut random, &frames[drawn]);
        let length = frame.len();
        match here.hear(&mut frame) {
            Heard::Answer {
                length: answer,
                resolved,
            } => {
                assert!(answer <= length);
                kept += u64::from(resolved.is_some());
            }
            Heard::Datagram(heard) => {
                let payload = &frame[heard.payload];
                leases += u64::from(client.take(payload, round));
                let mut echo = [&[0; HEADERS], payload].concat();
                let route = here.address_datagram(&mut echo, heard.port, heard.from);
                if let Route::Unresolved(neighbour) = route {
                    here.keep(neighbour, &mut echo);
                }
            }
            Heard::Resolved(frame) => {
                assert!(here.kept(frame).len() >= HEADERS);
                kept += 1;
            }
            Heard::Nothing => {}
        }
    }
    let counts = here.counts();
    let deep = [
        counts.malformed,
        counts.datagrams,
        counts.arps,
        counts.echoes,
        leases,
        kept,
    ];
    println!("{counts:?}, {leases} leases, {kept} kept");
    assert!(
        deep.iter().all(|count| *count > rounds / 10_000),
        "{deep:?}"
    );
}
