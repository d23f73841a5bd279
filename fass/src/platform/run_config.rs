//! The terms on which a platform runs DAGs.
//!
//! They are the same for every platform: what its scheduler does with its cores, and what a
//! commit reckons with. A platform keeps one of these, lets apps change it before their commits,
//! and shows it to each commit.

use alloc::borrow::Cow;

use sched_dag::analysis::{AnalysisSettings, OverheadSource, Overheads};
use sched_dag::{CoreDivision, Policy, Preemption, SchedulerOptions};

/// The terms on which a platform runs the DAGs of the commits to come.
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
    /// The scheduling policy, which decides what attributes are needed; whether a started
    /// instance may lose its core; and the number of processors that run subtasks, at least 1.
    pub scheduler: SchedulerOptions,
    /// How these are divided. If they are, DAGs say which cluster is theirs
    /// ([`Dag::cluster`](crate::Dag::cluster)).
    pub clusters: CoreDivision,
    /// Whether the commit divides them ([`analysis::assign`](sched_dag::analysis::assign())).
    pub assigns: bool,
    /// The cost of the platform's own work for an instance at most, as measured on it. The commit
    /// adds
    /// it to each WCET before it answers about deadlines
    /// ([`Commit::answers`](crate::commit::Commit::answers)); it changes nothing else. Without
    /// measurements, nothing is added: then WCETs have to include it.
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
    /// Where these are from, for the answer to say so.
    pub overhead_source: OverheadSource,
    /// A file of WCETs that were observed, if there is one; the commit takes what it has for its
    /// DAGs in place of what they state. `sched_dag::wcets` has the format.
    pub wcets: Option<Cow<'static, str>>,
    /// The word of an app that its commits to come are of a *fixed* set: all jobs are released, on time, and
    /// no DAG is paused, resumed or ended by functions, modes or persons. The text is a certificate of
    /// that set ([`certify`](sched_dag::analysis::certify())), by which the commit may bound responses
    /// that depend on it. A fault, or an execution beyond its WCET, voids the bounds of all.
    pub certificate: Option<Cow<'static, str>>,
    /// The budget of a subtask that states a WCET only, in WCETs; 0 for none.
    pub budget_factor: u64,
    /// The most events that journals have room for; 0: nothing is written down.
    pub most_events: u64,
}

impl RunConfig {
    /// Makes terms of so many cores: they are not divided, static priorities and preemption rule,
    /// nothing is charged, and there are no budgets but stated ones.
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

    /// Divides the cores into clusters of so many each, from core 0 on; no number: they are not
    /// divided. Each cluster schedules its own DAGs.
    pub fn divide(&mut self, sizes: &[u32]) {
        self.assigns = false;
        self.clusters = match sizes {
            [] => CoreDivision::Undivided,
            sizes => CoreDivision::Of(sizes.to_vec()),
        };
    }

    /// Lets the commit divide the cores: a DAG that needs several gets a cluster of its own, the
    /// others share clusters of one core each. All subtasks need WCETs. See
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
