//! The notebook of a verification: faults and warnings as they are found.

use alloc::vec::Vec;

use super::fault::Fault;
use super::warning::Warning;
use crate::order::sorted_by_key;

/// What has been found so far.
#[derive(Default)]
pub(super) struct Findings {
    /// Each fault with the position of its DAG.
    faults: Vec<(usize, Fault)>,
    pub(super) warnings: Vec<Warning>,
}

impl Findings {
    /// Notes a fault of a DAG; faults of the whole commit count as DAG 0's.
    pub(super) fn fault(&mut self, dag: usize, fault: Fault) {
        self.faults.push((dag, fault));
    }

    pub(super) fn has_faults(&self) -> bool {
        !self.faults.is_empty()
    }

    /// Returns the faults in the order of the DAGs and, within a DAG, in the
    /// order of the checks.
    pub(super) fn into_parts(self) -> (Vec<Fault>, Vec<Warning>) {
        let order = sorted_by_key(self.faults.len(), |fault| self.faults[fault].0);
        let mut faults: Vec<_> = self
            .faults
            .into_iter()
            .map(|(_, fault)| Some(fault))
            .collect();
        let faults = order.into_iter().filter_map(|fault| faults[fault].take());
        (faults.collect(), self.warnings)
    }
}
