//! Bounds of a run, recomputed on the host, next to the times that were observed.
//!
//! A record has everything that bounds follow from: the graphs with WCETs and priorities, the
//! policy, the cores, the charge on each instance, and the bounds. From these the host runs the
//! same analysis. So it also gets results for which the guest has no room, such as a witness, or
//! the parts of a bound ([`report`]). If host and guest disagree about a bound, that is an error.
//!
//! It also measures the execution times of the runs and the platform's own overheads
//! ([`observed`]). The longest calls, with a margin, are WCETs that a later commit can take; the
//! longest responses are shown next to the bounds ([`report`]).

pub mod observed;
pub mod report;

#[cfg(test)]
mod tests;
