//! Requests with wrong bytes: each is answered, and none ends the engine.

use random::Random;

use crate::{file, native, request};

/// A line of a serial log with the begin of a record.
const LINE: &[u8] = b"@{\"kind\":\"record\",\"bytes\":\"iUZBU1NSRUMJAA==\"}\n";

/// Requests to be spoilt: each has another way through the engine.
fn sound() -> Vec<Vec<u8>> {
    let dag = file("apps/dag-file/examples/demo.dag");
    let record = native(&request("record-of-play cores=2 periods=2", &dag));
    let twice = format!("open sizes={0},{0} names=a,b", record.len());
    let stamps = native(&request("record-of-play app=stamps cores=2", b""));
    vec![
        request("play cores=2 policy=edf execution=samples periods=2", &dag),
        request("svg-of-play cores=2 from=1ms to=20ms dags=camera", &dag),
        request("job of=play cores=2 clusters=1,1 dag=1 job=3", &dag),
        request("open run=0", &record),
        request("open live=yes judge=no", &record),
        request("svg from=0ms periods=2", &record),
        request("job dag=3 job=4", &stamps),
        request(&twice, &[&record[..], &record].concat()),
        request("open", LINE),
    ]
}

/// Returns so many spoilt requests, which follow from a seed.
pub(crate) fn spoilt(count: u64, seed: u64) -> Vec<Vec<u8>> {
    let (sound, mut random) = (sound(), Random::new(seed));
    let spoil = |number: u64| {
        let mut bytes = sound[usize::try_from(number).unwrap() % sound.len()].clone();
        for _ in 0..random.within(1..=3_u64) {
            let mut place =
                |len: usize| usize::try_from(random.within(0..=len as u64 - 1)).unwrap();
            if bytes.is_empty() {
                continue;
            }
            let (at, other) = (place(bytes.len()), place(bytes.len()));
            match place(6) {
                0 => bytes[at] ^= 1 << place(8),
                1 => bytes[at] = b"\n 0=%,9<-#"[place(10)],
                2 => bytes.truncate(at),
                3 => drop(bytes.drain(at.min(other)..at.max(other))),
                4 => bytes = [&bytes[..at], &bytes[other..]].concat(),
                _ => bytes[at] = u8::try_from(place(256)).unwrap(),
            }
        }
        bytes
    };
    (0..count).map(spoil).collect()
}

#[test]
fn a_thousand_spoilt_requests_are_answered() {
    let seed = std::env::var("PAGE_SEED").map_or(1, |seed| seed.parse().unwrap());
    for (number, spoilt) in spoilt(1000, seed).iter().enumerate() {
        println!("PAGE_SEED={seed}, request {number}");
        assert!(!native(spoilt).is_empty());
    }
}
