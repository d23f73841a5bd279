//! Pictures: drawn by a Python script, if there is what it needs.

use std::fs;
use std::path::Path;

use crate::bench::plots;

/// The pictures in the order of the report: file, title, what to see in it.
pub(super) const PICTURES: [(&str, &str, &str); 5] = [
    (
        "join_latency.svg",
        "Join latency as the paper defines it",
        "From the last publication of index i to the i-th join. Boxes are quartiles, whiskers \
         the 1st and the 99th percentile, the axis is logarithmic. Where joins are skipped, the \
         i-th join has nothing to do with job i, and this grows with the length of the run: read \
         it with the number of joins that never happened.",
    ),
    (
        "cover_delay.svg",
        "Cover delay",
        "From the last publication of index i to the first join in which every index is at least \
         i: how long it takes until the join knows all of job i, or something newer. It converges \
         and can be compared.",
    ),
    (
        "response.svg",
        "End-to-end response",
        "From the release of job i to the end of the first join that covers it. It contains the \
         backlog of the parallel subtasks, whose load is 25.5/25, for every policy alike.",
    ),
    (
        "distribution.svg",
        "Distribution of the cover delay",
        "Histogram and cumulative distribution for the largest N. The distribution is drawn over \
         all jobs: a curve that ends below 1 has jobs that no join ever covered.",
    ),
    (
        "gantt.svg",
        "An excerpt of the schedule",
        "The same stretch of the run under each policy. Bars are executions, numbered by job; \
         below, each join at the time it was ready, with a line to the publications that it \
         joined. Joins across jobs are red.",
    ),
];

/// Draws the pictures into `out/plots`.
///
/// # Errors
///
/// One line: what is missing, or what went wrong.
pub(super) fn draw(out: &Path) -> Result<(), String> {
    for (file, ..) in PICTURES {
        // Those of earlier figures would be wrong; mostly there are none.
        let _ = fs::remove_file(out.join("plots").join(file));
    }
    plots::draw("join_latency.py", out)
}

/// Returns a picture as the address of its own contents, if it was drawn.
pub(super) fn data_address(out: &Path, file: &str) -> Option<String> {
    let bytes = fs::read(out.join("plots").join(file)).ok()?;
    Some(format!("data:image/svg+xml;base64,{}", base64(&bytes)))
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |index: usize| u32::from(chunk.get(index).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let index = (bits >> (18 - 6 * digit)) & 63;
            let is_padding = digit > chunk.len();
            text.push(if is_padding {
                '='
            } else {
                char::from(DIGITS[index as usize])
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::base64;

    #[test]
    fn the_test_vectors_of_rfc_4648_hold() {
        let vectors = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, encoded) in vectors {
            assert_eq!(base64(plain.as_bytes()), encoded);
        }
    }
}
