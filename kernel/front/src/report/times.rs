//! A run's statistics as machine lines; `docs/serial-protocol.md` has the format.

use core::fmt;

use sched_dag::law::Histogram;
use sched_dag::{DagId, Instance, SubtaskId};

use crate::text::json::{self, Object};
use sched_dag::engine::Run;

/// Prints the statistics of a run: a line for each DAG, for each subtask, and for each of
/// several sinks.
pub fn dump(run: &Run) {
    let Some(times) = run.times() else {
        crate::println!("there are no statistics, for not all events were recorded");
        return;
    };
    for (dag, model) in (0..).map(DagId).zip(run.task_set().dags()) {
        let of_dag = times.dag(dag);
        json::emit("times_dag", |line| {
            line.number("dag", dag.0)
                .text("name", model.name())
                .number("first_recorded_job", run.record().first_job(dag))
                .object("response_time_ns", |object| {
                    describe(&of_dag.response_time, object);
                })
                .object("release_jitter_ns", |object| {
                    describe(&of_dag.release_jitter, object);
                });
        });
        for (subtask, model) in (0..).map(SubtaskId).zip(model.subtasks()) {
            let job = 0;
            let instance = Instance { dag, job, subtask };
            let of_subtask = times.subtask(run.task_set().vertex(instance));
            json::emit("times_subtask", |line| {
                line.number("dag", dag.0)
                    .number("subtask", subtask.0)
                    .text("name", model.name())
                    .object("join_latency_ns", |object| {
                        describe(&of_subtask.join_latency, object);
                    })
                    .object("execution_time_ns", |object| {
                        describe(&of_subtask.execution_time, object);
                    })
                    .list("execution_histogram", buckets(&of_subtask.execution_time));
            });
            if let Some(response_time) = &of_subtask.response_time {
                json::emit("times_sink", |line| {
                    line.number("dag", dag.0)
                        .number("subtask", subtask.0)
                        .text("name", model.name())
                        .number("relative_deadline_ns", model.relative_deadline_ns())
                        .number("misses", run.sink_misses(dag, subtask))
                        .object("response_time_ns", |object| describe(response_time, object));
                    if let Some(bound_ns) = run.sink_bound_ns(dag, subtask) {
                        line.number("bound_ns", bound_ns);
                    }
                });
            }
        }
    }
}

fn buckets(times: &Histogram) -> impl Iterator<Item = impl fmt::Display> {
    let buckets = times.filled();
    buckets.map(|(top, count)| fmt::from_fn(move |f| write!(f, "[{top},{count}]")))
}

fn describe(times: &Histogram, object: &mut Object<'_, '_>) {
    object
        .number("count", times.count())
        .number("min", times.min())
        .number("median", times.per_mille(500))
        .number("p99", times.per_mille(990))
        .number("p999", times.per_mille(999))
        .number("max", times.max());
}
