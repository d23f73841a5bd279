//! Reference schedules, run on the machine.
//!
//! A *case* is a set of DAGs with the execution time of every instance, and the
//! one schedule that the task model gives them ([`Case`]). The app runs cases
//! one after the other; the host tool compares their traces
//! (`./scripts/oracle schedules --in-kernel`), and also reads the cases with the
//! code here ([`parse()`]).
//!
//! - [`Case`], [`parse()`]: what a case says, read strictly;
//! - [`build`]: DAGs that execute for its times.
//!
//! The code here knows no kernel: the tests run it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod case;
mod dags;

pub use case::{Case, InstanceTimes, JobTimes, Turn, TurnTimes, parse, parse_block};
pub use dags::{Computing, Epoch, Scale, build};
