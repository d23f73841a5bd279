//! Times and what takes them, in words for the tests.

use core::time::Duration;

use fass::{Occupation, SubtaskAttributes, execute_for};

pub(crate) fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Keeps the core for so long.
pub(crate) fn hold(us: u64) {
    execute_for(Duration::from_micros(us), Occupation::Hold);
}

/// The attributes of a subtask that takes at most so long.
pub(crate) fn taking(name: &str, us: u64) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(Duration::from_micros(us))
}
