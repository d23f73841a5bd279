//! The angle of a knee, from two sensors on a walking leg: a fork and a join on real data.
//!
//! | subtask | takes | gives |
//! |---|---|---|
//! | `read`, the source, every 1/120 s | what was recorded | a sample of both sensors |
//! | `upper`, `lower` | the sample | the orientation of that sensor |
//! | `knee`, the sink | both orientations | the turn from one to the other |
//!
//! The orientations are those of a filter, [`filter`], whose state is recorded, too, so that a
//! replay can begin with each job that has it. The input is a recording, as
//! `./scripts/recording --from-csv` makes it of `data/walking.csv`, whose licence is next to it.
//! The code here knows no kernel: the tests run it in virtual time, and compare every value with
//! those of an independent implementation.

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
