//! The Autoware reference system: 24 subtasks in six DAGs that sample each other.
//!
//! The system is a model of a driving stack, made to compare ROS 2 executors: the graph of
//! `autoware_reference_system`, from `github.com/ros-realtime/reference-system` at commit `de8f3bc`
//! (Apache-2.0). Names, rates and the 29 edges come from there; no code does.
//!
//! # From callbacks to DAGs
//!
//! Nodes running at the same rate, started by the same cause, form a DAG. An edge inside a DAG is a
//! topic, and a node fusing two topics of its DAG is a join. Some edges lead to another rate, or to
//! a node with its own timer. There the callbacks of ROS 2 leave the value in a member variable;
//! here the reader samples the *latest value*.
//!
//! | DAG | period | subtasks | samples |
//! |---|---|---|---|
//! | `lidar` | 100 ms | 11, see below | `map`, `settings` |
//! | `map` | 120 ms | `PointCloudMap`, `PointCloudMapLoader` | |
//! | `settings` | 25 ms | `EuclideanClusterSettings` | |
//! | `visualizer` | 60 ms | `Visualizer` | |
//! | `route` | 100 ms | 5, see below | `visualizer`, `lidar` |
//! | `behaviour` | 100 ms | `BehaviorPlanner` to `VehicleDBWSystem`: 4 | `lidar`, `route` |
//!
//! The DAG `lidar` leads from the two lidar drivers to `ObjectCollisionEstimator`, `NDTLocalizer`
//! and `IntersectionOutput`; `route` leads from `Lanelet2Map` and `Lanelet2GlobalPlanner` to the
//! two planners.
//!
//! 19 edges are topics, 10 are samples. A DAG has a single rate, so a node fusing two rates runs
//! with the input that drives it: `NDTLocalizer` and `EuclideanClusterDetector` with the lidars,
//! `Lanelet2GlobalPlanner` with the route. `BehaviorPlanner`, a timer in the original as well,
//! samples all six.
//!
//! # The hot path
//!
//! The hot path leads from the lidars' release to the completion of `ObjectCollisionEstimator`,
//! within one DAG. The age of the lidars' data when the vehicle acts shows one hop later: through
//! `BehaviorPlanner`'s sample to the completion of `VehicleDBWSystem`. Every value carries the
//! number of its original lidar job ([`Origin`]), so both latencies are measured, not estimated.
//!
//! # Execution times
//!
//! In the original each node with work computes primes up to 4096, a few ms on a Raspberry Pi 4.
//! Here a piece of work has a WCET of 4 ms unless [`Workload::crunch`] says otherwise, and takes a
//! time between a part of its WCET and all of it. Drivers and sinks, which only pass values on,
//! have a WCET of 100 us.
//!
//! The library does not use the kernel: the tests run the system in virtual time.

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
    /// The number of jobs of the lidars, one every 100 ms; the other DAGs run for the same time.
    pub jobs: u64,
    /// The WCET of a piece of work.
    pub crunch: Duration,
    /// The least time of work, in percent of its WCET; more than 99 counts as 99.
    pub least_percent: u64,
    /// The seed of the execution times.
    pub seed: u64,
    /// How execution occupies a core.
    pub occupation: Occupation,
}
