//! Frames with wrong bytes: no panic, and nothing outside of the frame.

use net::{Client, Heard};
use random::Random;

use crate::frames::{MAC, interface, mend, vectors};

#[test]
fn no_mutated_frame_panics_or_reaches_beyond_itself() {
    let (mut random, frames) = (Random::new(1), vectors());
    let mut here = interface();
    let mut client = Client::new(MAC, 1);
    for round in 0..200_000_u64 {
        let mut frame = frames[random.index(frames.len())].clone();
        for _ in 0..random.within(0..=4) {
            let at = random.index(frame.len().min(60));
            frame[at] = random.within(0..=255);
        }
        frame.truncate(random.index(2 * frame.len()));
        if frame.len() >= 42 && random.chance(50) {
            mend(&mut frame);
        }
        let length = frame.len();
        match here.hear(&mut frame) {
            Heard::Answer { length: answer, .. } => assert!(answer <= length.max(42)),
            Heard::Datagram(heard) => {
                let payload = &frame[heard.payload];
                client.take(payload, round);
            }
            _ => {}
        }
    }
    let counts = here.counts();
    assert!(counts.malformed > 0 && counts.datagrams > 0 && counts.arps > 0 && counts.echoes > 0);
}
