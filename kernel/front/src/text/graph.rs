//! A committed DAG as a machine line; `docs/serial-protocol.md` has the format.
//!
//! With `graph=dump` on the command line each commit prints what it hands to the
//! kernel: a line of kind `graph` for each DAG. `./scripts/run --dot FILE` makes
//! a picture of it. The trace describes its DAGs by the same members.

use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use fass::{OverrunPolicy, Plan, Policy, Preemption, Terms};
use sched_dag::{Dag, DagId, OnFault, SchedulerOptions, SubtaskId, TaskSet};

use super::json::{self, Object};

/// Whether commits print their DAGs.
static DUMPS: AtomicBool = AtomicBool::new(false);

/// How many commits have.
static COMMITS: AtomicU64 = AtomicU64::new(0);

/// Makes the commits to come print their DAGs.
pub fn enable() {
    DUMPS.store(true, Ordering::Relaxed);
}

/// Prints the DAGs of a commit on these terms, if commits do.
pub fn dump(plan: &Plan, terms: &Terms) {
    if !DUMPS.load(Ordering::Relaxed) {
        return;
    }
    let commit = COMMITS.fetch_add(1, Ordering::Relaxed);
    let dags = plan.task_set.dags().iter().zip(&plan.proven.bounds_ns);
    let (options, overheads) = (&terms.scheduler, &terms.overheads);
    let charge_ns = overheads.of_an_instance_ns(options.preemption);
    let ready_ns = Some(overheads.ready_ns).filter(|&ready_ns| ready_ns > 0);
    let overhead_ns = || charge_ns.into_iter().chain(ready_ns);
    for (number, (dag, bound_ns)) in (0u32..).zip(dags) {
        json::emit("graph", |line| {
            line.number("commit", commit);
            scheduling(line, options, &plan.task_set);
            line.list("overhead_ns", overhead_ns())
                .list("bound_ns", bound_ns.iter());
            describe(line, number, dag);
            line.number("hash", dag.graph_hash())
                .flag("sporadic", dag.is_sporadic())
                .list("jobs", dag.jobs().iter())
                .list("topics", topics(dag))
                .list("states", states(dag))
                .list("samples", samples(plan, DagId(number)));
        });
    }
}

/// Says how DAGs are scheduled, by the members that the kinds `graph` and `trace_begin` share.
pub fn scheduling(line: &mut Object<'_, '_>, options: &SchedulerOptions, task_set: &TaskSet) {
    let policy = match options.policy {
        Policy::StaticPriority => "static",
        Policy::Edf => "edf",
    };
    let preemption = match options.preemption {
        Preemption::Enabled => "on",
        Preemption::Disabled => "off",
    };
    line.text("policy", policy)
        .text("preemption", preemption)
        .number("cores", options.cores);
    if task_set.is_divided() {
        let cores = |cluster| task_set.cores_of(cluster, options.cores).len();
        line.list("clusters", task_set.clusters().map(cores));
    }
}

/// Describes a DAG by the members that the kinds `graph` and `trace_dag` share.
pub fn describe(line: &mut Object<'_, '_>, number: u32, dag: &Dag) {
    let overrun = match dag.overrun() {
        OverrunPolicy::Queue => "queue",
        OverrunPolicy::Skip => "skip",
        OverrunPolicy::Abort => "abort",
    };
    line.number("dag", number)
        .text("name", dag.name())
        .number("period_ns", dag.period_ns())
        .number("relative_deadline_ns", dag.relative_deadline_ns())
        .number("offset_ns", dag.offset_ns())
        .number("in_flight", dag.in_flight())
        .text("overrun", overrun)
        .list("subtasks", subtasks(dag))
        .list("edges", edges(dag));
    if dag.states_cluster() {
        line.number("cluster", dag.cluster().0);
    }
    if dag.sinks().len() > 1 {
        line.list("sinks", sinks(dag));
    }
    if let OnFault::DropJob(of) = dag.on_fault() {
        let numbers = [of.faults.into(), of.window, of.in_all.into()];
        line.list("on_fault", numbers.into_iter());
    }
}

fn subtasks(dag: &Dag) -> impl Iterator<Item = impl fmt::Display> {
    dag.subtasks().iter().map(|subtask| {
        fmt::from_fn(move |f| {
            let non_preemptive = u8::from(subtask.is_non_preemptive());
            let priority = subtask.priority().0;
            let name = json::quoted(subtask.name());
            write!(f, "[{name},{priority},{non_preemptive},")?;
            match subtask.wcet_ns() {
                Some(wcet_ns) => write!(f, "{wcet_ns}]"),
                None => f.write_str("null]"),
            }
        })
    })
}

fn edges(dag: &Dag) -> impl Iterator<Item = impl fmt::Display> {
    let subtasks = (0..).map(SubtaskId).take(dag.subtasks().len());
    subtasks.flat_map(move |from| {
        let successors = dag.successors(from).iter();
        successors.map(move |to| fmt::from_fn(move |f| write!(f, "[{},{}]", from.0, to.0)))
    })
}

fn sinks(dag: &Dag) -> impl Iterator<Item = impl fmt::Display> {
    dag.sinks().iter().map(|sink| {
        let deadline_ns = dag.subtask(*sink).relative_deadline_ns();
        fmt::from_fn(move |f| write!(f, "[{},{deadline_ns}]", sink.0))
    })
}

fn topics(dag: &Dag) -> impl Iterator<Item = impl fmt::Display> {
    dag.topics().iter().map(|topic| {
        fmt::from_fn(move |f| {
            let (name, kind) = (json::quoted(&topic.name), json::quoted(topic.type_name));
            write!(f, "[{name},{kind},{},[", topic.writer.0)?;
            for (index, reader) in topic.readers.iter().enumerate() {
                let separator = if index == 0 { "" } else { "," };
                write!(f, "{separator}{}", reader.0)?;
            }
            write!(f, "],{}]", u8::from(topic.is_sampled))
        })
    })
}

fn states(dag: &Dag) -> impl Iterator<Item = impl fmt::Display> {
    dag.state_precedences().iter().map(|edge| {
        fmt::from_fn(move |f| {
            let state = json::quoted(&edge.state);
            write!(f, "[{state},{},{}]", edge.earlier.0, edge.later.0)
        })
    })
}

/// Writes which subtasks of a DAG sample which topics, and how old their values can be.
fn samples(plan: &Plan, reader: DagId) -> impl Iterator<Item = impl fmt::Display> {
    let of_reader = plan.staleness.iter();
    let of_reader = of_reader.filter(move |sample| sample.reader_dag.id == reader);
    of_reader.filter_map(|sample| {
        let writer = sample.writer_dag.id;
        let topics = plan.task_set.dags()[writer.index()].topics();
        let topic = topics.iter().position(|topic| topic.name == sample.topic)?;
        Some(fmt::from_fn(move |f| {
            write!(f, "[{},{},{topic},", sample.reader.id.0, writer.0)?;
            match sample.bound {
                Some(bound) => write!(f, "{}]", bound.as_nanos()),
                None => f.write_str("null]"),
            }
        }))
    })
}
