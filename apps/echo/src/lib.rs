//! An echo: returns every packet on a wire to its sender.
//!
//! | subtask | takes | gives |
//! |---|---|---|
//! | `hear`, the source | the packets received, into the state `batch` | their number |
//! | `sum` | the number of packets | their bytes in total |
//! | `tell`, the sink | the number of bytes | the packets, on the wire |
//!
//! The packets themselves stay in the DAG's state, so no edge copies them. The library does not use
//! the kernel.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::boxed::Box;
use alloc::vec;
use core::net::SocketAddrV4;
use core::time::Duration;

use fass::shared::{Framing, Received, Sender, Wire, WireOptions};
use fass::{Dag, SubtaskAttributes, create_dag};

/// The most packets of a job, and the most bytes of a packet: the room in a frame of Ethernet.
const MOST: usize = 16;
const LONGEST: usize = 1472;

/// The packets of a job.
struct PacketBatch {
    packets: Box<[Packet]>,
    count: usize,
}

struct Packet {
    from: Option<SocketAddrV4>,
    bytes: Box<[u8]>,
    length: usize,
}

impl PacketBatch {
    fn new() -> Self {
        let packet = || Packet {
            from: None,
            bytes: vec![0; LONGEST].into(),
            length: 0,
        };
        Self {
            packets: core::iter::repeat_with(packet).take(MOST).collect(),
            count: 0,
        }
    }

    fn packets(&self) -> &[Packet] {
        &self.packets[..self.count]
    }
}

/// Makes the wire.
pub fn wire() -> Wire {
    let options = WireOptions {
        framing: Framing::Chunks,
        longest_bytes: LONGEST,
        room: MOST,
    };
    Wire::with("echo", options)
}

/// Builds the DAGs. Two jobs are at least `distance` apart, and a job takes at most three quarters
/// of `distance`. The run ends after the given number of milliseconds; with 0, the run does not end
/// by itself.
pub fn build(wire: &Wire, distance: Duration, milliseconds: u64) -> [Dag; 2] {
    let taking = |name, share| SubtaskAttributes::named(name).wcet(distance / share);
    let echo = create_dag();
    echo.name("echo").in_flight(1).sporadic(distance);
    let batch = echo.state("batch", PacketBatch::new());
    let hear = |(mut packets, batch): (Received<'_, ()>, &mut PacketBatch)| {
        batch.count = 0;
        for packet in &mut batch.packets {
            let taken = packets.look(|bytes, _, from| {
                // The wire accepts no longer packets.
                packet.length = bytes.len().min(LONGEST);
                packet.bytes[..packet.length].copy_from_slice(&bytes[..packet.length]);
                packet.from = from;
            });
            if taken.is_none() {
                break;
            }
            batch.count += 1;
        }
        (batch.count,)
    };
    echo.using((wire.receiving(|_| Some(())), batch.update()))
        .source(hear)
        .writes(&["count"])
        .register(taking("hear", 3));
    let sum = |batch: &PacketBatch, (_count,): (usize,)| {
        let lengths = batch.packets().iter().map(|packet| packet.length);
        (lengths.sum::<usize>(),)
    };
    echo.using(batch.read())
        .subtask(sum)
        .reads(&["count"])
        .writes(&["bytes"])
        .register(taking("sum", 12));
    let tell = |(mut wire, batch): (Sender<'_>, &PacketBatch), (_bytes,): (usize,)| {
        for packet in batch.packets() {
            wire.to(packet.from);
            wire.send(&packet.bytes[..packet.length]);
            wire.end_packet();
        }
    };
    echo.using((wire.sending(), batch.read()))
        .subtask(tell)
        .reads(&["bytes"])
        .due(Duration::from_millis(10))
        .register(taking("tell", 3));

    let clock = create_dag();
    let ms = Duration::from_millis(1);
    clock
        .name("clock")
        .period(10 * ms)
        .relative_deadline(10 * ms);
    if milliseconds > 0 {
        clock.jobs(milliseconds.div_ceil(10));
    }
    clock.register_untyped_subtask(|_job| (), taking("tick", 20));
    [echo, clock]
}
