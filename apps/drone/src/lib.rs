//! A drone that flies between waypoints: DAGs that compute, and close a loop.
//!
//! | DAG | released | subtasks |
//! |---|---|---|
//! | `attitude` | every 1 ms | `measure`, `estimate`, `control`, `move` |
//! | `camera` | every 33.3 ms | `capture`, `detect`, `locate` |
//! | `battery` | every 100 ms | `drain` |
//! | `mission` | every 50 ms | `watch` |
//! | `command` | by a signal, at most every 200 ms | `decide` |
//! | `descent` | every 50 ms | `descend` |
//! | `safety` | by a fault of `camera`, `battery`, `mission` or `command` | `alarm` |
//!
//! The airframe and what its sensors see are simulated, within `measure`, `move` and `capture`;
//! all else is what would fly. The airframe is a *state* of `attitude`. Between the DAGs travel
//! *latest values*: `camera` reads what `attitude` believes, `attitude` where `camera` has seen
//! the beacon and what `command` has decided. `mission` signals a waypoint that is reached,
//! `battery` that little is left. A frame that is not done when the next is due makes that one be
//! skipped.
//!
//! There are two *modes*: in `flight`, `camera` and `mission` run, in `landing` `descent` does; the
//! others run in both. `command` enters the landing for want of charge when the camera is done with
//! its frame, `safety` at once when a fault has ended a DAG (`Dag::on_fault`). How many percent of
//! the charge are too few is the *parameter* `reserve`.
//!
//! The code here knows no kernel: the tests fly it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod airframe;
pub mod attitude;
pub mod camera;
mod dags;
mod flight;

use core::time::Duration;

pub use dags::{DroneSystem, WCETS};
pub use flight::Flight;

/// In m/s^2.
pub const GRAVITY: f64 = 9.81;

/// The period of the attitude loop.
pub const PERIOD: Duration = Duration::from_millis(1);

/// The period of the attitude loop, in seconds.
pub(crate) const SECONDS: f64 = 0.001;

/// The time between two frames: 30 in a second.
pub const FRAME: Duration = Duration::from_micros(33_333);

/// The workload of a flight.
#[derive(Clone, Copy, Debug)]
pub struct Workload {
    /// How long the flight takes, in seconds.
    pub seconds: u64,
    /// The seed of the sensors' noise.
    pub seed: u64,
    /// Whether each subtask takes its WCET besides what it computes: for virtual time, where
    /// computing takes none.
    pub takes_wcet: bool,
    /// The time that `detect` takes beyond that, as it must not; zero in a sound flight.
    pub delay: Duration,
    /// After how many frames `detect` panics; `None` in a sound flight.
    pub fault_at: Option<u64>,
    /// How many such faults cost a frame each, before one brings the drone down.
    pub survived: u32,
}
