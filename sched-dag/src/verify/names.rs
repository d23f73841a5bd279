//! The checks of names of DAGs and subtasks.
//!
//! A name is for people, so it may be left out; given twice within one DAG it
//! would make every message about it ambiguous.

use alloc::vec::Vec;

use super::fault::Fault;
use super::findings::Findings;
use super::interner::Interner;
use super::label::{DagLabel, SubtaskLabel};
use super::warning::Warning;
use crate::spec::DagSpec;

/// Checks the names of the whole commit.
pub(super) fn check(specs: &[&DagSpec], findings: &mut Findings) {
    let dag_names = specs.iter().map(|spec| spec.name.as_str());
    for_each_duplicate(specs.len(), dag_names, |first, second| {
        findings.warnings.push(Warning::DuplicateDagName {
            first: DagLabel::new(specs, first),
            second: DagLabel::new(specs, second),
        });
    });
    for (dag, spec) in specs.iter().enumerate() {
        let names = spec.subtasks.iter().map(|subtask| subtask.name.as_str());
        for_each_duplicate(spec.subtasks.len(), names, |first, second| {
            findings.fault(
                dag,
                Fault::DuplicateSubtask {
                    dag: DagLabel::new(specs, dag),
                    first: SubtaskLabel::new(spec, first),
                    second: SubtaskLabel::new(spec, second),
                },
            );
        });
    }
}

/// Reports each position whose name, unless empty, stands at an earlier one.
fn for_each_duplicate<'a>(
    count: usize,
    names: impl Iterator<Item = &'a str>,
    mut report: impl FnMut(usize, usize),
) {
    let mut interner = Interner::new(count);
    let mut first_positions: Vec<usize> = Vec::with_capacity(count);
    for (position, name) in names.enumerate().filter(|(_, name)| !name.is_empty()) {
        let number = interner.intern(name);
        match first_positions.get(number) {
            Some(&first) => report(first, position),
            None => first_positions.push(position),
        }
    }
}
