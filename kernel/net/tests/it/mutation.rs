//! Frames with wrong bytes. The tests of the machine have them, too.

use std::ops::Range;

use random::Random;

/// Frames that QEMU's user network and a raw socket have sent.
pub(crate) fn vectors() -> Vec<Vec<u8>> {
    include_str!("frames.hex").lines().map(frame).collect()
}

fn frame(line: &str) -> Vec<u8> {
    let digit = |at: usize| char::from(line.as_bytes()[at]).to_digit(16).unwrap_or(0);
    let byte = |at| (16 * digit(at) + digit(at + 1)).to_le_bytes()[0];
    (0..line.len()).step_by(2).map(byte).collect()
}

/// Returns a frame with a datagram to a port, from port 4000 of 10.0.2.2.
pub(crate) fn datagram(port: u16, payload: &[u8]) -> Vec<u8> {
    filled(1, port, payload)
}

/// Returns a frame with a question for an echo.
pub(crate) fn ping(payload: &[u8]) -> Vec<u8> {
    filled(3, 0, payload)
}

/// Returns a frame that is as one of the vectors, with another payload. Of a ping the port is its
/// sum, and the length its identifier.
fn filled(vector: usize, port: u16, payload: &[u8]) -> Vec<u8> {
    let header = include_str!("frames.hex")
        .lines()
        .nth(vector)
        .unwrap_or_default();
    let mut frame = frame(&header[..84]);
    let length = |headers: usize| {
        let [low, high, ..] = (headers + payload.len()).to_le_bytes();
        [high, low]
    };
    frame[16..18].copy_from_slice(&length(28));
    frame[36..38].copy_from_slice(&port.to_be_bytes());
    frame[38..40].copy_from_slice(&length(8));
    frame.extend(payload);
    mend(&mut frame);
    frame
}

/// Mends the check sums of an IPv4 packet where its own lengths place them, and leaves that of a
/// datagram out.
pub(crate) fn mend(frame: &mut [u8]) {
    let message = 14 + 4 * usize::from(frame[14] & 15);
    let end = 14 + usize::from(u16::from_be_bytes([frame[16], frame[17]]));
    match frame[23] {
        1 => write_sum(frame, message..end, message + 2),
        17 => frame
            .iter_mut()
            .skip(message + 6)
            .take(2)
            .for_each(|byte| *byte = 0),
        _ => {}
    }
    write_sum(frame, 14..message, 24);
}

fn write_sum(frame: &mut [u8], of: Range<usize>, at: usize) {
    if let Some(place) = frame.get_mut(at..at + 2) {
        place.fill(0);
        let words = frame.get(of).unwrap_or_default().chunks(2);
        let word =
            |word: &[u8]| u32::from(word[0]) << 8 | word.get(1).map_or(0, |low| u32::from(*low));
        let sum: u32 = words.map(word).sum();
        // Twice, as the first carry may make another.
        let carried = [(); 2]
            .iter()
            .fold(sum, |sum, ()| (sum & 0xffff) + (sum >> 16));
        let [low, high, ..] = (!carried).to_le_bytes();
        frame[at..at + 2].copy_from_slice(&[high, low]);
    }
}

/// Returns the frame with up to four bytes wrong, cut or not. Half have their sums mended, so that
/// what is wrong is seen by more than a check of these.
pub(crate) fn mutated(random: &mut Random, frame: &[u8]) -> Vec<u8> {
    let mut frame = frame.to_vec();
    for _ in 0..random.within(0..=4) {
        let depth = random.one_of(&[14, 34, 42, 60, frame.len()]);
        let at = random.index(depth.min(frame.len()));
        frame[at] = match random.index(3) {
            0 => random.within(0..=255),
            1 => frame[at] ^ 1 << random.within(0..=7_u32),
            _ => random.one_of(&[0, 1, 0x7f, 0x80, 0xff]),
        };
    }
    if random.chance(25) {
        frame.truncate(random.index(frame.len()));
    }
    if frame.len() >= 34 && frame[12..14] == [8, 0] && random.chance(50) {
        mend(&mut frame);
    }
    frame
}

/// Returns a number that the environment has, or else the usual one.
pub(crate) fn wanted(name: &str, usual: u64) -> u64 {
    let number = |text: String| text.parse().expect("a number");
    std::env::var(name).map_or(usual, number)
}
