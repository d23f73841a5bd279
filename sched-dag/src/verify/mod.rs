//! The verification of DAGs at commit.
//!
//! After the verification nothing can be added, and the holder of the [`TaskSet`] may rely on
//! everything it states. All faults of all DAGs are reported at once, so an app's author mostly
//! needs one run to see them. Only if there are no others come derived priorities that do not fit,
//! and then tables that cannot be enforced; and while a list cannot be read, the entries of all
//! lists stay unchecked. Warnings are reported separately and prevent nothing.
//!
//! After a fault, each check goes on with the author's most likely intention. So one slip is one
//! fault and hides no other. The verification of DAGs without faults takes time linear in subtasks,
//! ports and edges, except for sorting numbers, and for states, locks, affinities and tables,
//! supposed to be few. There is no recursion.
//!
//! Words: the *construction policy* says which shapes of graph are wanted. The default is the
//! paper's policy: exactly one source and one sink, connected, and one writer per topic. The caller
//! must write down every relaxation.

mod attributes;
mod fault;
mod label;
mod lists;
mod model;
mod names;
mod shape;
mod topics;

use alloc::string::String;
use alloc::vec::Vec;
use core::borrow::Borrow;
use core::fmt;

use crate::order::sorted_by_key;
use crate::policies::Policy;
use crate::policy::CoreDivision;
use crate::spec::DagSpec;
use crate::task_set::TaskSet;

pub use fault::{DagFault, ListFault, OverflowingTime, TopicSide, Warning};
pub use label::{DagLabel, SubtaskLabel};

/// The maximum number of inputs, and of outputs, of a subtask.
pub const MAX_ARITY: usize = 16;

/// DAGs that can be scheduled.
#[derive(Clone, Debug)]
pub struct VerifiedDags {
    /// The model for the scheduler.
    pub task_set: TaskSet,
    /// Oddities that the apps' authors may not have meant.
    pub warnings: Vec<Warning>,
}

/// DAGs that cannot be scheduled, with every reason.
#[derive(Clone, Debug)]
pub struct RejectedDags {
    faults: Vec<DagFault>,
    warnings: Vec<Warning>,
}

/// Verifies DAGs against the options.
///
/// # Errors
///
/// All faults found, in the order of the DAGs. A fault of the whole commit or in a list counts as
/// one of the first DAG.
pub fn verify<S: Borrow<DagSpec>>(
    specs: &[S],
    options: &CommitOptions,
) -> Result<VerifiedDags, RejectedDags> {
    let specs: Vec<&DagSpec> = specs.iter().map(Borrow::borrow).collect();
    verify_all(&specs, options)
}

fn verify_all(specs: &[&DagSpec], options: &CommitOptions) -> Result<VerifiedDags, RejectedDags> {
    let (mut findings, policy) = (VerifyFindings::new(specs), options.construction);
    let stated = lists::check(options, &mut findings);
    attributes::check(options, &stated.of_dags, &mut findings);
    topics::check_states(&mut findings);
    let topologies = topics::check(options, &mut findings);
    let shapes = topologies.into_iter().enumerate();
    let shapes = shapes.map(|(dag, topology)| shape::check(dag, topology, policy, &mut findings));
    let shapes: Vec<_> = shapes.collect();
    let mut task_set = if findings.has_faults() {
        None
    } else {
        model::build(options, shapes, &mut findings)
    };
    if let Some(task_set) = &mut task_set {
        lists::enforce(task_set, stated.tables, &mut findings);
    }
    let task_set = task_set.filter(|_| !findings.has_faults());
    let (mut faults, mut warnings) = findings.into_parts();
    names::suggest(specs, &mut faults);
    names::suggest_for_sinks(specs, &mut warnings);
    match task_set {
        Some(task_set) => Ok(VerifiedDags { task_set, warnings }),
        None => Err(RejectedDags { faults, warnings }),
    }
}

impl RejectedDags {
    /// Returns the faults in the order of the DAGs, never empty.
    #[must_use]
    pub fn faults(&self) -> &[DagFault] {
        &self.faults
    }

    /// Returns the warnings: oddities that the apps' authors may not have meant.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns faults and warnings by value.
    #[must_use]
    pub fn into_parts(self) -> (Vec<DagFault>, Vec<Warning>) {
        (self.faults, self.warnings)
    }
}

/// Writes the faults with [`write_faults`].
impl fmt::Display for RejectedDags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_faults(&self.faults, f)
    }
}

/// The maximum number of faults in a message; further faults show once these are corrected.
pub const MOST_FAULTS: usize = 20;

/// Writes one line per fault, without a newline at the end. Writes at most [`MOST_FAULTS`] faults,
/// and then the number of the others.
///
/// # Errors
///
/// Errors of the formatter.
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

impl core::error::Error for RejectedDags {}

/// The DAGs, and the findings so far.
struct VerifyFindings<'s> {
    specs: &'s [&'s DagSpec],
    /// Each fault with the position of its DAG.
    faults: Vec<(usize, DagFault)>,
    warnings: Vec<Warning>,
}

/// The findings about one DAG.
struct DagFindings<'f, 's> {
    dag: usize,
    spec: &'s DagSpec,
    findings: &'f mut VerifyFindings<'s>,
}

