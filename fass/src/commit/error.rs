//! A commit that was refused.

use alloc::vec::Vec;
use core::fmt;

use sched_dag::Warning;

use super::fault::Fault;

/// A refused commit: all its faults, and the warnings.
///
/// Its `Display` prints one line for each fault; of very many the first 20, and how
/// many more there are.
///
/// # Examples
///
/// ```
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = fass::create_dag(); // empty
/// let error = fass::finish_create_dags(&[dag]).unwrap_err();
/// for fault in error.faults() {
///     println!("{}: {fault}", fault.code());
/// }
/// assert_eq!(error.to_string().lines().count(), error.faults().len());
/// ```
#[derive(Clone, Debug)]
pub struct CommitError {
    pub(crate) faults: Vec<Fault>,
    pub(crate) warnings: Vec<Warning>,
}

impl CommitError {
    pub(super) fn of(fault: Fault, warnings: Vec<Warning>) -> Self {
        let faults = Vec::from([fault]);
        Self { faults, warnings }
    }

    /// Returns the faults, at least one.
    ///
    /// ```
    /// # let machine = virtual_time::VirtualTime::new();
    /// let error = fass::finish_create_dags(&[fass::create_dag()]).unwrap_err();
    /// assert!(!error.faults().is_empty());
    /// ```
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns what would not have refused the commit but deserves a look.
    ///
    /// ```
    /// # let machine = virtual_time::VirtualTime::new();
    /// let error = fass::finish_create_dags(&[fass::create_dag()]).unwrap_err();
    /// assert!(error.warnings().is_empty());
    /// ```
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
}

impl fmt::Display for CommitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        sched_dag::write_faults(&self.faults, f)
    }
}

impl core::error::Error for CommitError {}
