//! The platform that `fass` sees: one for the program, one machine a thread.

use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use fass::{Clusters, LaunchError, Occupation, Plan, Platform, Policy, Preemption};

use crate::report::{Recorded, Report};
use crate::run::{Setting, run_bodies, run_bodies_recorded};

/// A machine of host threads, belonging to the thread that makes it.
///
/// Made with one worker and static priorities; the builder's methods change that and
/// are to be called before the commit. A thread's newest machine is the one that
/// `fass::finish_create_dags` commits to.
///
/// # Examples
///
/// ```
/// use std::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use native::Native;
///
/// let machine = Native::new().workers(2);
/// let dag = create_dag();
/// dag.jobs(100);
/// let period = Duration::from_millis(10);
/// let named = SubtaskAttributes::named;
/// dag.register_periodic_subtask(|| (20u64,), vec!["number"], period, named("source"));
/// let sink = |(number,): (u64,)| assert_eq!(number, 20);
/// dag.register_sink_subtask(sink, vec!["number"], period, named("sink"));
/// finish_create_dags(&[dag]).unwrap();
///
/// let report = machine.run(); // a few microseconds, not a second
/// assert_eq!(report.statistics[0].completed, 100);
/// ```
#[derive(Debug)]
pub struct Native {
    machine: Rc<Machine>,
}

#[derive(Debug)]
struct Machine {
    policy: Cell<Policy>,
    workers: Cell<u32>,
    clusters: RefCell<Clusters>,
    plan: RefCell<Option<Plan>>,
}

thread_local! {
    static CURRENT: RefCell<Weak<Machine>> = const { RefCell::new(Weak::new()) };
}

impl Native {
    /// Makes a machine for this thread, and installs host threads as the program's
    /// platform if that has not happened yet.
    ///
    /// # Panics
    ///
    /// If the program has installed another platform.
    #[must_use = "dropping the machine removes it from the thread"]
    #[allow(clippy::new_without_default, reason = "it installs a platform")]
    pub fn new() -> Self {
        static IS_OURS: OnceLock<bool> = OnceLock::new();
        assert!(
            IS_OURS.get_or_init(|| fass::install(&HostThreads).is_ok()),
            "another platform is installed; host threads must be the program's only platform"
        );
        let machine = Rc::new(Machine {
            policy: Cell::new(Policy::StaticPriority),
            workers: Cell::new(1),
            clusters: RefCell::default(),
            plan: RefCell::new(None),
        });
        CURRENT.set(Rc::downgrade(&machine));
        Self { machine }
    }

    /// Sets the number of workers.
    #[must_use = "the machine itself is returned"]
    pub fn workers(self, workers: u32) -> Self {
        self.machine.workers.set(workers);
        self
    }

    /// Divides the workers into clusters of so many each, from worker 0 on. Each schedules its own
    /// DAGs, on a clock of its own. See [`fass::Dag::cluster`].
    #[must_use = "the machine itself is returned"]
    pub fn clusters(self, sizes: &[u32]) -> Self {
        let clusters = Clusters::Of(sizes.to_vec());
        self.machine.clusters.replace(clusters);
        self
    }

    /// Sets the scheduling policy.
    #[must_use = "the machine itself is returned"]
    pub fn policy(self, policy: Policy) -> Self {
        self.machine.policy.set(policy);
        self
    }

    /// Runs every job of every DAG, and consumes the machine.
    ///
    /// # Panics
    ///
    /// If nothing was committed, or a function panics.
    pub fn run(self) -> Report {
        let (plan, setting) = self.take();
        run_bodies(plan.task_set, plan.bodies, setting)
    }

    /// Runs as [`run`](Self::run) does, writes everything down, and checks it; see
    /// [`run_recorded`](crate::run_recorded()).
    ///
    /// # Panics
    ///
    /// As [`run`](Self::run); if the record does not fit into memory; if a sporadic DAG
    /// has no limit of jobs.
    pub fn run_recorded(self) -> Recorded {
        let (plan, setting) = self.take();
        run_bodies_recorded(plan.task_set, plan.bodies, setting)
    }

    fn take(&self) -> (Plan, Setting) {
        let plan = self.machine.plan.take();
        let plan = plan.expect("nothing is committed; call `finish_create_dags` first");
        let setting = Setting {
            policy: self.machine.policy.get(),
            workers: self.machine.workers.get(),
        };
        (plan, setting)
    }
}

/// The installed platform, which has no state of its own.
struct HostThreads;

impl Platform for HostThreads {
    fn policy(&self) -> Policy {
        current().map_or(Policy::StaticPriority, |machine| machine.policy.get())
    }

    fn preemption(&self) -> Preemption {
        Preemption::Disabled
    }

    fn cores(&self) -> u32 {
        current().map_or(1, |machine| machine.workers.get())
    }

    fn clusters(&self) -> Clusters {
        let machine = current();
        machine.map_or_else(Clusters::default, |machine| {
            machine.clusters.borrow().clone()
        })
    }

    /// The host's clock, from its first reading.
    fn now_ns(&self) -> u64 {
        static EPOCH: OnceLock<Instant> = OnceLock::new();
        let elapsed = EPOCH.get_or_init(Instant::now).elapsed();
        u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX)
    }

    /// Computes, whatever `how` says: a thread that sleeps would come back late.
    fn execute_for(&self, duration: Duration, _how: Occupation) {
        let start = Instant::now();
        while start.elapsed() < duration {
            std::hint::spin_loop();
        }
    }

    fn launch(&self, plan: Plan) -> Result<(), LaunchError> {
        let Some(machine) = current() else {
            return Err(LaunchError::new(
                "this thread has no `Native`; make one on the thread that commits",
            ));
        };
        let dags = plan.task_set.dags();
        if let Some(endless) = dags
            .iter()
            .find(|dag| dag.jobs().is_none() && !dag.is_sporadic())
        {
            return Err(LaunchError::new(format!(
                "dag `{}` has no limit of jobs and would run forever; state one by `jobs`",
                endless.name()
            )));
        }
        if plan.lifecycle.is_some() {
            return Err(LaunchError::new(
                "a function may pause dags, enter modes or end the run, or a dag starts paused, \
                 which `Native` does not do; run it on the kernel, on Linux or in virtual time",
            ));
        }
        let mut place = machine.plan.borrow_mut();
        if place.is_some() {
            return Err(LaunchError::new(
                "this `Native` has a plan already; commit all DAGs in one call, \
                 or make a new `Native`",
            ));
        }
        *place = Some(plan);
        Ok(())
    }
}

fn current() -> Option<Rc<Machine>> {
    CURRENT.with_borrow(Weak::upgrade)
}
