//! What a machine is asked to be, by the builder's methods, before the commit.

use fass::log::Level;
use fass::{Clusters, Overheads, Policy, Preemption};
use sched_dag::SchedulerOptions;

use crate::VirtualTime;
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
    /// Up to which level lines of the log are kept.
    pub(crate) log_level: Option<Level>,
    /// How many jobs' inputs are kept, if not all is.
    pub(crate) most_jobs: Option<u32>,
}

impl VirtualTime {
    /// Sets up to which level lines of the [log](fass::log!) go to [`Report::logs`]; `None`: none
    /// does. `info` by default.
    ///
    /// ```
    /// use fass::log::Level;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new().log_level(Some(Level::Debug));
    /// let (dag, period) = (create_dag(), std::time::Duration::from_millis(10));
    /// dag.name("clock").jobs(1).period(period).relative_deadline(period);
    /// let tick = |job| fass::log!(Level::Debug, "ticks", job = job);
    /// dag.register_untyped_subtask(tick, SubtaskAttributes::named("tick"));
    /// finish_create_dags(&[dag]).unwrap();
    /// fass::log!(Level::Info, "committed", dags = 1);
    /// let logs = machine.run().logs;
    /// assert_eq!(logs, ["info 0 s: committed dags=1", "debug clock/tick[0] 0 s: ticks job=0"]);
    /// ```
    ///
    /// [`Report::logs`]: crate::Report::logs
    #[must_use = "the machine itself is returned"]
    pub fn log_level(self, most: Option<Level>) -> Self {
        self.set(|settings| settings.log_level = most)
    }
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
            log_level: Some(Level::Info),
            most_jobs: None,
        }
    }
}
