//! What a wire has counted, when a run is over.

use fass::{Wire, WireCounts};

use crate::text::json;

/// Says it in a line for people and in one for programs.
pub fn report(wire: &Wire) {
    let WireCounts {
        packets,
        bytes,
        lost_packets,
        malformed,
        sent_bytes,
        unsent_bytes,
        ..
    } = wire.counts();
    crate::println!(
        "wire `{}`: {packets} packets came, {lost_packets} were lost, {malformed} malformed; \
         {sent_bytes} bytes sent, {unsent_bytes} lost",
        wire.name()
    );
    json::emit("wire", |line| {
        line.text("name", wire.name())
            .number("packets", packets)
            .number("bytes", bytes)
            .number("lost_packets", lost_packets)
            .number("malformed", malformed)
            .number("sent_bytes", sent_bytes)
            .number("unsent_bytes", unsent_bytes);
    });
}
