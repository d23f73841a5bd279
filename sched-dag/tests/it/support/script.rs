//! A run in virtual time, by a script, and the timeline that it has to be.

use std::collections::VecDeque;
use std::sync::Arc;

use sched_dag::journal::Event;
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::{RunOutcome, VirtualTime, Workload};
use sched_dag::{DagId, Instance, Scheduler, TaskSet};

use super::{Takes, ask, kind, line, told};

/// How long instances execute, which of them fail, and what is asked when.
pub(crate) struct Script<'a, T> {
    takes: T,
    fails: Box<dyn Fn(Instance) -> bool + 'a>,
    requests: VecDeque<(u64, Request)>,
    /// At which DAG's completions which DAG gets a signal.
    chained: Option<(DagId, DagId)>,
}

impl<'a, T: Takes> Script<'a, T> {
    pub(crate) fn new(takes: T) -> Self {
        Self {
            takes,
            fails: Box::new(|_| false),
            requests: VecDeque::new(),
            chained: None,
        }
    }

    pub(crate) fn failing(self, fails: impl Fn(Instance) -> bool + 'a) -> Self {
        let fails = Box::new(fails);
        Self { fails, ..self }
    }

    pub(crate) fn asking(self, requests: impl IntoIterator<Item = (u64, Request)>) -> Self {
        let requests = requests.into_iter().collect();
        Self { requests, ..self }
    }

    pub(crate) fn chained(self, chained: Option<(u32, u32)>) -> Self {
        let chained = chained.map(|(from, to)| (DagId(from), DagId(to)));
        Self { chained, ..self }
    }

    /// Runs until nothing happens any more.
    pub(crate) fn run(mut self, driver: VirtualTime) -> Run {
        let mut driver = driver.recording();
        assert_eq!(driver.run(&mut self), RunOutcome::Finished);
        Run {
            task_set: Arc::clone(driver.scheduler_of(DagId(0)).task_set()),
            events: driver.events(),
            driver,
        }
    }
}

impl<T: Takes> Workload for Script<'_, T> {
    fn execute(&mut self, instance: &mut Instance, _now_ns: u64) -> Option<u64> {
        Some(self.takes.takes_ns(*instance))
    }

    fn fails(&mut self, instance: Instance) -> bool {
        if let Some((_, to)) = self.chained.filter(|(from, _)| *from == instance.dag) {
            // It is late already, so it comes at this instant.
            self.requests.push_front((0, Request::Signal(to)));
        }
        (self.fails)(instance)
    }

    fn next_request_ns(&self) -> Option<u64> {
        self.requests.front().map(|&(at_ns, _)| at_ns)
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        let (_, request) = self.requests.pop_front_if(|(at_ns, _)| *at_ns <= now_ns)?;
        Some(request)
    }
}

/// A run that is over: its model, and all that was written down.
pub(crate) struct Run {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) events: Vec<Event>,
    pub(crate) driver: VirtualTime,
}

impl Run {
    pub(crate) fn scheduler(&self) -> &Scheduler {
        self.driver.scheduler_of(DagId(0))
    }

    /// Returns what happened, a line an event.
    pub(crate) fn lines(&self) -> Vec<String> {
        let lines = told(&self.events).into_iter();
        lines
            .map(|(time_ns, event)| format!("{time_ns} {event}"))
            .collect()
    }

    /// Fails unless it was as a timeline says.
    #[track_caller]
    pub(crate) fn must_be(&self, timeline: &str) {
        let mut expected = Vec::new();
        for (time_ns, questions, events) in timeline.lines().map(line) {
            expected.extend(events.iter().map(|event| (time_ns, *event)));
            questions.iter().for_each(|it| ask(self.scheduler(), it));
        }
        let told = told(&self.events);
        let is_meant =
            |event: &&(u64, String)| expected.iter().any(|(_, it)| kind(it) == kind(&event.1));
        let happened = told.iter().filter(is_meant);
        let happened: Vec<_> = happened.map(|(ns, event)| (Some(*ns), &**event)).collect();
        assert!(
            happened == expected,
            "happened:\n{}\n",
            self.lines().join("\n")
        );
    }
}
