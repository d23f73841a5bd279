//! What a machine is asked to be, by the builder's methods, before the commit.

use fass::{Clusters, Overheads, Policy, Preemption};
use sched_dag::SchedulerOptions;

use crate::disturbed::{Fault, Late};
use crate::silent::Silent;

/// What a machine is asked to be.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub(crate) scheduler: SchedulerOptions,
    pub(crate) clusters: Clusters,
    /// Whether the commit divides the cores.
    pub(crate) assigns: bool,
    pub(crate) overheads: Overheads,
    /// A file of observed WCETs.
    pub(crate) wcets: Option<String>,
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

impl Default for Settings {
    fn default() -> Self {
        Self {
            scheduler: SchedulerOptions {
                policy: Policy::StaticPriority,
                preemption: Preemption::Enabled,
                cores: 1,
            },
            clusters: Clusters::Undivided,
            assigns: false,
            overheads: Overheads::default(),
            wcets: None,
            silent: Silent::default(),
            late: Late::default(),
            faults: Vec::new(),
            contains_panics: false,
            most_jobs: None,
        }
    }
}
