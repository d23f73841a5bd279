//! What a machine is asked to be, by the builder's methods, before the commit.

use fass::Terms;

use crate::disturbed::{Fault, Late};
use crate::silent::Silent;

/// What a machine is asked to be.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings {
    /// The terms of the commits to come.
    pub(crate) terms: Terms,
    /// How long calls take that do not say.
    pub(crate) silent: Silent,
    /// How late interrupts are.
    pub(crate) late: Late,
    /// The calls that fail.
    pub(crate) faults: Vec<Fault>,
    /// Whether a panic of a function ends its DAG only.
    pub(crate) contains_panics: bool,
    /// How many jobs' inputs are kept, if not all is.
    pub(crate) most_jobs: Option<u32>,
}
