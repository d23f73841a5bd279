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
                .object("response_time_ns", figures(&of_dag.response_time))
                .object("release_jitter_ns", figures(&of_dag.release_jitter));
        });
        for (subtask, model) in (0..).map(SubtaskId).zip(model.subtasks()) {
            let job = 0;
            let instance = Instance { dag, job, subtask };
            let of_subtask = times.subtask(run.task_set().vertex(instance));
            let executions = of_subtask.execution_time.distribution();
            let buckets = executions.values();
            let buckets =
                buckets.map(|(top, count)| fmt::from_fn(move |f| write!(f, "[{top},{count}]")));
            json::emit("times_subtask", |line| {
                line.number("dag", dag.0)
                    .number("subtask", subtask.0)
                    .text("name", model.name())
                    .object("join_latency_ns", figures(&of_subtask.join_latency))
                    .object("execution_time_ns", figures(&of_subtask.execution_time))
                    .list("execution_histogram", buckets.clone());
            });
            if let Some(response_time) = &of_subtask.response_time {
                json::emit("times_sink", |line| {
                    line.number("dag", dag.0)
                        .number("subtask", subtask.0)
                        .text("name", model.name())
                        .number("relative_deadline_ns", model.relative_deadline_ns())
                        .number("misses", run.sink_misses(dag, subtask))
                        .object("response_time_ns", figures(response_time));
                    if let Some(bound_ns) = run.sink_bound_ns(dag, subtask) {
                        line.number("bound_ns", bound_ns);
                    }
                });
            }
        }
    }
}

/// Returns the fields of a distribution.
fn figures(times: &Histogram) -> impl Fn(&mut Object<'_, '_>) + use<> {
    let times = times.distribution();
    move |object| {
        object
            .number("count", times.count())
            .number("min", times.min())
            .number("median", times.median())
            .number("p99", times.p99())
            .number("p999", times.per_mille(999))
            .number("max", times.max());
    }
}
