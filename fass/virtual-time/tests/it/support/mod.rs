//! DAGs of few words, and a look at what their functions saw.

#![allow(dead_code, reason = "each test uses a part of this")]

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use fass::{
    Dag, FaultLimit, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags,
};
use virtual_time::{Report, VirtualTime};

pub(crate) const MS: u64 = 1_000_000;

pub(crate) const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

pub(crate) fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

pub(crate) fn taking(name: &str, wcet_ms: u64) -> SubtaskAttributes {
    named(name).wcet(ms(wcet_ms))
}

pub(crate) fn work(time_ms: u64) {
    execute_for(ms(time_ms), Occupation::Spin);
}

/// One fault in so many jobs.
pub(crate) const fn one_in(window: u64, in_all: u32) -> FaultLimit {
    let faults = 1;
    FaultLimit {
        faults,
        window,
        in_all,
    }
}

#[track_caller]
pub(crate) fn commit(dags: &[Dag]) {
    if let Err(error) = finish_create_dags(dags) {
        panic!("{error}");
    }
}

/// Commits DAGs and runs them, by the rules.
#[track_caller]
pub(crate) fn run(machine: &VirtualTime, dags: &[Dag]) -> Report {
    commit(dags);
    let report = machine.run();
    assert_eq!(report.violations(), []);
    report
}

/// Makes a DAG that is due every so many milliseconds, each job before the next one.
pub(crate) fn every(period_ms: u64, name: &str) -> Dag {
    let (dag, period) = (create_dag(), ms(period_ms));
    dag.name(name).period(period).relative_deadline(period);
    dag
}

/// A DAG of one subtask that executes for so many milliseconds, every 10 ms.
pub(crate) fn ticking(name: &str, time_ms: u64) -> Dag {
    let dag = every(10, name);
    dag.register_untyped_subtask(move |_job| work(time_ms), taking("tick", time_ms));
    dag
}

/// Source and sink of these execution times, every 10 ms; the sink insists on receiving the values
/// in their order. The topic has the DAG's name.
pub(crate) fn pair(name: &str, times_ms: [u64; 2]) -> Dag {
    let dag = every(10, name);
    let source = dag.source(job_numbers(times_ms[0]));
    source.writes(&[name]).register(named("source"));
    let mut next = 0..;
    let sink = move |(number,): (u64,)| {
        work(times_ms[1]);
        assert_eq!(Some(number), next.next());
    };
    dag.subtask(sink).reads(&[name]).register(named("sink"));
    dag
}

/// A source that works for so long, and writes the number of its job.
pub(crate) fn job_numbers(takes_ms: u64) -> impl FnMut() -> (u64,) + Send + 'static {
    let mut jobs = 0_u64..;
    move || {
        work(takes_ms);
        (jobs.next().expect("it has no end"),)
    }
}

/// Values that functions saw, kept for the test.
#[derive(Clone, Debug)]
pub(crate) struct Seen<T>(Arc<Mutex<Vec<T>>>);

impl<T> Default for Seen<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Clone> Seen<T> {
    /// Makes an end for the test, and one for a function.
    pub(crate) fn shared() -> (Self, Self) {
        let seen = Self::default();
        (seen.clone(), seen)
    }

    pub(crate) fn add(&self, seen: T) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.push(seen);
    }

    pub(crate) fn all(&self) -> Vec<T> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.clone()
    }
}
