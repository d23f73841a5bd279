//! The verification of DAGs at commit.
//!
//! After it nothing can be added, and the holder of the [`TaskSet`] may rely on
//! what it says. All faults of all DAGs are reported at once, so an app's
//! author needs one run to see them; warnings stand apart and prevent nothing.
//!
//! Each check goes on after a fault with what the author most likely meant, so
//! that one slip is one fault and hides no other. The whole costs time linear
//! in subtasks, ports and edges, but for sorting numbers; nothing recurs.

mod attributes;
mod cycles;
mod fault;
mod findings;
mod interner;
mod label;
mod misspelt;
mod model;
mod options;
mod phrases;
mod shape;
mod states;
mod topics;

use alloc::vec::Vec;
use core::borrow::Borrow;
use core::fmt;

pub use fault::{Direction, Fault, Time, Warning};
pub use label::{DagLabel, SubtaskLabel};
pub use options::{CommitOptions, ConstructionPolicy, Count};

use findings::Findings;

use crate::spec::DagSpec;
use crate::task_set::TaskSet;

/// The most inputs and the most outputs that a subtask may have.
pub const MAX_ARITY: usize = 16;

/// DAGs that can be scheduled.
#[derive(Clone, Debug)]
pub struct Verified {
    /// The model for the scheduler.
    pub task_set: TaskSet,
    /// What the apps' authors may not have meant.
    pub warnings: Vec<Warning>,
}

/// DAGs that cannot be scheduled, with every reason.
#[derive(Clone, Debug)]
pub struct Rejected {
    faults: Vec<Fault>,
    warnings: Vec<Warning>,
}

/// Verifies DAGs against the options.
///
/// # Errors
///
/// All faults of all DAGs, in the order of the DAGs.
pub fn verify<S: Borrow<DagSpec>>(
    specs: &[S],
    options: &CommitOptions,
) -> Result<Verified, Rejected> {
    let specs: Vec<&DagSpec> = specs.iter().map(Borrow::borrow).collect();
    verify_all(&specs, options)
}

fn verify_all(specs: &[&DagSpec], options: &CommitOptions) -> Result<Verified, Rejected> {
    let (mut findings, policy) = (Findings::new(specs), options.construction);
    attributes::check(options, &mut findings);
    states::check(&mut findings);
    let topologies = topics::check(options, &mut findings);
    let shapes = topologies.into_iter().enumerate();
    let shapes = shapes.map(|(dag, topology)| shape::check(dag, topology, policy, &mut findings));
    let shapes: Vec<_> = shapes.collect();
    let task_set = if findings.has_faults() {
        None
    } else {
        model::build(options, shapes, &mut findings)
    };
    let (mut faults, warnings) = findings.into_parts();
    misspelt::suggest(specs, &mut faults);
    match task_set {
        Some(task_set) => Ok(Verified { task_set, warnings }),
        None => Err(Rejected { faults, warnings }),
    }
}

impl Rejected {
    /// Returns the faults in the order of the DAGs, never empty.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns what else the apps' authors may not have meant.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns faults and warnings to keep.
    #[must_use]
    pub fn into_parts(self) -> (Vec<Fault>, Vec<Warning>) {
        (self.faults, self.warnings)
    }
}

/// Writes as [`write_faults`] does.
impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_faults(&self.faults, f)
    }
}

/// The most faults that a message tells; what is left shows when these are mended.
pub const MOST_FAULTS: usize = 20;

/// Writes one line a fault, without a newline at the end; of very many the first
/// [`MOST_FAULTS`], and how many more there are.
///
/// # Errors
///
/// The formatter's.
pub fn write_faults(faults: &[impl fmt::Display], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    for (position, fault) in faults.iter().take(MOST_FAULTS).enumerate() {
        if position > 0 {
            f.write_str("\n")?;
        }
        write!(f, "{fault}")?;
    }
    match faults.len().saturating_sub(MOST_FAULTS) {
        0 => Ok(()),
        more => write!(f, "\nand {more} more faults"),
    }
}

impl core::error::Error for Rejected {}
