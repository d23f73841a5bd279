//! Workloads of empty bodies, and the stamps that measure what is between them.
//!
//! A *body* here does nothing but read the clock, so the time between two bodies
//! is the system's alone. [`Shape`] describes the graphs, purely; [`build()`] makes
//! DAGs of them through the same API that every app uses; [`Stamps`] holds the
//! times that the bodies have read.
//!
//! The code here knows no kernel: the tests run it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod build;
mod shape;
mod stamps;

pub use build::{Stamping, Workload, build};
pub use shape::{LAYER, Shape};
pub use stamps::{Pen, Stamps};
