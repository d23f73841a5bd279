//! The notebook of a verification: what is verified, and the faults and warnings as they are
//! found.

use alloc::vec::Vec;

use super::fault::{Fault, Warning};
use super::label::{DagLabel, SubtaskLabel};
use crate::order::sorted_by_key;
use crate::spec::DagSpec;

/// The DAGs, and what has been found so far.
pub(super) struct Findings<'s> {
    pub(super) specs: &'s [&'s DagSpec],
    /// Each fault with the position of its DAG.
    faults: Vec<(usize, Fault)>,
    pub(super) warnings: Vec<Warning>,
}

/// The page of one DAG.
pub(super) struct Page<'f, 's> {
    pub(super) dag: usize,
    pub(super) spec: &'s DagSpec,
    findings: &'f mut Findings<'s>,
}

impl<'s> Findings<'s> {
    pub(super) const fn new(specs: &'s [&'s DagSpec]) -> Self {
        Self {
            specs,
            faults: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Opens the page of a DAG.
    pub(super) fn of(&mut self, dag: usize) -> Page<'_, 's> {
        let spec = self.specs[dag];
        let findings = self;
        Page {
            dag,
            spec,
            findings,
        }
    }

    pub(super) fn label(&self, dag: usize) -> DagLabel {
        DagLabel::new(self.specs, dag)
    }

    /// Notes a fault of the whole commit, which counts as DAG 0's.
    pub(super) fn fault(&mut self, fault: Fault) {
        self.faults.push((0, fault));
    }

    pub(super) fn has_faults(&self) -> bool {
        !self.faults.is_empty()
    }

    /// Returns the faults in the order of the DAGs and, within a DAG, in the
    /// order of the checks.
    pub(super) fn into_parts(self) -> (Vec<Fault>, Vec<Warning>) {
        let order = sorted_by_key(self.faults.len(), |fault| self.faults[fault].0);
        let faults = self.faults.into_iter().map(|(_, fault)| Some(fault));
        let mut faults: Vec<Option<Fault>> = faults.collect();
        let faults = order.into_iter().filter_map(|fault| faults[fault].take());
        (faults.collect(), self.warnings)
    }
}

impl Page<'_, '_> {
    pub(super) fn label(&self) -> DagLabel {
        self.findings.label(self.dag)
    }

    pub(super) fn subtask(&self, subtask: usize) -> SubtaskLabel {
        SubtaskLabel::new(self.spec, subtask)
    }

    /// Notes a fault, which names the DAG.
    pub(super) fn fault(&mut self, fault: impl FnOnce(DagLabel) -> Fault) {
        let fault = fault(self.label());
        self.findings.faults.push((self.dag, fault));
    }

    /// Notes a warning, which names the DAG.
    pub(super) fn warn(&mut self, warning: impl FnOnce(DagLabel) -> Warning) {
        let warning = warning(self.label());
        self.findings.warnings.push(warning);
    }
}
