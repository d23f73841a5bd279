//! Runs DAGs built with `fass` on the host, in virtual time.
//!
//! For our purposes *virtual time* is a clock jumping from one event to the next (other terms are
//! in `docs/glossary.md`). The real functions run, with real values on real topics, under the
//! kernel's own scheduler. Only the passing of time is made up: a function takes the time it states
//! with `fass::execute_for`, else its subtask's WCET, or the time set by [`VirtualTime::silent`]
//! instead. Without any of these a call takes no time. Simulating a second of a DAG's life takes
//! about a millisecond, and every run of the same DAGs gives the same events at the same
//! nanosecond, as long as the functions themselves do the same.
//!
//! Virtual time is the place to test an app: build the DAGs with the app's own code, commit them,
//! [`run`](VirtualTime::run), and look into the [`Report`].
//!
//! # Guarantees
//!
//! - The schedule follows rules R1-R5 of the task model. [`Report::violations`] checks the rules
//!   over the recorded events.
//! - A panic in a function fails the run, and so the test. With [`VirtualTime::contain_panics`] the
//!   panic ends its DAG or costs a job instead, and is reported.
//! - Machines belong to threads: tests running in parallel, each with its own [`VirtualTime`], do
//!   not disturb one another.
//!
//! # Limits
//!
//! - Functions run one after another, on one thread. Races between functions that share data behind
//!   the scheduler's back do not show here.
//! - An instance's function runs at the instant of its start, and all at once; an async function
//!   runs up to its next wait. If the instance is preempted in virtual time, the call has long
//!   returned; `fass::now_ns` inside the function counts as if there were no preemption.
//! - The kernel's own overheads are zero. (The commit's answers can include overheads:
//!   [`VirtualTime::overheads`]. Interrupts can be [late](VirtualTime::late).)
//! - Everything is recorded, so memory grows with the length of a run.
#![forbid(unsafe_code)]

mod command;
mod edge;
mod job;
mod link;
mod machine;
mod platform;
mod report;
mod settings;

use std::rc::Rc;
use std::time::Duration;

use fass::commit::Overheads;
use fass::shared::Signal;
use fass::{Policy, Preemption};
pub use recording::Malformed;
pub use sched_dag::law::{Rule, Violation};
pub use sched_dag::{
    CoreId, DagId, DagLabel, DagStatistics, Instance, JobOutcome, SubtaskId, SubtaskLabel,
};

pub use command::replay_command;
pub use edge::Divergence;
pub use job::{JobShown, Passed, SubtaskShown, Value};
pub use link::{Link, LinkOptions};
use machine::Machine;
pub use machine::{RunError, SentPacket};
pub use report::{DagReport, InstanceRecord, JobRecord, PanicRecord, Report};
pub use sched_dag::journal::{Event, EventKind};
use settings::Settings;
pub use settings::Silent;

/// A machine in virtual time, belonging to the thread that makes it.
///
/// A new machine has the machine's defaults, static priorities and preemption, but one core. The
/// builder's methods change the settings and are to be called before the commit.
/// `fass::finish_create_dags` commits to the thread's newest machine; dropping the machine removes
/// it.
///
/// # Examples
///
/// ```
/// use std::time::Duration;
/// use fass::{Occupation, Policy, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new().cores(1).policy(Policy::Edf);
/// let dag = create_dag();
/// dag.jobs(2);
/// let period = Duration::from_millis(10);
/// dag.register_periodic_subtask(
///     || {
///         execute_for(Duration::from_millis(2), Occupation::Spin);
///         (1,)
///     },
///     ["number"],
///     period,
///     SubtaskAttributes::named("source"),
/// );
/// dag.register_sink_subtask(
///     |(_,): (i32,)| execute_for(Duration::from_millis(3), Occupation::Spin),
///     ["number"],
///     period,
///     SubtaskAttributes::named("sink"),
/// );
/// finish_create_dags(&[dag]).unwrap();
///
/// let report = machine.run();
/// assert_eq!(report.violations(), []);
/// assert_eq!(report.jobs[0].response_time_ns(), Some(5_000_000));
/// assert_eq!(report.jobs[1].release_ns, Some(10_000_000));
/// ```
#[must_use = "dropping the machine removes it from the thread"]
#[derive(Debug)]
pub struct VirtualTime {
    machine: Rc<Machine>,
}

