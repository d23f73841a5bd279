//! A car keeping its distance: a radar measures the gap to the car ahead, and a motor takes speeds.
//!
//! Both are at the ends of one wire. The radar sends lines such as `gap 2350`, in cm; the motor
//! gets lines such as `speed 1235`, in cm/s. The DAG `cruise` has three subtasks:
//!
//! | subtask | takes | gives |
//! |---|---|---|
//! | `measure`, the source | what came on the wire | the newest gap, if one is fresh |
//! | `control` | the gap | a speed |
//! | `drive`, the sink | the speed | a line on the wire |
//!
//! `cruise` runs every 10 ms or, if released by packets, at most so often. Without a fresh gap the
//! car stops. The DAG `watch` checks every 10 ms whether the wire has a link. Without a link,
//! `watch` enters the mode `lost`, and the DAG `brake` runs in place of `cruise`. The library does
//! not use the kernel.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use core::fmt::Write;
use core::time::Duration;

use fass::shared::{ModeSwitch, Modes, Received, Sender, Wire};
use fass::{Dag, SubtaskAttributes, create_dag};

/// The time between two jobs, or the least time.
pub const PERIOD: Duration = Duration::from_millis(10);

/// The time for which a gap is fresh.
const FRESH_NS: u64 = 50_000_000;

/// The gap to keep, in cm, and the highest speed, in cm/s.
const WANTED_CM: i32 = 2_000;
const FASTEST_CM_S: i32 = 3_000;

/// The source of `cruise`'s releases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReleaseSource {
    /// The time.
    Period,
    /// A packet.
    Packets,
}

/// Decodes a line such as `gap 2350`: a gap in cm.
fn decode(line: &[u8]) -> Option<i32> {
    let gap = str::from_utf8(line).ok()?.strip_prefix("gap ")?;
    gap.parse().ok().filter(|gap| (0..100_000).contains(gap))
}

/// Builds the DAGs. The run ends after `jobs` periods.
pub fn build(wire: &Wire, releases: ReleaseSource, jobs: u64) -> [Dag; 3] {
    let (cruise, brake) = (build_cruise(wire, releases, jobs), build_brake(jobs));
    let watch = build_watch(wire, &cruise, &brake, jobs);
    // Where there are two clusters, the DAGs of the two modes share a cluster.
    [cruise, watch, brake]
}

fn taking(name: &str, us: u64) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(Duration::from_micros(us))
}

fn build_cruise(wire: &Wire, releases: ReleaseSource, jobs: u64) -> Dag {
    let cruise = create_dag();
    (cruise.name("cruise").record::<Option<i32>>("gap")).record::<i32>("speed");
    let mut newest = None;
    let measure = move |packets: Received<'_, i32>| {
        newest = packets.last().or(newest);
        let age_ns = |received_ns| fass::now_ns().saturating_sub(received_ns);
        let fresh = newest.filter(|packet| age_ns(packet.received_ns) < FRESH_NS);
        (fresh.map(|packet| packet.value),)
    };
    match releases {
        ReleaseSource::Period => _ = cruise.jobs(jobs).period(PERIOD),
        ReleaseSource::Packets => _ = cruise.sporadic(PERIOD), // the wire raises the signal
    }
    cruise
        .using(wire.receiving(decode))
        .source(measure)
        .writes(&["gap"])
        .register(taking("measure", 300));
    let mut speed = 0_i32;
    let control = move |(gap,): (Option<i32>,)| {
        speed = gap.map_or(0, |gap| {
            (speed + (gap - WANTED_CM) / 10).clamp(0, FASTEST_CM_S)
        });
        (speed,)
    };
    cruise.register_subtask(control, ["gap"], ["speed"], taking("control", 100));
    let drive = |mut wire: Sender<'_>, (speed,): (i32,)| {
        // Sending never fails: what finds no room is lost, and counted.
        let _ = writeln!(wire, "speed {speed}");
    };
    cruise
        .using(wire.sending())
        .subtask(drive)
        .reads(&["speed"])
        .due(PERIOD)
        .register(taking("drive", 100));
    cruise
}

fn build_brake(jobs: u64) -> Dag {
    let brake = create_dag();
    brake.name("brake").jobs(jobs).relative_deadline(PERIOD);
    let mut without = 0_u32;
    let slow_down = move || {
        without += 1;
        fass::log!(Warn, "no link", periods = without);
    };
    brake
        .period(PERIOD)
        .source(slow_down)
        .register(taking("slow_down", 100));
    brake
}

/// Builds the DAG that watches the link and enters the matching mode.
fn build_watch(wire: &Wire, cruise: &Dag, brake: &Dag, jobs: u64) -> Dag {
    let modes = Modes::new();
    let following = modes.mode("following", &[cruise]);
    let lost = modes.mode("lost", &[brake]);
    let watch = create_dag();
    watch.name("watch").jobs(jobs);
    watch
        .period(PERIOD)
        .using(wire.link().reading())
        .source(|is_up: bool| (is_up,))
        .writes(&["link"])
        .register(taking("look", 50));
    let mut was_up = true;
    // The source cannot decide: a replay leaves sources out.
    let decide = move |modes: (ModeSwitch<'_>, ModeSwitch<'_>), (is_up,): (bool,)| {
        let (mut following, mut lost) = modes;
        match (was_up, is_up) {
            (true, false) => lost.at_once(),
            (false, true) => following.at_once(),
            _ => {}
        }
        was_up = is_up;
    };
    watch
        .using((following.entering(), lost.entering()))
        .subtask(decide)
        .reads(&["link"])
        .due(PERIOD)
        .register(taking("decide", 50));
    watch.record::<bool>("link");
    watch
}
