//! A plan while it runs.
//!
//! The driver is `sched_dag::virtual_time`, the one loop in virtual time, which has the engine
//! with the bodies and the journal; it asks for the execution time of each instance at its start.
//! [`Calls`] answers by running the instance's real body and adding up what it executed. Why a run
//! could not go on is a [`RunError`].

use std::error::Error;
use std::fmt;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use fass::{Plan, Runner};
use sched_dag::virtual_time::{End, VirtualTime as Driver};
use sched_dag::{Dag, DagId, DagLabel, Instance, SchedulerOptions, SubtaskLabel, TaskSet};

use crate::nanoseconds;
use crate::report::Report;
use crate::surroundings::{Calls, PanicRecord, Surroundings};

/// A plan that runs, or can go on running.
#[derive(Debug)]
pub(crate) struct Session {
    driver: Driver<Runner>,
    calls: Calls,
    /// Whether a function may end the run.
    may_shut_down: bool,
    /// Up to when it has run.
    until_ns: u64,
}

fn dags(task_set: &TaskSet) -> impl Iterator<Item = (DagId, &Dag)> + Clone {
    (0..).map(DagId).zip(task_set.dags())
}

impl Session {
    pub(crate) fn new(plan: Plan, options: SchedulerOptions, machine: &Rc<Surroundings>) -> Self {
        let task_set: Arc<TaskSet> = plan.task_set;
        for (dag, _) in dags(&task_set).filter(|(_, model)| model.is_sporadic()) {
            machine.follow_signal(dag, 0);
        }
        let bodies = Runner::all(&task_set, plan.bodies);
        let driver = Driver::of_bodies(&task_set, options, bodies, &plan.after_fault);
        Self {
            may_shut_down: (plan.lifecycle.as_ref()).is_some_and(|life| life.may_shut_down()),
            driver: driver.with_lifecycle(plan.lifecycle).recording(),
            calls: Calls::new(&task_set, machine),
            until_ns: 0,
        }
    }

    /// Returns the number of the DAG of this name.
    fn find(&self, name: &str) -> Result<DagId, RunError> {
        let dags = dags(&self.calls.task_set);
        let mut of_name = dags.clone().filter(|(_, dag)| dag.name() == name);
        of_name.next().map(|(dag, _)| dag).ok_or_else(|| {
            let there = dags.map(|(_, dag)| format!("`{}`", dag.name()));
            RunError::NoSuchDag {
                name: name.into(),
                there: there.collect::<Vec<String>>().join(", "),
            }
        })
    }

    /// Runs for a duration, or to the end; in either case not beyond the end of a job.
    pub(crate) fn run(
        &mut self,
        duration: Option<Duration>,
        until: Option<(&str, u64)>,
    ) -> Result<Report, RunError> {
        let machine = Rc::clone(&self.calls.machine);
        let until_ns = match duration {
            Some(duration) => self.until_ns.saturating_add(nanoseconds(duration)),
            None => u64::MAX,
        };
        if duration.is_none() && until.is_none() {
            self.require_end()?;
        }
        let until = until.map(|(dag, job)| Ok((self.find(dag)?, job)));
        let until = until.transpose()?;
        self.calls.until = until;
        self.calls.has_arrived = until.is_some_and(|(dag, last)| {
            let run = self.driver.run_so_far();
            let mut jobs = run.record().numbered(dag);
            jobs.any(|(job, times)| job >= last && times.ended_ns.is_some())
        });
        let end = self.driver.run_until(until_ns, &mut self.calls);
        let now_ns = self.driver.now_ns();
        // What has no event any more has run as far as it was asked to.
        let (clock_ns, reached_ns) = match end {
            End::TimeReached => (until_ns, until_ns),
            End::Finished | End::TimeOverflow(_) => (now_ns, until_ns),
            End::Stopped => (now_ns, now_ns),
        };
        machine.now_ns.set(clock_ns);
        self.until_ns = reached_ns;
        let is_over = end == End::Finished;
        let outcome = (machine.edge).of_replay(|replay| replay.outcome(is_over));
        let report = Report::new(self.driver.run_so_far(), now_ns, &self.calls, outcome);
        if let Some(PanicRecord { instance, message }) = self.calls.panic.take() {
            let (dag, subtask) = self.labels(instance);
            return Err(RunError::Panicked {
                dag,
                subtask,
                job: instance.job,
                message,
                report: Box::new(report),
            });
        }
        if let End::TimeOverflow(instance) = end {
            let ((dag, subtask), job) = (self.labels(instance), instance.job);
            return Err(RunError::TimeOverflow { dag, subtask, job });
        }
        Ok(report)
    }

    fn labels(&self, Instance { dag, subtask, .. }: Instance) -> (DagLabel, SubtaskLabel) {
        let task_set = &self.calls.task_set;
        (task_set.label(dag), task_set.subtask_label(dag, subtask))
    }

    fn require_end(&self) -> Result<(), RunError> {
        let task_set = &self.calls.task_set;
        let is_endless = |dag: &Dag| dag.jobs().is_none() && !dag.is_sporadic();
        match dags(task_set).find(|(_, dag)| is_endless(dag)) {
            Some((dag, _)) if !self.may_shut_down => Err(RunError::Endless {
                dag: task_set.label(dag),
            }),
            _ => Ok(()),
        }
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(&self) -> Vec<u8> {
        let edge = &self.calls.machine.edge;
        edge.recording(&self.driver.run_so_far())
    }
}

/// Why a run in virtual time ended early, or could not begin.
///
/// ```
/// use virtual_time::{RunError, VirtualTime};
///
/// let machine = VirtualTime::new(); // and nothing is committed
/// assert!(matches!(machine.try_run(), Err(RunError::NothingToRun)));
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub enum RunError {
    /// Nothing has been committed on this thread since the machine was made, or
    /// an earlier run has failed.
    NothingToRun,
    /// A run to the end was asked for, but this DAG has no end.
    Endless {
        /// The DAG.
        dag: DagLabel,
    },
    /// A subtask's function panicked, and the machine was not told to
    /// [contain](crate::VirtualTime::contain_panics) that. No function runs
    /// after it.
    Panicked {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The job.
        job: u64,
        /// The panic's message.
        message: String,
        /// What happened up to the panic.
        report: Box<Report>,
    },
    /// A job of a DAG was asked for that is not in the commit.
    NoSuchDag {
        /// The name.
        name: String,
        /// Those that are there.
        there: String,
    },
    /// An instance would finish after `u64::MAX` nanoseconds.
    TimeOverflow {
        /// The DAG.
        dag: DagLabel,
        /// The subtask.
        subtask: SubtaskLabel,
        /// The job.
        job: u64,
    },
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingToRun => f.write_str(
                "there is nothing to run; commit DAGs on this thread after making the `VirtualTime`",
            ),
            Self::Endless { dag } => write!(
                f,
                "{dag} has no limit of jobs, so its run has no end; set `jobs` or use `run_for`"
            ),
            Self::Panicked {
                dag,
                subtask,
                job,
                message,
                ..
            } => write!(f, "{subtask} of {dag} panicked in job {job}: {message}"),
            Self::NoSuchDag { name, there } => {
                write!(f, "there is no dag `{name}`; there are {there}")
            }
            Self::TimeOverflow { dag, subtask, job } => write!(
                f,
                "{subtask} of {dag} would finish job {job} after {} ns, the last time there is; \
                 execute for less",
                u64::MAX
            ),
        }
    }
}

impl Error for RunError {}
