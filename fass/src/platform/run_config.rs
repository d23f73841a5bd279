//! The terms on which a platform runs DAGs.
//!
//! The terms are of the same kind for every platform: how its scheduler uses its cores, and what a
//! commit assumes. A platform keeps a [`RunConfig`], lets apps change the terms before their
//! commits, and shows them to each commit.

use alloc::borrow::Cow;

use sched_dag::analysis::{AnalysisSettings, OverheadSource, Overheads};
use sched_dag::{CoreDivision, Policy, Preemption, SchedulerOptions};

/// The terms on which a platform runs the DAGs of coming commits.
///
/// ```
/// use fass::commit::CoreDivision;
/// use fass::platform::RunConfig;
/// use fass::Policy;
///
/// let mut terms = RunConfig::of_cores(3);
/// terms.scheduler.policy = Policy::Edf;
/// terms.divide(&[1, 2]);
/// assert_eq!(terms.clusters, CoreDivision::Of(vec![1, 2]));
/// ```
#[derive(Clone, Debug)]
pub struct RunConfig {
    /// The scheduling policy, which decides what attributes are needed; whether a started instance
    /// may lose its core; and the number of processors running subtasks, at least 1.
    pub scheduler: SchedulerOptions,
    /// The division of the processors into clusters. If the processors are divided here, each DAG
    /// states its cluster ([`Dag::cluster`](crate::Dag::cluster)).
    pub clusters: CoreDivision,
    /// Whether the commit divides the processors
    /// ([`analysis::assign`](sched_dag::analysis::assign())).
    pub assigns: bool,
    /// The greatest cost of the platform's own work for an instance, as measured on the platform.
    /// The commit adds the cost to each WCET before dividing cores, making tables and answering
    /// about deadlines ([`Commit::answers`](crate::commit::Commit::answers)); the run itself
    /// depends on the cost only through them. Without measurements nothing is added: then WCETs
    /// have to include the cost.
    ///
    /// ```
    /// use fass::commit::Overheads;
    /// use fass::Preemption;
    ///
    /// let measured = Overheads {
    ///     context_switch_ns: 300,
    ///     dispatch_ns: 900,
    ///     interrupt_ns: 2_000,
    ///     ..Overheads::NONE
    /// };
    /// // Into the instance, out of it, one dispatch, one interrupt to preempt another.
    /// assert_eq!(measured.of_an_instance_ns(Preemption::Enabled), Some(3_500));
    /// ```
    pub overheads: Overheads,
    /// The origin of the overheads, shown in the answer.
    pub overhead_source: OverheadSource,
    /// The text of a file with observed WCETs, if there is one. For the DAGs in the file the commit
    /// replaces their stated WCETs with the observed ones. `sched_dag::wcets` has the format.
    pub wcets: Option<Cow<'static, str>>,
    /// The app's promise that its coming commits contain a *fixed* set: all jobs are released, on
    /// time, and no DAG is paused, resumed or ended by functions, modes or people. The text is a
    /// certificate of that set ([`certify`](sched_dag::analysis::certify())). Based on the
    /// certificate the commit may prove bounds valid only for a fixed set. A fault, or an execution
    /// beyond its WCET, voids the bounds of all DAGs.
    pub certificate: Option<Cow<'static, str>>,
    /// The budget of a subtask with a WCET but without a stated budget, as a multiple of the WCET;
    /// 0 for none.
    pub budget_factor: u64,
    /// The greatest number of events kept in the journals; with 0 nothing is written down.
    pub most_events: u64,
}

impl RunConfig {
    /// Makes terms for a number of cores: undivided cores, static priorities, preemption, no
    /// overheads, and no budgets except stated ones.
    pub const fn of_cores(cores: u32) -> Self {
        Self {
            scheduler: SchedulerOptions {
                policy: Policy::StaticPriority,
                preemption: Preemption::Enabled,
                cores,
            },
            clusters: CoreDivision::Undivided,
            assigns: false,
            overheads: Overheads::NONE,
            overhead_source: OverheadSource::Stated,
            wcets: None,
            certificate: None,
            budget_factor: 0,
            most_events: u64::MAX,
        }
    }

    /// Divides the cores into clusters of the given sizes, from core 0 on; an empty list leaves the
    /// cores undivided. Each cluster schedules its own DAGs.
    pub fn divide(&mut self, sizes: &[u32]) {
        self.assigns = false;
        self.clusters = match sizes {
            [] => CoreDivision::Undivided,
            sizes => CoreDivision::Of(sizes.to_vec()),
        };
    }

    /// Lets the commit divide the cores: a DAG needing several cores gets a cluster of its own, and
    /// the others share clusters of one core each. All subtasks need WCETs. See
    /// [`ClusterPlacement`](crate::commit::ClusterPlacement).
    pub fn divide_by_commit(&mut self) {
        (self.clusters, self.assigns) = (CoreDivision::Undivided, true);
    }

    /// Returns the settings for the analysis of a commit.
    #[must_use]
    pub fn settings(&self) -> AnalysisSettings {
        AnalysisSettings::new(self.scheduler, self.overheads)
    }
}

impl Default for RunConfig {
    fn default() -> Self {
        Self::of_cores(1)
    }
}
