//! A run's trace for the eye: JSON that Perfetto's viewer opens.
//!
//! The format is the Trace Event Format of Chrome's tracing, which
//! <https://ui.perfetto.dev>, `chrome://tracing` and speedscope read. In its
//! words: a *process* is a group of *tracks* (it calls them threads); a *slice*
//! is a stretch of time on a track, an *instant* a moment, a *flow* an arrow from
//! one slice to another. For each run there are
//!
//! - a group `cores` with a track for each core: a slice is one uninterrupted
//!   piece of an instance's execution, an instant a preemption, or the request
//!   for one (`cores`);
//! - a group for each DAG: its releases, deadlines and misses as instants, a
//!   slice for each job from its nominal release to its completion, and for each
//!   subtask the slices of its instances from readiness to their end, with what
//!   they executed inside (`dags`);
//! - if the trace breaks a rule, a group `breaches` that says where.
//!
//! Flows lead along each edge of the graph from an instance's finish to the
//! start of its successor in the same job, and from an instance's finish to the start of
//! each one that samples its value; once between cores and once between subtasks (`flows`).
//!
//! It guarantees that slices of one track nest, and that each flow has both its
//! ends. Each time is the trace's, in microseconds with three decimals. All runs
//! begin at 0, side by side. Where events were lost, only what came after the
//! last gap is shown.

mod command;
mod cores;
mod dags;
mod flows;
mod output;
#[cfg(test)]
mod tests;

use sched_dag::Instance;
use sched_dag::law::Violation;

use super::check;
use super::view::View;
use crate::json::Object;
use crate::record::Run;
use flows::Flows;
use output::{Output, Track};

pub use command::{TRACE, trace};

/// Returns runs as one text of JSON. Breaches are looked for with `bound_ns`, as
/// [`check`] does.
#[must_use]
pub fn convert(runs: &[Run], bound_ns: u64) -> String {
    let (mut output, mut next_flow) = (Output::default(), 0);
    for run in runs {
        let view = View::new(run);
        let breaches = check(run, bound_ns).breaches;
        let prefix = match runs {
            [_] => String::new(),
            _ => format!("run {} ", run.number),
        };
        let mut flows = Flows::new(&view, next_flow);
        cores::draw(&view, &prefix, &flows, &mut output);
        dags::draw(&view, &prefix, &mut flows, &mut output);
        draw_breaches(run, &breaches, &prefix, &mut output);
        next_flow = flows.next();
    }
    output.end()
}

fn draw_breaches(run: &Run, breaches: &[Violation], prefix: &str, output: &mut Output) {
    if breaches.is_empty() {
        return;
    }
    let group = output.group(&format!("{prefix}breaches"), "");
    let mut track = output.track(group, "rules");
    for breach in breaches {
        let what = breach.with_names(&run.task_set).to_string();
        let args = Object::new().text("what", &what).end();
        track.instant(breach.time_ns(), &breach.rule().to_string(), &args);
    }
    output.add(track);
}

/// The name of an instance on a track that shows all DAGs.
fn instance_name(run: &Run, instance: Instance) -> String {
    let Instance { dag, job, subtask } = instance;
    let model = run.task_set.dag(dag);
    let subtask = name_or(model.subtask(subtask).name(), subtask.0);
    format!("{}/{subtask} #{job}", name_or(model.name(), dag.0))
}

fn name_or(name: &str, number: u32) -> String {
    match name {
        "" => number.to_string(),
        name => name.to_string(),
    }
}

/// What a group's or a track's slices say of an instance.
fn instance_args(instance: Instance) -> Object {
    let Instance { dag, job, subtask } = instance;
    Object::new()
        .number("dag", dag.0)
        .number("job", job)
        .number("subtask", subtask.0)
}

/// Draws a piece of an instance's execution, with the arrows into its start and out of its finish.
fn draw_piece(
    view: &View<'_>,
    (instance, piece): (Instance, usize),
    (name, args): (&str, &str),
    flows: &Flows,
    track: &mut Track,
) {
    let history = &view.histories[&instance];
    let slice = history.slices[piece];
    track.begin(slice.from_ns, name, args);
    if piece == 0 && history.start_ns.is_some() {
        flows.into(instance).for_each(|flow| track.flow_in(flow));
    }
    let to_ns = slice.to_ns.unwrap_or(view.end_ns);
    track.advance(to_ns);
    if piece + 1 == history.slices.len() && history.finish_ns.is_some() {
        flows.out(instance).for_each(|flow| track.flow_out(flow));
    }
    track.end(to_ns);
}
