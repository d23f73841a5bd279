//! The angle of a knee, from two sensors on a walking leg: a fork and a join on real data.
//!
//! | subtask | takes | gives |
//! |---|---|---|
//! | `read`, the source, every 1/120 s | the recording | a sample of both sensors |
//! | `upper`, `lower` | the sample | the orientation of their sensor |
//! | `knee`, the sink | both orientations | the turn between the two |
//!
//! A filter ([`filter`]) computes the orientations. Its state is recorded, too, so a replay can
//! begin with each job whose state is in the recording. The input is a recording, made by
//! `./scripts/recording --from-csv` of `data/walking.csv`, whose licence lies in the same folder.
//! The library does not use the kernel: the tests run the app in virtual time, and compare
//! every value with the values of an independent implementation.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod dag;
pub mod filter;

use core::time::Duration;

pub use dag::{WalkOrientations, build};

/// The time between two samples: 120 in a second.
pub const PERIOD: Duration = Duration::from_nanos(8_333_333);

/// The DAG, and the topic of the samples, by their names in a recording.
pub const DAG: &str = "gait";
/// See [`DAG`].
pub const TOPIC: &str = "sample";

recording::recordable! {
    /// The measurements of both sensors at one time.
    #[derive(Clone, Debug)]
    pub struct Sample {
        /// On the upper leg.
        pub upper: Sensor,
        /// On the lower leg.
        pub lower: Sensor,
    }

    /// The measurements of a sensor, along its axes.
    #[derive(Clone, Debug)]
    pub struct Sensor {
        /// The acceleration, in m/s^2.
        pub acc: [f64; 3],
        /// The angular rate, in rad/s.
        pub gyr: [f64; 3],
        /// The magnetic field, in a unit of its own.
        pub mag: [f64; 3],
    }
}
