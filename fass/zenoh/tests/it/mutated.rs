//! Messages with wrong bytes: no panic, and a session that goes on or opens anew.
//!
//! `MESSAGES=n` and `SEED=n` draw more and others.

use std::env;

use random::Random;
use zenoh::{Declaration, SessionCounts};

use crate::script::{bytes, client};

/// The datagrams of the scripts, as they are, and of frames what stands behind the number.
fn seeds() -> Vec<(u8, Vec<u8>)> {
    let files = [
        include_str!("../vectors/session.txt"),
        include_str!("../vectors/heard.txt"),
        include_str!("../vectors/sent.txt"),
        include_str!("../vectors/malformed.txt"),
    ];
    let lines = files.iter().flat_map(|file| file.lines());
    let messages = lines.filter_map(|line| line.strip_prefix("< ").or(line.strip_prefix("> ")));
    // One end of a session is enough: behind it nothing goes deep.
    let messages = messages
        .filter(|words| !["none", "-", "2300", "0302"].contains(words))
        .map(bytes);
    let split = |message: Vec<u8>| {
        let (header, rest) = message.split_first().unwrap();
        let is_numbered = is_numbered(*header);
        let number = rest.iter().position(|byte| is_numbered && byte & 0x80 == 0);
        (*header, rest[number.map_or(0, |last| last + 1)..].to_vec())
    };
    let mut seeds: Vec<(u8, Vec<u8>)> = messages.map(split).collect();
    // Of the answers that open a session, too, one of each is enough.
    seeds.sort();
    seeds.dedup_by(|a, b| a.0 == b.0 && (!is_numbered(a.0) || a.1 == b.1));
    seeds
}

/// Returns whether a message is a frame or a fragment.
fn is_numbered(header: u8) -> bool {
    matches!(header & 0x1f, 5 | 6)
}

/// Returns the message with up to four bytes wrong, cut or not.
fn mutated(random: &mut Random, message: &[u8]) -> Vec<u8> {
    let mut message = message.to_vec();
    for _ in 0..random.within(0..=4) {
        if message.is_empty() {
            break;
        }
        let depth = random.one_of(&[8, 24, 60, message.len()]);
        let at = random.index(depth.min(message.len()));
        match random.index(5) {
            0 => message[at] = random.within(0..=255),
            1 => message[at] ^= 1 << random.within(0..=7_u32),
            2 => message[at] = random.one_of(&[0, 1, 0x7f, 0x80, 0xff]),
            3 => _ = message.remove(at),
            _ => message.insert(at, random.within(0..=255)),
        }
    }
    if random.chance(10) {
        message.truncate(random.index(message.len() + 1));
    }
    message
}

fn wanted(name: &str, usual: u64) -> u64 {
    env::var(name).map_or(usual, |text| text.parse().unwrap())
}

#[test]
fn no_mutated_message_panics_or_ends_a_session_for_good() {
    let (rounds, seed) = (wanted("MESSAGES", 200_000), wanted("SEED", 1));
    let (mut random, seeds) = (Random::new(seed), seeds());
    let mut session = client("fffffff0000000000000000000000001", 10_000);
    let declared = [Declaration::Subscriber("vec/sub"), Declaration::Token("@")];
    let (mut now_ns, mut longest, mut out) = (0, 0, [0; 1400]);
    // The number of the next frame in each channel. A wrong one would be all that is seen.
    let mut next = [0_u32; 2];
    for round in 0..rounds {
        if rounds > 200_000 && round % (rounds / 10) == 0 {
            println!(
                "{round} of {rounds} messages, seed {seed}: {:?}",
                session.counts()
            );
        }
        let is_up = session.up_since_ns().is_some();
        now_ns += if is_up { 1_000_000 } else { 100_000_000 };
        let length = session.due(now_ns, |place| declared.get(place).copied(), &mut out);
        let (header, mut message) = match (out[..length].first(), is_up) {
            // Answers of a router.
            (Some(0x41), false) => (
                0x61,
                bytes("09f0aa511d0ad4a01e6551dfaa5d5774804b0a780501aa"),
            ),
            (Some(0x42), false) => {
                next = [0x0fff_fff0; 2];
                (0x62, bytes("0af0ffff7f"))
            }
            _ => seeds[random.index(seeds.len())].clone(),
        };
        if is_up || random.chance(10) {
            message = mutated(&mut random, &message);
        }
        let header = if random.chance(3) {
            random.within(0..=255)
        } else {
            header
        };
        if is_numbered(header) && !random.once_in(5000) {
            let next = &mut next[usize::from(header >> 5 & 1)];
            let digit =
                |at: u32| (*next >> (7 * at)).to_le_bytes()[0] & 0x7f | u8::from(at < 3) << 7;
            message.splice(0..0, (0..4).map(digit));
            *next = next.wrapping_add(1) & 0x0fff_ffff;
        }
        message.insert(0, header);
        session.hear(now_ns, &message, &mut |put| {
            let parts = [put.key, put.attachment, put.payload].map(<[u8]>::len);
            longest = longest.max(parts.iter().sum());
        });
        let payload = &message[..message.len().min(1000)];
        let put = session.put("vec/sub", &[1; 33], payload, &mut out);
        assert!(put.is_none() || session.up_since_ns().is_some());
    }
    check(&session.counts(), rounds);
    assert!(
        longest <= zenoh::MOST_FRAGMENTED,
        "{longest} bytes of a value"
    );
}

/// Checks that messages have gone as deep as there is a count for.
fn check(counts: &SessionCounts, rounds: u64) {
    println!("{counts:?}");
    let whole = counts.fragments - counts.dropped;
    let lost = [
        counts.lost,
        counts.malformed,
        counts.foreign,
        counts.repeated,
    ];
    let deep = [counts.puts, counts.sent, counts.gaps, counts.dropped, whole];
    let is_deep = |count: &u64| *count > rounds / 10_000;
    assert!(lost.iter().chain(&deep).all(is_deep), "{counts:?}");
    assert!(counts.opened <= counts.lost + 1);
}
