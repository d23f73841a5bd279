//! A drone flying between waypoints, with DAGs that compute and close a loop.
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
//! The airframe and its sensors are simulated, within `measure`, `move` and `capture`; a real drone
//! would fly with all other code. The airframe is a *state* of `attitude`. *Latest values* travel
//! between the DAGs: `camera` reads the estimate of `attitude`; `attitude` reads the place of the
//! airframe found by `camera` and the goal decided by `command`. `mission` signals a reached
//! waypoint, `battery` a low charge. A frame still unfinished when the next frame is due makes the
//! DAG skip the next frame.
//!
//! There are two *modes*: in `flight`, `camera` and `mission` run; in `landing`, `descent` runs.
//! The others run in both. `command` enters the landing for want of charge, when the camera has
//! finished its frame; `safety` enters the landing at once, when a fault has ended a DAG
//! (`Dag::on_fault`). The *parameter* `reserve` says how many percent of the charge are too few.
//!
//! The library does not use the kernel: the tests fly the drone in virtual time.

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

/// The acceleration of gravity, in m/s^2.
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
    /// The length of the flight, in seconds.
    pub seconds: u64,
    /// The seed of the sensors' noise.
    pub seed: u64,
    /// Whether each subtask takes its WCET besides computing: for virtual time, where computing
    /// takes no time.
    pub takes_wcet: bool,
    /// The time that `detect` takes beyond its work, as an error; zero in a sound flight.
    pub delay: Duration,
    /// The number of frames after which `detect` panics; `None` in a sound flight.
    pub fault_at: Option<u64>,
    /// The number of such faults that cost only a frame each; the next fault brings the drone down.
    pub survived: u32,
}
