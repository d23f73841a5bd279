//! The Autoware reference system: 24 subtasks in six DAGs that sample each other.
//!
//! The system is a model of a driving stack, made to compare ROS 2 executors: the
//! graph of `autoware_reference_system`, from
//! `github.com/ros-realtime/reference-system` at commit `de8f3bc` (Apache-2.0).
//! Names, rates and the 29 edges are from there. No code of it is here.
//!
//! # From callbacks to DAGs
//!
//! Nodes that run at one rate, started by one cause, are one DAG. An edge inside it is a
//! topic, and a node that fuses two of its topics is a join. Where an edge leads to
//! another rate, or to a node with a timer of its own, the callbacks of ROS 2 leave
//! the value in a member variable; here the reader samples the *latest value*.
//!
//! | DAG | period | subtasks | samples |
//! |---|---|---|---|
//! | `lidar` | 100 ms | the two lidar drivers to `ObjectCollisionEstimator`, `NDTLocalizer` and
//! `IntersectionOutput`: 11 | `map`, `settings` |
//! | `map` | 120 ms | `PointCloudMap`, `PointCloudMapLoader` | |
//! | `settings` | 25 ms | `EuclideanClusterSettings` | |
//! | `visualizer` | 60 ms | `Visualizer` | |
//! | `route` | 100 ms | `Lanelet2Map`, `Lanelet2GlobalPlanner` to the two planners: 5 |
//! `visualizer`, `lidar` |
//! | `behaviour` | 100 ms | `BehaviorPlanner` to `VehicleDBWSystem`: 4 | `lidar`, `route` |
//!
//! 19 edges are topics, 10 are samples. A node that fuses two rates runs, as a DAG
//! has one rate, with the input that carries it on: `NDTLocalizer` and
//! `EuclideanClusterDetector` with the lidars, `Lanelet2GlobalPlanner` with the
//! route. `BehaviorPlanner`, a timer in the original as well, samples all six.
//!
//! # The hot path
//!
//! From the lidars' release to the completion of `ObjectCollisionEstimator`, within
//! one DAG. How old what the lidars saw is when the vehicle acts on it shows one
//! hop later: through `BehaviorPlanner`'s sample to the completion of
//! `VehicleDBWSystem`. Every value carries the number of the lidar job that it goes
//! back to ([`Origin`]), so both are measured, not estimated.
//!
//! # Execution times
//!
//! In the original each of these nodes computes primes up to 4096, a few ms on a
//! Raspberry Pi 4. Here such a piece of work has a WCET of 4 ms unless
//! [`Workload::crunch`] says otherwise, and takes a time between a part of it and
//! all of it. Drivers and sinks have a WCET of 100 us, as they only pass values on.
//!
//! The code here knows no kernel: the tests run it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod graph;
mod latency;

use core::time::Duration;

use fass::Occupation;

pub use graph::{AutowareSystem, Origin};
pub use latency::Latencies;

/// The WCET of a driver and of a sink.
pub const WCET_OF_ENDS: Duration = Duration::from_micros(100);

/// The number of subtasks.
pub const SUBTASKS: usize = 24;

/// The workload of a run of the system.
#[derive(Clone, Copy, Debug)]
pub struct Workload {
    /// The number of jobs of the lidars, which come every 100 ms; the other DAGs
    /// run for the same time.
    pub jobs: u64,
    /// The WCET of a piece of work.
    pub crunch: Duration,
    /// The least part of its WCET that work takes, in percent, at most 100.
    pub least_percent: u64,
    /// The seed of the execution times.
    pub seed: u64,
    /// How execution occupies a core.
    pub occupation: Occupation,
}
