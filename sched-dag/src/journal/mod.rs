//! The journal: what happened in a run, each moment written down once.
//!
//! A driver writes an [`Event`] at each moment: the kernel with its cores' clocks,
//! virtual time and host threads with the scheduler's. All that is said of a run
//! later is computed from these events: the times of jobs and instances, breaches of
//! the rules and statistics by [`law`](crate::law), the lines of a trace, what a
//! viewer draws.
//!
//! [`What`] is the only list of words. Here they are printed and read, and here an
//! event is packed into three [words](Event::words) of 64 bits and unpacked.
//!
//! # Order
//!
//! Events stand in the order in which the scheduler learnt of them: of the events of
//! one instance, one job and one core each comes after all that it follows from. Their
//! times need not ascend: on a machine a function returns before the scheduler hears
//! of it, and another core may come between.

mod event;
mod what;

pub use event::{Event, Subject};
pub use what::{UnknownWord, What};
