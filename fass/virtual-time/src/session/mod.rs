//! A plan while it runs.
//!
//! The driver is `sched_dag::virtual_time`, the one loop in virtual time, which has the engine
//! with the bodies and the journal; it asks for the execution time of each instance at its start.
//! [`Calls`] answers by running the instance's real body and adding up what it executed.

mod calls;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use fass::edge::Outcome;
use fass::{Plan, Runner};
use sched_dag::virtual_time::{End, VirtualTime as Driver};
use sched_dag::{Dag, DagId, SchedulerOptions, TaskSet};

use calls::{Called, Calls};

use crate::edge::Edge;
use crate::error::RunError;
use crate::record::PanicRecord;
use crate::report::Report;
use crate::surroundings::Surroundings;

/// A plan that runs, or can go on running.
#[derive(Debug)]
pub(crate) struct Session {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
    driver: Driver<Runner>,
    /// Whether a function may end the run.
    may_shut_down: bool,
    /// Whether interrupts may be late.
    is_late: bool,
    called: Called,
    /// Up to when it has run.
    until_ns: u64,
}

impl Session {
    pub(crate) fn new(plan: Plan, options: SchedulerOptions) -> Self {
        let task_set = plan.task_set;
        let bodies = Runner::all(&task_set, plan.bodies);
        let driver = Driver::of_bodies(&task_set, options, bodies, &plan.after_fault);
        Self {
            may_shut_down: (plan.lifecycle.as_ref()).is_some_and(|life| life.may_shut_down()),
            driver: driver.with_lifecycle(plan.lifecycle).recording(),
            options,
            is_late: false,
            called: Called {
                executed_ns: BTreeMap::new(),
                panics: Vec::new(),
                degraded: vec![false; task_set.dags().len()],
            },
            until_ns: 0,
            task_set,
        }
    }

    /// Returns the number of the DAG of this name.
    pub(crate) fn find(&self, name: &str) -> Result<DagId, RunError> {
        let dags = (0..).map(DagId).zip(self.task_set.dags());
        let mut of_name = dags.clone().filter(|(_, dag)| dag.name() == name);
        of_name.next().map(|(dag, _)| dag).ok_or_else(|| {
            let there = dags.map(|(_, dag)| format!("`{}`", dag.name()));
            RunError::NoSuchDag {
                name: name.into(),
                there: there.collect::<Vec<String>>().join(", "),
            }
        })
    }

    /// Runs for a duration, or to the end; in either case not beyond the end of the job that the
    /// machine shall stop at.
    pub(crate) fn run(
        &mut self,
        machine: &Surroundings,
        duration: Option<Duration>,
    ) -> Result<Report, RunError> {
        self.is_late |= machine.late.get().most_ns > 0;
        let until = machine.until.get();
        let until_ns = match duration {
            Some(duration) => {
                let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
                self.until_ns.saturating_add(ns)
            }
            None => {
                if until.is_none() {
                    self.require_end()?;
                }
                u64::MAX
            }
        };
        let has_arrived = until.is_some_and(|(dag, last)| {
            let record = self.report(&machine.edge, false).record();
            let mut jobs = record.numbered(dag);
            jobs.any(|(job, times)| job >= last && times.ended_ns.is_some())
        });
        let mut calls = Calls {
            task_set: &self.task_set,
            machine,
            called: &mut self.called,
            panic: None,
            has_arrived,
        };
        let end = self.driver.run_until(until_ns, &mut calls);
        let panic = calls.panic;
        self.until_ns = match end {
            End::Stopped => self.driver.now_ns(),
            _ => until_ns,
        };
        machine.now_ns.set(match end {
            End::TimeReached => until_ns,
            End::Finished | End::TimeOverflow(_) | End::Stopped => self.driver.now_ns(),
        });
        if let Some(PanicRecord { instance, message }) = panic {
            return Err(RunError::Panicked {
                dag: self.task_set.label(instance.dag),
                subtask: self.task_set.subtask_label(instance.dag, instance.subtask),
                job: instance.job,
                message,
                report: Box::new(self.report(&machine.edge, false)),
            });
        }
        match end {
            End::Finished | End::TimeReached | End::Stopped => {
                Ok(self.report(&machine.edge, end == End::Finished))
            }
            End::TimeOverflow(instance) => Err(RunError::TimeOverflow {
                dag: self.task_set.label(instance.dag),
                subtask: self.task_set.subtask_label(instance.dag, instance.subtask),
                job: instance.job,
            }),
        }
    }

    fn require_end(&self) -> Result<(), RunError> {
        let mut dags = (0..).map(DagId).zip(self.task_set.dags());
        let is_endless =
            |dag: &Dag| dag.jobs().is_none() && !dag.is_sporadic() && !self.may_shut_down;
        match dags.find(|(_, dag)| is_endless(dag)) {
            None => Ok(()),
            Some((dag, _)) => Err(RunError::Endless {
                dag: self.task_set.label(dag),
            }),
        }
    }

    /// Returns the recording of the run so far.
    pub(crate) fn recording(&self, edge: &Edge) -> Vec<u8> {
        let events = &self.driver.events();
        edge.recording(&self.task_set, events, &self.report(edge, false).record())
    }

    fn report(&self, edge: &Edge, is_over: bool) -> Report {
        let Outcome {
            compared,
            uncompared,
            divergence,
            lacking,
        } = edge.outcome(is_over);
        let dags = (0..).map(DagId).zip(self.task_set.dags());
        let sink_misses = |(dag, model): (DagId, &Dag)| {
            let sinks = model.sinks().iter();
            sinks
                .map(|&sink| self.driver.scheduler_of(dag).sink_misses(dag, sink))
                .collect()
        };
        let sink_misses = dags.clone().map(sink_misses).collect();
        let statistics = dags.map(|(dag, _)| *self.driver.scheduler_of(dag).statistics(dag));
        let mut report = Report {
            instances: Vec::new(),
            jobs: Vec::new(),
            panics: self.called.panics.clone(),
            degraded: self.called.degraded.clone(),
            events: self.driver.events(),
            statistics: statistics.collect(),
            sink_misses,
            end_ns: self.driver.now_ns(),
            compared,
            uncompared,
            divergence,
            lacking,
            task_set: Arc::clone(&self.task_set),
            options: self.options,
            is_late: self.is_late,
        };
        report.look_at_events(&self.called.executed_ns);
        report
    }
}
