//! Views of a run, computed from its record, for people and pages.
//!
//! - [`json`], [`protocol`]: a guest's output, read strictly;
//! - [`record`]: the record of a boot; [`notes`]: its commits; [`links`]: records of several
//!   machines, read as one;
//! - [`view`](mod@view): a run in the order of time; [`marks`]: faults, modes and pauses of a run;
//! - [`findings`]: breaches of the model's rules in a run, and the run's figures;
//!   [`certification`]: whether the proofs of the bounds hold for a run; [`chains`]: the latencies
//!   from DAG to DAG;
//! - [`picture`]: a run drawn as [`svg`], below its tables ([`planned`]); [`units`]: times as text.
//!
//! The crate has no I/O: the commands of `scripts/` and the page share the crate.

#![forbid(unsafe_code)]

pub mod certification;
pub mod chains;
pub mod findings;
pub mod json;
pub mod links;
pub mod marks;
pub mod notes;
pub mod picture;
pub mod planned;
pub mod protocol;
pub mod record;
pub mod svg;
pub mod units;
pub mod view;

#[cfg(test)]
use record::tests::made;

#[cfg(test)]
mod tests;