impl<'s> VerifyFindings<'s> {
    const fn new(specs: &'s [&'s DagSpec]) -> Self {
        Self {
            specs,
            faults: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Opens the findings about a DAG.
    fn findings_of(&mut self, dag: usize) -> DagFindings<'_, 's> {
        let spec = self.specs[dag];
        let findings = self;
        DagFindings {
            dag,
            spec,
            findings,
        }
    }

    fn label(&self, dag: usize) -> DagLabel {
        DagLabel::new(self.specs, dag)
    }

    /// Records a fault of the whole commit, under DAG 0.
    fn fault(&mut self, fault: DagFault) {
        self.faults.push((0, fault));
    }

    /// Records a fault in the list of a core.
    fn core_list(&mut self, list: &str, why: ListFault) {
        let list = list.into();
        self.fault(DagFault::CoreList { list, why });
    }

    fn has_faults(&self) -> bool {
        !self.faults.is_empty()
    }

    /// Returns the faults ordered by DAG and, within a DAG, in the order of the checks.
    fn into_parts(self) -> (Vec<DagFault>, Vec<Warning>) {
        let order = sorted_by_key(self.faults.len(), |fault| self.faults[fault].0);
        let faults = self.faults.into_iter().map(|(_, fault)| Some(fault));
        let mut faults: Vec<Option<DagFault>> = faults.collect();
        let faults = order.into_iter().filter_map(|fault| faults[fault].take());
        (faults.collect(), self.warnings)
    }
}

impl DagFindings<'_, '_> {
    fn label(&self) -> DagLabel {
        self.findings.label(self.dag)
    }

    fn subtask(&self, subtask: usize) -> SubtaskLabel {
        SubtaskLabel::new(self.spec, subtask)
    }

    /// Records a fault, with the label of the DAG.
    fn fault(&mut self, fault: impl FnOnce(DagLabel) -> DagFault) {
        let fault = fault(self.label());
        self.findings.faults.push((self.dag, fault));
    }

    /// Records a warning, with the label of the DAG.
    fn warn(&mut self, warning: impl FnOnce(DagLabel) -> Warning) {
        let warning = warning(self.label());
        self.findings.warnings.push(warning);
    }
}

/// Options of the verification.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[must_use = "options have no effect until something is verified by them"]
pub struct CommitOptions {
    /// The order for ready instances; decides which attributes are needed.
    pub policy: Policy,
    /// The number of cores for the scheduler, at least 1.
    pub cores: u32,
    /// The division of the cores into clusters.
    pub clusters: CoreDivision,
    /// The lists of cores, one text for each, such as `core 0: dag.a dag.b#1`; `docs/dag-file.md`
    /// describes the notation.
    pub lists: Vec<String>,
    /// The shapes of graph to accept.
    pub construction: ConstructionPolicy,
    /// The maximum number of instances for the jobs in flight of all DAGs: the sum over the DAGs of
    /// jobs in flight times subtasks. This bounds the memory of the scheduler and of the edges'
    /// slots. Default: 2^20.
    pub instance_limit: u32,
}

/// The shapes of graph accepted by a commit.
///
/// The default is the paper's policy: one source, one sink, one writer per topic, and all subtasks
/// connected with each other if the edges' directions are ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct ConstructionPolicy {
    /// How many subtasks may lack a predecessor.
    pub sources: CountLimit,
    /// How many subtasks may lack a successor.
    pub sinks: CountLimit,
    /// How many subtasks may write one topic. With [`CountLimit::Several`], a reader waits for all
    /// writers.
    pub writers: CountLimit,
    /// Into how many parts, without an edge between them, a DAG may fall.
    pub parts: CountLimit,
}

/// How many sources, sinks, writers or parts a DAG may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum CountLimit {
    /// Exactly one.
    #[default]
    One,
    /// One or more.
    Several,
}

impl CommitOptions {
    /// Returns options with the paper's construction policy.
    pub const fn new(policy: Policy, cores: u32) -> Self {
        Self {
            policy,
            cores,
            clusters: CoreDivision::Undivided,
            lists: Vec::new(),
            construction: ConstructionPolicy::paper(),
            instance_limit: 1 << 20,
        }
    }

    /// Returns the same options with another construction policy.
    pub fn with_construction(mut self, construction: ConstructionPolicy) -> Self {
        self.construction = construction;
        self
    }

    /// Returns the same options with the cores divided.
    pub fn with_clusters(mut self, clusters: CoreDivision) -> Self {
        self.clusters = clusters;
        self
    }

    /// Returns the same options with lists of cores.
    pub fn with_lists(mut self, lists: &[impl AsRef<str>]) -> Self {
        self.lists = lists.iter().map(|list| list.as_ref().into()).collect();
        self
    }

    /// Returns the same options with another bound on instances in flight.
    pub fn with_instance_limit(mut self, instance_limit: u32) -> Self {
        self.instance_limit = instance_limit;
        self
    }
}

impl ConstructionPolicy {
    /// Returns the paper's policy, the default.
    pub const fn paper() -> Self {
        Self::all(CountLimit::One)
    }

    /// Returns the policy that accepts every acyclic graph.
    pub const fn any_graph() -> Self {
        Self::all(CountLimit::Several)
    }

    const fn all(count: CountLimit) -> Self {
        Self {
            sources: count,
            sinks: count,
            writers: count,
            parts: count,
        }
    }
}
