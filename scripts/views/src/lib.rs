//! Views of a run: its record, read, and what people and pages see of it.
//!
//! - [`json`], [`protocol`]: a guest's output, read strictly;
//! - [`record`]: the record of a boot; [`notes`]: what it committed;
//!   [`links`]: those of several machines, read as one;
//! - [`view`](mod@view): a run in the order of time; [`marks`]: its faults, modes and pauses;
//! - [`findings`]: its breaches of the model's rules, and its figures; [`certification`]: whether
//!   the proofs of its bounds hold of it; [`chains`]: its latencies from DAG to DAG;
//! - [`picture`]: a run drawn as [`svg`], below its tables ([`planned`]); [`units`]: times as text.
//!
//! The crate has no I/O: the commands of `scripts/` and the page share it.

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
