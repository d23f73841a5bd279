//! What a worker executes: the body of a subtask.

use fass::{Body, Request};
use sched_dag::DagId;

/// The function of a subtask, with all that belongs to it.
pub(crate) trait Execute: Send {
    /// Does the subtask's part of a job.
    fn run(&mut self, job: u64);

    /// Publishes the effects that the last [`run`](Self::run) prepared outside its DAG,
    /// and calls `raise` for each signal. Mostly there are none.
    fn complete(&mut self, raise: &mut dyn FnMut(DagId)) {
        let _ = raise;
    }

    /// Drops what has arrived for a job that it will not run. Mostly there is nothing.
    fn discard(&mut self, job: u64) {
        let _ = job;
    }
}

/// Keeps a signal that an instance has raised. A subtask may use a signal several
/// times; it is one signal then, and the list has room for each DAG once.
pub(crate) fn keep_signal(signals: &mut Vec<DagId>, dag: DagId) {
    if !signals.contains(&dag) {
        signals.push(dag);
    }
}

impl<F: FnMut(u64) + Send + ?Sized> Execute for Box<F> {
    #[inline]
    fn run(&mut self, job: u64) {
        self(job);
    }
}

/// A place among those of all vertices, in a cluster that has the bodies of some.
impl<B: Execute> Execute for Option<B> {
    #[inline]
    fn run(&mut self, job: u64) {
        if let Some(body) = self {
            body.run(job);
        }
    }

    #[inline]
    fn complete(&mut self, raise: &mut dyn FnMut(DagId)) {
        if let Some(body) = self {
            body.complete(raise);
        }
    }

    fn discard(&mut self, job: u64) {
        if let Some(body) = self {
            body.discard(job);
        }
    }
}

impl Execute for Body {
    #[inline]
    fn run(&mut self, job: u64) {
        Self::run(self, job);
    }

    #[inline]
    fn complete(&mut self, raise: &mut dyn FnMut(DagId)) {
        // Reading the host's clock takes longer than a hand-off.
        if self.has_effects() {
            // The launch has refused plans that ask for more than signals.
            let ask = &mut |request| match request {
                Request::Signal(dag) => raise(dag),
                _ => debug_assert!(false, "{request:?} is asked for"),
            };
            Self::complete(self, fass::now_ns(), ask);
        }
    }

    fn discard(&mut self, job: u64) {
        Self::discard(self, job);
    }
}
