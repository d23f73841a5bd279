//! A vehicle that brakes for what its two cameras see: images of 64 KiB, computed with.
//!
//! | DAG | released | subtasks |
//! |---|---|---|
//! | `stereo` | every 40 ms | `expose`, then `left`, `smooth_left`, `features_left` in parallel with the same of the right, then `fuse` |
//! | `drive` | every 10 ms | `decide`, `move` |
//!
//! The road is simulated, within `left`, `right` and `move`; all else is what would drive. Each
//! camera's image is smoothed by a convolution, and searched for features. `fuse` looks for each
//! feature in the other camera's image: how far it is shifted there says how far away it is.
//! `drive` samples that latest distance, and brakes. So a long job with images is preempted by a
//! short one, four times a frame, on any number of cores.
//!
//! Images are shared ([`image`]): what travels on an edge is an `Arc`, and nothing allocates once
//! the DAGs are committed. The code here knows no kernel: the tests drive it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod car;
mod dags;
mod drive;
pub mod features;
pub mod image;
pub mod road;
pub mod stereo;

use core::time::Duration;

pub use dags::{System, WCETS};
pub use drive::Drive;

/// The time between two frames.
pub const FRAME: Duration = Duration::from_millis(40);

/// The time between two steps of the vehicle.
pub const STEP: Duration = Duration::from_millis(10);

/// What a drive is made of.
#[derive(Clone, Copy, Debug)]
pub struct Workload {
    /// How long the drive takes, in seconds.
    pub seconds: u64,
    /// The seed of the cameras' noise.
    pub seed: u64,
    /// Whether each subtask takes its WCET besides what it computes: for virtual time, where
    /// computing takes none.
    pub takes_wcet: bool,
}
