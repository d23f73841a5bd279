//! What the tests of sharing subtasks need: short words, and a look from inside.

#![allow(dead_code, reason = "each test uses a part of this")]

use std::sync::{Arc, Mutex, PoisonError};

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for};

pub(crate) use super::{ms, named};

pub(crate) fn taking(name: &str, wcet_ms: u64) -> SubtaskAttributes {
    named(name).wcet(ms(wcet_ms))
}

pub(crate) fn work(time_ms: u64) {
    execute_for(ms(time_ms), Occupation::Spin);
}

/// Makes a DAG that is due every so many milliseconds, each job before the next one.
pub(crate) fn every(period_ms: u64, name: &str) -> Dag {
    let (dag, period) = (create_dag(), ms(period_ms));
    dag.name(name).period(period).relative_deadline(period);
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

/// What functions saw, kept for the test.
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
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(seen);
    }

    pub(crate) fn all(&self) -> Vec<T> {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}
