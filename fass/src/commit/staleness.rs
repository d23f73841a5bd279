//! How old a sampled value can be, as the commit knows it.
//!
//! Let the writer's DAG have period T and a proven bound R. Take a sample at time t
//! and the latest job k that was complete by then. Job k + 1, released T later, was
//! not, and is so within R: t < r(k) + T + R. So the *staleness*, counted from the
//! nominal release of the job that the value is of, is less than T + R; this is the
//! term of one hop in the end-to-end bound of A. Davare et al., Period Optimization
//! for Hard Real-time Distributed Automotive Systems, DAC 2007
//! (doi:10.1145/1278480.1278553).
//!
//! It holds from the writer's first completion on, and for as long as jobs come: not
//! behind the last job of a DAG with a limit, nor while one is paused or after it was
//! ended, and never for a sporadic writer, whose signals may stay away.

use alloc::vec::Vec;
use core::time::Duration;

use sched_dag::TaskSet;

use super::answer::Answer;
use crate::api::dag::Dag;
use crate::run::latest::AnyLatest;
use crate::run::latest::Staleness;

/// Returns the staleness of each sample of all DAGs.
pub(crate) fn of_all(dags: &[Dag], task_set: &TaskSet, answers: &[Answer]) -> Vec<Staleness> {
    let mut found = Vec::new();
    for (dag, reader) in dags.iter().zip(answers) {
        let draft = dag.draft.borrow();
        for (subtask, latest, _) in &draft.samples {
            let Some(writer) = writer_of(dags, &**latest) else {
                continue;
            };
            let model = &task_set.dags()[writer];
            found.push(Staleness {
                reader_dag: reader.dag.clone(),
                reader: draft.label(*subtask),
                writer_dag: answers[writer].dag.clone(),
                topic: latest.topic().into(),
                bound: bound(model, &answers[writer]),
            });
        }
    }
    found
}

/// Returns how old a value of a DAG can be, by the answer about that.
fn bound(writer: &sched_dag::Dag, answer: &Answer) -> Option<Duration> {
    let response = answer.verdict.bound().filter(|_| !writer.is_sporadic())?;
    Duration::from_nanos(writer.period_ns()).checked_add(response)
}

/// Returns the position of the DAG whose topic a latest value is of.
pub(crate) fn writer_of(dags: &[Dag], latest: &dyn AnyLatest) -> Option<usize> {
    let is_it = |offered: &alloc::rc::Rc<dyn AnyLatest>| {
        core::ptr::addr_eq(alloc::rc::Rc::as_ptr(offered), latest)
    };
    dags.iter()
        .position(|dag| dag.draft.borrow().latest.iter().any(is_it))
}