/// Ends the run. The run refers back to the machine, so the machine would never be freed otherwise.
impl Drop for VirtualTime {
    fn drop(&mut self) {
        drop(self.machine.session.take());
    }
}

/// Converts a duration into nanoseconds, saturating at `u64::MAX`.
fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

impl VirtualTime {
    /// Makes a machine for this thread, and installs virtual time as the program's platform unless
    /// it is installed already.
    ///
    /// # Panics
    ///
    /// If the program has installed another platform.
    #[allow(clippy::new_without_default, reason = "it installs a platform")]
    pub fn new() -> Self {
        Self {
            machine: platform::make_current(),
        }
    }

    fn set(self, change: impl FnOnce(&mut Settings)) -> Self {
        change(&mut self.machine.settings.borrow_mut());
        self
    }

    /// Sets the number of cores. See [`VirtualTime`].
    pub fn cores(self, cores: u32) -> Self {
        self.set(|settings| settings.terms.scheduler.cores = cores)
    }

    /// Divides the cores into clusters of the given sizes, from core 0 on. Each cluster schedules
    /// its own DAGs; all clusters have one clock. See [`fass::Dag::cluster`].
    pub fn clusters(self, sizes: &[u32]) -> Self {
        self.set(|settings| settings.terms.divide(sizes))
    }

    /// Lets the commit divide the cores: a DAG needing several cores gets a cluster of its own, and
    /// the others share clusters of one core each. All subtasks need WCETs. See
    /// [`fass::commit::ClusterPlacement`].
    pub fn assign_clusters(self) -> Self {
        self.set(|settings| settings.terms.divide_by_commit())
    }

    /// Sets the scheduling policy. See [`VirtualTime`].
    pub fn policy(self, policy: Policy) -> Self {
        self.set(|settings| settings.terms.scheduler.policy = policy)
    }

    /// Sets whether a started instance may lose its core. See [`VirtualTime`].
    pub fn preemption(self, preemption: Preemption) -> Self {
        self.set(|settings| settings.terms.scheduler.preemption = preemption)
    }

    /// Sets the costs added to each WCET by the commit before it answers about deadlines: the costs
    /// of the DAGs' intended machine. The run itself stays without overheads. See [`VirtualTime`].
    pub fn overheads(self, overheads: Overheads) -> Self {
        self.set(|settings| settings.terms.overheads = overheads)
    }

    /// Gives the commit a file of observed WCETs, in the format of `./scripts/recording --observe`.
    /// For the DAGs in the file, observed WCETs replace stated ones.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let observed = "margin 20\ndag 3497787414769821261 tick\nwcet 1200000 0 count\nend\n";
    /// let _machine = VirtualTime::new().wcets(observed);
    /// let (dag, period) = (create_dag(), Duration::from_millis(10));
    /// dag.name("tick").period(period).relative_deadline(period);
    /// dag.register_untyped_subtask(|_| (), SubtaskAttributes::named("count"));
    /// let commit = finish_create_dags(&[dag]).unwrap();
    /// assert_eq!(
    ///     commit.answer("tick").to_string(),
    ///     "dag `tick` takes at most 1.2ms, by multiple paths; 1 of 1 WCETs are observed ones and 20 %"
    /// );
    /// ```
    pub fn wcets(self, file: &str) -> Self {
        let file = file.to_owned();
        self.set(|settings| settings.terms.wcets = Some(file.into()))
    }

    /// Contains panics, instead of failing the run: a panic in a function ends only its DAG, or
    /// costs one of its jobs (`Dag::survive_faults`), as on the kernel's machine.
    ///
    /// The instance fails after executing as long as it had executed up to the panic. Then its DAG
    /// starts nothing more, or goes on with the next job; the other DAGs go on. [`Report::panics`]
    /// has every panic. A test expecting no panic has to look there, because an assertion inside a
    /// function panics, too. A call taking longer than its subtask's budget counts as a panic at
    /// the end of the budget.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new().contain_panics();
    /// let dags = ["healthy", "faulty"].map(|name| {
    ///     let dag = create_dag();
    ///     dag.name(name).jobs(4);
    ///     let period = Duration::from_millis(10);
    ///     let attributes = SubtaskAttributes::named("source");
    ///     dag.register_periodic_subtask(|| (1,), vec![name], period, attributes);
    ///     let sink = move |(_,): (i32,)| assert!(name == "healthy", "no sink");
    ///     let attributes = SubtaskAttributes::named("sink");
    ///     dag.register_sink_subtask(sink, vec![name], period, attributes);
    ///     dag
    /// });
    /// finish_create_dags(&dags).unwrap();
    ///
    /// let report = machine.run();
    /// assert_eq!(report.panics[0].message, "no sink");
    /// assert_eq!(report.dag("healthy").statistics().completed, 4);
    /// assert_eq!(report.dag("faulty").statistics().cut_short, 1);
    /// ```
    pub fn contain_panics(self) -> Self {
        self.set(|settings| settings.contains_panics = true)
    }

    /// Raises a signal from outside at a time of the run, counted from the start of scheduling; at
    /// once if the time has passed. To be called after the commit. In a replay, does nothing: only
    /// recorded signals come.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new();
    /// let dag = create_dag();
    /// dag.relative_deadline(Duration::from_millis(5));
    /// let answer = SubtaskAttributes::named("answer");
    /// let button = dag.sporadic(Duration::from_millis(50));
    /// dag.source(|| ()).register(answer);
    /// finish_create_dags(&[dag]).unwrap();
    /// machine.raise_at(&button, Duration::from_millis(7));
    /// machine.raise_at(&button, Duration::from_millis(9)); // early, so at 57 ms
    ///
    /// let report = machine.run();
    /// assert_eq!(report.violations(), []);
    /// assert_eq!(report.jobs[1].release_ns, Some(57_000_000));
    /// ```
    ///
    /// # Panics
    ///
    /// If the signal's DAG is not committed.
    pub fn raise_at(&self, signal: &Signal, time: Duration) {
        let Some(target) = signal.target() else {
            panic!("a signal is raised before its DAG is committed; commit that first");
        };
        self.machine.raise_at(nanoseconds(time), target);
    }

    /// Runs until every job of every DAG has ended and no further signal comes, and reports
    /// everything since the commit. (If a periodic DAG has no last job, the run ends when a
    /// function shuts it down, or never; if no function may do so, the run is refused.) If no call
    /// has taken any time, prints a warning on standard error ([`Report::took_no_time`]).
    ///
    /// # Panics
    ///
    /// If [`try_run`](Self::try_run) gives an error, with its message.
    pub fn run(&self) -> Report {
        let report = self.try_run().unwrap_or_else(|error| panic!("{error}"));
        if let Some(warning) = report.warning() {
            eprintln!("{warning}");
        }
        report
    }

    /// Runs for `duration` of virtual time, including events at its very end, and reports
    /// everything since the commit. May be called again to go on.
    ///
    /// # Panics
    ///
    /// If [`try_run_for`](Self::try_run_for) gives an error, with its message.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new();
    /// let dag = create_dag(); // without a limit of jobs
    /// let ms = Duration::from_millis;
    /// dag.period(ms(10)).relative_deadline(ms(10));
    /// dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    /// finish_create_dags(&[dag]).unwrap();
    /// assert_eq!(machine.run_for(ms(25)).jobs.len(), 3); // released at 0, 10 and 20 ms
    /// assert_eq!(machine.run_for(ms(10)).jobs.len(), 4); // and at 30 ms
    /// ```
    pub fn run_for(&self, duration: Duration) -> Report {
        let result = self.try_run_for(duration);
        result.unwrap_or_else(|error| panic!("{error}"))
    }

    /// Runs until a job or a later one of the DAG has ended or is skipped, or the run is over, and
    /// returns the recorded inputs and outputs of the job's subtasks (see
    /// [`Dag::record`](fass::Dag::record)). May be called again to go on.
    ///
    /// # Errors
    ///
    /// See [`RunError`].
    pub fn until(&self, dag: &str, job: u64) -> Result<JobShown, RunError> {
        let report = self.run_until(None, Some((dag, job)))?;
        Ok(self.show(&report, report.task_set().find(dag), job))
    }

    /// Runs as [`run`](Self::run) does.
    ///
    /// # Errors
    ///
    /// See [`RunError`]. After any of them except [`RunError::Endless`] the run is over.
    pub fn try_run(&self) -> Result<Report, RunError> {
        self.run_until(None, None)
    }

    /// Runs as [`run_for`](Self::run_for) does.
    ///
    /// # Errors
    ///
    /// See [`RunError`]. After an error the run is over.
    pub fn try_run_for(&self, duration: Duration) -> Result<Report, RunError> {
        self.run_until(Some(duration), None)
    }
}
